//! The tool in a tick: the points of S that it holds or runs into, as the body's step has them.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod displayed;
mod look;

use crate::dense::{Cholesky, room, zeros};
use crate::near_tick::{get, put};
use crate::{NearField, NearFieldCapacity, Support, TickIntegrator};
use glam::{DMat3, DVec3};
use look::Point;
use palpate_laws::{Answer, CLOSED_M, Effort, Row, ToolMove, solve_rows, solve_with_proxy};

/// Most points that are touched at once.
const MOST_POINTS: usize = 48;
/// How often points are looked for again after some were met.
const MEETINGS: usize = 4;
/// What is done for the impulses of all rows in a step.
const EFFORT: Effort = Effort { sweeps: 60, tolerance: 1e-6 };
/// So often a row is asked for its impulse in a tick at most, so that no tick takes long.
const MOST_ANSWERS: usize = 1000;

/// The points of a step, and room to find their impulses in.
#[derive(Debug)]
pub(crate) struct Meeting {
    points: Vec<Point>,
    /// Those that gave something in the step before.
    last: Vec<Point>,
    /// No step has been made since the model step.
    is_first: bool,
    rows: Vec<Row>,
    before: Vec<f64>,
    closing: Vec<f64>,
    /// Of S: velocities, and the impulses that all rows give.
    velocity: Vec<f64>,
    given: Vec<f64>,
    /// How often rows may still be asked in this tick.
    answers_left: usize,
    /// Whether impulses of this tick were not found as well as they should be.
    unsolved: bool,
    /// Gram matrix of the rows, its factor, and forces.
    gram: Vec<f64>,
    factor: Cholesky,
    shares: [Vec<f64>; 3],
}

impl Clone for Meeting {
    /// With the room of the original: a tick must not have to make it.
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.before.len(), self.velocity.len());
        copy.points.extend_from_slice(&self.points);
        copy.last.extend_from_slice(&self.last);
        copy.is_first = self.is_first;
        copy
    }
}

impl Meeting {
    pub(crate) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        Self::new(3 * capacity.nodes + capacity.order, 3 * capacity.nodes)
    }

    /// For n unknowns, of which so many are those of S.
    fn new(n: usize, of_support: usize) -> Self {
        let forces = zeros(MOST_POINTS);
        let Point { law, gap: gap_m, impulse_ns, .. } = Point::default();
        let row = Row { law, gap_m, own_per_kg: DMat3::ZERO, impulse_ns };
        Self {
            points: room(MOST_POINTS, Point::default()),
            last: room(MOST_POINTS, Point::default()),
            is_first: true,
            rows: room(MOST_POINTS, row),
            before: zeros(n),
            closing: zeros(n),
            velocity: zeros(of_support),
            given: zeros(of_support),
            answers_left: MOST_ANSWERS,
            unsolved: false,
            gram: zeros(MOST_POINTS * MOST_POINTS),
            factor: Cholesky::with_capacity(MOST_POINTS),
            shares: [forces.clone(), forces.clone(), forces],
        }
    }

    pub(crate) fn forget(&mut self) {
        self.points.clear();
        self.last.clear();
        (self.is_first, self.unsolved) = (true, false);
    }

    /// Begins a tick.
    pub(crate) fn begin(&mut self) {
        (self.answers_left, self.unsolved) = (MOST_ANSWERS, false);
    }

    /// How often rows were asked in this tick.
    pub(crate) fn answers(&self) -> usize {
        MOST_ANSWERS - self.answers_left
    }

    /// Whether impulses of this tick were not found as well as they should be.
    pub(crate) fn is_unsolved(&self) -> bool {
        self.unsolved
    }

    /// Makes the velocities `z_dot` those with which the tool, moving so in a step of length `h`, is held or not entered.
    /// Where a gap was overdue, the velocities with which positions close it are others, and returned; and where the tool
    /// is then.
    pub(crate) fn meet(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &mut [f64],
    ) -> (Option<&[f64]>, DVec3) {
        let (was_overdue, drawn) = self.obey(field, tool, h, z, z_dot);
        let closing = self.closing.get(..z_dot.len()).filter(|_| was_overdue);
        (closing, tool.to_m + drawn)
    }

    /// As [`Meeting::meet`]; whether a gap was overdue, and how far the tool is drawn by its coupling, m.
    fn obey(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &mut [f64],
    ) -> (bool, DVec3) {
        let mut drawn = tool.short_m();
        std::mem::swap(&mut self.last, &mut self.points);
        self.last.retain(|point| point.is_met && point.impulse_ns != DVec3::ZERO);
        self.points.clear();
        match field.support {
            Support::Driven => {}
            Support::Held => self.points.push(Point::held(field, tool, h, z)),
            Support::Touched { .. } => self.look(field, tool, h, z, z_dot),
        }
        self.is_first = false;
        let (Some(before), false) = (self.before.get_mut(..z_dot.len()), self.points.is_empty()) else {
            return (false, drawn);
        };
        before.copy_from_slice(z_dot);
        let mut was_overdue = false;
        for _ in 0..MEETINGS {
            let mut more = false;
            for point in self.points.iter_mut().filter(|point| !point.is_met) {
                let gap = point.gap_m + (h * point.velocity(field, z_dot) - drawn).dot(point.push);
                point.is_met = point.is_held || gap < 0.0;
                more |= point.is_met;
            }
            if !more {
                break;
            }
            was_overdue = self.points.iter().any(|p| p.is_met && p.overdue.length() > CLOSED_M);
            if was_overdue {
                drawn = self.solve(field, tool, h, z_dot, |point| point.gap);
                if let Some(closing) = self.closing.get_mut(..z_dot.len()) {
                    closing.copy_from_slice(z_dot);
                }
                self.solve(field, tool, h, z_dot, |point| point.gap - point.overdue);
            } else {
                drawn = self.solve(field, tool, h, z_dot, |point| point.gap);
            }
        }
        (was_overdue, drawn)
    }

    /// Makes `z_dot` the velocities with which the points that are met close their gaps as their laws say, and returns how far
    /// the tool's coupling draws it, m.
    fn solve(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z_dot: &mut [f64],
        gap: impl Fn(&Point) -> DVec3,
    ) -> DVec3 {
        z_dot.iter_mut().zip(&self.before).for_each(|(to, from)| *to = *from);
        // Those that are met come first.
        self.points.sort_unstable_by_key(|point| !point.is_met);
        let met = self.points.iter().take_while(|point| point.is_met).count();
        let s = 3 * field.nodes;
        let (Some(points), Some(velocity), Some(given), Some(of_support)) = (
            self.points.get_mut(..met),
            self.velocity.get_mut(..s),
            self.given.get_mut(..s),
            z_dot.get_mut(..s),
        ) else {
            return tool.short_m();
        };
        velocity.copy_from_slice(of_support);
        given.fill(0.0);
        self.rows.clear();
        self.rows.extend(points.iter().map(|point| Row {
            law: point.law,
            gap_m: gap(point),
            own_per_kg: own_per_kg(point, field),
            // From nothing, as the body does: where rows share a load in more than one way, that decides how.
            impulse_ns: DVec3::ZERO,
        }));
        let mut answer = OfSupport { points, field, velocity, given };
        let sweeps = EFFORT.sweeps.min(self.answers_left / met.max(1)).max(1);
        let effort = Effort { sweeps, ..EFFORT };
        let (sweeps, drawn) = match tool.proxy {
            Some(proxy) => solve_with_proxy(&mut self.rows, &mut answer, |_| true, proxy, h, effort),
            None => (solve_rows(&mut self.rows, &mut answer, h, effort), DVec3::ZERO),
        };
        self.answers_left = self.answers_left.saturating_sub(sweeps.count * met);
        self.unsolved |= !sweeps.converged;
        points.iter_mut().zip(&self.rows).for_each(|(point, row)| point.impulse_ns = row.impulse_ns);
        match field.integrator {
            TickIntegrator::Explicit { .. } => of_support.copy_from_slice(velocity),
            TickIntegrator::Implicit { .. } => {
                let n = z_dot.len();
                for (column, impulse) in field.answer.chunks_exact(n.max(1)).zip(&*given) {
                    if *impulse != 0.0 {
                        z_dot.iter_mut().zip(column).for_each(|(v, c)| *v += impulse * c);
                    }
                }
            }
        }
        drawn
    }
}

