//! The places at which `palpate-lab mesh` taps a body.

use crate::top::Top;
use glam::{DVec2, DVec3, Vec3Swizzles};
use palpate_body::Body;
use std::f64::consts::TAU;

/// Minimum y of the normal of a surface that faces up.
const MIN_UP: f64 = 0.7;
/// Distances from the rim of the surface that faces up, in radii of the tool: the first one that leaves enough places is used.
const RIM_RADII: [f64; 3] = [2.0, 1.0, 0.0];
/// Number of directions in which the distance from the rim is checked.
const DIRECTIONS: usize = 8;
/// Maximum height difference over the distance from the rim, relative to it: the slope of a surface with [`MIN_UP`].
const MAX_SLOPE: f64 = 1.0;
/// Rounding allowed to heights, relative to the size of the body.
const TOLERANCE: f64 = 1e-9;

/// Up to `count` different places of the surface of `body`, m, for a tool of radius `radius_m`.
///
/// The first one is the top above the centre of mass, or, where there is a hole, the nearest corner of the upper half that is visible from
/// above. Each further one is the middle of a triangle that faces up, is visible from above and moves freely, with the largest distance from
/// the earlier ones along x and z.
pub(super) fn places(body: &Body, top: &Top, count: usize, radius_m: f64) -> Vec<DVec3> {
    let first = above_center_of_mass(body, top).filter(|_| count > 0);
    let mut places: Vec<DVec3> = first.into_iter().collect();
    if places.is_empty() || count < 2 {
        return places;
    }
    let free = free_middles(body, top);
    let inside =
        |rim_m: f64| -> Vec<DVec3> { free.iter().copied().filter(|x| is_inside(top, *x, rim_m)).collect() };
    let candidates =
        RIM_RADII.into_iter().map(|radii| inside(radii * radius_m)).find(|found| found.len() + 1 >= count);
    let candidates = candidates.unwrap_or(free);
    while places.len() < count {
        let distance =
            |x: &DVec3| places.iter().map(|place| place.xz().distance(x.xz())).fold(f64::INFINITY, f64::min);
        let farthest = candidates.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).copied();
        match farthest.filter(|x| distance(x) > 0.0) {
            Some(x) => places.push(x),
            None => break,
        }
    }
    places
}

/// The highest point of the surface above the centre of mass, or the nearest visible corner of its upper half.
fn above_center_of_mass(body: &Body, top: &Top) -> Option<DVec3> {
    let masses = body.network().mass_kg();
    let moment: DVec3 = body.positions_m().iter().zip(masses).map(|(x, mass_kg)| *mass_kg * *x).sum();
    let middle_m = (moment / masses.iter().sum::<f64>()).xz();
    let half_m = 0.5 * (top.low_m.y + top.high_m.y);
    let distance = |x: &DVec3| x.xz().distance(middle_m);
    top.highest_m(middle_m).or_else(|| {
        let corners = top.triangles.iter().flatten().filter(|x| x.y > half_m && is_visible(top, **x));
        corners.min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
    })
}

/// Whether nothing lies above `x`.
fn is_visible(top: &Top, x: DVec3) -> bool {
    top.highest_m(x.xz()).is_some_and(|highest| highest.y <= x.y + TOLERANCE * top.size_m())
}

/// The middles of the triangles that face up, are visible from above and have no fixed node.
fn free_middles(body: &Body, top: &Top) -> Vec<DVec3> {
    let (surface, network) = (body.surface(), body.network());
    let is_free = |triangle: usize| {
        let points = surface.corners(triangle).map(|point| &surface.points[point]);
        points.iter().all(|point| point.nodes().iter().all(|(node, _)| !network.is_fixed(*node)))
    };
    let middle = |(triangle, [a, b, c]): (usize, &[DVec3; 3])| {
        let up = (b - a).cross(c - a).normalize_or_zero().y;
        let middle = (a + b + c) / 3.0;
        (up >= MIN_UP && is_free(triangle) && is_visible(top, middle)).then_some(middle)
    };
    top.triangles.iter().enumerate().filter_map(middle).collect()
}

/// Whether the surface goes on around `x` up to the distance `rim_m`, without a steep slope.
fn is_inside(top: &Top, x: DVec3, rim_m: f64) -> bool {
    (0..DIRECTIONS).all(|direction| {
        let along = DVec2::from_angle(TAU * direction as f64 / DIRECTIONS as f64);
        let found = top.highest_m(x.xz() + rim_m * along);
        found.is_some_and(|beside| (beside.y - x.y).abs() <= MAX_SLOPE * rim_m + TOLERANCE * top.size_m())
    })
}
