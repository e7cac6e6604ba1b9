//! The tool in a tick: the points of S that it holds or runs into, as the body's step has them.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::Cholesky;
use crate::near_tick::{get, put};
use crate::{NearField, Support, TickIntegrator};
use glam::{DMat3, DVec3};
use palpate_laws::{
    Answer, CLOSED_M, CLOSING_M_PER_S, Coulomb, ProxyStep, Row, RowLaw, solve_rows, solve_with_proxy,
};

/// Most points that are touched at once.
const MOST_POINTS: usize = 48;
/// How often points are looked for again after some were met.
const MEETINGS: usize = 4;
/// Most sweeps over all rows in a step.
const SWEEPS: usize = 60;
/// Of a step of the tool that touches, the largest part of its radius.
const SHARE_OF_RADIUS: f64 = 0.5;
/// Into so many steps a tick is cut at most so that nothing is passed unseen.
const MOST_CUTS: f64 = 8.0;
/// What several rows can hardly tell apart, by less than that share of them, is taken from their impulses.
const SHARE: f64 = 1e-2;

/// The points of a step, and room to find their impulses in.
#[derive(Debug)]
pub(crate) struct Meeting {
    points: Vec<Point>,
    rows: Vec<Row>,
    before: Vec<f64>,
    closing: Vec<f64>,
    /// Gram matrix of the rows, its factor, and forces.
    gram: Vec<f64>,
    factor: Cholesky,
    shares: [Vec<f64>; 3],
}

/// What the tool does in a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolMove {
    /// Where it begins and ends, m; behind a coupling, if it moves as its device does.
    from_m: DVec3,
    to_m: DVec3,
    /// What draws it elsewhere.
    proxy: Option<ProxyStep>,
}

impl ToolMove {
    /// That of a tool at `proxy_m` whose device goes from one place to another.
    pub(crate) fn new(field: &NearField, device_m: (DVec3, DVec3), proxy_m: DVec3) -> Self {
        let Some(coupling) = field.coupling else {
            return Self { from_m: device_m.0, to_m: device_m.1, proxy: None };
        };
        let behind_m = device_m.0 - proxy_m;
        let radius_m = match field.support {
            Support::Touched { shape, .. } => Some(shape.radius_m()),
            Support::Driven | Support::Held => None,
        };
        let short_m = coupling.short_m(behind_m, radius_m);
        let proxy = Some(ProxyStep { coupling, short_m });
        Self { from_m: proxy_m, to_m: device_m.1 - behind_m, proxy }
    }

    /// How far its coupling draws it if nothing is in the way, m.
    fn short_m(&self) -> DVec3 {
        self.proxy.map_or(DVec3::ZERO, |proxy| proxy.short_m)
    }
}

/// A row on nodes of S.
#[derive(Clone, Copy, Debug)]
struct Point {
    /// Of a triangle; what is held has its weights in the field.
    nodes: [(usize, f64); 3],
    is_held: bool,
    law: RowLaw,
    /// Along which the tool pushes.
    push: DVec3,
    gap_m: f64,
    gap: DVec3,
    overdue: DVec3,
    impulse_ns: DVec3,
    /// Whether it takes part in the problem.
    is_met: bool,
}

impl Point {
    /// Its nodes and weights.
    fn weights<'a>(&'a self, field: &'a NearField) -> impl Iterator<Item = (usize, f64)> + 'a {
        let held = field.weight.iter().take(field.nodes).copied().enumerate();
        let three = self.nodes.iter().copied();
        let held = if self.is_held { Some(held) } else { None };
        let three = if self.is_held { None } else { Some(three) };
        held.into_iter().flatten().chain(three.into_iter().flatten()).filter(|(_, w)| *w != 0.0)
    }

    fn velocity(&self, field: &NearField, z_dot: &[f64]) -> DVec3 {
        self.weights(field).map(|(node, w)| w * get(z_dot, node)).sum()
    }
}

impl Clone for Meeting {
    /// With the room of the original: a tick must not have to make it.
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.before.len());
        copy.points.extend_from_slice(&self.points);
        copy.rows.extend_from_slice(&self.rows);
        copy
    }
}

