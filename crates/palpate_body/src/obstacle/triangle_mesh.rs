//! Signed distance from a triangle mesh.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use parry3d_f64::query::{PointQuery, PointQueryWithLocation};
use parry3d_f64::shape::{Triangle, TrianglePointLocation};
use std::collections::BTreeMap;

/// Triangles with the normals of their faces, edges and vertices, and a bounding volume tree.
pub(crate) struct TriangleMesh {
    vertices_m: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
    face_normals: Vec<DVec3>,
    /// Of the edges from corner 0 to 1, 1 to 2 and 0 to 2.
    edges: Vec<[Feature; 3]>,
    vertices: Vec<Feature>,
    bvh: Bvh,
    size_m: f64,
    is_closed: bool,
    is_convex: bool,
    /// Thickness of an open mesh behind its triangles, m.
    thickness_m: f64,
}

/// An edge or a vertex.
#[derive(Clone, Copy, Default)]
struct Feature {
    /// Mean of the normals of the adjacent faces. At a vertex they are weighted by angle, which makes the sign of the
    /// distance correct (J. A. Baerentzen and H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243).
    normal: DVec3,
    is_border: bool,
}

/// Area of a triangle, relative to the square of its longest edge, up to which it is omitted.
const DEGENERATE: f64 = 1e-12;
/// Distance, relative to the size of the mesh, up to which a point counts as being on an edge.
const ON_EDGE: f64 = 1e-12;
/// Deviation from 1 of the cosine between a face and the mean normal of an edge or vertex in the same plane.
const FLAT: f64 = 1e-12;
/// Thickness of an open mesh, relative to its size.
const SHELL: f64 = 0.05;

impl std::fmt::Debug for TriangleMesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TriangleMesh").field("triangles", &self.triangles.len()).finish_non_exhaustive()
    }
}

impl PartialEq for TriangleMesh {
    fn eq(&self, other: &Self) -> bool {
        self.vertices_m == other.vertices_m
            && self.triangles == other.triangles
            && (self.is_convex, self.thickness_m) == (other.is_convex, other.thickness_m)
    }
}

