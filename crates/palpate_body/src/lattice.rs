//! A regular lattice in one, two or three dimensions.

use crate::error::check_positive;
use crate::{BodyError, Link, Network, NetworkBuilder};
use glam::DVec3;
use palpate_laws::Spring;

/// Neighbours that springs join in a lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbours {
    /// Neighbours along the axes: 2 in one dimension, 4 in two, 6 in three. In more than one dimension the lattice
    /// has no shear stiffness.
    Lateral,
    /// Also the neighbours across faces and cells: 2 in one dimension, 8 in two, 26 in three.
    #[default]
    LateralAndDiagonal,
}

/// A regular lattice of nodes in one, two or three dimensions. An axis with one node omits a dimension.
///
/// Node (i, j, k) has index i + nx (j + ny k) and lies at (i, j, k) · spacing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    nodes: [usize; 3],
    spacing_m: f64,
    neighbours: Neighbours,
    allow_free: bool,
}

impl Lattice {
    /// Creates a lattice of `nodes` nodes along x, y, z, `spacing_m` apart.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if an axis has no node, the total is below two or above a million, or the spacing is
    /// not finite or not above zero.
    pub fn new(nodes: [usize; 3], spacing_m: f64) -> Result<Self, BodyError> {
        check_positive("spacing of the lattice, m", spacing_m)?;
        let total = nodes.iter().try_fold(1usize, |total, n| total.checked_mul(*n)).unwrap_or(usize::MAX);
        let ok = (2..=1_000_000).contains(&total);
        crate::error::check(
            "nodes of the lattice",
            total as f64,
            ok,
            "2 to a million, at least 1 along each axis",
        )?;
        Ok(Self { nodes, spacing_m, neighbours: Neighbours::default(), allow_free: false })
    }

    /// Sets the neighbours that springs join.
    #[must_use]
    pub fn joined_to(self, neighbours: Neighbours) -> Self {
        Self { neighbours, ..self }
    }

    /// Allows a lattice without fixed nodes.
    #[must_use]
    pub fn allow_unconstrained(self) -> Self {
        Self { allow_free: true, ..self }
    }

    /// Number of nodes along x, y, z.
    #[must_use]
    pub fn nodes(&self) -> [usize; 3] {
        self.nodes
    }

    /// Index of node (i, j, k).
    #[must_use]
    pub fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.nodes[0] * (j + self.nodes[1] * k)
    }

    /// All (i, j, k), in the order of their indices.
    pub fn grid(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        grid(self.nodes)
    }

    /// Position of node (i, j, k), m.
    #[must_use]
    pub fn position_m(&self, ijk: [usize; 3]) -> DVec3 {
        self.spacing_m * DVec3::from_array(ijk.map(|n| n as f64))
    }

    /// Creates the network with the same stiffness, damping and mass throughout. `fixed` selects the fixed nodes.
    ///
    /// # Errors
    /// [`BodyError`] if a parameter is invalid, all nodes are fixed or, without [`Lattice::allow_unconstrained`],
    /// none is.
    pub fn uniform(
        &self,
        stiffness_n_per_m: f64,
        damping_ns_per_m: f64,
        mass_kg: f64,
        fixed: impl Fn([usize; 3]) -> bool,
    ) -> Result<Network, BodyError> {
        let rest_m: Vec<DVec3> = self.grid().map(|ijk| self.position_m(ijk)).collect();
        let mut links = Vec::new();
        let joined = |step: &[i32; 3]| {
            let axes = step.iter().filter(|s| **s != 0).count();
            axes == 1 || self.neighbours == Neighbours::LateralAndDiagonal
        };
        for ijk in self.grid() {
            for step in steps().filter(joined) {
                let Some(other) = neighbour(self.nodes, ijk, step) else { continue };
                let (a, b) = (self.node(ijk), self.node(other));
                let spring =
                    Spring::linear(stiffness_n_per_m, rest_m[a].distance(rest_m[b]), damping_ns_per_m)
                        .map_err(|source| BodyError::Law { link: links.len(), source })?;
                links.push(Link { a, b, spring });
            }
        }
        let nodes = rest_m.len();
        let fixed = self.grid().map(fixed).collect();
        let network = NetworkBuilder::of(rest_m, vec![mass_kg; nodes], fixed, links);
        if self.allow_free { network.allow_unconstrained() } else { network }.build()
    }
}

/// All (i, j, k) below `nodes`, with i fastest.
pub(crate) fn grid([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
}

/// The node one `step` from `ijk`, if it lies in a lattice of `nodes`.
pub(crate) fn neighbour(nodes: [usize; 3], ijk: [usize; 3], step: [i32; 3]) -> Option<[usize; 3]> {
    let mut other = [0; 3];
    for axis in 0..3 {
        other[axis] = ijk[axis].checked_add_signed(step[axis] as isize).filter(|&n| n < nodes[axis])?;
    }
    Some(other)
}

/// The 13 steps to neighbours that are lexically above zero: each pair of neighbours once.
pub(crate) fn steps() -> impl Iterator<Item = [i32; 3]> {
    let range = || -1..=1;
    range()
        .flat_map(move |i| range().flat_map(move |j| range().map(move |k| [i, j, k])))
        .filter(|step| *step > [0, 0, 0])
}
