//! The state of a body, and its restoration.

use super::Body;
use crate::energy::EnergyLedger;
use crate::obstacle::Pose;
use crate::{BodyError, Tie};
use glam::{DQuat, DVec3};
use palpate_laws::RelaxedStress;

/// State of a body: everything that a step changes, except the tools. Gravity, loads and obstacles are not part of
/// it.
///
/// Restored into a body of the same network with the same gravity, loads and obstacles, it leads to bit-identical
/// steps. Energy accounting restarts. A file preserves the bits if its format does (serde_json with
/// `float_roundtrip`).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BodyState {
    /// Position of every node, m.
    pub positions_m: Vec<DVec3>,
    /// Velocity of every node, m/s.
    pub velocities_m_per_s: Vec<DVec3>,
    /// Time for which the body has been at rest, s; see [`Body::is_settled`].
    pub quiet_s: f64,
    /// Whether a tool touched or held the body at the end of the last advance. The body then does not sleep without it.
    #[cfg_attr(feature = "serde", serde(default))]
    pub is_touched: bool,
    /// Ties, including torn ones.
    pub ties: Vec<Tie>,
    /// Relaxed stress of every hexahedron, and then of every smoothed domain of a node of tetrahedra, times its volume, J: xx, yy, zz, xy, yz, zx
    /// of each term of the Prony series. Empty where no element relaxes.
    #[cfg_attr(feature = "serde", serde(default))]
    pub relaxed_stress_j: Vec<RelaxedStress>,
    /// Position of the fixed nodes relative to rest, m; see [`Body::move_fixed`].
    #[cfg_attr(feature = "serde", serde(default))]
    pub fixed_position_m: DVec3,
    /// Rotation of the fixed nodes relative to rest.
    #[cfg_attr(feature = "serde", serde(default))]
    pub fixed_rotation: DQuat,
}

impl Body {
    /// Sets positions and velocities to those of `other`, which has the same nodes. Relaxed stress is adopted in proportion to the shear moduli
    /// where both bodies have the same elements; otherwise no stress has relaxed.
    ///
    /// # Errors
    /// As [`Body::set_state`].
    pub fn adopt_motion(&mut self, other: &Self) -> Result<(), BodyError> {
        self.set_state(&other.x, &other.v)?;
        let (now, before) = (self.network.relaxing_materials(), other.network.relaxing_materials());
        if self.relaxed.len() == other.relaxed.len() {
            let pairs = self.relaxed.iter_mut().zip(&other.relaxed).zip(now.zip(before));
            for ((to, from), (now, before)) in pairs {
                let share = now.parameters_j.mu / before.parameters_j.mu;
                *to = from.map(|of| of.map(|stress| share * stress));
            }
        }
        Ok(())
    }

    /// Current state.
    #[must_use]
    pub fn state(&self) -> BodyState {
        BodyState {
            positions_m: self.x.clone(),
            velocities_m_per_s: self.v.clone(),
            quiet_s: self.quiet_s,
            is_touched: self.is_touched,
            ties: self.ties.clone(),
            relaxed_stress_j: self.relaxed.clone(),
            fixed_position_m: self.fixed_pose.position_m,
            fixed_rotation: self.fixed_pose.rotation,
        }
    }

    /// Restores `state`, bit for bit if it comes from the same network.
    ///
    /// # Errors
    /// As [`Body::set_state`].
    pub fn restore(&mut self, state: &BodyState) -> Result<(), BodyError> {
        state.ties.iter().try_for_each(|tie| tie.validate(self.x.len()))?;
        let fixed_pose = Pose::new(state.fixed_position_m, state.fixed_rotation)?;
        let (found, needed) = (state.relaxed_stress_j.len(), self.relaxed.len());
        if found != 0 && found != needed {
            return Err(BodyError::RelaxedStress { found, needed });
        }
        self.set_state(&state.positions_m, &state.velocities_m_per_s)?;
        (self.fixed_pose, self.fixed_target) = (fixed_pose, None);
        if !state.relaxed_stress_j.is_empty() {
            self.relaxed.clone_from(&state.relaxed_stress_j);
        }
        self.ties.clone_from(&state.ties);
        (self.quiet_s, self.is_touched) = (state.quiet_s, state.is_touched);
        Ok(())
    }

    /// Sets positions, m, and velocities, m/s, of all nodes. Velocities of fixed nodes are set to zero, and no stress has relaxed.
    ///
    /// # Errors
    /// [`BodyError::Length`] if a list does not have one entry for each node, [`BodyError::Position`] if an entry is
    /// not finite. The state is then unchanged.
    pub fn set_state(&mut self, x_m: &[DVec3], v_m_per_s: &[DVec3]) -> Result<(), BodyError> {
        let nodes = self.network.node_count();
        for (what, list) in [("the list of positions", x_m), ("the list of velocities", v_m_per_s)] {
            if list.len() != nodes {
                return Err(BodyError::Length { what, found: list.len(), nodes });
            }
            if let Some(node) = list.iter().position(|value| !value.is_finite()) {
                return Err(BodyError::Position { node });
            }
        }
        self.x.copy_from_slice(x_m);
        self.v.copy_from_slice(v_m_per_s);
        self.quiet_s = 0.0;
        // Fixed nodes do not move.
        for node in (0..nodes).filter(|&node| self.network.is_fixed(node)) {
            self.v[node] = DVec3::ZERO;
        }
        self.relaxed.fill(RelaxedStress::default());
        self.to_relax = f64::from(u8::from(!self.relaxed.is_empty()));
        self.contacts.clear();
        // Setting a state is no work.
        self.ledger = self.ledger.take().map(|_| EnergyLedger::start(self));
        Ok(())
    }
}
