//! Components of what is inside a cell.

use super::cell_grid::CellGrid;
use super::fill::CellSurface;
use crate::ClosedMesh;
use crate::disjoint_sets::DisjointSets;
use glam::DVec3;
use std::collections::BTreeMap;

/// Number of lines across each side of a cell.
const ALONG: usize = 8;
/// Width of a gap that counts as closed, in cells.
const MIN_GAP: f64 = 1e-5;
/// Share inside of a cell that no line crosses, above which all lines are inside.
const FULL: f64 = 0.5;
/// Length of an interval that counts as empty, in cells.
const ON_FACE: f64 = 1e-9;

/// The components of what is inside a cell, found on 8 × 8 lines along each axis.
///
/// Lines along different axes meet at 8³ samples. What a line passes between two crossings of the surface is connected, with the
/// samples there and with the surface at its ends. The surface is connected along its edges in the cell. So a gap or a wall of any
/// thickness counts, if lines meet it. Without any, each connected surface bounds a component.
#[derive(Debug)]
pub(super) struct CellSamples {
    /// Places inside with their components, 0 to 1 along each side of the cell.
    places: Vec<(DVec3, usize)>,
    /// For the lower and the upper face along each axis: the component that each line reaches.
    faces: [[Vec<Option<usize>>; 2]; 3],
    /// Share of each component in the length of the lines inside.
    pub shares: Vec<f64>,
    /// Bounds of each component, 0 to 1 along each side of the cell.
    pub bounds: Vec<[DVec3; 2]>,
    /// Triangles that bound each component.
    pub triangles: Vec<Vec<usize>>,
}

/// Where a line crosses the surface.
#[derive(Clone, Copy)]
struct Crossing {
    /// Position along the line, from 0 to 1.
    at: f64,
    /// Whether the line leaves.
    leaves: bool,
    /// Index of the triangle in those of the cell.
    triangle: usize,
}

/// A line along `axis`, at the middles of fields i, j across it, with its crossings in their order.
struct Line {
    axis: usize,
    across: [usize; 2],
    crossings: Vec<Crossing>,
}

/// What a line passes between two crossings.
struct Interval {
    from: f64,
    to: f64,
    /// `None` for a line without crossings.
    is_inside: Option<bool>,
    /// Triangles at its ends.
    ends: [Option<usize>; 2],
}

impl Line {
    fn at(&self, along: f64) -> DVec3 {
        let mut at = DVec3::ZERO;
        at[self.axis] = along;
        for (side, across) in self.across.iter().enumerate() {
            at[(self.axis + 1 + side) % 3] = (*across as f64 + 0.5) / ALONG as f64;
        }
        at
    }

    /// What the line passes. Surface on a face of the cell bounds nothing in it.
    fn intervals(&self) -> impl Iterator<Item = Interval> {
        let all = (0..=self.crossings.len()).map(|index| {
            let before = index.checked_sub(1).map(|before| self.crossings[before]);
            let after = self.crossings.get(index);
            Interval {
                from: before.map_or(0.0, |crossing| crossing.at),
                to: after.map_or(1.0, |crossing| crossing.at),
                is_inside: after.map(|after| after.leaves).or(before.map(|before| !before.leaves)),
                ends: [before.map(|crossing| crossing.triangle), after.map(|crossing| crossing.triangle)],
            }
        });
        all.filter(|interval| interval.to - interval.from > ON_FACE)
    }

