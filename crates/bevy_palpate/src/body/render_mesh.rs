//! The picture of a body: a mesh that follows its nodes, every frame.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use glam::{DAffine3, DVec3, Vec3A};
use palpate_body::{Body, Skin};

/// The mesh that a body has been given, and what it shows.
#[derive(Debug, Default)]
pub(crate) struct RenderMesh {
    pub(super) mesh: Handle<Mesh>,
    /// What the entity showed before.
    pub(super) replaced: Option<Handle<Mesh>>,
    /// Whether the mesh has the body's vertices.
    pub(super) is_current: bool,
    /// The nodes before the last model step, m; none if there has been no step.
    before_m: Vec<DVec3>,
    /// The nodes as they are shown, m, and the entity's place.
    shown_m: Vec<DVec3>,
    place: GlobalTransform,
    pub(super) positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

/// A node that is nearer than that to where it is shown has not moved, m: less than single precision can show of any body, and
/// more than what is left of one that has come to rest.
const MOTION_TOLERANCE_M: f64 = 1e-9;

impl RenderMesh {
    /// What the entity showed before it was given this.
    pub(super) fn replaced(&self) -> Option<&Handle<Mesh>> {
        self.replaced.as_ref()
    }

    /// Whether it is what an entity shows.
    pub(super) fn is_shown_by(&self, mesh: &Mesh3d) -> bool {
        self.mesh == mesh.0
    }

    /// The same mesh, to be written anew for a body of another shape.
    pub(super) fn of_another_shape(self) -> Self {
        Self { mesh: self.mesh, replaced: self.replaced, ..Self::default() }
    }

    /// The nodes of `body` as they are shown, m.
    pub(super) fn nodes_m<'a>(&'a self, body: &'a Body) -> &'a [DVec3] {
        let x = body.positions_m();
        if self.shown_m.len() == x.len() { &self.shown_m } else { x }
    }

    /// Notes where the nodes are before a model step.
    pub(crate) fn begin_step(&mut self, body: &Body) {
        self.before_m.clear();
        self.before_m.extend_from_slice(body.positions_m());
    }

    /// The nodes have been put elsewhere: there is nothing between.
    pub(super) fn forget_step(&mut self) {
        self.before_m.clear();
    }

    /// Moves what is shown to `share` of the way through the last model step; whether anything moved.
    pub(super) fn move_nodes(&mut self, body: &Body, share: f64, place: &GlobalTransform) -> bool {
        let x = body.positions_m();
        let mut moved = self.place != *place || self.shown_m.len() != x.len();
        self.place = *place;
        self.shown_m.resize(x.len(), DVec3::ZERO);
        for (index, shown) in self.shown_m.iter_mut().enumerate() {
            // To the bit where it is if it has not moved, whatever the share; `lerp` is not.
            let between = |before: &DVec3| *before + (x[index] - *before) * share;
            let at = self.before_m.get(index).map_or(x[index], between);
            if at.distance_squared(*shown) > MOTION_TOLERANCE_M * MOTION_TOLERANCE_M {
                (*shown, moved) = (at, true);
            }
        }
        moved
    }

    /// Writes vertices and normals, in the frame of the entity.
    pub(super) fn write(&mut self, body: &Body, skin: Option<&mut Skin>) {
        let affine = self.place.affine();
        let to_local = affine.inverse();
        // What is flattened has no frame of its own; such a transform is refused, and what was drawn stays.
        if !(to_local.matrix3.is_finite() && to_local.translation.is_finite()) {
            return;
        }
        let to_local =
            DAffine3 { matrix3: to_local.matrix3.as_dmat3(), translation: to_local.translation.as_dvec3() };
        match skin {
            Some(skin) => {
                self.positions.resize(skin.vertices(), [0.0; 3]);
                self.normals.resize(skin.vertices(), [0.0; 3]);
                // The lists are as long as they must be.
                let _ = skin.deform(&self.shown_m, &to_local, &mut self.positions, &mut self.normals);
            }
            None => self.write_surface(body, &to_local),
        }
    }

    /// A body that is drawn as it is touched: every vertex with the mean normal of its triangles.
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

    /// Copies vertices and normals into `mesh`, if it has as many.
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

    /// A mesh with vertices and normals as they are, and what else `source` has: colours, texture coordinates.
    pub(super) fn make_mesh(&self, triangles: &[[usize; 3]], source: Option<&Mesh>) -> Mesh {
        let usage = RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD;
        let mut mesh = source.cloned().unwrap_or_else(|| Mesh::new(PrimitiveTopology::TriangleList, usage));
        mesh.asset_usage = usage;
        // It moves with the nodes, not with joints.
        mesh.remove_attribute(Mesh::ATTRIBUTE_JOINT_INDEX);
        mesh.remove_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT);
        mesh.insert_indices(Indices::U32(triangles.iter().flatten().map(|&vertex| vertex as u32).collect()));
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, self.positions.clone());
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals.clone());
        mesh
    }
}