/// H A⁻¹ Hᵀ of a point with itself.
fn own_per_kg(point: &Point, field: &NearField) -> DMat3 {
    match field.integrator {
        TickIntegrator::Explicit { .. } => {
            let per_kg =
                |(node, w): (usize, f64)| w * w * field.node_per_kg.get(node).copied().unwrap_or(0.0);
            DMat3::from_diagonal(DVec3::splat(point.weights(field).map(per_kg).sum()))
        }
        TickIntegrator::Implicit { .. } => {
            let pairs =
                point.weights(field).flat_map(|(i, w)| point.weights(field).map(move |(j, o)| (i, j, w * o)));
            pairs.map(|(i, j, w)| block(field, i, j) * w).sum()
        }
    }
}

/// The velocity of node i of S that an impulse on node j gives, 1/kg.
fn block(field: &NearField, i: usize, j: usize) -> DMat3 {
    let n = field.unknowns();
    let column = |axis: usize| {
        let start = n * (3 * j + axis);
        field.answer.get(start..start + n).map_or(DVec3::ZERO, |column| get(column, i))
    };
    DMat3::from_cols(column(0), column(1), column(2))
}

/// What impulses on points do to the velocities of S.
struct OfSupport<'a> {
    points: &'a [Point],
    field: &'a NearField,
    velocity: &'a mut [f64],
    given: &'a mut [f64],
}

impl Answer for OfSupport<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        self.points.get(row).map_or(DVec3::ZERO, |point| point.velocity(self.field, self.velocity))
    }

    fn push(&mut self, row: usize, impulse_ns: DVec3) {
        let Some(point) = self.points.get(row) else { return };
        let n = self.field.unknowns();
        for (node, w) in point.weights(self.field) {
            match self.field.integrator {
                TickIntegrator::Explicit { .. } => {
                    let per_kg = self.field.node_per_kg.get(node).copied().unwrap_or(0.0);
                    let v = get(self.velocity, node) + w * per_kg * impulse_ns;
                    put(self.velocity, node, v);
                }
                TickIntegrator::Implicit { .. } => {
                    let all = get(self.given, node) + w * impulse_ns;
                    put(self.given, node, all);
                    for (axis, part) in impulse_ns.to_array().into_iter().enumerate() {
                        let start = n * (3 * node + axis);
                        let column = self.field.answer.get(start..start + n).unwrap_or_default();
                        self.velocity.iter_mut().zip(column).for_each(|(v, c)| *v += w * part * c);
                    }
                }
            }
        }
    }
}
