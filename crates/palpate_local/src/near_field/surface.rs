//! The surface of a near field, and where the tool touches it, as data.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;
use palpate_laws::{MAX_PATCHES, Neighbour, PATCH_ROWS, POINT_NODES, Patch, PatchScale};

/// A point of the surface: Σ w_i x_i over nodes of S and of the ring, and over what does not move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearPoint {
    /// The nodes that carry it, each once, and their weights; 0 where there are fewer. An index below s is that of a node of S, s + i that of
    /// node i of the ring.
    pub nodes: [(usize, f64); POINT_NODES],
    /// Σ w_i x_i over the nodes that carry it and do not move, m.
    pub fixed_m: DVec3,
    /// Young's modulus there, Pa; 0 where the body has none.
    pub modulus_pa: f64,
}

impl NearPoint {
    /// The node `node` of S itself.
    #[must_use]
    pub fn node(node: usize) -> Self {
        let mut point = Self::default();
        if let Some(first) = point.nodes.first_mut() {
            *first = (node, 1.0);
        }
        point
    }

    /// The nodes of S and of the ring that carry it, and their weights.
    pub fn carriers(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        self.nodes.into_iter().filter(|(_, w)| *w != 0.0)
    }
}

/// A triangle of the surface on which contact patches are found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearTriangle {
    /// Its corners, points of the surface, counter-clockwise seen from outside.
    pub points: [usize; 3],
    /// What is across its edges, of the triangles that are known.
    pub neighbours: [Neighbour; 3],
    /// Its outward unit normal at rest.
    pub rest_normal: DVec3,
    /// Whether nodes of S alone carry it, so that it moves under a tool that touches it, or fixed ones alone. What else is touched stands still and
    /// gives way as the smooth surface of a half-space does.
    pub is_reachable: bool,
}

/// A contact patch at the model step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearPatch {
    /// Where it is: its triangle is one of the near field's.
    pub patch: Patch,
    /// The normal at rest of the triangle on which it began.
    pub rest_normal: DVec3,
    /// The force along the normal on each of its rows, N, and the whole force on the body.
    pub row_n: [f64; PATCH_ROWS],
    /// See `row_n`.
    pub force_n: [DVec3; PATCH_ROWS],
}

/// What contact needs to know of the body beside its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearContact {
    /// Size of a cell, and directions that turn with the body.
    pub scale: PatchScale,
    /// Poisson's ratio.
    pub poissons_ratio: f64,
    /// Whether contact gets the compliance that the grid lacks.
    pub adds_compliance: bool,
    /// The patches that the tool touched in the last step of the body, the first `count` of these.
    pub patches: [NearPatch; MAX_PATCHES],
    /// How many patches it touched.
    pub count: usize,
}

impl Default for NearContact {
    fn default() -> Self {
        Self {
            scale: PatchScale { cell_m: 1.0, spread_m: 0.0, axes: DVec3::AXES },
            poissons_ratio: 0.0,
            adds_compliance: false,
            patches: [NearPatch::default(); MAX_PATCHES],
            count: 0,
        }
    }
}

impl NearContact {
    pub(super) fn is_finite(&self) -> bool {
        let PatchScale { cell_m, spread_m, axes } = self.scale;
        let patch = |p: &NearPatch| {
            let Patch { foot, normal, axis, tip_m, eased_n } = p.patch;
            [p.rest_normal, normal, axis, tip_m].iter().chain(&p.force_n).all(|v| v.is_finite())
                && foot.weights.iter().chain(&p.row_n).chain(&[eased_n]).all(|v| v.is_finite())
        };
        let numbers = [cell_m, spread_m, self.poissons_ratio].iter().all(|v| v.is_finite()) && cell_m > 0.0;
        numbers && axes.iter().all(|axis| axis.is_finite()) && self.patches().iter().all(patch)
    }

    /// The patches that the tool touched.
    #[must_use]
    pub fn patches(&self) -> &[NearPatch] {
        self.patches.get(..self.count).unwrap_or_default()
    }
}
