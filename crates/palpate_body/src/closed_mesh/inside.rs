//! Inside test for a closed surface.

use super::MeshError;
use super::geometry::{TOLERANCE, bounds};
use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// A closed surface whose winding number is computed by a ray along +x.
///
/// Coordinates are integers, so every sign is exact. Where the ray would meet an edge or a corner, the position is
/// shifted symbolically by (ε, ε²) in y and z (H. Edelsbrunner and E. P. Mücke, ACM Trans. Graph. 9 (1990) 66).
#[derive(Clone)]
pub(super) struct Inside {
    triangles: Vec<[[i32; 3]; 3]>,
    bvh: Bvh,
    half_size_m: DVec3,
    unit_m: f64,
}

/// Units along half the longest side. Products of three differences fit in 128 bits.
pub(super) const UNITS: f64 = (1_u32 << 25) as f64;

impl std::fmt::Debug for Inside {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Inside").field("triangles", &self.triangles.len()).finish_non_exhaustive()
    }
}

impl Inside {
    /// Creates the test for `triangles` of `points_m`, which lie within ±`half_size_m`.
    pub fn new(triangles: &[[usize; 3]], points_m: &[DVec3], half_size_m: DVec3) -> Self {
        let unit_m = half_size_m.max_element() / UNITS;
        let boxes = triangles.iter().map(|t| bounds(t.map(|point| points_m[point]), 2.0 * unit_m));
        let whole = |x: DVec3| (x / unit_m).round().as_ivec3().to_array();
        Self {
            triangles: triangles.iter().map(|t| t.map(|point| whole(points_m[point]))).collect(),
            bvh: Bvh::from_iter(BvhBuildStrategy::Binned, boxes.enumerate()),
            half_size_m,
            unit_m,
        }
    }

    /// Tree over the boxes of the triangles, which are slightly enlarged.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Flips the triangles of the parts with `turned`, where `part` is the part of each.
    pub fn turn(&mut self, part: &[usize], turned: &[bool]) {
        for (corners, _) in self.triangles.iter_mut().zip(part).filter(|(_, part)| turned[**part]) {
            corners.swap(1, 2);
        }
    }

    /// Winding number of the surface around `place_m`: 1 inside, 0 outside.
    pub fn winding(&self, place_m: DVec3) -> i64 {
        let mut sum = 0;
        self.crossed(place_m, |_, sign| sum += sign);
        sum
    }

    /// Calls `each` with every triangle that a ray along +x crosses, with +1 if the triangle faces along the ray and
    /// −1 otherwise.
    fn crossed(&self, place_m: DVec3, mut each: impl FnMut(usize, i64)) {
        // Positions far outside would overflow the integers.
        if !place_m.abs().cmple(self.half_size_m + self.unit_m).all() {
            return;
        }
        let place = (place_m / self.unit_m).round().as_i64vec3().to_array();
        let ray = Aabb::new(place_m, DVec3::new(self.half_size_m.x + self.unit_m, place_m.y, place_m.z));
        for triangle in self.bvh.intersect_aabb(&ray) {
            let sign = crossing(&self.corners(triangle as usize), place);
            if sign != 0 {
                each(triangle as usize, sign);
            }
        }
    }

    /// Parts to flip, so that the outermost face outward and nested parts alternate.
    ///
    /// # Errors
    /// [`MeshError::Nested`] for a part within another with the same orientation.
    pub fn parts_to_turn(
        &self,
        part: &[usize],
        parts: usize,
        center_m: DVec3,
    ) -> Result<Vec<bool>, MeshError> {
        let mut orientation = vec![0.0; parts];
        let mut widest = vec![(0.0, 0); parts];
        for (triangle, &part) in part.iter().enumerate() {
            let [a, b, c] = self.corners_m(triangle);
            orientation[part] += a.dot(b.cross(c));
            let area = (b - a).cross(c - a).length();
            if area > widest[part].0 {
                widest[part] = (area, triangle);
            }
        }
        let orientation: Vec<f64> = orientation.into_iter().map(f64::signum).collect();
        let containers: Vec<Vec<usize>> = (0..parts)
            .map(|own| {
                // A position just inside the part, because parts may touch.
                let [a, b, c] = self.corners_m(widest[own].1);
                let inward = -orientation[own] * (b - a).cross(c - a).normalize_or_zero();
                let depth_m = 16.0 * TOLERANCE * 2.0 * self.half_size_m.max_element();
                let mut winding = std::collections::BTreeMap::new();
                self.crossed((a + b + c) / 3.0 + depth_m * inward, |triangle, sign| {
                    *winding.entry(part[triangle]).or_insert(0) += sign;
                });
                winding
                    .into_iter()
                    .filter(|&(other, times)| other != own && times != 0)
                    .map(|(other, _)| other)
                    .collect()
            })
            .collect();
        let mut turn: Vec<bool> = orientation.iter().map(|&orientation| orientation < 0.0).collect();
        for own in 0..parts {
            let depth = |other: &&usize| containers[**other].len();
            let Some(&parent) = containers[own].iter().max_by_key(depth) else { continue };
            if orientation[own] == orientation[parent] {
                let at = part.iter().position(|&p| p == own).map_or(DVec3::ZERO, |t| self.corners_m(t)[0]);
                return Err(MeshError::Nested { at_m: center_m + at });
            }
            // Of two parts with opposite orientation both are flipped or neither, depending on the outermost part.
            let outermost = containers[own].iter().min_by_key(depth).copied().unwrap_or(parent);
            turn[own] = orientation[outermost] < 0.0;
        }
        Ok(turn)
    }

