//! The tool in a step: the points of the surface that it may run into, and the one that it holds.

use super::{Constraint, Source, ToolStep};
use crate::BodyPoint;
use crate::body::{Body, StepReport};
use crate::contact::Weights;
use crate::tool::Hold;
use glam::DVec3;
use palpate_laws::{CLOSING_M_PER_S, RowLaw};

/// Most nodes that a tool touches at once.
const MOST_TOUCHED: usize = 64;

impl Body {
    /// Where the tool may touch in this step, each place once.
    pub(super) fn touchable(&self, (index, tool): (usize, &ToolStep<'_>), h: f64) -> Vec<Constraint> {
        let mut rows: Vec<Constraint> = Vec::new();
        let mut places: Vec<[usize; 3]> = Vec::new();
        let Hold::Nothing { shape, .. } = tool.contact.hold else { return rows };
        let moved = tool.way.to_m - tool.way.from_m;
        // What is farther cannot come.
        let speed2 = |&node: &usize| self.v[node].length_squared();
        let fastest = self.network.free().iter().map(speed2).fold(0.0, f64::max).sqrt();
        let drawn = tool.way.short_m().length();
        let far = 2.0 * (moved.length() + h * fastest) + drawn;
        let points = &self.surface.points;
        let free_share = |point: usize| points[point].free_share(|node| self.network.is_fixed(node));
        for &(triangle, longest_m) in tool.near {
            let corners_m = triangle.map(|point| points[point].of(&self.x));
            shape.features(tool.way.to_m, corners_m, longest_m, |feature| {
                if feature.gap_m > far {
                    return;
                }
                let corners = [0, 1, 2].map(|i| (triangle[i], feature.weights[i]));
                let on: Weights = corners.into_iter().filter(|(_, w)| *w > 0.0).collect();
                // An edge or a corner belongs to several triangles; a punch touches a face at several places.
                let mut place = [usize::MAX; 3];
                on.iter().zip(&mut place).for_each(|((point, _), place)| *place = *point);
                place.sort_unstable();
                let is_face = on.len() == 3;
                let is_touched = tool.contact.touched.iter().any(|t| t.is_on(&on));
                if (!is_face && places.contains(&place))
                    || feature.is_out_of_reach(triangle.map(free_share), is_touched)
                {
                    return;
                }
                let Some(law) = tool.contact.law(feature.normal) else { return };
                places.push(place);
                let push = feature.normal;
                let gap = feature.gap(moved, h);
                rows.push(Constraint {
                    source: Source::Touch {
                        tool: index,
                        corners,
                        apart_m: feature.gap_m,
                        gap_m: gap.normal_m,
                        push,
                    },
                    nodes: BodyPoint::between(corners.map(|(p, w)| (&points[p], w))).into_nodes(),
                    law: RowLaw::OneSided(law),
                    gap: gap.gap_m,
                    overdue: gap.overdue_m,
                });
            });
        }
        rows
    }

    /// Adds what the tool `index`, `drawn` by its coupling, would have run into at the end of a step of length `h`, up to so many
    /// nodes: first where it touched at the points `before`, then the deepest.
    pub(super) fn meet_tool(
        &self,
        (index, touchable): (usize, &[Constraint]),
        before: &[usize],
        (h, drawn): (f64, DVec3),
        rows: &mut Vec<Constraint>,
        report: &mut StepReport,
    ) {
        let mut entered: Vec<(bool, f64, &Constraint)> = Vec::new();
        for row in touchable {
            let Source::Touch { gap_m, push, corners, .. } = row.source else { continue };
            let velocity: DVec3 = row.nodes.iter().map(|&(node, w)| w * self.v[node]).sum();
            let gap = gap_m + (h * velocity - drawn).dot(push);
            if gap < 0.0 && !rows.iter().any(|known| known.source == row.source) {
                let was_touched = corners.iter().all(|(point, w)| *w <= 0.0 || before.contains(point));
                entered.push((!was_touched, gap, row));
            }
        }
        // What was touched before goes first, so that a tool at rest does not change its mind.
        entered.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let touches = |row: &&Constraint| row.source.is_touch_of(index);
        let mut nodes: Vec<usize> =
            rows.iter().filter(touches).flat_map(|row| row.nodes.iter().map(|(node, _)| *node)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut left_out = 0;
        for (_, _, row) in entered {
            let more: Vec<usize> =
                row.nodes.iter().map(|(node, _)| *node).filter(|node| !nodes.contains(node)).collect();
            if nodes.len() + more.len() > MOST_TOUCHED {
                left_out += 1;
                continue;
            }
            nodes.extend(more);
            rows.push(row.clone());
        }
        report.left_out = report.left_out.max(left_out);
    }

    /// The row of a point that the tool holds.
    pub(super) fn grip_row(&self, (index, tool): (usize, &ToolStep<'_>), h: f64) -> Option<Constraint> {
        let Hold::Point { point, offset_m } = &tool.contact.hold else { return None };
        let apart = point.of(&self.x) - (tool.way.from_m + *offset_m);
        let overdue = apart.clamp_length_max(h * CLOSING_M_PER_S);
        let gap = overdue - (tool.way.to_m - tool.way.from_m);
        let nodes = point.nodes().to_vec();
        Some(Constraint { source: Source::Grip(index), nodes, law: RowLaw::TwoSided, gap, overdue })
    }
}
