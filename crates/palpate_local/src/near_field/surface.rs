//! The surface of a near field and its contact patches, as plain data.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;
use palpate_laws::{MAX_PATCHES, Neighbour, PATCH_ROWS, POINT_NODES, Patch, PatchScale};

/// A point of the surface, Σ w_i x_i over nodes of S, nodes of the ring, and fixed nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearPoint {
    /// Nodes that carry the point, each once, with their weights; unused entries have weight 0. An index i < s is node i of S, s + i is
    /// node i of the ring.
    pub nodes: [(usize, f64); POINT_NODES],
    /// Part of the sum over nodes that neither S nor the ring contains, at their positions of the model step, m.
    pub fixed_m: DVec3,
    /// Young's modulus at the point, Pa; 0 where the body has none.
    pub modulus_pa: f64,
}

impl NearPoint {
    /// A point at node `node` of S.
    #[must_use]
    pub fn node(node: usize) -> Self {
        let mut point = Self::default();
        if let Some(first) = point.nodes.first_mut() {
            *first = (node, 1.0);
        }
        point
    }

    /// Nodes of S and of the ring that carry the point, with their weights.
    pub fn carriers(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        self.nodes.into_iter().filter(|(_, w)| *w != 0.0)
    }
}

/// A triangle of the contact surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearTriangle {
    /// Corners as indices of surface points, counter-clockwise seen from outside.
    pub points: [usize; 3],
    /// Neighbours across the edges, as far as the near field contains them.
    pub neighbours: [Neighbour; 3],
    /// Outward unit normal at rest.
    pub rest_normal: DVec3,
    /// Whether nodes of S alone carry the triangle, or fixed nodes alone: it then moves under a touching tool as in the body. Other
    /// triangles are static until the next hand-over and yield like the surface of a half-space.
    pub is_reachable: bool,
}

/// A contact patch at the model step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NearPatch {
    /// The patch; its triangle is an index into [`crate::NearField::triangle`].
    pub patch: Patch,
    /// Normal at rest of the triangle on which the patch began.
    pub rest_normal: DVec3,
    /// Force along the normal on each row, N.
    pub row_n: [f64; PATCH_ROWS],
    /// Force on the body by each row, N.
    pub force_n: [DVec3; PATCH_ROWS],
}

/// Contact parameters of the body, and the contact patches at the model step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearContact {
    /// Cell size, spread of small contacts, and axes that rotate with the body.
    pub scale: PatchScale,
    /// Poisson's ratio.
    pub poissons_ratio: f64,
    /// Whether rows are in series with the contact compliance that the grid lacks.
    pub adds_compliance: bool,
    /// Patches of the last step of the body, in the first `count` entries.
    pub patches: [NearPatch; MAX_PATCHES],
    /// Number of patches.
    pub count: usize,
}

impl Default for NearContact {
    fn default() -> Self {
        Self {
            scale: PatchScale { cell_m: 1.0, spread_m: 0.0, axes: DVec3::AXES, softens: true },
            poissons_ratio: 0.0,
            adds_compliance: false,
            patches: [NearPatch::default(); MAX_PATCHES],
            count: 0,
        }
    }
}

impl NearContact {
    pub(super) fn is_finite(&self) -> bool {
        let PatchScale { cell_m, spread_m, axes, .. } = self.scale;
        let patch = |p: &NearPatch| {
            let Patch { foot, normal, axis, tip_m, averaged_n } = p.patch;
            [p.rest_normal, normal, axis, tip_m].iter().chain(&p.force_n).all(|v| v.is_finite())
                && foot.weights.iter().chain(&p.row_n).chain(&[averaged_n]).all(|v| v.is_finite())
        };
        let numbers = [cell_m, spread_m, self.poissons_ratio].iter().all(|v| v.is_finite()) && cell_m > 0.0;
        numbers && axes.iter().all(|axis| axis.is_finite()) && self.patches().iter().all(patch)
    }

    /// The patches in use.
    #[must_use]
    pub fn patches(&self) -> &[NearPatch] {
        self.patches.get(..self.count).unwrap_or_default()
    }
}
