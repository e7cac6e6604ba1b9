//! The constraint rows of the contact patches of a tick, with their weights over S.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::contact_patches::{ContactPatches, TickPatch, modulus_pa};
use super::contact_row::{ContactRow, weighted_sum};
use super::placed_surface::NodeMotion;
use crate::NearField;
use glam::DVec3;
use palpate_laws::{
    ConstraintLaw, Coulomb, LoadedPoint, PATCH_ROWS, PatchLayout, SeriesCompliance, is_out_of_reach, mobility,
};

/// Writes the rows of the patches of a tick into `rows`, and their weights into `weights`, s numbers a row; `mean` is a buffer of s
/// numbers. Returns whether rows were dropped because a buffer is full.
pub(super) fn write_patch_rows(
    field: &NearField,
    patches: &mut ContactPatches,
    friction: f64,
    motion: &NodeMotion<'_>,
    (rows, weights, mean): (&mut Vec<ContactRow>, &mut [f64], &mut [f64]),
) -> bool {
    rows.clear();
    let (s, z) = (field.nodes.max(1), motion.z);
    let (current, points, carried) = patches.parts();
    let surface = points.surface(field, motion);
    let mut is_full = false;
    for (index, TickPatch { near, layout }) in current.enumerate() {
        let Some(mean) = mean.get_mut(..field.nodes) else { return is_full };
        mean.fill(0.0);
        let mut mean_m = DVec3::ZERO;
        // Each row's own part is accumulated where its weights will be, one row after the other.
        let Some(own) = weights.get_mut(s * rows.len()..) else { return is_full };
        let mut own_m = [DVec3::ZERO; PATCH_ROWS];
        if layout.apart > 0.0 {
            own.iter_mut().take(s * PATCH_ROWS).for_each(|w| *w = 0.0);
        }
        let mut layout = *layout;
        let corners = |triangle: usize| Some(field.triangle.get(triangle)?.points);
        layout.carry(&surface, corners, &field.contact.scale, carried);
        for LoadedPoint { point, share, of_rows } in &*carried {
            let (Some(near_point), Some(x)) = (field.point.get(*point), surface.point_m(*point)) else {
                continue;
            };
            mean_m += *share * x;
            let parts = || of_rows.iter().enumerate().filter(|(_, part)| **part > 0.0);
            for (row, part) in parts() {
                if let Some(at_m) = own_m.get_mut(row) {
                    *at_m += *part * x;
                }
            }
            for (node, w) in near_point.nodes.iter().filter(|(_, w)| *w != 0.0) {
                let Some(to) = mean.get_mut(*node) else { continue };
                *to += share * w;
                for (row, part) in parts() {
                    if let Some(to) = own.get_mut(row * s + node) {
                        *to += part * w;
                    }
                }
            }
        }
        // A surface beyond S is static until the next hand-over, and yields like a half-space.
        let foot = field.triangle.get(near.patch.foot.triangle);
        let is_static = foot.is_some_and(|triangle| !triangle.is_reachable);
        let series = if is_static {
            layout.law.map(|law| SeriesCompliance::of_share(1.0, law))
        } else {
            missing_compliance(field, mean, modulus_pa(field, near.patch.foot), &layout)
        };
        if is_static && series.is_none() {
            continue;
        }
        let first = rows.len();
        for row in layout.rows() {
            // A skipped row leaves its place to the rows after it.
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
            let inward = -row.normal;
            // A static surface has friction only once a normal force acts.
            let is_unloaded = is_static && row.force_n <= 0.0;
            let Ok(coulomb) = Coulomb::new(inward, if is_unloaded { 0.0 } else { friction }) else {
                continue;
            };
            if is_static {
                weights.fill(0.0);
            }
            rows.push(ContactRow {
                patch_row: Some((index, row.index)),
                law: ConstraintLaw::Unilateral { coulomb, series: series.map(|series| (series, 0.0)) },
                inward,
                tip_m: row.tip_m - lead_m * row.normal,
                rest_m: at_m - weighted_sum(weights, z),
                normal_force_n: row.force_n,
                body_force_n: row.whole_n(&near.force_n),
                ..ContactRow::default()
            });
        }
    }
    is_full
}

/// The contact compliance that the grid lacks, for a contact whose force is spread over S by `mean`.
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
    layout.missing_compliance(sum / modulus_pa, &field.contact.scale)
}
