//! The springs, volume barriers and elements of a near field, as plain data.

use glam::DVec3;
use palpate_laws::{DomainMaterial, ElementMaterial, RelaxedStress, Spring, VolumeBarrier};

/// The end b of a near spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NearEnd {
    /// A node of S.
    Support(usize),
    /// A node of the ring.
    Ring(usize),
    /// A fixed position, m.
    Fixed(DVec3),
}

/// A spring incident to S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearSpring {
    /// Node of S at the end a.
    pub a: usize,
    /// The end b.
    pub b: NearEnd,
    /// Force law, rest length and damper.
    pub spring: Spring,
}

/// A tetrahedron of a strongly compressed cell that has a node in S, with its volume barrier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearTetrahedron {
    /// Nodes; the three edges start at the first. An index i < s is node i of S, s + i is node i of the ring.
    pub nodes: [usize; 4],
    /// Volume barrier.
    pub barrier: VolumeBarrier,
}

/// A hexahedral element that has a free node in S.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearHexahedron {
    /// Nodes of the corners: an index i < s is node i of S, s + i is node i of the ring.
    pub nodes: [u16; 8],
    /// Index of the shape in [`NearField::shape`](crate::NearField::shape).
    pub shape: usize,
    /// Material.
    pub material: ElementMaterial,
    /// Relaxed stress at the model step, times the volume, J.
    pub relaxed: RelaxedStress,
}

/// A smoothed domain of tetrahedra that has a free node in S.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearDomain {
    /// First of its entries in [`NearField::domain_node`](crate::NearField::domain_node) and
    /// [`NearField::domain_gradient_per_m`](crate::NearField::domain_gradient_per_m), and their number.
    pub entries: (usize, usize),
    /// Material.
    pub material: DomainMaterial,
    /// Relaxed stress at the model step, times the volume, J.
    pub relaxed: RelaxedStress,
}

impl NearDomain {
    /// Its part of a list of entries.
    #[must_use]
    pub fn part<'a, T>(&self, of: &'a [T]) -> &'a [T] {
        let (first, count) = self.entries;
        first.checked_add(count).and_then(|end| of.get(first..end)).unwrap_or_default()
    }
}
