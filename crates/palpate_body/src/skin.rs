//! The drawn mesh of a body.

use crate::cell_lattice::Embedding;
use crate::vertex_normals::vertex_normals;
use crate::{BodyError, ClosedMesh, MeshError};
use glam::{DAffine3, DVec3, Vec3A};
use std::collections::BTreeMap;

/// Deformation of a mesh with the nodes of its body ([`crate::MeshBody::skin`]). Positions follow by trilinear
/// weights of a cell, and normals are area-weighted means of the adjacent triangles.
///
/// Coincident vertices share a normal, which makes the surface smooth there. If the mesh has normals
/// ([`ClosedMesh::with_normals`]), only vertices with equal normals share one, so hard edges stay hard.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Nodes of the cells that carry points.
    cells: Vec<[u32; 8]>,
    /// End of each cell's range of points.
    ends: Vec<u32>,
    /// Local coordinates of each point in its cell.
    locals: Vec<[f32; 3]>,
    /// Triangles as indices of points.
    triangles: Vec<[u32; 3]>,
    /// Point of each vertex.
    point_of: Vec<u32>,
    nodes: usize,
    /// Node positions relative to the first node, in the output frame.
    node_at: Vec<Vec3A>,
    at: Vec<Vec3A>,
    normal: Vec<Vec3A>,
}

/// Minimum cosine between equal normals: 2.6°.
const AGREE: f64 = 0.999;

impl Skin {
    pub(crate) fn new(mesh: &ClosedMesh, embedding: &Embedding<'_>) -> Self {
        let grouped = Grouped::new(mesh);
        let of_points: Vec<[usize; 3]> = mesh
            .triangles()
            .iter()
            .filter_map(|&[a, b, c]| {
                let [a, b, c] = [a, b, c].map(|vertex| mesh.point_of(vertex));
                Some([a?, b?, c?])
            })
            .collect();
        let normals = vertex_normals(&of_points, mesh.points_m());
        let mut placed: Vec<(usize, DVec3, usize)> = Vec::with_capacity(grouped.place_m.len());
        for (index, &(place_m, point)) in grouped.place_m.iter().enumerate() {
            let normal = point.map_or(DVec3::ZERO, |point| normals[point]);
            let (cell, local) = embedding.locate(place_m, normal);
            // A vertex without triangles may lie anywhere; it is not visible.
            let local = if point.is_some() { local } else { local.clamp(DVec3::ZERO, DVec3::ONE) };
            placed.push((cell, local, index));
        }
        placed.sort_by_key(|&(cell, _, point)| (cell, point));
        let mut rank = vec![0; placed.len()];
        placed.iter().enumerate().for_each(|(index, (.., point))| rank[*point] = index as u32);
        let (mut cells, mut ends) = (Vec::new(), Vec::new());
        for same in placed.chunk_by(|a, b| a.0 == b.0) {
            cells.push(embedding.cells()[same[0].0].map(|node| node as u32));
            ends.push(ends.last().copied().unwrap_or(0) + same.len() as u32);
        }
        let point_of: Vec<u32> = grouped.of.iter().map(|&point| rank[point]).collect();
        // Sorted by their points, which lie close together in memory.
        let mut triangles: Vec<[u32; 3]> =
            mesh.triangles().iter().map(|t| t.map(|vertex| point_of[vertex])).collect();
        triangles.sort_by_key(|t| t.iter().copied().min());
        let points = placed.len();
        let nodes = embedding.cells().iter().flatten().max().map_or(0, |node| node + 1);
        Self {
            cells,
            ends,
            locals: placed.iter().map(|(_, local, _)| local.as_vec3().to_array()).collect(),
            triangles,
            point_of,
            nodes,
            node_at: vec![Vec3A::ZERO; nodes],
            at: vec![Vec3A::ZERO; points],
            normal: vec![Vec3A::ZERO; points],
        }
    }

