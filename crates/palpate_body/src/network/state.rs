//! A network in a state.

use super::Network;
use glam::DVec3;
use palpate_laws::RelaxedStress;

/// A network with positions and velocities of its nodes.
#[derive(Clone, Copy)]
pub(crate) struct NetworkState<'a> {
    pub(crate) network: &'a Network,
    /// Position of every node, m.
    pub(crate) x: &'a [DVec3],
    /// Velocity of every node, m/s.
    pub(crate) v: &'a [DVec3],
    /// Relaxed stress of every hexahedron, and then of every smoothed domain of a node; empty where none relaxes.
    pub(crate) relaxed: &'a [RelaxedStress],
}