impl TriangleMesh {
    /// Creates a mesh from triangles, counter-clockwise as seen from outside. Coincident vertices are merged and
    /// degenerate triangles omitted. A closed mesh that encloses a negative volume is turned. `None` if no triangle
    /// remains.
    pub(super) fn new(vertices_m: &[DVec3], triangles: &[[usize; 3]], is_convex: bool) -> Option<Self> {
        let (vertices_m, merged) = merge_coincident(vertices_m);
        let corners_m = |t: &[usize; 3]| t.map(|vertex| vertices_m[vertex]);
        let mut triangles: Vec<[usize; 3]> = triangles
            .iter()
            .map(|t| t.map(|vertex| merged[vertex]))
            .filter(|t| {
                let [a, b, c] = corners_m(t);
                let longest2 = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
                (b - a).cross(c - a).length() > DEGENERATE * longest2
            })
            .collect();
        let first = *triangles.first()?;
        let mut beside: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        let directed = |&[a, b, c]: &[usize; 3]| [(a, b), (b, c), (c, a)];
        for (index, t) in triangles.iter().enumerate() {
            directed(t).into_iter().for_each(|edge| beside.entry(edge).or_default().push(index));
        }
        // An edge of two triangles of consistent winding.
        let opposite =
            |(a, b): (usize, usize)| match (&beside[&(a, b)][..], beside.get(&(b, a)).map(Vec::as_slice)) {
                (&[_], Some(&[other])) => Some(other),
                _ => None,
            };
        let is_closed = is_convex || beside.keys().all(|edge| opposite(*edge).is_some());
        let origin = corners_m(&first)[0];
        let volume_m3: f64 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners_m(t).map(|x| x - origin);
                a.dot(b.cross(c))
            })
            .sum();
        let is_inside_out = is_closed && volume_m3 < 0.0;
        let outward = if is_inside_out { -1.0 } else { 1.0 };
        let face_normals: Vec<DVec3> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners_m(t);
                outward * (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let edge = |index: usize, edge: (usize, usize)| {
            let other = opposite(edge);
            let normal = face_normals[index] + other.map_or(DVec3::ZERO, |other| face_normals[other]);
            let is_border = other.is_none() && !is_closed;
            Feature { normal: normal.try_normalize().unwrap_or(face_normals[index]), is_border }
        };
        let edges: Vec<[Feature; 3]> =
            triangles.iter().enumerate().map(|(index, t)| directed(t).map(|of| edge(index, of))).collect();
        let mut vertices = vec![Feature::default(); vertices_m.len()];
        for (index, t) in triangles.iter().enumerate() {
            for corner in 0..3 {
                let [at, next, last] = [0, 1, 2].map(|i| vertices_m[t[(corner + i) % 3]]);
                let vertex = &mut vertices[t[corner]];
                vertex.normal += (next - at).angle_between(last - at) * face_normals[index];
                vertex.is_border |=
                    edges[index][corner].is_border || edges[index][(corner + 2) % 3].is_border;
            }
        }
        for (index, t) in triangles.iter().enumerate() {
            for &vertex in t {
                let normal = vertices[vertex].normal;
                vertices[vertex].normal = normal.try_normalize().unwrap_or(face_normals[index]);
            }
        }
        if is_inside_out {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        // The edges of a turned triangle: 0 to 2, 2 to 1, 1 to 0 of the given one.
        let edges =
            edges.into_iter().map(|[ab, bc, ca]| if is_inside_out { [ca, bc, ab] } else { [ab, bc, ca] });
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners_m(t);
                Aabb::new(a.min(b).min(c), a.max(b).max(c))
            })
            .collect();
        let low = boxes.iter().fold(origin, |low, of| low.min(of.mins));
        let high = boxes.iter().fold(origin, |high, of| high.max(of.maxs));
        let size_m = (high - low).length();
        Some(Self {
            edges: edges.collect(),
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            vertices_m,
            triangles,
            face_normals,
            vertices,
            size_m,
            is_closed,
            is_convex,
            thickness_m: SHELL * size_m,
        })
    }

    pub(super) fn is_closed(&self) -> bool {
        self.is_closed
    }

    pub(super) fn thickness_m(&self) -> f64 {
        self.thickness_m
    }

    pub(super) fn with_thickness(&self, thickness_m: f64) -> Self {
        Self {
            vertices_m: self.vertices_m.clone(),
            triangles: self.triangles.clone(),
            face_normals: self.face_normals.clone(),
            edges: self.edges.clone(),
            vertices: self.vertices.clone(),
            bvh: self.bvh.clone(),
            thickness_m,
            ..*self
        }
    }

    /// Distance of the farthest vertex from `center_m`, m.
    pub(super) fn reach_m(&self, center_m: DVec3) -> f64 {
        let used = self.triangles.iter().flatten().map(|&vertex| self.vertices_m[vertex]);
        used.map(|x| x.distance(center_m)).fold(0.0, f64::max)
    }

    /// Distance of `x_m`, m, negative inside, and the outward unit normal; `None` if it is farther than `within_m`.
    ///
    /// An open mesh is a shell of a certain thickness behind its triangles. A point in the shell is inside, unless it
    /// lies beside the border. The shell has no side walls.
    pub(super) fn gap_m(&self, x_m: DVec3, within_m: f64) -> Option<(f64, DVec3)> {
        let corners_m = |triangle: usize| self.triangles[triangle].map(|vertex| self.vertices_m[vertex]);
        // Points deep inside are far from the surface.
        let reach_m = match self.is_closed {
            true if self.bvh.root_aabb().contains_local_point(x_m) => f64::INFINITY,
            true => within_m,
            false => within_m + self.thickness_m,
        };
        let (triangle, (_, (nearest_m, location))) = self.bvh.find_best(
            reach_m,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(x_m, true),
            |leaf, _| {
                let [a, b, c] = corners_m(leaf as usize);
                let (projection, location) =
                    Triangle::new(a, b, c).project_local_point_and_get_location(x_m, false);
                Some((projection.point.distance(x_m), (projection.point, location)))
            },
        )?;
        let triangle = triangle as usize;
        let face = self.face_normals[triangle];
        let feature = match location {
            TrianglePointLocation::OnVertex(corner) => {
                self.vertices[self.triangles[triangle][corner as usize]]
            }
            TrianglePointLocation::OnEdge(edge, _) => self.edges[triangle][edge as usize],
            TrianglePointLocation::OnFace(..) | TrianglePointLocation::OnSolid => {
                let height_m = (x_m - corners_m(triangle)[0]).dot(face);
                let is_on_face = height_m.abs() <= ON_EDGE * self.size_m;
                let at_border = location.barycentric_coordinates().filter(|_| is_on_face);
                match at_border.and_then(|weights| self.feature_at(triangle, weights)) {
                    Some(feature) if !feature.is_border => return Some((height_m, feature.normal)),
                    _ => return Some(self.behind_or(height_m, face)),
                }
            }
        };
        // An edge between triangles in one plane is part of the face.
        if !feature.is_border && feature.normal.dot(face) > 1.0 - FLAT {
            let height_m = (x_m - corners_m(triangle)[0]).dot(face);
            return Some(self.behind_or(height_m, face));
        }
        let (away, on_m) = (x_m - nearest_m, ON_EDGE * self.size_m);
        let distance_m = away.length();
        if distance_m <= on_m {
            let height_m = (x_m - corners_m(triangle)[0]).dot(face);
            return Some((
                if self.is_closed { height_m.clamp(-on_m, on_m) } else { distance_m },
                feature.normal,
            ));
        }
        let is_beside = feature.is_border && (away - away.dot(face) * face).length() > 1e3 * on_m;
        let is_outside =
            away.dot(feature.normal) >= 0.0 || is_beside || self.is_convex && self.is_beyond_a_plane(x_m);
        if is_outside {
            return Some((distance_m, away / distance_m));
        }
        Some(self.behind_or(-distance_m, -away / distance_m))
    }

    /// The edge or vertex of a triangle at the given weights of its corners, if the place is on one.
    fn feature_at(&self, triangle: usize, weights: [f64; 3]) -> Option<Feature> {
        let is_zero = weights.map(|weight| weight <= ON_EDGE);
        match is_zero {
            [false, false, true] => Some(self.edges[triangle][0]),
            [true, false, false] => Some(self.edges[triangle][1]),
            [false, true, false] => Some(self.edges[triangle][2]),
            _ => {
                let corner = is_zero.iter().position(|zero| !zero)?;
                let others = is_zero.iter().filter(|zero| **zero).count();
                (others == 2).then(|| self.vertices[self.triangles[triangle][corner]])
            }
        }
    }

    /// Gap and normal at the signed distance `height_m` from the triangles. Behind the shell of an open mesh it is the
    /// distance from the shell's back.
    fn behind_or(&self, height_m: f64, normal: DVec3) -> (f64, DVec3) {
        if self.is_closed || height_m >= -self.thickness_m {
            (height_m, normal)
        } else {
            (-height_m - self.thickness_m, -normal)
        }
    }

    fn is_beyond_a_plane(&self, x_m: DVec3) -> bool {
        let mut planes = self.triangles.iter().zip(&self.face_normals);
        planes.any(|(t, normal)| (x_m - self.vertices_m[t[0]]).dot(*normal) > 0.0)
    }
}

/// The distinct positions in the order of their first occurrence, and the index of that of each vertex.
fn merge_coincident(vertices_m: &[DVec3]) -> (Vec<DVec3>, Vec<usize>) {
    let (mut distinct, mut known) = (Vec::new(), BTreeMap::new());
    let merged = vertices_m
        .iter()
        .map(|x| {
            // Minus zero becomes zero.
            let key = (*x + DVec3::ZERO).to_array().map(f64::to_bits);
            *known.entry(key).or_insert_with(|| {
                distinct.push(*x);
                distinct.len() - 1
            })
        })
        .collect();
    (distinct, merged)
}
