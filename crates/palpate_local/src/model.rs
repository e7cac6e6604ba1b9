//! The local model as plain data, and the schemes.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::{Cholesky, zeros};
use crate::{LocalModelError, NearField, NearFieldCapacity, Support};
use glam::{DMat3, DVec3};

/// How the loop computes the force between two model steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Scheme {
    /// The force of the last model step, constant.
    Hold,
    /// The force of the last model step through a first-order low-pass at 10 Hz.
    LowPass,
    /// Force and static stiffness of the last model step: the whole body follows the tool quasi-statically.
    Tangent,
    /// The nodes near the tool move linearly and all others are fixed: the local linear approximation of the seed paper.
    Neighbourhood,
    /// The whole body, linearised about the model step and projected onto a rational Krylov basis of its response to the tool.
    KrylovLinear,
    /// The springs near the tool exact, all others linearised and reduced: see [`crate::NearField`].
    #[default]
    NearFieldExact,
}

impl Scheme {
    /// All schemes.
    pub const ALL: [Self; 6] = [
        Self::Hold,
        Self::LowPass,
        Self::Tangent,
        Self::Neighbourhood,
        Self::KrylovLinear,
        Self::NearFieldExact,
    ];

    /// The name of the scheme in files and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::LowPass => "low_pass",
            Self::Tangent => "tangent",
            Self::Neighbourhood => "neighbourhood",
            Self::KrylovLinear => "krylov_linear",
            Self::NearFieldExact => "near_field_exact",
        }
    }

    /// Whether the scheme has a dynamic state, into which missed samples are replayed at a hand-over.
    #[must_use]
    pub fn has_state(self) -> bool {
        matches!(self, Self::Neighbourhood | Self::KrylovLinear | Self::NearFieldExact)
    }
}

impl std::fmt::Display for Scheme {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Scheme {
    type Err = LocalModelError;

    /// Parses [`Scheme::name`], with hyphens or underscores.
    fn from_str(name: &str) -> Result<Self, LocalModelError> {
        let name = name.trim().replace('-', "_");
        Self::ALL.into_iter().find(|scheme| scheme.name() == name).ok_or(LocalModelError::UnknownScheme)
    }
}

/// Identity of a local model: the body, its epoch, and the sample of the model step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelId {
    /// Identity of the body; [`ModelId::NO_BODY`] for a model without a body.
    pub body: u64,
    /// Number of rebuilds of the body: models of different epochs have different networks.
    pub epoch: u64,
    /// Sequence number of the sample to which the body had been stepped.
    pub sequence: u64,
}

impl ModelId {
    /// The body of a model that displays zero force because there is no body.
    pub const NO_BODY: u64 = 0;
}

/// State of the contact at the model step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Contact {
    /// The tool touches nothing; the force is zero.
    #[default]
    Apart,
    /// The tool holds a point: a bilateral constraint.
    Held,
    /// The tool touches the surface: a unilateral constraint.
    Touching {
        /// Outward unit normal of the surface.
        normal: DVec3,
    },
}

/// A local model: plain data that the model step writes and the loop reads.
///
/// The vectors have the lengths of their capacity and are written in place, so a hand-over neither allocates nor frees memory.
/// [`LocalModel::validate`] checks a model before it is used.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalModel {
    /// Body, epoch and sample of the model.
    pub id: ModelId,
    /// Scheme by which it computes force.
    pub scheme: Scheme,
    /// State of the contact at the model step.
    pub contact: Contact,
    /// f_N, the displayed force at the model step, N.
    pub force_n: DVec3,
    /// x_N, the tool's position at the model step, m.
    pub position_m: DVec3,
    /// v_N, the tool's velocity at the model step, m/s.
    pub velocity_m_per_s: DVec3,
    /// Static stiffness of the whole body (`Tangent`) or K_cc (`Neighbourhood`, `KrylovLinear`), N/m.
    pub stiffness_n_per_m: DMat3,
    /// B_cc (`Neighbourhood`, `KrylovLinear`), N s/m.
    pub damping_ns_per_m: DMat3,
    /// Whether the clamped tangent was used, because the exact one could not be factorised.
    pub clamped: bool,
    /// The linear reduced dynamics (`Neighbourhood`, `KrylovLinear`); of order zero for other schemes.
    pub reduced: Reduced,
    /// The near field and the reduced far field (`NearFieldExact`); empty for other schemes.
    pub near: NearField,
    /// A second body under the tool (`NearFieldExact`).
    pub second: SecondBody,
}

