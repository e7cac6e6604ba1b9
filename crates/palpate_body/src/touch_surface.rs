//! The touchable surface of a mesh, with triangles of a size that fits the cells.

mod cluster;
mod flip;
mod subdivide;
mod thickness;

use crate::parallel;
use crate::triangle_bvh::triangle_bvh;
use crate::vertex_normals::vertex_normals;
use crate::{BodyPoint, ClosedMesh, Surface};
use glam::DVec3;
use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Triangle;

/// The touchable surface of a mesh.
///
/// Where the mesh is finer than the cells, many triangles would move alike; where it is coarser, a dent would have no
/// vertices. Vertices are clustered first, edges of slivers are flipped, and long edges are halved afterwards.
pub(crate) struct TouchSurface {
    pub surface: Surface,
    /// Maximum distance of a point of the mesh's enclosing surface from this one, m.
    pub deviation_m: f64,
}

/// Distance of points relative to the thickness below them, and minimum distance relative to that where the body is thick.
const THICKNESS_SHARE: f64 = 0.5;
const MIN_SPACING_SHARE: f64 = 0.25;

impl TouchSurface {
    /// Creates the surface with points at least `spacing` cells of `cell_m` apart, closer where the body is thin, and edges of at most 1 + `spacing`
    /// cells. With these limits few clustered edges are halved again. `point_at` embeds a position, relative to the
    /// mesh's centre, with the outward normal there, in the body.
    pub(crate) fn new(
        mesh: &ClosedMesh,
        point_at: impl Fn(DVec3, DVec3) -> BodyPoint,
        cell_m: f64,
        spacing: f64,
    ) -> Self {
        let enclosing_m = mesh.enclosing_points_m();
        let normals: Vec<DVec3> = vertex_normals(mesh.closed_triangles(), enclosing_m)
            .into_iter()
            .map(DVec3::normalize_or_zero)
            .collect();
        let spacing_m = spacing * cell_m;
        // Points further apart than half the thickness of a finger would lose it.
        let thickness_m = thickness::thickness_m(
            mesh.enclosing_bvh(),
            mesh.closed_triangles(),
            enclosing_m,
            &normals,
            spacing_m / THICKNESS_SHARE,
        );
        let apart_m: Vec<f64> = thickness_m
            .iter()
            .map(|thickness_m| {
                (THICKNESS_SHARE * thickness_m).clamp(MIN_SPACING_SHARE * spacing_m, spacing_m)
            })
            .collect();
        let mut clustered = cluster::cluster(mesh.closed_triangles(), enclosing_m, &normals, &apart_m);
        let mut points_m: Vec<DVec3> = clustered.kept.iter().map(|&point| enclosing_m[point]).collect();
        let kept_normals: Vec<DVec3> = clustered.kept.iter().map(|&point| normals[point]).collect();
        flip::flip(&mut clustered.triangles, &points_m, &kept_normals);
        let deviation_m = deviation(enclosing_m, &clustered.triangles, &points_m);
        let triangles = subdivide::subdivide(clustered.triangles, &mut points_m, (1.0 + spacing) * cell_m);
        let normals = vertex_normals(&triangles, &points_m);
        let points: Vec<_> = points_m.iter().zip(normals).map(|(x, normal)| point_at(*x, normal)).collect();
        let vertices = (0..points.len()).collect();
        Self { surface: Surface { points, vertices, triangles }, deviation_m }
    }
}

/// Maximum distance of `places_m` from the triangles.
fn deviation(places_m: &[DVec3], triangles: &[[usize; 3]], points_m: &[DVec3]) -> f64 {
    let corners = |triangle: usize| triangles[triangle].map(|point| points_m[point]);
    let bvh = triangle_bvh((0..triangles.len()).map(corners));
    let distance = |place_m: &DVec3| {
        let found = bvh.find_best(
            f64::INFINITY,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(*place_m, true),
            |leaf, _| {
                let [a, b, c] = corners(leaf as usize);
                Some(Triangle::new(a, b, c).project_local_point(*place_m, false).point.distance(*place_m))
            },
        );
        found.map_or(0.0, |(_, distance)| distance)
    };
    parallel::map(places_m, distance).into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
