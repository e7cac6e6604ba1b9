//! A tool that gives way: a proxy without mass behind a stiff coupling whose force saturates.

use crate::LawError;
use glam::DVec3;

/// What draws a tool's proxy, which is what the body meets, to where the device is: a spring as long as its force is
/// below the largest, and from there on that force and no more, however far the device has gone. A virtual coupling (J. E.
/// Colgate, M. C. Stanley, J. M. Brown, Proc. IROS 1995) without mass and damper, implicit in time.
///
/// So a hand that goes deeper than a body can leaves the proxy behind on the surface, and no body is dragged through itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCoupling {
    /// k, N/m: below saturation the proxy stays F/k behind the device.
    pub stiffness_n_per_m: f64,
    /// The force at which it saturates, N.
    pub max_force_n: f64,
}

/// The proxy in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyStep {
    /// What draws it.
    pub coupling: VirtualCoupling,
    /// From where it would be at the end of the step if it moved as the device does, for which the rows' gaps are, to the
    /// device, m; less, if it is not to go as far in one step.
    pub short_m: DVec3,
}

/// What a tool does in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMove {
    /// Where it begins and ends, m; behind a coupling, if it moves as its device does.
    pub from_m: DVec3,
    /// See `from_m`.
    pub to_m: DVec3,
    /// What draws it elsewhere.
    pub proxy: Option<ProxyStep>,
}

impl ToolMove {
    /// That of a tool behind `coupling`, if there is one, whose proxy is at `proxy_m` and whose device goes from one place to
    /// another; `radius_m` is `None` for a tool that holds.
    #[must_use]
    pub fn new(
        coupling: Option<VirtualCoupling>,
        device_m: (DVec3, DVec3),
        proxy_m: DVec3,
        radius_m: Option<f64>,
    ) -> Self {
        let Some(coupling) = coupling else {
            return Self { from_m: device_m.0, to_m: device_m.1, proxy: None };
        };
        let behind_m = device_m.0 - proxy_m;
        let proxy = Some(ProxyStep { coupling, short_m: coupling.short_m(behind_m, radius_m) });
        Self { from_m: proxy_m, to_m: device_m.1 - behind_m, proxy }
    }

    /// How far its coupling draws it if nothing is in the way, m.
    #[must_use]
    pub fn short_m(&self) -> DVec3 {
        self.proxy.map_or(DVec3::ZERO, |proxy| proxy.short_m)
    }
}

impl VirtualCoupling {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// [`LawError::Stiffness`] and [`LawError::CouplingForce`] for what is not finite and above 0.
    pub fn validate(&self) -> Result<(), LawError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.stiffness_n_per_m) {
            return Err(LawError::Stiffness(self.stiffness_n_per_m));
        }
        if positive(self.max_force_n) { Ok(()) } else { Err(LawError::CouplingForce(self.max_force_n)) }
    }

    /// How far behind the device the proxy is when the force saturates, m.
    #[must_use]
    pub fn stretch_m(&self) -> f64 {
        self.max_force_n / self.stiffness_n_per_m
    }

    /// `force_n`, but no more than the largest.
    #[must_use]
    pub fn limit(&self, force_n: DVec3) -> DVec3 {
        force_n.clamp_length_max(self.max_force_n)
    }

    /// How far the proxy, `behind_m` the device, may go towards it in one step beside the device's own motion: anywhere for
    /// a tool that holds (`radius_m` is `None`), half its radius for one that touches, so that it passes nothing unseen.
    #[must_use]
    pub fn short_m(&self, behind_m: DVec3, radius_m: Option<f64>) -> DVec3 {
        match radius_m {
            None => behind_m,
            Some(radius_m) => behind_m.clamp_length_max(self.stretch_m().max(0.5 * radius_m)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_sense_is_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let soft = VirtualCoupling { stiffness_n_per_m: bad, max_force_n: 1.0 };
            assert!(matches!(soft.validate(), Err(LawError::Stiffness(_))));
            let weak = VirtualCoupling { stiffness_n_per_m: 1.0, max_force_n: bad };
            assert!(matches!(weak.validate(), Err(LawError::CouplingForce(_))));
        }
    }
}
