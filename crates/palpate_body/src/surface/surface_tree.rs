//! The nearest point of a surface.

use crate::{BodyPoint, Surface};
use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace};
use parry3d_f64::query::{PointQuery, PointQueryWithLocation};
use parry3d_f64::shape::Triangle;
use std::collections::HashMap;

/// Bounding volume tree of the triangles of a body's surface. It is built once and refitted when the body has moved.
#[derive(Clone)]
pub struct SurfaceTree {
    /// Points of each triangle, counter-clockwise as seen from outside.
    triangles: Vec<[usize; 3]>,
    /// Position of each point of the surface at the last fit, m.
    x: Vec<DVec3>,
    /// Triangles around each point, and at each edge.
    round_point: HashMap<usize, Vec<usize>>,
    beside_edge: HashMap<(usize, usize), Vec<usize>>,
    bvh: Bvh,
    workspace: BvhWorkspace,
}

/// The nearest point of a body's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Index of the triangle.
    pub triangle: usize,
    /// Corners of the triangle as points of the surface, with their weights, at least 0.
    pub corners: [(usize, f64); 3],
    /// Position, m.
    pub point_m: DVec3,
    /// Outward unit normal of the surface. On an edge or a corner it is the mean over the adjacent triangles,
    /// weighted by their angles.
    pub normal: DVec3,
    /// Distance of the given position from the surface, m; negative inside the body.
    pub distance_m: f64,
}

impl std::fmt::Debug for SurfaceTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SurfaceTree").field("triangles", &self.triangles.len()).finish_non_exhaustive()
    }
}

impl ClosestPoint {
    /// Converts it to a point of the body, to be held or tied.
    ///
    /// # Panics
    /// If `surface` has fewer points than the one of the tree.
    #[must_use]
    pub fn body_point(&self, surface: &Surface) -> BodyPoint {
        BodyPoint::between(self.corners.map(|(point, w)| (&surface.points[point], w)))
    }
}

/// Weights below this value count as zero: the point lies on an edge or a corner.
const NO_WEIGHT: f64 = 1e-9;

impl SurfaceTree {
    /// Creates the tree of `surface` with the nodes at `positions_m`.
    pub(crate) fn of_surface(surface: &Surface, positions_m: &[DVec3]) -> Self {
        let triangles: Vec<[usize; 3]> =
            (0..surface.triangles.len()).map(|triangle| surface.corners(triangle)).collect();
        let (mut round_point, mut beside_edge) = (HashMap::<_, Vec<_>>::new(), HashMap::<_, Vec<_>>::new());
        for (index, &points) in triangles.iter().enumerate() {
            for corner in 0..3 {
                let (a, b) = (points[corner], points[(corner + 1) % 3]);
                round_point.entry(a).or_default().push(index);
                beside_edge.entry((a.min(b), a.max(b))).or_default().push(index);
            }
        }
        let x: Vec<DVec3> = surface.points.iter().map(|point| point.of(positions_m)).collect();
        let boxes: Vec<Aabb> = triangles.iter().map(|t| bounds(t.map(|point| x[point]))).collect();
        let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Self { triangles, x, round_point, beside_edge, bvh, workspace: BvhWorkspace::default() }
    }

    /// Refits the tree to the nodes at `positions_m`.
    pub(crate) fn refit_to(&mut self, surface: &Surface, positions_m: &[DVec3]) {
        let points = &surface.points;
        self.x.iter_mut().zip(points).for_each(|(x, point)| *x = point.of(positions_m));
        for (index, t) in self.triangles.iter().enumerate() {
            self.bvh.insert_or_update_partially(bounds(t.map(|point| self.x[point])), index as u32, 0.0);
        }
        self.bvh.refit(&mut self.workspace);
    }

    /// Indices of the triangles whose boxes overlap the box from `low_m` to `high_m`, in ascending order.
    #[must_use]
    pub fn near(&self, low_m: DVec3, high_m: DVec3) -> Vec<usize> {
        let mut triangles: Vec<usize> =
            self.bvh.intersect_aabb(&Aabb::new(low_m, high_m)).map(|index| index as usize).collect();
        triangles.sort_unstable();
        triangles
    }

    /// The point of the surface nearest to `place_m`, in the shape of the last fit. `None` if it is not within
    /// `within_m`, or lies on a degenerate triangle.
    #[must_use]
    pub fn closest(&self, place_m: DVec3, within_m: f64) -> Option<ClosestPoint> {
        let corners = |triangle: usize| self.triangles[triangle].map(|point| self.x[point]);
        let (triangle, (_, weights)) = self.bvh.find_best(
            within_m,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(place_m, true),
            |leaf, _| {
                let [a, b, c] = corners(leaf as usize);
                let (projection, location) =
                    Triangle::new(a, b, c).project_local_point_and_get_location(place_m, false);
                Some((projection.point.distance(place_m), location.barycentric_coordinates()?))
            },
        )?;
        let triangle = triangle as usize;
        let [i, j, k] = self.triangles[triangle];
        let on = [(i, weights[0]), (j, weights[1]), (k, weights[2])];
        let point_m: DVec3 = on.iter().map(|&(point, w)| w * self.x[point]).sum();
        let normal = self.normal(triangle, weights);
        // A degenerate triangle has no outside.
        if normal == DVec3::ZERO {
            return None;
        }
        let away = place_m - point_m;
        Some(ClosestPoint {
            triangle,
            corners: on,
            point_m,
            normal,
            distance_m: away.length().copysign(away.dot(normal)),
        })
    }

    /// Normal at a place of `triangle`. On its edges and corners it combines all adjacent triangles (J. A. Baerentzen
    /// and H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243), which makes the sign of the distance correct.
    fn normal(&self, triangle: usize, weights: [f64; 3]) -> DVec3 {
        let x = &self.x;
        let face = |index: usize| {
            let [a, b, c] = self.triangles[index].map(|point| x[point]);
            (b - a).cross(c - a).normalize_or_zero()
        };
        let own = self.triangles[triangle];
        let on: Vec<usize> = (0..3).filter(|&i| weights[i] > NO_WEIGHT).map(|i| own[i]).collect();
        let sum = match on[..] {
            [point] => {
                let angle = |index: usize| {
                    let t = self.triangles[index];
                    let at = t.iter().position(|&n| n == point).unwrap_or(0);
                    let (p, q) = (x[t[(at + 1) % 3]] - x[point], x[t[(at + 2) % 3]] - x[point]);
                    p.angle_between(q)
                };
                let round = self.round_point.get(&point);
                round.into_iter().flatten().map(|&index| angle(index) * face(index)).sum()
            }
            [a, b] => {
                let beside = self.beside_edge.get(&(a.min(b), a.max(b)));
                beside.into_iter().flatten().map(|&index| face(index)).sum()
            }
            _ => face(triangle),
        };
        DVec3::try_normalize(sum).unwrap_or_else(|| face(triangle))
    }
}

fn bounds(corners: [DVec3; 3]) -> Aabb {
    let [a, b, c] = corners;
    Aabb::new(a.min(b).min(c), a.max(b).max(c))
}
