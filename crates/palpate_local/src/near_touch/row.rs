//! The rows of a step: the point that the tool holds, or those of its contact patches.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::patches::{Patches, Placed, TickPatch, modulus_pa as patch_modulus};
use crate::NearField;
use crate::near_tick::vec3_at;
use glam::DVec3;
use palpate_laws::{
    CarriedPoint, ConstraintLaw, ContactGap, Coulomb, MAX_CORRECTION_SPEED_M_PER_S, PATCH_ROWS, PatchLayout,
    SeriesCompliance, SeriesDeflection, ToolMove, is_out_of_reach, mobility,
};

/// A row on nodes of S, but for its weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactRow {
    /// Its patch in the tick, and which of the patch's rows it is; `None` for what is held.
    pub(super) of: Option<(usize, usize)>,
    pub(super) law: ConstraintLaw,
    /// Along which the tool pushes.
    pub(super) inward: DVec3,
    /// From the tool to its tip, m.
    tip_m: DVec3,
    /// Where the row's point is without δx_S, m.
    rest_m: DVec3,
    /// The force along the normal in the step before, and the whole force on the body, N.
    force_n: f64,
    whole_n: DVec3,
    /// As in [`ContactGap`].
    pub(super) gap_m: f64,
    pub(super) gap: DVec3,
    pub(super) initial_violation: DVec3,
    pub(super) impulse_ns: DVec3,
    /// Whether it takes part in the problem of the step.
    pub(super) is_active: bool,
}

impl Default for ContactRow {
    /// One that pushes nothing, only to fill a place.
    fn default() -> Self {
        Self {
            of: None,
            law: ConstraintLaw::Bilateral,
            inward: DVec3::ZERO,
            tip_m: DVec3::ZERO,
            rest_m: DVec3::ZERO,
            force_n: 0.0,
            whole_n: DVec3::ZERO,
            gap_m: 0.0,
            gap: DVec3::ZERO,
            initial_violation: DVec3::ZERO,
            impulse_ns: DVec3::ZERO,
            is_active: false,
        }
    }
}

impl ContactRow {
    /// That of what the tool holds, whose weights are the field's.
    pub(super) fn aim_held(
        &mut self,
        field: &NearField,
        weights: &[f64],
        tool: &ToolMove,
        h: f64,
        z: &[f64],
    ) {
        let moved_so_far = of_nodes(weights, z) - (tool.from_m - field.proxy_m);
        self.initial_violation = moved_so_far.clamp_length_max(h * MAX_CORRECTION_SPEED_M_PER_S);
        self.gap = self.initial_violation - (tool.to_m - tool.from_m);
        self.is_active = false;
    }

    /// Its gap in a step of length `h`.
    pub(super) fn aim(&mut self, weights: &[f64], tool: &ToolMove, h: f64, z: &[f64]) {
        let at_m = self.rest_m + of_nodes(weights, z);
        let apart_m = (tool.to_m + self.tip_m - at_m).dot(-self.inward);
        let mut given_way = SeriesDeflection::default();
        if let ConstraintLaw::Unilateral { series: Some((series, across_m_per_n)), .. } = &mut self.law {
            given_way = SeriesDeflection::of(Some(*series), self.force_n, self.whole_n);
            *across_m_per_n = given_way.across_m_per_n;
        }
        let gap = ContactGap::new(apart_m, self.inward, tool.to_m - tool.from_m, given_way, h);
        (self.gap_m, self.gap, self.initial_violation) = (gap.normal_m, gap.gap_m, gap.overdue_m);
        (self.impulse_ns, self.is_active) = (DVec3::ZERO, false);
    }

    /// Notes its force in a step of length `h`.
    pub(super) fn note(&mut self, h: f64) {
        let whole_n = if self.is_active { self.impulse_ns / h } else { DVec3::ZERO };
        (self.force_n, self.whole_n) = (whole_n.dot(self.inward).max(0.0), whole_n);
    }

    /// The force along the normal in the step that has been made, and the whole force on the body, N.
    pub(super) fn force_n(&self) -> (f64, DVec3) {
        (self.force_n, self.whole_n)
    }
}

/// The weights of S in a row.
pub(super) fn weights_of(all: &[f64], nodes: usize, row: usize) -> &[f64] {
    all.get(row * nodes..(row + 1) * nodes).unwrap_or_default()
}

/// Σ w_i v_i over the nodes of S.
pub(super) fn of_nodes(weights: &[f64], v: &[f64]) -> DVec3 {
    weights.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(i, w)| *w * vec3_at(v, i)).sum()
}