    /// Indices of the samples in an interval.
    fn samples(&self, interval: &Interval) -> impl Iterator<Item = usize> + use<> {
        let place = |at: f64| (ALONG as f64 * at + 0.5).floor() as usize;
        let (axis, across) = (self.axis, self.across);
        (place(interval.from)..place(interval.to)).map(move |along| {
            let mut place = [0; 3];
            (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (along, across[0], across[1]);
            place[0] + ALONG * (place[1] + ALONG * place[2])
        })
    }
}

impl CellSamples {
    /// Finds the components in the cell at `place`, of which `share` is inside; `None` if all of the surface there belongs to one.
    pub(super) fn new(
        mesh: &ClosedMesh,
        grid: &CellGrid,
        place: [usize; 3],
        surface: &CellSurface,
        share: f64,
    ) -> Option<Self> {
        let lines = lines(mesh, grid, place, surface);
        let total = ALONG.pow(3);
        // Samples, then triangles.
        let mut sets = DisjointSets::new(total + surface.triangles.len());
        for (a, b) in edges_within(mesh, grid, place, surface) {
            sets.unite(total + a, total + b);
        }
        let members = |line: &Line, interval: &Interval| -> Vec<usize> {
            // What is outside has no surface of its own.
            let ends = interval.ends.into_iter().flatten().filter(|_| interval.is_inside == Some(true));
            line.samples(interval).chain(ends.map(|triangle| total + triangle)).collect()
        };
        for line in &lines {
            for interval in line.intervals() {
                members(line, &interval).windows(2).for_each(|pair| sets.unite(pair[0], pair[1]));
            }
        }
        let mut inside = vec![0_i64; total + surface.triangles.len()];
        for line in &lines {
            for interval in line.intervals() {
                let vote = interval.is_inside.map_or(0, |is_inside| if is_inside { 1 } else { -1 });
                if let Some(&member) = members(line, &interval).first() {
                    inside[sets.find(member)] += vote;
                }
            }
        }
        // What no line meets is divided by its surface.
        let is_met = inside.iter().any(|votes| *votes > 0);
        if !is_met && share > FULL {
            // The surface touches a corner or an edge of a full cell.
            return None;
        }
        let mut number: BTreeMap<usize, usize> = BTreeMap::new();
        for index in 0..inside.len() {
            let set = sets.find(index);
            if inside[set] > 0 || (!is_met && index >= total) {
                let next = number.len();
                number.entry(set).or_insert(next);
            }
        }
        let count = number.len();
        let component = |index: usize, sets: &mut DisjointSets| number.get(&sets.find(index)).copied();
        let triangles = 0..surface.triangles.len();
        if count < 2 && triangles.clone().all(|index| component(total + index, &mut sets).is_some()) {
            return None;
        }
        let mut samples = Self {
            places: Vec::new(),
            faces: std::array::from_fn(|_| std::array::from_fn(|_| vec![None; ALONG * ALONG])),
            shares: vec![if is_met { 0.0 } else { 1.0 }; count],
            bounds: vec![if is_met { [DVec3::INFINITY, DVec3::NEG_INFINITY] } else { surface.bounds }; count],
            triangles: vec![Vec::new(); count],
        };
        for line in &lines {
            for interval in line.intervals() {
                let Some(&member) = members(line, &interval).first() else { continue };
                if let Some(component) = component(member, &mut sets) {
                    samples.add(component, line, &interval);
                }
            }
        }
        let length: f64 = samples.shares.iter().sum();
        samples.shares.iter_mut().for_each(|share| *share /= length);
        let low = DVec3::from_array(place.map(|n| n as f64));
        for index in triangles {
            let (Some(component), triangle) = (component(total + index, &mut sets), surface.triangles[index])
            else {
                continue;
            };
            samples.triangles[component].push(triangle);
            if !is_met {
                let corners = mesh.closed_triangles()[triangle].map(|point| mesh.enclosing_points_m()[point]);
                let middle = grid.in_cells(corners.iter().sum::<DVec3>() / 3.0) - low;
                samples.places.push((middle.clamp(DVec3::ZERO, DVec3::ONE), component));
            }
        }
        Some(samples)
    }

    fn add(&mut self, component: usize, line: &Line, interval: &Interval) {
        self.shares[component] += interval.to - interval.from;
        let face = line.across[0] + ALONG * line.across[1];
        if interval.ends[0].is_none() {
            self.faces[line.axis][0][face] = Some(component);
        }
        if interval.ends[1].is_none() {
            self.faces[line.axis][1][face] = Some(component);
        }
        let mut aside = DVec3::splat(0.5 / ALONG as f64);
        aside[line.axis] = 0.0;
        let [low, high] = &mut self.bounds[component];
        *low = low.min(line.at(interval.from) - aside);
        *high = high.max(line.at(interval.to) + aside);
        self.places.push((line.at(0.5 * (interval.from + interval.to)), component));
        if line.axis == 0 {
            for sample in line.samples(interval) {
                self.places.push((line.at(((sample % ALONG) as f64 + 0.5) / ALONG as f64), component));
            }
        }
    }

    /// The component at a place on its surface with the outward `normal`, or at a place inside, 0 to 1 along each side of the cell: the one
    /// that a ball, which touches the surface there from inside and grows, meets first.
    pub(super) fn component_at(&self, at: DVec3, normal: DVec3) -> usize {
        let radius = |(place, _): &(DVec3, usize)| {
            let (d2, depth) = (place.distance_squared(at), (at - *place).dot(normal));
            if depth > 0.0 { d2 / depth } else { f64::INFINITY }
        };
        let distance = |(place, _): &(DVec3, usize)| place.distance_squared(at);
        let first = |a: &&(DVec3, usize), b: &&(DVec3, usize)| {
            radius(a).total_cmp(&radius(b)).then(distance(a).total_cmp(&distance(b)))
        };
        self.places.iter().min_by(first).map_or(0, |(_, component)| *component)
    }

