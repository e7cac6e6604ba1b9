//! A closed surface around the samples inside a mesh.

use super::closed_surface::ClosedSurface;
use super::winding_samples::WindingSamples;
use crate::parallel;
use crate::vertex_normals::vertex_normals;
use glam::DVec3;
use parry3d_f64::partitioning::{Bvh, BvhNode};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Triangle;

/// Distance, in spacings of the samples, up to which a point moves onto the mesh.
const MAX_MOVE: f64 = 1.0;
/// Number of times that points move to the middle of their neighbours, and then onto the mesh.
const RELAXATIONS: usize = 3;

/// The boundary of the samples with a winding number beyond 1/2 (S. F. F. Gibson, MICCAI 98, LNCS 1496, 888): a point in each cube of eight samples
/// that differ, a quadrilateral across each edge between two samples that do. Points move onto the triangles with these `corners`, and boxes in
/// `bvh`, that face the same way, if any are near; elsewhere, across holes, they lie where the winding number is interpolated to 1/2.
pub(super) fn enclose(
    samples: &WindingSamples,
    corners: &(impl Fn(usize) -> [DVec3; 3] + Sync),
    bvh: &Bvh,
) -> ClosedSurface {
    let mut surface = extract(samples);
    let max_m = MAX_MOVE * samples.spacing_m;
    for _ in 0..RELAXATIONS {
        relax(&mut surface);
        let normals = vertex_normals(&surface.triangles, &surface.points_m);
        let points_m = &surface.points_m;
        let moved = |point: usize| {
            let x = points_m[point];
            nearest(bvh, corners, x, normals[point], max_m).unwrap_or(x)
        };
        surface.points_m = parallel::map_ranges(points_m.len(), |range| range.map(moved).collect());
    }
    surface
}

/// Whether a winding number is inside.
pub(super) fn is_inside(winding: f32) -> bool {
    winding.abs() > 0.5
}

fn extract(samples: &WindingSamples) -> ClosedSurface {
    let [nx, ny, nz] = samples.counts;
    let cubes = [nx - 1, ny - 1, nz - 1];
    let cube_index = |[i, j, k]: [usize; 3]| i + cubes[0] * (j + cubes[1] * k);
    let mut point_of = vec![u32::MAX; cubes.iter().product()];
    let mut points_m = Vec::new();
    for cube in crate::lattice::grid(cubes) {
        let at = |c: usize| [cube[0] + (c & 1), cube[1] + (c >> 1 & 1), cube[2] + (c >> 2)];
        let winding: [f32; 8] = std::array::from_fn(|c| samples.winding[samples.index(at(c))]);
        let inside = winding.map(is_inside);
        if inside.iter().all(|is| *is == inside[0]) {
            continue;
        }
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for (a, b) in EDGES {
            if inside[a] != inside[b] {
                let (wa, wb) = (f64::from(winding[a].abs()), f64::from(winding[b].abs()));
                let share = ((0.5 - wa) / (wb - wa)).clamp(0.0, 1.0);
                sum += samples.at_m(at(a)).lerp(samples.at_m(at(b)), share);
                count += 1.0;
            }
        }
        point_of[cube_index(cube)] = points_m.len() as u32;
        points_m.push(sum / count);
    }
    let mut triangles = Vec::new();
    for place in crate::lattice::grid(samples.counts) {
        let own = is_inside(samples.winding[samples.index(place)]);
        for axis in 0..3 {
            let mut next = place;
            next[axis] += 1;
            if next[axis] == samples.counts[axis] || is_inside(samples.winding[samples.index(next)]) == own {
                continue;
            }
            // The outermost samples are outside, so that the edge has four cubes.
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let around = |du: usize, dv: usize| {
                let mut cube = place;
                (cube[u], cube[v]) = (cube[u] - du, cube[v] - dv);
                point_of[cube_index(cube)] as usize
            };
            let [a, b, c, d] = [around(1, 1), around(0, 1), around(0, 0), around(1, 0)];
            let [a, b, c, d] = if own { [a, b, c, d] } else { [d, c, b, a] };
            // The shorter diagonal.
            let length = |p: usize, q: usize| points_m[p].distance_squared(points_m[q]);
            if length(a, c) <= length(b, d) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    ClosedSurface { points_m, triangles }
}

/// Corners of the edges of a cube.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

/// Moves every point to the middle of its neighbours.
fn relax(surface: &mut ClosedSurface) {
    let mut sums = vec![(DVec3::ZERO, 0.0); surface.points_m.len()];
    for &[a, b, c] in &surface.triangles {
        // Each edge has two triangles, so every neighbour counts twice.
        for (from, to) in [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)] {
            sums[from].0 += surface.points_m[to];
            sums[from].1 += 1.0;
        }
    }
    for (x, (sum, count)) in surface.points_m.iter_mut().zip(sums) {
        if count > 0.0 {
            *x = 0.5 * (*x + sum / count);
        }
    }
}

/// The nearest point of a triangle that faces along `normal`, within `max_m`.
fn nearest(
    bvh: &Bvh,
    corners: &impl Fn(usize) -> [DVec3; 3],
    x_m: DVec3,
    normal: DVec3,
    max_m: f64,
) -> Option<DVec3> {
    let found = bvh.find_best(
        max_m,
        |node: &BvhNode, _| node.aabb().distance_to_local_point(x_m, true),
        |leaf, _| {
            let [a, b, c] = corners(leaf as usize);
            if (b - a).cross(c - a).dot(normal) <= 0.0 {
                return None;
            }
            let on_m = Triangle::new(a, b, c).project_local_point(x_m, false).point;
            Some((on_m.distance(x_m), on_m))
        },
    );
    found.map(|(_, (_, on_m))| on_m)
}