    /// Where the line along `axis` through `at_m` crosses a triangle: +1 or −1 as it leaves or enters, and the coordinate, m.
    pub fn line_crossing(&self, triangle: usize, axis: usize, at_m: DVec3) -> Option<(i64, f64)> {
        let turned = |x: [i64; 3]| [x[axis], x[(axis + 1) % 3], x[(axis + 2) % 3]];
        let corners = self.corners(triangle).map(turned);
        let [_, y, z] = turned((at_m / self.unit_m).round().as_i64vec3().to_array());
        row_crossing(&corners, [y, z]).map(|(sign, x)| (sign, self.unit_m * x))
    }

    fn corners_m(&self, triangle: usize) -> [DVec3; 3] {
        self.corners(triangle).map(|[x, y, z]| self.unit_m * DVec3::new(x as f64, y as f64, z as f64))
    }

    /// Corners of a triangle, in units.
    fn corners(&self, triangle: usize) -> [[i64; 3]; 3] {
        self.triangles[triangle].map(|corner| corner.map(i64::from))
    }
}

/// +1 or −1 if the ray from `p` along +x crosses the triangle from its inner or its outer side, else 0.
fn crossing(&[a, b, c]: &[[i64; 3]; 3], p: [i64; 3]) -> i64 {
    // The x component of the normal: twice the signed projected area.
    let facing = cross_x(b, a, c).signum();
    if facing == 0 || [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| side(from, to, p) != facing) {
        return 0;
    }
    let d = |to: [i64; 3]| [0, 1, 2].map(|i| i128::from(to[i] - a[i]));
    let ([bx, by, bz], [cx, cy, cz], [px, py, pz]) = (d(b), d(c), d(p));
    let beyond = px * (by * cz - bz * cy) + py * (bz * cx - bx * cz) + pz * (bx * cy - by * cx);
    // The triangle is ahead if p lies behind its plane as seen along the ray.
    if beyond.signum() == -i128::from(facing) { facing } else { 0 }
}

/// Where the line along x at (y, z) crosses the triangle: +1 or −1 as it leaves or enters, and x. All in integers, so that lines through edges
/// and corners of a closed surface cross it as often as lines beside them.
pub(super) fn row_crossing(&[a, b, c]: &[[i64; 3]; 3], [y, z]: [i64; 2]) -> Option<(i64, f64)> {
    let facing = cross_x(b, a, c).signum();
    let p = [0, y, z];
    if facing == 0 || [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| side(from, to, p) != facing) {
        return None;
    }
    let [[bx, by, bz], [cx, cy, cz]] = [b, c].map(|to| [0, 1, 2].map(|i| (to[i] - a[i]) as f64));
    let (nx, ny, nz) = (by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx);
    let x = a[0] as f64 - (ny * (y - a[1]) as f64 + nz * (z - a[2]) as f64) / nx;
    Some((facing, x.clamp(a[0].min(b[0]).min(c[0]) as f64, a[0].max(b[0]).max(c[0]) as f64)))
}

/// (b − a) × (c − a) along x.
fn cross_x(b: [i64; 3], a: [i64; 3], c: [i64; 3]) -> i64 {
    (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
}

/// The side of the line from `a` to `b`, seen along x, on which the shifted position (y + ε, z + ε²) of `p` lies.
fn side(a: [i64; 3], b: [i64; 3], p: [i64; 3]) -> i64 {
    let signs = [cross_x(b, a, p), a[2] - b[2], b[1] - a[1]];
    signs.into_iter().map(i64::signum).find(|sign| *sign != 0).unwrap_or(0)
}