    /// Pairs of components of this cell and of `next`, the following one along `axis`, that continue through their face. `None` for a cell
    /// that is one component.
    pub(super) fn through(this: Option<&Self>, next: Option<&Self>, axis: usize) -> Vec<(usize, usize)> {
        let component = |cell: Option<&Self>, side: usize, line: usize| {
            cell.map_or(Some(0), |cell| cell.faces[axis][side][line])
        };
        let pair = |line: usize| component(this, 1, line).zip(component(next, 0, line));
        let mut pairs: Vec<(usize, usize)> = (0..ALONG * ALONG).filter_map(pair).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

/// The lines of a cell along all axes.
fn lines(mesh: &ClosedMesh, grid: &CellGrid, place: [usize; 3], surface: &CellSurface) -> Vec<Line> {
    let mut lines: Vec<Line> = (0..3 * ALONG * ALONG)
        .map(|n| {
            let across = [n % ALONG, n / ALONG % ALONG];
            Line { axis: n / (ALONG * ALONG), across, crossings: Vec::new() }
        })
        .collect();
    let low = DVec3::from_array(place.map(|n| n as f64));
    for (index, &triangle) in surface.triangles.iter().enumerate() {
        let corners = mesh.closed_triangles()[triangle]
            .map(|point| ALONG as f64 * (grid.in_cells(mesh.enclosing_points_m()[point]) - low) - 0.5);
        let range = |axis: usize| {
            let [a, b, c] = corners.map(|corner| corner[axis]);
            // Slightly more, because coordinates are rounded.
            let begin = (a.min(b).min(c) - 0.01).ceil().clamp(0.0, ALONG as f64) as usize;
            let end = (a.max(b).max(c) + 0.01).floor().clamp(-1.0, (ALONG - 1) as f64) + 1.0;
            begin..(end as usize).max(begin)
        };
        for axis in 0..3 {
            for j in range((axis + 2) % 3) {
                for i in range((axis + 1) % 3) {
                    let line = &mut lines[i + ALONG * (j + ALONG * axis)];
                    let at_m = grid.at_m(low + line.at(0.0));
                    let Some((sign, x_m)) = mesh.line_crossing(triangle, axis, at_m) else { continue };
                    let at = (x_m - grid.low_m[axis]) / grid.cell_m - low[axis];
                    if (0.0..=1.0).contains(&at) {
                        line.crossings.push(Crossing { at, leaves: sign > 0, triangle: index });
                    }
                }
            }
        }
    }
    for line in &mut lines {
        line.crossings.sort_by(|a, b| a.at.total_cmp(&b.at));
        // Two walls that touch are one; so are two crossings of one kind, where rounding has lost one between them.
        let mut kept: Vec<Crossing> = Vec::with_capacity(line.crossings.len());
        for &crossing in &line.crossings {
            match kept.last() {
                Some(last) if last.leaves && !crossing.leaves && crossing.at - last.at < MIN_GAP => {
                    kept.pop();
                }
                Some(last) if last.leaves == crossing.leaves => {}
                _ => kept.push(crossing),
            }
        }
        line.crossings = kept;
    }
    lines
}

/// Pairs of triangles, as indices into those of the cell, with a common edge that meets the cell.
fn edges_within(
    mesh: &ClosedMesh,
    grid: &CellGrid,
    place: [usize; 3],
    surface: &CellSurface,
) -> Vec<(usize, usize)> {
    let low = DVec3::from_array(place.map(|n| n as f64));
    let at = |point: usize| grid.in_cells(mesh.enclosing_points_m()[point]) - low;
    let mut sides: Vec<((usize, usize), usize)> = Vec::with_capacity(3 * surface.triangles.len());
    for (index, &triangle) in surface.triangles.iter().enumerate() {
        let [a, b, c] = mesh.closed_triangles()[triangle];
        sides.extend([(a, b), (b, c), (c, a)].map(|(from, to)| ((from.min(to), from.max(to)), index)));
    }
    sides.sort_unstable();
    let of_one_edge = sides.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    of_one_edge
        .filter(|pair| meets_cell(at(pair[0].0.0), at(pair[0].0.1)))
        .map(|pair| (pair[0].1, pair[1].1))
        .collect()
}

/// Whether a segment meets the unit cube.
fn meets_cell(from: DVec3, to: DVec3) -> bool {
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let (start, step) = (from[axis], to[axis] - from[axis]);
        if step == 0.0 {
            if !(0.0..=1.0).contains(&start) {
                return false;
            }
            continue;
        }
        let (a, b) = (-start / step, (1.0 - start) / step);
        (begin, end) = (begin.max(a.min(b)), end.min(a.max(b)));
    }
    begin <= end
}
