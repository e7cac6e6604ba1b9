//! A cut into a block.

use crate::error::{check, check_positive};
use crate::{BodyError, BodyPoint, Link, Surface};
use glam::DVec3;
use palpate_laws::Spring;
use std::collections::HashMap;

/// A slit in the side +y of a block: along z, in the middle plane across x, centred on that side.
///
/// The nodes in the slit are duplicated, one for each lip, each with the mass of its own cells. The springs in its plane are split
/// likewise. The lips meet at the ends and at the bottom. At rest the slit is open: the lips are bent apart in
/// a parabola along z, and less with depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slit {
    /// Length along z, m, rounded to whole cells.
    pub length_m: f64,
    /// Depth, m, rounded to whole cells.
    pub depth_m: f64,
    /// Distance between the lips at rest, in the middle of the side, m.
    pub opening_m: f64,
}

/// The slit in terms of nodes of the lattice.
struct Cut {
    nodes: [usize; 3],
    /// Index of its plane along x.
    plane: usize,
    /// Index along y of the node below the lowest open one.
    bottom: usize,
    /// Indices of its two ends along z.
    ends: [usize; 2],
}

/// Shares of the lip at lower x in the nodes and springs in the plane of a slit.
#[derive(Clone, Copy)]
pub(crate) struct LipShares<'a> {
    /// Share of the mass and of the drag of node (i, j, k).
    pub(crate) mass: &'a dyn Fn([usize; 3]) -> f64,
    /// Share of the stiffness and damping of the spring from node (i, j, k) in the direction of a step.
    pub(crate) spring: &'a dyn Fn([usize; 3], [i32; 3]) -> f64,
}

impl LipShares<'static> {
    /// Shares of a block of one tissue.
    pub(crate) const HALVES: Self = Self { mass: &|_| 0.5, spring: &|_, _| 0.5 };
}

/// The lists of a block under construction.
pub(super) struct Pieces<'a> {
    pub(super) rest_m: &'a mut Vec<DVec3>,
    pub(super) mass_kg: &'a mut Vec<f64>,
    pub(super) drag_ns_per_m: &'a mut Vec<f64>,
    pub(super) youngs_modulus_pa: &'a mut Vec<f64>,
    pub(super) lips: LipShares<'a>,
    pub(super) fixed: &'a mut Vec<bool>,
    pub(super) links: &'a mut Vec<Link>,
    pub(super) cells: &'a mut Vec<[usize; 8]>,
    pub(super) surface: &'a mut Surface,
}

impl Cut {
    fn of(slit: Slit, (nodes, cell): ([usize; 3], DVec3)) -> Result<Self, BodyError> {
        let [along_x, along_y, along_z] = nodes;
        check("nodes across a slit", along_x as f64, along_x % 2 == 1 && along_x >= 5, "odd and at least 5")?;
        let cells = |length: f64, cell: f64| (length / cell).round();
        let length = cells(check_positive("length of a slit, m", slit.length_m)?, cell.z);
        // The same number of cells remains on both sides.
        let length = if (along_z - 1) % 2 == length as usize % 2 { length } else { length - 1.0 };
        let (most_long, most_deep) = (along_z as f64 - 3.0, along_y as f64 - 2.0);
        let depth = cells(check_positive("depth of a slit, m", slit.depth_m)?, cell.y);
        check(
            "cells along a slit",
            length,
            (2.0..=most_long).contains(&length),
            "at least 2, less than the block has by 2",
        )?;
        check(
            "cells down a slit",
            depth,
            (1.0..=most_deep).contains(&depth),
            "at least 1, less than the block has",
        )?;
        let gape = slit.opening_m;
        check("gape of a slit, m", gape, (0.0..=cell.x).contains(&gape), "at least 0, a cell at most")?;
        let first = (along_z - 1 - length as usize) / 2;
        Ok(Self {
            nodes,
            plane: along_x / 2,
            bottom: along_y - 1 - depth as usize,
            ends: [first, first + length as usize],
        })
    }

    fn ijk(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes;
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.nodes[0] * (j + self.nodes[1] * k)
    }

    fn is_open(&self, [i, j, k]: [usize; 3]) -> bool {
        i == self.plane && j > self.bottom && self.ends[0] < k && k < self.ends[1]
    }

    /// Distance of a lip from the plane as a fraction of half the opening.
    fn bend(&self, [_, j, k]: [usize; 3]) -> f64 {
        let up = (j - self.bottom) as f64 / (self.nodes[1] - 1 - self.bottom) as f64;
        let [first, last] = self.ends.map(|end| end as f64);
        let along = (2.0 * k as f64 - first - last) / (last - first);
        up * (1.0 - along * along)
    }
}