/// Maximum number of bodies that a local model contains.
pub const MAX_BODIES: usize = 2;

/// The second body of a local model of [`Scheme::NearFieldExact`], for an instrument between two organs.
///
/// The tool touches both bodies: it has one proxy, which their contacts and its coupling determine together. Nothing else joins the two
/// near fields.
#[derive(Clone, Debug, PartialEq)]
pub struct SecondBody {
    /// Identity of the body; [`ModelId::NO_BODY`] for a model of one body.
    pub body: u64,
    /// Number of rebuilds of the body: see [`ModelId::epoch`].
    pub epoch: u64,
    /// Its near field; empty without a second body.
    pub near: NearField,
}

/// Maximum sizes of a local model, fixed at construction. Larger models are rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacity {
    /// Maximum order of the linear reduced dynamics.
    pub order: usize,
    /// Maximum sizes of the near field.
    pub near: NearFieldCapacity,
    /// Maximum sizes of the near field of a second body; [`NearFieldCapacity::NONE`] for models of one body.
    pub second: NearFieldCapacity,
}

impl Default for Capacity {
    /// Order 96, and near fields of sixteen nodes of one body.
    fn default() -> Self {
        Self { order: 96, near: NearFieldCapacity::default(), second: NearFieldCapacity::NONE }
    }
}

impl Capacity {
    /// Capacity for linear reduced dynamics of order `order` and no near field.
    #[must_use]
    pub fn of_order(order: usize) -> Self {
        Self { order, near: NearFieldCapacity::NONE, second: NearFieldCapacity::NONE }
    }
}

/// The linear reduced dynamics of a local model of order p. Matrices are stored by rows in the first p·p (or p·3) entries.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduced {
    /// p.
    pub order: usize,
    /// K̃ = Vᵀ K_rr V.
    pub stiffness: Vec<f64>,
    /// B̃ = Vᵀ B_rr V.
    pub damping: Vec<f64>,
    /// Vᵀ K_rc, p × 3.
    pub stiffness_rc: Vec<f64>,
    /// Vᵀ B_rc, p × 3.
    pub damping_rc: Vec<f64>,
    /// Vᵀ F_N.
    pub force: Vec<f64>,
    /// q̇_N = Vᵀ v_N.
    pub velocity: Vec<f64>,
    /// Factor of M̃/h + B̃ + h K̃.
    pub implicit: Cholesky,
    /// h, s: the tick for which the factor was computed.
    pub step_s: f64,
}

impl LocalModel {
    /// A model that displays zero force, with buffers for `capacity`.
    #[must_use]
    pub fn empty(capacity: Capacity) -> Self {
        Self {
            id: ModelId::default(),
            scheme: Scheme::Hold,
            contact: Contact::Apart,
            force_n: DVec3::ZERO,
            position_m: DVec3::ZERO,
            velocity_m_per_s: DVec3::ZERO,
            stiffness_n_per_m: DMat3::ZERO,
            damping_ns_per_m: DMat3::ZERO,
            clamped: false,
            reduced: Reduced::with_capacity(capacity.order),
            near: NearField::with_capacity(capacity.near),
            second: SecondBody {
                body: ModelId::NO_BODY,
                epoch: 0,
                near: NearField::with_capacity(capacity.second),
            },
        }
    }

    /// Becomes a model without a body, which displays zero force, for sample `sequence`.
    pub fn clear(&mut self, sequence: u64) {
        self.id = ModelId { body: ModelId::NO_BODY, epoch: 0, sequence };
        (self.scheme, self.contact, self.force_n) = (Scheme::Hold, Contact::Apart, DVec3::ZERO);
        self.reduced.order = 0;
        self.near.clear();
        self.second.clear();
    }

