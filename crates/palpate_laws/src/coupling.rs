//! The virtual coupling between a device and the tool's proxy.

use crate::LawError;
use glam::DVec3;

/// A virtual coupling: a spring with a force limit between the device and the tool's proxy, which touches the body.
///
/// Below the limit the coupling is a linear spring. At the limit it yields, however far the device moves on. The
/// coupling follows J. E. Colgate, M. C. Stanley and J. M. Brown (Proc. IROS 1995), without mass and damper, and is
/// integrated implicitly. When the device goes deeper than the body can follow, the proxy stays on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCoupling {
    /// Stiffness k, N/m. Below the force limit the proxy is F/k behind the device.
    pub stiffness_n_per_m: f64,
    /// Maximum force, N.
    pub max_force_n: f64,
}

/// A proxy in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyStep {
    /// Coupling to the device.
    pub coupling: VirtualCoupling,
    /// Remaining displacement to the device, m, from the position that the proxy would have if it moved with the
    /// device. The gaps of the rows refer to that position. The displacement is shorter if the proxy may not go that
    /// far in one step.
    pub remaining_m: DVec3,
}

/// Motion of a tool in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMove {
    /// Position at the beginning of the step, m.
    pub from_m: DVec3,
    /// Position at the end of the step, m. With a coupling, the position if the proxy moves with the device.
    pub to_m: DVec3,
    /// The proxy, with a coupling.
    pub proxy: Option<ProxyStep>,
}

impl ToolMove {
    /// Motion of a tool whose device moves from `device_m.0` to `device_m.1`, m. With a `coupling`, the proxy is at
    /// `proxy_m`. `radius_m` is `None` for a tool that holds a point.
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
        let proxy = Some(ProxyStep { coupling, remaining_m: coupling.remaining_m(behind_m, radius_m) });
        Self { from_m: proxy_m, to_m: device_m.1 - behind_m, proxy }
    }

    /// Displacement of the proxy by its coupling if nothing blocks it, m.
    #[must_use]
    pub fn remaining_m(&self) -> DVec3 {
        self.proxy.map_or(DVec3::ZERO, |proxy| proxy.remaining_m)
    }
}

impl VirtualCoupling {
    /// Checks stiffness and force limit.
    ///
    /// # Errors
    /// [`LawError::Stiffness`] and [`LawError::CouplingForce`] for a value that is not finite or not above 0.
    pub fn validate(&self) -> Result<(), LawError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.stiffness_n_per_m) {
            return Err(LawError::Stiffness(self.stiffness_n_per_m));
        }
        if positive(self.max_force_n) { Ok(()) } else { Err(LawError::CouplingForce(self.max_force_n)) }
    }

    /// Distance between device and proxy at the force limit, m.
    #[must_use]
    pub fn stretch_m(&self) -> f64 {
        self.max_force_n / self.stiffness_n_per_m
    }

    /// Limits `force_n` to the maximum force, N.
    #[must_use]
    pub fn limit(&self, force_n: DVec3) -> DVec3 {
        force_n.clamp_length_max(self.max_force_n)
    }

    /// Displacement of the proxy towards the device that one step allows, in addition to the device's own motion, m.
    /// The proxy is `behind_m` away from the device. A tool that holds a point (`radius_m` is `None`) may go all the
    /// way. A touching tool is limited to half its radius, and to the coupling's stretch if that is longer. It
    /// therefore crosses no surface undetected.
    #[must_use]
    pub fn remaining_m(&self, behind_m: DVec3, radius_m: Option<f64>) -> DVec3 {
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
    fn rejects_values_that_are_not_positive_and_finite() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let soft = VirtualCoupling { stiffness_n_per_m: bad, max_force_n: 1.0 };
            assert!(matches!(soft.validate(), Err(LawError::Stiffness(_))));
            let weak = VirtualCoupling { stiffness_n_per_m: 1.0, max_force_n: bad };
            assert!(matches!(weak.validate(), Err(LawError::CouplingForce(_))));
        }
    }
}
