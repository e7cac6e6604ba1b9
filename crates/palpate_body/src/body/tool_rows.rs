//! Constraint rows of a tool: contact patches, and the point that it holds.

use super::Body;
use super::constraint::{Constraint, ConstraintSource, is_prescribed};
use super::substep::{Substep, ToolStep};
use super::tool_patches::PatchRow;
use crate::tool::Hold;
use glam::DVec3;
use palpate_laws::{ConstraintLaw, ContactGap, MAX_CORRECTION_SPEED_M_PER_S, SeriesDeflection};

impl Body {
    /// Rows of the tool's candidate patches.
    pub(super) fn tool_contact_rows(
        &self,
        (index, tool): (usize, &ToolStep<'_>),
        step: &Substep<'_>,
    ) -> Vec<Constraint> {
        let (moved, h) = (tool.way.to_m - tool.way.from_m, step.h);
        let row = |patch: usize, index_in_patch: usize, row: &PatchRow| {
            let (normal, push) = (row.normal, -row.normal);
            let law = tool.contact.law(push)?;
            let at_m: DVec3 = row.nodes.iter().map(|&(node, w)| w * self.x[node]).sum();
            let apart_m = (tool.way.to_m + row.tip_m - at_m).dot(normal);
            let given_way = SeriesDeflection::of(row.series, row.force_n, row.whole_n);
            let gap = ContactGap::new(apart_m, push, moved - step.given_m(&row.nodes), given_way, h);
            let series = row.series.map(|series| (series, given_way.across_m_per_n));
            if row.series.is_none() && palpate_laws::is_out_of_reach(row.free_share, row.force_n > 0.0) {
                return None;
            }
            Some(Constraint {
                source: ConstraintSource::Touch {
                    tool: index,
                    patch: (patch, index_in_patch),
                    apart_m,
                    gap_m: gap.normal_m,
                    push,
                },
                nodes: row.nodes.clone(),
                rigid: None,
                law: ConstraintLaw::Unilateral { coulomb: law, series },
                gap: gap.gap_m,
                initial_violation: gap.initial_violation_m,
            })
        };
        let rows =
            tool.patches.iter().enumerate().flat_map(|(patch, of)| {
                of.rows.iter().enumerate().map(move |(index, row)| (patch, index, row))
            });
        rows.filter_map(|(patch, index, of_patch)| row(patch, index, of_patch)).collect()
    }

    /// Adds the rows that the tool, displaced by `displacement_m`, would penetrate at the end of the step.
    pub(super) fn activate_tool_contacts(
        &self,
        touchable: &[Constraint],
        (step, displacement_m): (&Substep<'_>, DVec3),
        rows: &mut Vec<Constraint>,
    ) {
        for row in touchable {
            let ConstraintSource::Touch { gap_m, push, .. } = row.source else { continue };
            let responding =
                row.nodes.iter().filter(|(node, _)| !is_prescribed(&self.network, step.drive, *node));
            let velocity: DVec3 = responding.map(|&(node, w)| w * self.v[node]).sum();
            let gap = gap_m + (step.h * velocity - displacement_m).dot(push);
            if gap < 0.0 && !rows.iter().any(|known| known.source == row.source) {
                rows.push(row.clone());
            }
        }
    }

    /// Row of the point that the tool holds.
    pub(super) fn grip_row(
        &self,
        (index, tool): (usize, &ToolStep<'_>),
        step: &Substep<'_>,
    ) -> Option<Constraint> {
        let Hold::Point { point, offset_m } = &tool.contact.hold else { return None };
        let given = step.given_m(point.nodes());
        let apart = point.of(&self.x) - given - (tool.way.from_m + *offset_m);
        let initial_violation = apart.clamp_length_max(step.h * MAX_CORRECTION_SPEED_M_PER_S);
        let gap = initial_violation - (tool.way.to_m - tool.way.from_m - given);
        let nodes = point.nodes().to_vec();
        Some(Constraint {
            source: ConstraintSource::Grip(index),
            nodes,
            rigid: None,
            law: ConstraintLaw::Bilateral,
            gap,
            initial_violation,
        })
    }
}