    /// The near fields of all bodies; empty ones have no body or no surface within reach.
    #[must_use]
    pub fn near_fields(&self) -> [&NearField; MAX_BODIES] {
        [&self.near, &self.second.near]
    }

    /// Whether the model has a near field that is not empty.
    #[must_use]
    pub fn has_near_field(&self) -> bool {
        !(self.near.is_empty() && self.second.near.is_empty())
    }

    /// Whether the model has a dynamic state: a near field, or a linear dynamic scheme in contact.
    #[must_use]
    pub fn has_state(&self) -> bool {
        match self.scheme {
            Scheme::Hold | Scheme::LowPass | Scheme::Tangent => false,
            Scheme::Neighbourhood | Scheme::KrylovLinear => self.contact != Contact::Apart,
            Scheme::NearFieldExact => self.has_near_field(),
        }
    }

    /// The tick for which the model was built, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        match self.scheme {
            Scheme::NearFieldExact if self.near.is_empty() => self.second.near.tick_s,
            Scheme::NearFieldExact => self.near.tick_s,
            _ => self.reduced.step_s,
        }
    }

    /// Checks sizes and indices, and that every number in use is finite.
    ///
    /// # Errors
    /// [`LocalModelError::NotFinite`], [`LocalModelError::Size`], [`LocalModelError::Order`], [`LocalModelError::Capacity`],
    /// [`LocalModelError::Index`].
    pub fn validate(&self) -> Result<(), LocalModelError> {
        let normal = match self.contact {
            Contact::Touching { normal } => normal,
            Contact::Apart | Contact::Held => DVec3::ZERO,
        };
        for (what, ok) in [
            ("force", self.force_n.is_finite()),
            ("position", self.position_m.is_finite()),
            ("velocity", self.velocity_m_per_s.is_finite()),
            ("normal", normal.is_finite()),
            ("stiffness", self.stiffness_n_per_m.is_finite()),
            ("damping", self.damping_ns_per_m.is_finite()),
        ] {
            if !ok {
                return Err(LocalModelError::NotFinite { what });
            }
        }
        self.reduced.validate()?;
        self.near.validate()?;
        self.second.validate(&self.near)
    }

    /// Removes the near fields of all bodies but `bodies`. Returns whether the model still has one of these.
    pub(crate) fn retain_bodies(&mut self, bodies: &[u64]) -> bool {
        if self.second.body != ModelId::NO_BODY && !bodies.contains(&self.second.body) {
            self.second.clear();
        }
        let has_first = bodies.contains(&self.id.body);
        if !has_first {
            self.near.clear();
        }
        has_first || self.second.body != ModelId::NO_BODY
    }

    /// Body and epoch of each near field of the model.
    pub(crate) fn bodies(&self) -> [Option<(u64, u64)>; MAX_BODIES] {
        let second = Some((self.second.body, self.second.epoch));
        [Some((self.id.body, self.id.epoch)), second.filter(|(body, _)| *body != ModelId::NO_BODY)]
    }

    /// Copies `other` without allocation.
    ///
    /// # Errors
    /// [`LocalModelError::Order`], [`LocalModelError::Capacity`] when `other` exceeds the capacity; `self` is then unchanged.
    pub fn copy_from(&mut self, other: &Self) -> Result<(), LocalModelError> {
        other.near.fits(self.near.capacity())?;
        other.second.near.fits(self.second.near.capacity())?;
        self.reduced.copy_from(&other.reduced)?;
        self.near.copy_from(&other.near)?;
        self.second.near.copy_from(&other.second.near)?;
        (self.second.body, self.second.epoch) = (other.second.body, other.second.epoch);
        self.id = other.id;
        self.scheme = other.scheme;
        self.contact = other.contact;
        self.force_n = other.force_n;
        self.position_m = other.position_m;
        self.velocity_m_per_s = other.velocity_m_per_s;
        self.stiffness_n_per_m = other.stiffness_n_per_m;
        self.damping_ns_per_m = other.damping_ns_per_m;
        self.clamped = other.clamped;
        Ok(())
    }
}

