//! Obstacles and ties in a step: the velocities that obey them.

use super::{Body, StepReport};
use crate::contact::{self, Coupled, Law, Masses, Row};
use crate::tie::{TieEnd, TieKind};
use crate::{BodyError, Integrator, NodeContact};
use glam::DVec3;

/// How fast what is inside an obstacle is pushed out, and what is apart is drawn together.
const CLOSING_M_PER_S: f64 = 1.0;
/// Less than that of a gap is rounding and needs no care.
const CLOSED_M: f64 = 1e-6;
/// How often obstacles are looked for again after some were met.
const MEETINGS: usize = 8;

/// A node that has met an obstacle.
struct Met {
    node: usize,
    obstacle: usize,
    gap_m: f64,
    normal: DVec3,
}

impl Body {
    /// Makes the velocities those that keep nodes out of obstacles and ties together at the end of a step of length `h`,
    /// between the shares `along` of its advance, in which the node that is driven has been moved by so much. Where a gap was overdue, the velocities with which positions close it are
    /// others, and returned.
    pub(super) fn constrain(
        &mut self,
        drive: Option<(usize, DVec3)>,
        h: f64,
        along: (f64, f64),
        integrator: &Integrator,
        report: &mut StepReport,
    ) -> Result<Option<Vec<DVec3>>, BodyError> {
        let driven = drive.map(|(node, _)| node);
        self.contacts.clear();
        let mut closing = None;
        let before = self.v.clone();
        let ties = self.tie_rows(drive, h, along);
        let mut met: Vec<Met> = Vec::new();
        // A push out of one obstacle may lead into another: until no more are met.
        for meeting in 0..MEETINGS {
            let known = met.len();
            self.meet(driven, h, &mut met);
            if met.len() == known && (meeting > 0 || ties.is_empty()) {
                break;
            }
            self.v.copy_from_slice(&before);
            let mut rows: Vec<Row> = ties.iter().map(|(_, row)| row.clone()).collect();
            rows.extend(met.iter().filter_map(|m| self.obstacle_row(m)));
            let sweeps = self.solve(driven, h, integrator, &mut rows)?;
            report.sweeps = report.sweeps.max(sweeps);
            report.unsolved += usize::from(sweeps == contact::SWEEPS);
            closing = None;
            if rows.iter().any(|row| row.overdue.length() > CLOSED_M) {
                closing = Some(std::mem::replace(&mut self.v, before.clone()));
                for row in &mut rows {
                    (row.gap, row.impulse) = (row.gap - row.overdue, DVec3::ZERO);
                }
                self.solve(driven, h, integrator, &mut rows)?;
            }
            let contacts = met.iter().zip(&rows[ties.len()..]);
            self.contacts = contacts
                .filter(|(_, row)| row.impulse != DVec3::ZERO)
                .map(|(&Met { node, obstacle, gap_m, normal }, row)| NodeContact {
                    node,
                    obstacle,
                    normal,
                    gap_m: gap_m + h * self.v[node].dot(normal),
                    impulse_ns: row.impulse,
                    velocity_m_per_s: self.v[node],
                })
                .collect();
            for ((index, _), row) in ties.iter().zip(&rows) {
                self.ties[*index].last = (row.impulse, h);
            }
        }
        for tie in &mut self.ties {
            if let TieKind::Joint { tear_limit_n: Some(limit) } = tie.kind
                && !tie.torn
                && tie.force_n().length() > limit
            {
                tie.torn = true;
                report.torn += 1;
            }
        }
        report.contacts = report.contacts.max(self.contacts.len());
        Ok(closing)
    }

    /// Adds the nodes that would be inside an obstacle at the end of the step.
    fn meet(&self, driven: Option<usize>, h: f64, met: &mut Vec<Met>) {
        let known = met.len();
        for &node in self.network.free().iter().filter(|&&node| driven != Some(node)) {
            for (obstacle, what) in self.obstacles.iter().enumerate() {
                let (gap_m, normal) = what.gap_m(self.x[node]);
                let enters = gap_m + h * self.v[node].dot(normal) < 0.0;
                if enters && !met[..known].iter().any(|m| (m.node, m.obstacle) == (node, obstacle)) {
                    met.push(Met { node, obstacle, gap_m: gap_m.max(-h * CLOSING_M_PER_S), normal });
                }
            }
        }
    }

