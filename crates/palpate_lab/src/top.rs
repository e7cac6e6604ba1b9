//! The undeformed surface of a body, from above.

use glam::{DVec2, DVec3, Vec3Swizzles};
use palpate_body::{Body, SurfaceTree};

/// Surface of a body at rest.
pub(crate) struct Top {
    pub(crate) triangles: Vec<[DVec3; 3]>,
    pub(crate) tree: SurfaceTree,
    pub(crate) low_m: DVec3,
    pub(crate) high_m: DVec3,
}

/// Rounding allowed to barycentric weights and to the radius of a disc, relative.
pub(crate) const MARGIN: f64 = 1e-9;

impl Top {
    pub(crate) fn of(body: &Body) -> Self {
        let (surface, x) = (body.surface(), body.positions_m());
        let at = |point: usize| surface.points[point].of(x);
        let triangles: Vec<[DVec3; 3]> =
            (0..surface.triangles.len()).map(|triangle| surface.corners(triangle).map(at)).collect();
        let corners = || triangles.iter().flatten();
        let low_m = corners().copied().reduce(DVec3::min).unwrap_or_default();
        let high_m = corners().copied().reduce(DVec3::max).unwrap_or_default();
        Self { tree: SurfaceTree::new(body), triangles, low_m, high_m }
    }

    /// Longest side of the body's bounds, m.
    pub(crate) fn size_m(&self) -> f64 {
        (self.high_m - self.low_m).max_element()
    }

    /// The highest point of the surface at `at` (x, z), m; `None` where no surface is above or below it.
    pub(crate) fn highest_m(&self, at: DVec2) -> Option<DVec3> {
        let column = |y: f64| DVec3::new(at.x, y, at.y);
        let near = self.tree.near(column(self.low_m.y), column(self.high_m.y));
        let heights = near.into_iter().filter_map(|triangle| height_m(&self.triangles[triangle], at));
        heights.reduce(f64::max).map(column)
    }
}

/// Height of `triangle` at `at` (x, z), m; `None` outside it and for an upright triangle.
pub(crate) fn height_m([a, b, c]: &[DVec3; 3], at: DVec2) -> Option<f64> {
    let (to_b, to_c, to_at) = (b.xz() - a.xz(), c.xz() - a.xz(), at - a.xz());
    let area = to_b.perp_dot(to_c);
    let weights = [to_at.perp_dot(to_c) / area, to_b.perp_dot(to_at) / area];
    let is_inside = weights.iter().all(|w| *w >= -MARGIN) && weights.iter().sum::<f64>() <= 1.0 + MARGIN;
    is_inside.then(|| a.y + weights[0] * (b.y - a.y) + weights[1] * (c.y - a.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slope of 1 in 2 along x, from (0, 0, 0).
    const SLOPE: [DVec3; 3] = [DVec3::ZERO, DVec3::new(4.0, 2.0, 4.0), DVec3::new(4.0, 2.0, -4.0)];

    #[test]
    fn height_of_a_slope_is_that_of_its_plane() {
        assert!((height_m(&SLOPE, DVec2::new(2.0, 1.0)).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(height_m(&SLOPE, DVec2::new(2.0, 2.1)), None);
    }
}
