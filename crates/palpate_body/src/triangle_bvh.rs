//! Trees over triangles.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// A tree over the bounding boxes of `triangles`, whose leaves have their indices.
pub(crate) fn triangle_bvh(triangles: impl Iterator<Item = [DVec3; 3]>) -> Bvh {
    let boxes = triangles.map(|[a, b, c]| Aabb::new(a.min(b).min(c), a.max(b).max(c)));
    Bvh::from_iter(BvhBuildStrategy::Binned, boxes.enumerate())
}
