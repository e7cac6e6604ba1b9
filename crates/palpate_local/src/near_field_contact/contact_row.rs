//! A constraint row of the tool in a tick, and weighted sums over the nodes of S.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::NearField;
use crate::dense::vec3_at;
use glam::DVec3;
use palpate_laws::{ConstraintLaw, ContactGap, MAX_CORRECTION_SPEED_M_PER_S, SeriesDeflection, ToolMove};

/// A constraint row on a point Σ w_i x_i over the nodes of S. The weights are stored apart: see [`row_weights`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactRow {
    /// Index of the patch in the tick, and of the row in the patch; `None` for a held point.
    pub(super) patch_row: Option<(usize, usize)>,
    pub(crate) law: ConstraintLaw,
    /// Inward unit normal, the direction in which the tool pushes.
    pub(super) inward: DVec3,
    /// From the tool's position to its point of contact, m.
    pub(super) tip_m: DVec3,
    /// Position of the row's point for δx_S = 0, m.
    pub(super) rest_m: DVec3,
    /// Force along the normal in the previous step, N.
    pub(super) normal_force_n: f64,
    /// Force on the body in the previous step, N.
    pub(super) body_force_n: DVec3,
    /// As in [`ContactGap`].
    pub(super) gap_m: f64,
    pub(crate) gap: DVec3,
    /// The part of the gap that was violated before the step; only positions correct it, m.
    pub(crate) initial_violation: DVec3,
    pub(crate) impulse_ns: DVec3,
    /// Whether the row is in the active set of the step.
    pub(super) is_active: bool,
}

impl Default for ContactRow {
    /// An inactive bilateral row.
    fn default() -> Self {
        Self {
            patch_row: None,
            law: ConstraintLaw::Bilateral,
            inward: DVec3::ZERO,
            tip_m: DVec3::ZERO,
            rest_m: DVec3::ZERO,
            normal_force_n: 0.0,
            body_force_n: DVec3::ZERO,
            gap_m: 0.0,
            gap: DVec3::ZERO,
            initial_violation: DVec3::ZERO,
            impulse_ns: DVec3::ZERO,
            is_active: false,
        }
    }
}

impl ContactRow {
    /// Sets the gap of a held point for a step of length `h`.
    pub(super) fn set_held_gap(
        &mut self,
        field: &NearField,
        weights: &[f64],
        tool: &ToolMove,
        h: f64,
        z: &[f64],
    ) {
        let offset = weighted_sum(weights, z) - (tool.from_m - field.proxy_m);
        self.initial_violation = offset.clamp_length_max(h * MAX_CORRECTION_SPEED_M_PER_S);
        self.gap = self.initial_violation - (tool.to_m - tool.from_m);
        self.is_active = false;
    }

    /// Sets the gap of a contact for a step of length `h`, and clears the impulse.
    pub(super) fn set_contact_gap(&mut self, weights: &[f64], tool: &ToolMove, h: f64, z: &[f64]) {
        let at_m = self.rest_m + weighted_sum(weights, z);
        let apart_m = (tool.to_m + self.tip_m - at_m).dot(-self.inward);
        let mut deflection = SeriesDeflection::default();
        if let ConstraintLaw::Unilateral { series: Some((series, across_m_per_n)), .. } = &mut self.law {
            deflection = SeriesDeflection::of(Some(*series), self.normal_force_n, self.body_force_n);
            *across_m_per_n = deflection.across_m_per_n;
        }
        let gap = ContactGap::new(apart_m, self.inward, tool.to_m - tool.from_m, deflection, h);
        (self.gap_m, self.gap, self.initial_violation) = (gap.normal_m, gap.gap_m, gap.initial_violation_m);
        (self.impulse_ns, self.is_active) = (DVec3::ZERO, false);
    }

    /// Stores the force that belongs to the impulse of a step of length `h`.
    pub(super) fn store_force(&mut self, h: f64) {
        let force_n = if self.is_active { self.impulse_ns / h } else { DVec3::ZERO };
        (self.normal_force_n, self.body_force_n) = (force_n.dot(self.inward).max(0.0), force_n);
    }
}

/// The weights of row `row` over the `nodes` nodes of S.
pub(super) fn row_weights(all: &[f64], nodes: usize, row: usize) -> &[f64] {
    all.get(row * nodes..(row + 1) * nodes).unwrap_or_default()
}

/// Σ w_i v_i over the nodes of S.
pub(super) fn weighted_sum(weights: &[f64], v: &[f64]) -> DVec3 {
    weights.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(i, w)| *w * vec3_at(v, i)).sum()
}
