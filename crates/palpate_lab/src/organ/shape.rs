//! Shape of the organ: blended ellipsoids minus others.

use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_4;

/// Triangle mesh.
pub(super) struct Shape {
    /// Vertices, m.
    pub positions_m: Vec<DVec3>,
    /// Outward unit normals of the vertices.
    pub normals: Vec<DVec3>,
    /// Vertices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
}

/// Centre from which every ray meets the surface once, m.
const CENTER_M: DVec3 = DVec3::new(0.0, 0.004, 0.0);
/// Distance from the centre beyond every point of the surface, m.
const OUTSIDE_M: f64 = 0.12;
/// Stretch of the directions to the proportions of the organ, which spreads the vertices evenly.
const STRETCH: DVec3 = DVec3::new(1.6, 0.7, 1.0);

/// Organ from a cube with `fields` fields along each edge, projected onto the surface.
pub(super) fn organ(fields: usize) -> Shape {
    let (directions, triangles) = cube(fields);
    let positions_m: Vec<DVec3> = directions.into_iter().map(surface_point_m).collect();
    let mut normals = vec![DVec3::ZERO; positions_m.len()];
    for t in &triangles {
        let [a, b, c] = t.map(|vertex| positions_m[vertex]);
        t.iter().for_each(|&vertex| normals[vertex] += (b - a).cross(c - a));
    }
    normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
    Shape { positions_m, normals, triangles }
}

/// Point where a ray from the centre leaves the organ, by bisection, m.
fn surface_point_m(direction: DVec3) -> DVec3 {
    let direction = (STRETCH * direction).normalize();
    let (mut inside, mut outside) = (0.0, OUTSIDE_M);
    for _ in 0..48 {
        let middle = 0.5 * (inside + outside);
        if implicit_m(CENTER_M + middle * direction) < 0.0 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    CENTER_M + outside * direction
}

/// Implicit function of the organ, negative inside: a large lobe, a thin lobe and a tail, minus a hollow below and a groove in front.
fn implicit_m(at: DVec3) -> f64 {
    let large = ellipsoid(at, [-0.020, 0.000, 0.000], [0.040, 0.029, 0.037]);
    let thin = ellipsoid(at, [0.028, 0.006, 0.006], [0.036, 0.015, 0.026]);
    let tail = ellipsoid(at, [-0.030, -0.012, 0.006], [0.024, 0.022, 0.026]);
    let hollow = ellipsoid(at, [0.006, -0.034, 0.012], [0.022, 0.022, 0.026]);
    let groove = ellipsoid(at, [0.012, 0.004, 0.047], [0.007, 0.020, 0.018]);
    let full = blend(blend(large, thin, 0.030), tail, 0.020);
    subtract(subtract(full, hollow, 0.016), groove, 0.012)
}

/// Approximate distance from an ellipsoid, m.
fn ellipsoid(at: DVec3, center_m: [f64; 3], radii_m: [f64; 3]) -> f64 {
    let (from, radii) = (at - DVec3::from_array(center_m), DVec3::from_array(radii_m));
    let (near, steep) = ((from / radii).length(), (from / (radii * radii)).length());
    near * (near - 1.0) / steep.max(f64::MIN_POSITIVE)
}

/// Smooth union over `width_m`.
fn blend(a: f64, b: f64, width_m: f64) -> f64 {
    let near = (width_m - (a - b).abs()).max(0.0) / width_m;
    a.min(b) - near * near * width_m / 4.0
}

/// Smooth difference: the first minus the second.
fn subtract(a: f64, b: f64, width_m: f64) -> f64 {
    -blend(-a, b, width_m)
}

/// Directions to the vertices of a cube's grid at equal angles, and the triangles of the grid.
fn cube(fields: usize) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let angle = |i: usize| (FRAC_PI_4 * (2.0 * i as f64 / fields as f64 - 1.0)).tan();
    let (mut directions, mut triangles) = (Vec::new(), Vec::new());
    let mut indices = HashMap::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, fields)]) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut at = |p: usize, q: usize| {
            let mut place = [side; 3];
            (place[u], place[v]) = (p, q);
            *indices.entry(place).or_insert_with(|| {
                directions.push(DVec3::from_array(place.map(angle)).normalize());
                directions.len() - 1
            })
        };
        for (p, q) in (0..fields).flat_map(|p| (0..fields).map(move |q| (p, q))) {
            let [a, b, c, d] = [at(p, q), at(p + 1, q), at(p + 1, q + 1), at(p, q + 1)];
            // The order is reversed on the side against the axis.
            triangles.extend(if side == 0 { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] });
        }
    }
    (directions, triangles)
}