impl Meeting {
    pub(crate) fn new(n: usize) -> Self {
        let forces = vec![0.0; MOST_POINTS];
        Self {
            points: Vec::with_capacity(MOST_POINTS),
            rows: Vec::with_capacity(MOST_POINTS),
            before: vec![0.0; n],
            closing: vec![0.0; n],
            gram: vec![0.0; MOST_POINTS * MOST_POINTS],
            factor: Cholesky::with_capacity(MOST_POINTS),
            shares: [forces.clone(), forces.clone(), forces],
        }
    }

    pub(crate) fn forget(&mut self) {
        self.points.clear();
    }

    /// Substeps of a tick in which the tool moves between two places: more where it would pass something.
    pub(crate) fn substeps(&self, field: &NearField, from: DVec3, to: DVec3, substeps: u32) -> u32 {
        let Support::Touched { shape, .. } = field.support else { return substeps };
        let share = SHARE_OF_RADIUS * shape.radius_m() * f64::from(substeps);
        let cuts = (from.distance(to) / share - 1e-9).ceil().clamp(1.0, MOST_CUTS);
        substeps * cuts as u32
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
        self.points.clear();
        match field.support {
            Support::Driven => {}
            Support::Held => self.hold(field, tool, h, z),
            Support::Touched { .. } => self.look(field, tool, h, z, z_dot),
        }
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

    /// The row of a point that is held.
    fn hold(&mut self, field: &NearField, tool: &ToolMove, h: f64, z: &[f64]) {
        let place = |x: &dyn Fn(usize) -> DVec3| -> DVec3 {
            field.weight.iter().take(field.nodes).enumerate().map(|(i, w)| *w * x(i)).sum()
        };
        let moved_so_far = place(&|i| get(z, i)) - (tool.from_m - field.proxy_m);
        let overdue = moved_so_far.clamp_length_max(h * CLOSING_M_PER_S);
        self.points.push(Point {
            nodes: [(0, 0.0); 3],
            is_held: true,
            law: RowLaw::TwoSided,
            push: DVec3::ZERO,
            gap_m: 0.0,
            gap: overdue - (tool.to_m - tool.from_m),
            overdue,
            impulse_ns: DVec3::ZERO,
            is_met: false,
        });
    }

    /// The places where the tool may run into the triangles of S in this step, each once.
    fn look(&mut self, field: &NearField, tool: &ToolMove, h: f64, z: &[f64], z_dot: &[f64]) {
        let Support::Touched { shape, friction } = field.support else { return };
        let moved = tool.to_m - tool.from_m;
        let fastest = (0..field.nodes).map(|i| get(z_dot, i).length()).fold(0.0, f64::max);
        let far = 2.0 * (moved.length() + h * fastest) + tool.short_m().length();
        let place = |i: usize| field.node_m.get(i).copied().unwrap_or_default() + get(z, i);
        let is_fixed = |i: usize| field.node_per_kg.get(i).is_none_or(|per_kg| *per_kg == 0.0);
        let points = &mut self.points;
        for &(triangle, longest_m) in field.triangle.iter().take(field.triangles) {
            shape.features(tool.to_m, triangle.map(place), longest_m, |feature| {
                if feature.gap_m > far || points.len() == MOST_POINTS {
                    return;
                }
                let [i, j, k] = triangle;
                let [a, b, c] = feature.weights;
                let nodes = [(i, a), (j, b), (k, c)];
                let on =
                    |nodes: &[(usize, f64); 3], node: usize| nodes.iter().any(|&(n, w)| n == node && w > 0.0);
                let count = feature.weights.iter().filter(|w| **w > 0.0).count();
                // An edge or a corner belongs to several triangles; a punch touches a face at several places.
                let is_known = count < 3
                    && points.iter().any(|point| {
                        let known = point.nodes.iter().filter(|(_, w)| *w > 0.0).count();
                        known == count && nodes.iter().all(|&(n, w)| w <= 0.0 || on(&point.nodes, n))
                    });
                if is_known || feature.is_out_of_reach(triangle.map(is_fixed)) {
                    return;
                }
                let push = feature.normal;
                let Ok(law) = Coulomb::new(push, friction) else { return };
                let gap = feature.gap(moved, h);
                points.push(Point {
                    nodes,
                    is_held: false,
                    law: RowLaw::OneSided(law),
                    push,
                    gap_m: gap.normal_m,
                    gap: gap.gap_m,
                    overdue: gap.overdue_m,
                    impulse_ns: DVec3::ZERO,
                    is_met: false,
                });
            });
        }
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
        let Some(points) = self.points.get_mut(..met) else { return tool.short_m() };
        self.rows.clear();
        self.rows.extend(points.iter().map(|point| Row {
            law: point.law,
            gap_m: gap(point),
            own_per_kg: own_per_kg(point, field),
            impulse_ns: DVec3::ZERO,
        }));
        let mut answer = OfField { points, field, z_dot };
        let drawn = match tool.proxy {
            Some(proxy) => solve_with_proxy(&mut self.rows, &mut answer, |_| true, proxy, h, SWEEPS).1,
            None => {
                solve_rows(&mut self.rows, &mut answer, h, SWEEPS);
                DVec3::ZERO
            }
        };
        points.iter_mut().zip(&self.rows).for_each(|(point, row)| point.impulse_ns = row.impulse_ns);
        drawn
    }

    /// The force on the hand, N, from the internal forces on S: the sum over the points that pushed in the last step, of
    /// length `h`, of (H Hᵀ)⁻¹ H F, each as far as it lies in its friction cone.
    pub(crate) fn displayed_n(&mut self, internal_n: &[DVec3], friction: f64, h: f64) -> DVec3 {
        self.points.retain(|point| point.is_met && point.impulse_ns != DVec3::ZERO);
        let m = self.points.len();
        let in_cone = |point: &Point, f: DVec3| {
            Coulomb::new(-point.push, friction).map_or(DVec3::ZERO, |cone| cone.in_cone(f))
        };
        let of = |point: &Point, node: usize| -> f64 {
            point.nodes.iter().filter(|(n, _)| *n == node).map(|(_, w)| *w).sum()
        };
        let product =
            |a: &Point, b: &Point| -> f64 { a.nodes.iter().map(|&(node, w)| w * of(b, node)).sum() };
        let force = |node: usize| internal_n.get(node).copied().unwrap_or_default();
        // H (F − Hᵀ guess), the guess being −λ/h.
        for (r, point) in self.points.iter().enumerate() {
            let mut rest: DVec3 = point.nodes.iter().map(|&(node, w)| w * force(node)).sum();
            for (s, other) in self.points.iter().enumerate() {
                let gram = product(point, other);
                rest += gram * other.impulse_ns / h;
                if let Some(entry) = self.gram.get_mut(r * m + s) {
                    *entry = if r == s && m > 1 { gram * (1.0 + SHARE) } else { gram };
                }
            }
            for (shares, part) in self.shares.iter_mut().zip(rest.to_array()) {
                if let Some(share) = shares.get_mut(r) {
                    *share = part;
                }
            }
        }
        let is_solved = self.factor.factorise(m, &self.gram).is_ok();
        for shares in &mut self.shares {
            if let Some(shares) = shares.get_mut(..m) {
                if is_solved { self.factor.solve_in_place(shares) } else { shares.fill(0.0) }
            }
        }
        let [x, y, z] = &self.shares;
        let shares = x.iter().zip(y).zip(z).map(|((x, y), z)| DVec3::new(*x, *y, *z));
        self.points.iter().zip(shares).map(|(point, more)| in_cone(point, more - point.impulse_ns / h)).sum()
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

/// What impulses on points do to the velocities of a field.
struct OfField<'a> {
    points: &'a [Point],
    field: &'a NearField,
    z_dot: &'a mut [f64],
}

impl Answer for OfField<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        self.points.get(row).map_or(DVec3::ZERO, |point| point.velocity(self.field, self.z_dot))
    }

    fn push(&mut self, row: usize, impulse_ns: DVec3) {
        let Some(point) = self.points.get(row) else { return };
        let n = self.field.unknowns();
        for (node, w) in point.weights(self.field) {
            match self.field.integrator {
                TickIntegrator::Explicit { .. } => {
                    let per_kg = self.field.node_per_kg.get(node).copied().unwrap_or(0.0);
                    let v = get(self.z_dot, node) + w * per_kg * impulse_ns;
                    put(self.z_dot, node, v);
                }
                TickIntegrator::Implicit { .. } => {
                    for (axis, part) in impulse_ns.to_array().into_iter().enumerate() {
                        let start = n * (3 * node + axis);
                        let column = self.field.answer.get(start..start + n).unwrap_or_default();
                        self.z_dot.iter_mut().zip(column).for_each(|(v, c)| *v += w * part * c);
                    }
                }
            }
        }
    }
}