/// Cuts a slit into a block with the given number of nodes along each axis and the given cell size, m.
pub(super) fn cut(slit: Slit, block: ([usize; 3], DVec3), pieces: &mut Pieces<'_>) -> Result<(), BodyError> {
    let cut = Cut::of(slit, block)?;
    let lattice = pieces.rest_m.len();
    let mut right: HashMap<usize, usize> = HashMap::new();
    for node in (0..lattice).filter(|&node| cut.is_open(cut.ijk(node))) {
        right.insert(node, pieces.rest_m.len());
        let bend = DVec3::X * (0.5 * slit.opening_m * cut.bend(cut.ijk(node)));
        let share = (pieces.lips.mass)(cut.ijk(node));
        for list in [&mut *pieces.mass_kg, &mut *pieces.drag_ns_per_m] {
            let whole = list[node];
            list[node] = share * whole;
            list.push((1.0 - share) * whole);
        }
        pieces.rest_m.push(pieces.rest_m[node] + bend);
        pieces.youngs_modulus_pa.push(pieces.youngs_modulus_pa[node]);
        pieces.fixed.push(pieces.fixed[node]);
        pieces.rest_m[node] -= bend;
    }
    let on_right = |node: usize| right.get(&node).copied().unwrap_or(node);
    let mut doubled = Vec::new();
    for (index, link) in pieces.links.iter_mut().enumerate() {
        let law = |source| BodyError::Law { link: index, source };
        if !(right.contains_key(&link.a) || right.contains_key(&link.b)) {
            continue;
        }
        let side = (cut.ijk(link.a)[0] + cut.ijk(link.b)[0]).cmp(&(2 * cut.plane));
        if side.is_gt() {
            (link.a, link.b) = (on_right(link.a), on_right(link.b));
        } else if side.is_eq() {
            let (from, to) = (cut.ijk(link.a), cut.ijk(link.b));
            let step = std::array::from_fn(|axis| to[axis] as i32 - from[axis] as i32);
            let left = (pieces.lips.spring)(from, step);
            let right = link.spring.scaled(1.0 - left, 1.0 - left).map_err(law)?;
            doubled.push(Link { a: on_right(link.a), b: on_right(link.b), spring: right });
            link.spring = link.spring.scaled(left, left).map_err(law)?;
        }
    }
    pieces.links.extend(doubled);
    for cell in pieces.cells.iter_mut().filter(|cell| cut.ijk(cell[0])[0] >= cut.plane) {
        *cell = cell.map(on_right);
    }
    // The bent springs are at rest.
    for (index, link) in pieces.links.iter_mut().enumerate() {
        let length_m = pieces.rest_m[link.a].distance(pieces.rest_m[link.b]);
        link.spring = Spring::new(link.spring.law(), length_m, link.spring.damping_ns_per_m())
            .map_err(|source| BodyError::Law { link: index, source })?;
    }
    cut.open_surface(&right, pieces.surface);
    Ok(())
}

impl Cut {
    /// Creates separate points and vertices for the right lip, and the walls of both lips.
    fn open_surface(&self, right: &HashMap<usize, usize>, surface: &mut Surface) {
        let mut point_of: HashMap<usize, usize> =
            surface.points.iter().enumerate().map(|(point, at)| (at.nodes()[0].0, point)).collect();
        let Surface { points, vertices, triangles } = surface;
        let mut point_of = |node: usize, points: &mut Vec<BodyPoint>| {
            *point_of.entry(node).or_insert_with(|| {
                points.push(BodyPoint::node(node));
                points.len() - 1
            })
        };
        let mut vertex_of: HashMap<usize, usize> = HashMap::new();
        for triangle in triangles.iter_mut() {
            let nodes = triangle.map(|vertex| points[vertices[vertex]].nodes()[0].0);
            if nodes.iter().map(|&node| self.ijk(node)[0]).sum::<usize>() <= 3 * self.plane {
                continue;
            }
            for (vertex, node) in triangle.iter_mut().zip(nodes) {
                let Some(&copy) = right.get(&node) else { continue };
                *vertex = *vertex_of.entry(copy).or_insert_with(|| {
                    vertices.push(point_of(copy, points));
                    vertices.len() - 1
                });
            }
        }
        let (lows, alongs) = (self.bottom..self.nodes[1] - 1, self.ends[0]..self.ends[1]);
        for is_right in [false, true] {
            let mut wall: HashMap<usize, usize> = HashMap::new();
            for (j, k) in lows.clone().flat_map(|j| alongs.clone().map(move |k| (j, k))) {
                let corners = [[j, k], [j + 1, k], [j + 1, k + 1], [j, k + 1]].map(|[j, k]| {
                    let node = self.node([self.plane, j, k]);
                    let node = if is_right { right.get(&node).copied().unwrap_or(node) } else { node };
                    *wall.entry(node).or_insert_with(|| {
                        vertices.push(point_of(node, points));
                        vertices.len() - 1
                    })
                });
                // Split along a diagonal with an open corner; otherwise both lips would share a triangle at the end
                // of the slit.
                let [a, b, c, d] = corners;
                let is_open = |j, k| self.is_open([self.plane, j, k]);
                let halves = if is_open(j, k) || is_open(j + 1, k + 1) {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, b, d], [b, c, d]]
                };
                // The left lip faces +x, the right one −x.
                triangles.extend(halves.map(|[p, q, r]| if is_right { [p, r, q] } else { [p, q, r] }));
            }
        }
    }
}
