//! The render mesh of a body, which follows its nodes in every frame.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use glam::{DAffine3, DVec3, Vec3A};
use palpate_body::{Body, Skin};

/// The mesh that shows a body, with the buffers to update it.
#[derive(Debug, Default)]
pub(crate) struct RenderMesh {
    pub(super) mesh: Handle<Mesh>,
    /// The mesh that this one replaced on the entity.
    pub(super) replaced: Option<Handle<Mesh>>,
    /// Whether the mesh has the body's vertices.
    pub(super) is_current: bool,
    /// Nodes before the last model step, m; empty before the first step.
    before_m: Vec<DVec3>,
    /// Nodes as drawn, m, world frame.
    shown_m: Vec<DVec3>,
    /// Pose of the entity as drawn.
    pose: GlobalTransform,
    pub(super) positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

/// Displacement below which a node counts as unmoved, m: below the resolution of single precision for any body, above the residual motion
/// of a body at rest.
const MOTION_TOLERANCE_M: f64 = 1e-9;

impl RenderMesh {
    /// The mesh that this one replaced on the entity.
    pub(super) fn replaced(&self) -> Option<&Handle<Mesh>> {
        self.replaced.as_ref()
    }

    /// Whether `mesh` is this mesh.
    pub(super) fn is_shown_by(&self, mesh: &Mesh3d) -> bool {
        self.mesh == mesh.0
    }

    /// The same mesh with empty buffers, for a body of another shape.
    pub(super) fn for_new_shape(self) -> Self {
        Self { mesh: self.mesh, replaced: self.replaced, ..Self::default() }
    }

    /// Nodes of `body` as drawn, m.
    pub(super) fn nodes_m<'a>(&'a self, body: &'a Body) -> &'a [DVec3] {
        let x = body.positions_m();
        if self.shown_m.len() == x.len() { &self.shown_m } else { x }
    }

    /// Stores the positions of the nodes before a model step.
    pub(crate) fn start_step(&mut self, body: &Body) {
        self.before_m.clear();
        self.before_m.extend_from_slice(body.positions_m());
    }

    /// Discards the stored positions, because the nodes were displaced without a motion.
    pub(super) fn discard_step(&mut self) {
        self.before_m.clear();
    }

    /// Interpolates the drawn nodes at `share` of the last model step, 0 to 1. Returns whether a node or the entity moved.
    pub(super) fn move_nodes(&mut self, body: &Body, share: f64, pose: &GlobalTransform) -> bool {
        let x = body.positions_m();
        let mut moved = self.pose != *pose || self.shown_m.len() != x.len();
        self.pose = *pose;
        self.shown_m.resize(x.len(), DVec3::ZERO);
        for (index, shown) in self.shown_m.iter_mut().enumerate() {
            // Unlike `lerp`, returns the exact position of a node that has not moved, for every share.
            let between = |before: &DVec3| *before + (x[index] - *before) * share;
            let at = self.before_m.get(index).map_or(x[index], between);
            if at.distance_squared(*shown) > MOTION_TOLERANCE_M * MOTION_TOLERANCE_M {
                (*shown, moved) = (at, true);
            }
        }
        moved
    }

    /// Writes vertices and normals into the buffers, in the frame of the entity.
    pub(super) fn write(&mut self, body: &Body, skin: Option<&mut Skin>) {
        let affine = self.pose.affine();
        let to_local = affine.inverse();
        // A transform with a zero scale has no inverse. It is rejected elsewhere; the drawn mesh stays as it was.
        if !(to_local.matrix3.is_finite() && to_local.translation.is_finite()) {
            return;
        }
        let to_local =
            DAffine3 { matrix3: to_local.matrix3.as_dmat3(), translation: to_local.translation.as_dvec3() };
        match skin {
            Some(skin) => {
                self.positions.resize(skin.vertices(), [0.0; 3]);
                self.normals.resize(skin.vertices(), [0.0; 3]);
                // Cannot fail: the buffers have the right lengths.
                let _ = skin.deform(&self.shown_m, &to_local, &mut self.positions, &mut self.normals);
            }
            None => self.write_surface(body, &to_local),
        }
    }

    /// Writes the touched surface of `body`: every vertex with the area-weighted mean normal of its triangles.
    fn write_surface(&mut self, body: &Body, to_local: &DAffine3) {
        let surface = body.surface();
        self.positions.resize(surface.vertices.len(), [0.0; 3]);
        self.normals.resize(surface.vertices.len(), [0.0; 3]);
        for (position, &point) in self.positions.iter_mut().zip(&surface.vertices) {
            *position =
                to_local.transform_point3(surface.points[point].of(&self.shown_m)).as_vec3().to_array();
        }
        self.normals.fill([0.0; 3]);
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|vertex| Vec3A::from_array(self.positions[vertex]));
            let area = (b - a).cross(c - a);
            for &vertex in triangle {
                self.normals[vertex] = (Vec3A::from_array(self.normals[vertex]) + area).to_array();
            }
        }
        for normal in &mut self.normals {
            *normal = Vec3A::from_array(*normal).normalize_or(Vec3A::Y).to_array();
        }
    }

    /// Copies vertices and normals into `mesh`. Returns whether it has the same number of them.
    pub(super) fn copy_to(&self, mesh: &mut Mesh) -> bool {
        let lists = [(Mesh::ATTRIBUTE_POSITION, &self.positions), (Mesh::ATTRIBUTE_NORMAL, &self.normals)];
        lists.into_iter().all(|(id, from)| match mesh.try_attribute_mut(id) {
            Ok(VertexAttributeValues::Float32x3(to)) if to.len() == from.len() => {
                to.copy_from_slice(from);
                true
            }
            _ => false,
        })
    }

    /// Returns a mesh with the present vertices and normals, and the other attributes of `source`: colours, texture coordinates.
    pub(super) fn make_mesh(&self, triangles: &[[usize; 3]], source: Option<Mesh>) -> Mesh {
        let usage = RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD;
        let mut mesh = source.unwrap_or_else(|| Mesh::new(PrimitiveTopology::TriangleList, usage));
        mesh.asset_usage = usage;
        // The mesh is deformed by the body, not by joints.
        mesh.remove_attribute(Mesh::ATTRIBUTE_JOINT_INDEX);
        mesh.remove_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT);
        mesh.insert_indices(Indices::U32(triangles.iter().flatten().map(|&vertex| vertex as u32).collect()));
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, self.positions.clone());
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals.clone());
        mesh
    }
}