    /// Number of vertices of the mesh, the length of the lists that [`Skin::deform`] writes.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.point_of.len()
    }

    /// Writes position and unit normal of every vertex in the given order, for nodes at `positions_m` (m),
    /// transformed by `to_local`. Normals point outward also under a mirroring transform. A vertex without adjacent
    /// area gets the normal (0, 1, 0). Nothing is allocated.
    ///
    /// # Errors
    /// [`BodyError::Length`] or [`MeshError::Length`] if a list does not have one entry for each node or vertex.
    pub fn deform(
        &mut self,
        positions_m: &[DVec3],
        to_local: &DAffine3,
        out_positions: &mut [[f32; 3]],
        out_normals: &mut [[f32; 3]],
    ) -> Result<(), BodyError> {
        let (found, nodes) = (positions_m.len(), self.nodes);
        if found != nodes {
            return Err(BodyError::Length { what: "the list of positions", found, nodes });
        }
        let vertices = self.vertices();
        for (what, found) in [
            ("the list of drawn positions", out_positions.len()),
            ("the list of drawn normals", out_normals.len()),
        ] {
            if found != vertices {
                return Err(MeshError::Length { what, found, vertices }.into());
            }
        }
        let origin = positions_m.first().map_or(DVec3::ZERO, |x| to_local.transform_point3(*x));
        for (at, x) in self.node_at.iter_mut().zip(positions_m) {
            *at = (to_local.transform_point3(*x) - origin).as_vec3a();
        }
        self.place();
        self.turn(if to_local.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 });
        let origin = origin.as_vec3a();
        for ((&point, position), normal) in self.point_of.iter().zip(out_positions).zip(out_normals) {
            *position = (self.at[point as usize] + origin).to_array();
            *normal = self.normal[point as usize].to_array();
        }
        Ok(())
    }

    /// Computes the points from the nodes, cell by cell: x = c₀ + c₁a + c₂b + c₃c + c₁₂ab + c₁₃ac + c₂₃bc + c₁₂₃abc.
    fn place(&mut self) {
        let mut first = 0;
        for (nodes, &end) in self.cells.iter().zip(&self.ends) {
            let n = nodes.map(|node| self.node_at[node as usize]);
            let (c0, c1, c2, c3) = (n[0], n[1] - n[0], n[2] - n[0], n[4] - n[0]);
            let (c12, c13, c23) = (n[3] - n[2] - c1, n[5] - n[4] - c1, n[6] - n[4] - c2);
            let c123 = (n[7] - n[6]) - (n[5] - n[4]) - c12;
            let run = first..end as usize;
            for (at, &[a, b, c]) in self.at[run.clone()].iter_mut().zip(&self.locals[run]) {
                *at = c0 + (c1 + c12 * b + (c13 + c123 * b) * c) * a + (c2 + c23 * c) * b + c3 * c;
            }
            first = end as usize;
        }
    }

    /// Computes the normals from the triangles.
    fn turn(&mut self, sign: f32) {
        self.normal.fill(Vec3A::ZERO);
        for t in &self.triangles {
            let [i, j, k] = t.map(|point| point as usize);
            let (a, b, c) = (self.at[i], self.at[j], self.at[k]);
            let area = (b - a).cross(c - a);
            self.normal[i] += area;
            self.normal[j] += area;
            self.normal[k] += area;
        }
        for normal in &mut self.normal {
            // Areas below (1e-9 m)² are invisible.
            let length2 = normal.length_squared();
            *normal = if length2 > 1e-36 { *normal * (sign / length2.sqrt()) } else { Vec3A::Y };
        }
    }
}

/// Groups of vertices that are drawn as one: coincident and, with given normals, with equal normals.
struct Grouped {
    /// Group of each vertex.
    of: Vec<usize>,
    /// Position of each group relative to the mesh's centre, m, and its welded point, if a triangle uses it.
    place_m: Vec<(DVec3, Option<usize>)>,
}

impl Grouped {
    fn new(mesh: &ClosedMesh) -> Self {
        let mut made = Self { of: Vec::with_capacity(mesh.vertices_m().len()), place_m: Vec::new() };
        // Groups at each welded point, with their normals.
        let mut at_point: BTreeMap<usize, Vec<(DVec3, usize)>> = BTreeMap::new();
        for vertex in 0..mesh.vertices_m().len() {
            let normal = mesh.normals().map_or(DVec3::ZERO, |normals| normals[vertex].normalize_or_zero());
            let group = match mesh.point_of(vertex) {
                Some(point) => {
                    let groups = at_point.entry(point).or_default();
                    let same = |(other, _): &&(DVec3, usize)| *other == normal || other.dot(normal) > AGREE;
                    match groups.iter().find(same) {
                        Some(&(_, group)) => group,
                        None => {
                            groups.push((normal, made.place_m.len()));
                            made.add(mesh.points_m()[point], Some(point))
                        }
                    }
                }
                None => made.add(mesh.vertices_m()[vertex] - mesh.center_m(), None),
            };
            made.of.push(group);
        }
        made
    }

    fn add(&mut self, place_m: DVec3, point: Option<usize>) -> usize {
        self.place_m.push((place_m, point));
        self.place_m.len() - 1
    }
}
