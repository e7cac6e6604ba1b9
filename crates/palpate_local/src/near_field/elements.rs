//! The springs and volume barriers of a near field, as data.

use glam::DVec3;
use palpate_laws::{Spring, VolumeBarrier};

/// The other end of a near spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NearEnd {
    /// A node of S.
    Support(usize),
    /// A node of the ring.
    Ring(usize),
    /// What does not move, m.
    Fixed(DVec3),
}

/// A spring with an end in S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearSpring {
    /// Its node a, in S.
    pub a: usize,
    /// Its node b.
    pub b: NearEnd,
    /// Its law, rest length and damper.
    pub spring: Spring,
}

/// A tetrahedron of a cell with a node in S, and its volume barrier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearTetrahedron {
    /// Its nodes; the edges lead from the first to the others: i < s is node i of S, s + i node i of the ring.
    pub nodes: [usize; 4],
    /// Its barrier.
    pub barrier: VolumeBarrier,
}