    fn obstacle_row(&self, met: &Met) -> Option<Row> {
        let law = Law::OneSided(self.obstacles[met.obstacle].law(met.normal)?);
        let gap = met.gap_m * met.normal;
        let overdue = met.gap_m.min(0.0) * met.normal;
        Some(Row { nodes: vec![(met.node, 1.0)], law, gap, overdue, impulse: DVec3::ZERO })
    }

    /// The rows of the ties that hold, with their indices.
    fn tie_rows(&mut self, drive: Option<(usize, DVec3)>, h: f64, along: (f64, f64)) -> Vec<(usize, Row)> {
        let mut rows = Vec::new();
        for (index, tie) in self.ties.iter_mut().enumerate() {
            tie.last = (DVec3::ZERO, h);
            if tie.torn {
                continue;
            }
            let mut nodes = tie.a.nodes().to_vec();
            let at = tie.a.of(&self.x);
            // Where the other end is now, and how far it is moved by others than the body in this step.
            let (other, moved) = match &tie.b {
                TieEnd::Point(b) => {
                    for &(node, w) in b.nodes() {
                        match nodes.iter_mut().find(|(known, _)| *known == node) {
                            Some((_, weight)) => *weight -= w,
                            None => nodes.push((node, -w)),
                        }
                    }
                    (b.of(&self.x), DVec3::ZERO)
                }
                TieEnd::Anchor { from_m, to_m } => {
                    let place = |share: f64| *from_m + (*to_m - *from_m) * share;
                    (place(along.0), place(along.1) - place(along.0))
                }
            };
            // A driven node is already where it is at the end of the step.
            let pulled = drive.map_or(DVec3::ZERO, |(driven, by)| {
                nodes.iter().filter(|(node, _)| *node == driven).map(|(_, w)| *w * by).sum()
            });
            let (apart, moved) = (at - other - pulled, moved - pulled);
            nodes.retain(|(node, _)| drive.is_none_or(|(driven, _)| driven != *node));
            let (law, gap, overdue) = match tie.kind {
                TieKind::Joint { .. } => {
                    let closing = apart.clamp_length_max(h * CLOSING_M_PER_S);
                    (Law::TwoSided, closing - moved, closing)
                }
                TieKind::Thread { length_m } => {
                    // Along the line between its ends at the end of the step, as far as that is known.
                    let Some(direction) = (apart - moved).try_normalize() else { continue };
                    let slack =
                        (length_m - (apart - moved).length()).max(-h * CLOSING_M_PER_S - moved.length());
                    let before = (length_m - apart.length()).clamp(-h * CLOSING_M_PER_S, 0.0);
                    (Law::Tension(direction), -slack * direction, -before * direction)
                }
            };
            rows.push((index, Row { nodes, law, gap, overdue, impulse: DVec3::ZERO }));
        }
        rows
    }

    fn solve(
        &mut self,
        driven: Option<usize>,
        h: f64,
        integrator: &Integrator,
        rows: &mut [Row],
    ) -> Result<usize, BodyError> {
        // What is fixed or driven answers to no impulse.
        let movable =
            |(node, _): &(usize, f64)| self.network.free_index(*node).is_some() && driven != Some(*node);
        let nodes: Vec<Vec<(usize, f64)>> =
            rows.iter().map(|row| row.nodes.iter().copied().filter(movable).collect()).collect();
        Ok(match (integrator, &self.implicit) {
            (Integrator::LinearlyImplicitEuler(settings), Some(implicit)) => {
                let columns = nodes.iter().map(|row| implicit.answer(&self.network, row, settings));
                let answer = Coupled { columns: columns.collect::<Result<_, _>>()?, rows: nodes };
                contact::solve(rows, &answer, h, &mut self.v)
            }
            _ => {
                let answer = Masses { rows: nodes, mass_kg: self.network.mass_kg() };
                contact::solve(rows, &answer, h, &mut self.v)
            }
        })
    }
}
