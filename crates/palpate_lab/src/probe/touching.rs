//! Position at which a tool from above first touches the undeformed surface.

use super::options::{Place, Tool};
use crate::top::{MARGIN, Top, height_m};
use glam::{DVec2, DVec3, Vec3Swizzles};

/// Gap at which a sphere counts as touching, m.
const GAP_M: f64 = 1e-12;
/// Maximum number of steps down to the surface; each is as long as the gap.
const MAX_STEPS: usize = 2000;

impl Top {
    /// The centre of the top: the middle of the bounds along x and z, at the height of the highest point, m.
    pub(in crate::probe) fn center_m(&self) -> DVec3 {
        DVec3 { y: self.high_m.y, ..0.5 * (self.low_m + self.high_m) }
    }

    /// The bounds along x and z, mm from the centre of the top.
    pub(in crate::probe) fn bounds_mm(&self) -> [DVec2; 2] {
        [self.low_m, self.high_m].map(|corner| 1e3 * (corner - self.center_m()).xz())
    }

    /// Centre of `tool` where it just touches the surface at `place`, m; `None` where no surface lies below the centre.
    pub(in crate::probe) fn touching_m(&self, tool: Tool, place: Place) -> Option<DVec3> {
        let center = self.center_m();
        let at = DVec2::new(center.x + 1e-3 * place.x_mm, center.z + 1e-3 * place.z_mm);
        self.highest_m(at)?;
        let y = match tool {
            Tool::Sphere { radius_m } => self.sphere_height_m(radius_m, at),
            Tool::Punch { radius_m } => {
                let heights = self.triangles.iter().filter_map(|triangle| highest_m(triangle, at, radius_m));
                heights.fold(f64::NEG_INFINITY, f64::max)
            }
        };
        Some(DVec3::new(at.x, y, at.y))
    }

    /// Height at which a sphere from above meets the surface: it moves down by its gap until the gap closes.
    fn sphere_height_m(&self, radius_m: f64, at: DVec2) -> f64 {
        let mut y = self.high_m.y + radius_m + self.size_m();
        for _ in 0..MAX_STEPS {
            let nearest = self.tree.closest(DVec3::new(at.x, y, at.y), 4.0 * self.size_m() + radius_m);
            let gap = nearest.map_or(0.0, |nearest| nearest.distance_m.abs() - radius_m);
            if gap < GAP_M {
                break;
            }
            y -= gap;
        }
        y
    }
}

/// Greatest height of `triangle` over the disc of `radius_m` round `at` (x, z), m; `None` outside the disc.
fn highest_m(triangle: &[DVec3; 3], at: DVec2, radius_m: f64) -> Option<f64> {
    let [a, b, c] = *triangle;
    let on_edges = [(a, b), (b, c), (c, a)].into_iter().flat_map(|(from, to)| {
        // |from + s (to - from) - at| = radius, and the ends of the edge.
        let (along, offset) = (to.xz() - from.xz(), from.xz() - at);
        let (p, q) = (along.dot(offset), offset.length_squared() - radius_m * radius_m);
        let root = (p * p - along.length_squared() * q).max(0.0).sqrt();
        let shares = [0.0, 1.0, (-p - root) / along.length_squared(), (-p + root) / along.length_squared()];
        shares.map(|s| from + s.clamp(0.0, 1.0) * (to - from))
    });
    let is_within = |x: &DVec3| x.xz().distance(at) <= radius_m * (1.0 + MARGIN);
    let normal = (b - a).cross(c - a);
    let uphill = (-normal.xz() * normal.y).normalize_or_zero();
    let inside = [at, at + radius_m * uphill].into_iter().filter_map(|place| height_m(triangle, place));
    on_edges.filter(is_within).map(|x| x.y).chain(inside).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slope of 1 in 2 along x, from (0, 0, 0).
    const SLOPE: [DVec3; 3] = [DVec3::ZERO, DVec3::new(4.0, 2.0, 4.0), DVec3::new(4.0, 2.0, -4.0)];

    #[test]
    fn disc_meets_the_highest_point_below_it() {
        let highest = |x, z, r| highest_m(&SLOPE, DVec2::new(x, z), r);
        // Uphill within the triangle, at an edge, at a corner, outside it.
        assert!((highest(2.5, 0.0, 0.5).unwrap() - 1.5).abs() < 1e-12);
        assert!((highest(3.9, 0.0, 1.0).unwrap() - 2.0).abs() < 1e-12);
        assert!((highest(-0.5, 0.0, 0.5).unwrap()).abs() < 1e-9);
        assert_eq!(highest(-1.0, 0.0, 0.5), None);
    }
}