impl SecondBody {
    /// Becomes that of a model of one body.
    pub fn clear(&mut self) {
        (self.body, self.epoch) = (ModelId::NO_BODY, 0);
        self.near.clear();
    }

    /// Checks the near field, and that it has the same tool and the same substeps as the `first` one, unless one of them is empty.
    fn validate(&self, first: &NearField) -> Result<(), LocalModelError> {
        self.near.validate()?;
        if self.near.is_empty() {
            return Ok(());
        }
        let second = &self.near;
        let tool = |field: &NearField| (field.support, field.coupling, field.start_m, field.proxy_m);
        let is_touch = matches!(second.support, Support::Touched { .. });
        let is_same = first.is_empty()
            || tool(first) == tool(second)
                && first.tick_s == second.tick_s
                && first.integrator.substeps() == second.integrator.substeps();
        match (self.body != ModelId::NO_BODY, is_touch, is_same) {
            (true, true, true) => Ok(()),
            (false, ..) => Err(LocalModelError::SecondBody { problem: "it has no identity" }),
            (_, false, _) => Err(LocalModelError::SecondBody { problem: "the tool does not touch it" }),
            (.., false) => Err(LocalModelError::SecondBody {
                problem: "its tool, tick or substeps are not those of the first",
            }),
        }
    }
}

impl Reduced {
    fn with_capacity(p: usize) -> Self {
        Self {
            order: 0,
            stiffness: zeros(p * p),
            damping: zeros(p * p),
            stiffness_rc: zeros(3 * p),
            damping_rc: zeros(3 * p),
            force: zeros(p),
            velocity: zeros(p),
            implicit: Cholesky::with_capacity(p),
            step_s: 0.0,
        }
    }

    /// Maximum order.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.force.len()
    }

    /// The vectors with their names and the number of entries that order p requires.
    fn parts(&self) -> [(&'static str, &Vec<f64>, usize); 6] {
        let p = self.order;
        [
            ("reduced stiffness", &self.stiffness, p * p),
            ("reduced damping", &self.damping, p * p),
            ("coupling stiffness", &self.stiffness_rc, 3 * p),
            ("coupling damping", &self.damping_rc, 3 * p),
            ("reduced force", &self.force, p),
            ("reduced velocity", &self.velocity, p),
        ]
    }

    fn validate(&self) -> Result<(), LocalModelError> {
        let (order, capacity) = (self.order, self.capacity());
        // Checked first: the products below then cannot overflow.
        if order > capacity {
            return Err(LocalModelError::Order { order, capacity });
        }
        if order > 0 && !(self.step_s.is_finite() && self.step_s > 0.0) {
            return Err(LocalModelError::NotFinite { what: "step" });
        }
        if order > 0 && self.implicit.order() != order {
            let found = self.implicit.order() * self.implicit.order();
            return Err(LocalModelError::Size {
                what: "implicit factor",
                found,
                needed: order * order,
                order,
            });
        }
        for (what, values, needed) in self.parts() {
            match values.get(..needed) {
                None => {
                    return Err(LocalModelError::Size { what, found: values.len(), needed, order });
                }
                Some(used) if !used.iter().all(|v| v.is_finite()) => {
                    return Err(LocalModelError::NotFinite { what });
                }
                Some(_) => {}
            }
        }
        if self.implicit.is_finite() {
            Ok(())
        } else {
            Err(LocalModelError::NotFinite { what: "implicit factor" })
        }
    }

    fn copy_from(&mut self, other: &Self) -> Result<(), LocalModelError> {
        let capacity = self.capacity();
        if other.order > capacity {
            return Err(LocalModelError::Order { order: other.order, capacity });
        }
        self.implicit.copy_from(&other.implicit)?;
        self.order = other.order;
        self.step_s = other.step_s;
        let targets = [
            &mut self.stiffness,
            &mut self.damping,
            &mut self.stiffness_rc,
            &mut self.damping_rc,
            &mut self.force,
            &mut self.velocity,
        ];
        for (to, (_, from, used)) in targets.into_iter().zip(other.parts()) {
            for (to, from) in to.iter_mut().zip(from.iter().take(used)) {
                *to = *from;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