/// The rows of the patches of a tick, whose weights are those of S, `weights` row by row of s each. Returns whether there were more than there
/// is room for.
pub(super) fn rows_of_patches(
    field: &NearField,
    patches: &mut Patches,
    friction: f64,
    placed: &Placed<'_>,
    (rows, weights, mean): (&mut Vec<ContactRow>, &mut [f64], &mut [f64]),
) -> bool {
    rows.clear();
    let (s, z) = (field.nodes.max(1), placed.z);
    let (now, points, carried) = patches.parts();
    let surface = points.of(field, placed);
    let mut is_full = false;
    for (index, TickPatch { known, layout }) in now.enumerate() {
        let Some(mean) = mean.get_mut(..field.nodes) else { return is_full };
        mean.fill(0.0);
        let mut mean_m = DVec3::ZERO;
        // The rows' own parts lie where the rows will be, one after the other.
        let Some(own) = weights.get_mut(s * rows.len()..) else { return is_full };
        let mut own_m = [DVec3::ZERO; PATCH_ROWS];
        if layout.apart > 0.0 {
            own.iter_mut().take(s * PATCH_ROWS).for_each(|w| *w = 0.0);
        }
        let mut layout = *layout;
        let corners = |triangle: usize| Some(field.triangle.get(triangle)?.points);
        layout.carry(&surface, corners, &field.contact.scale, carried);
        for CarriedPoint { point, share, of_rows } in &*carried {
            let (Some(carriers), Some(x)) = (field.point.get(*point), surface.point_m(*point)) else {
                continue;
            };
            mean_m += *share * x;
            let parts = || of_rows.iter().enumerate().filter(|(_, part)| **part > 0.0);
            for (row, part) in parts() {
                if let Some(at_m) = own_m.get_mut(row) {
                    *at_m += *part * x;
                }
            }
            for (node, w) in carriers.nodes.iter().filter(|(_, w)| *w != 0.0) {
                let Some(to) = mean.get_mut(*node) else { continue };
                *to += share * w;
                for (row, part) in parts() {
                    if let Some(to) = own.get_mut(row * s + node) {
                        *to += part * w;
                    }
                }
            }
        }
        // What S does not carry stands still until the next hand-over, and gives way as a half-space does.
        let foot = field.triangle.get(known.patch.foot.triangle);
        let is_static = foot.is_some_and(|triangle| !triangle.is_reachable);
        let series = if is_static {
            layout.law.map(|law| SeriesCompliance::of_share(1.0, law))
        } else {
            missing_compliance(field, mean, patch_modulus(field, known.patch.foot), &layout)
        };
        if is_static && series.is_none() {
            continue;
        }
        let first = rows.len();
        for row in layout.rows() {
            // Rows that are left out leave their place to those after them.
            let (from, start) = (s * (first + row.index), s * rows.len());
            if rows.len() == rows.capacity() || from + s > weights.len() {
                is_full = true;
                break;
            }
            if layout.apart > 0.0 {
                weights.copy_within(from..from + s, start);
            }
            let Some(weights) = weights.get_mut(start..start + field.nodes) else { break };
            let (rest, part) = (1.0 - layout.apart, layout.apart / row.portion);
            let mut at_m = rest * mean_m;
            if layout.apart > 0.0 {
                weights.iter_mut().zip(&*mean).for_each(|(to, w)| *to = rest * w + part * *to);
                at_m += part * own_m.get(row.index).copied().unwrap_or_default();
            } else {
                weights.copy_from_slice(mean);
            }
            let is_free = |per_kg: &f64| *per_kg > 0.0;
            let free = weights.iter().zip(&field.node_per_kg).filter(|(_, per_kg)| is_free(per_kg));
            let free: f64 = free.map(|(w, _)| w).sum();
            let borne = row.portion * if is_static { 1.0 } else { mobility(free) };
            if series.map_or(is_out_of_reach(free, row.force_n > 0.0), |_| borne <= 0.0) {
                continue;
            }
            let series = series.map(|series| series.of_portion(borne));
            let lead_m = series.map_or(0.0, |series| series.lead_m);
            let push = -row.normal;
            // What stands still gives way across the normal only under a force along it.
            let begins = is_static && row.force_n <= 0.0;
            let Ok(coulomb) = Coulomb::new(push, if begins { 0.0 } else { friction }) else { continue };
            if is_static {
                weights.fill(0.0);
            }
            rows.push(ContactRow {
                of: Some((index, row.index)),
                law: ConstraintLaw::Unilateral { coulomb, series: series.map(|series| (series, 0.0)) },
                inward: push,
                tip_m: row.tip_m - lead_m * row.normal,
                rest_m: at_m - of_nodes(weights, z),
                force_n: row.force_n,
                whole_n: row.whole_n(&known.force_n),
                ..ContactRow::default()
            });
        }
    }
    is_full
}

/// What the grid lacks of the law of a contact whose force is spread over S by `mean`.
fn missing_compliance(
    field: &NearField,
    mean: &[f64],
    modulus_pa: Option<f64>,
    layout: &PatchLayout,
) -> Option<SeriesCompliance> {
    let modulus_pa = modulus_pa?;
    if !field.contact.adds_compliance {
        return layout.least_compliance();
    }
    let rows = field.compliance.chunks_exact(field.nodes.max(1)).zip(mean).filter(|(_, w)| **w != 0.0);
    let sum: f64 = rows.map(|(row, w)| w * row.iter().zip(mean).map(|(g, o)| g * o).sum::<f64>()).sum();
    let cell_m = field.contact.scale.cell_m;
    layout.missing_compliance(sum / modulus_pa, cell_m)
}
