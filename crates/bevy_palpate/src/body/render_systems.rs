//! Assigns a mesh to every body, and updates its vertices in every frame.

use super::shape::DeformableBody;
use super::simulated::{SimulatedBody, SourceMesh};
use crate::model_time::ModelOverstep;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;

/// Assigns a mesh to every new body, if the app has mesh assets. A body with a [`Mesh3d`] of its own keeps it, unless it is the mesh from
/// which the body was built.
pub(super) fn assign_meshes(
    mut commands: Commands,
    meshes: Option<ResMut<Assets<Mesh>>>,
    mut bodies: Query<
        (Entity, &DeformableBody, &mut SimulatedBody, Option<&Mesh3d>),
        Or<(Added<SimulatedBody>, Changed<Mesh3d>)>,
    >,
) {
    let Some(mut meshes) = meshes else { return };
    for (entity, shape, mut simulated, shown) in &mut bodies {
        let is_source = |shown: &&Mesh3d| shape.mesh().is_some_and(|shape| shape.mesh == shown.0);
        if shown.is_some_and(|shown| !is_source(&shown)) {
            continue;
        }
        let simulated = simulated.bypass_change_detection();
        if !meshes.contains(&simulated.drawn.mesh) {
            let pose = simulated.pose;
            simulated.drawn.move_nodes(&simulated.body, 1.0, &pose);
            simulated.drawn.write(&simulated.body, simulated.skin.as_mut());
            let mesh = simulated.make_mesh(&meshes);
            (simulated.drawn.mesh, simulated.drawn.is_current) = (meshes.add(mesh), true);
        }
        simulated.drawn.replaced = shown.map(|shown| shown.0.clone());
        commands.entity(entity).try_insert(Mesh3d(simulated.drawn.mesh.clone()));
    }
}

/// Moves the vertices of every body's mesh to the nodes as interpolated between the last two model steps. The mesh of an unmoved body is
/// not changed, so it is not uploaded. Does not allocate.
pub(super) fn update_meshes(
    meshes: Option<ResMut<Assets<Mesh>>>,
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    transforms: TransformHelper,
    overstep: ModelOverstep,
) {
    let Some(mut meshes) = meshes else { return };
    let share = overstep.share();
    for (entity, mut simulated) in &mut bodies {
        let simulated = simulated.bypass_change_detection();
        let pose = transforms.compute_global_transform(entity).unwrap_or_default();
        let has_moved = simulated.drawn.move_nodes(&simulated.body, share, &pose);
        if (has_moved || !simulated.drawn.is_current) && meshes.contains(&simulated.drawn.mesh) {
            simulated.drawn.write(&simulated.body, simulated.skin.as_mut());
            simulated.update_asset(&mut meshes);
        }
    }
}

impl SimulatedBody {
    /// Writes the buffers into the mesh asset, or replaces the asset if it has other vertices.
    fn update_asset(&mut self, meshes: &mut Assets<Mesh>) {
        let is_written = self.drawn.is_current
            && meshes.get_mut(&self.drawn.mesh).is_some_and(|mut mesh| self.drawn.copy_to(&mut mesh));
        if !is_written {
            let mesh = self.make_mesh(meshes);
            if let Some(mut old) = meshes.get_mut(&self.drawn.mesh) {
                *old = mesh;
            }
        }
        self.drawn.is_current = true;
    }

    /// Returns a mesh of the body with the attributes of its source mesh; if the source has changed, with those of the drawn mesh.
    fn make_mesh(&self, meshes: &Assets<Mesh>) -> Mesh {
        let has_positions = |mesh: &Mesh| {
            let positions = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION);
            positions.is_ok_and(|positions| positions.len() == self.drawn.positions.len())
        };
        let of_source = self.source_mesh(meshes).filter(has_positions);
        let source =
            of_source.or_else(|| meshes.get(&self.drawn.mesh).filter(|mesh| has_positions(mesh)).cloned());
        let triangles = match &self.closed {
            Some(joined) => joined.mesh.triangles(),
            None => &self.body.surface().triangles,
        };
        self.drawn.make_mesh(triangles, source.filter(|_| self.skin.is_some()))
    }

    /// The mesh of which the body is made, with the parts of its surface; `None` if it is not available. Attributes that a part lacks are left
    /// out.
    fn source_mesh(&self, meshes: &Assets<Mesh>) -> Option<Mesh> {
        let shape = self.built_shape.mesh().filter(|_| self.source == SourceMesh::Same)?;
        let joined = &self.closed.as_ref()?.joined;
        let mut parts = shape.handles().enumerate().filter(|(index, _)| joined.contains(index));
        let mut mesh = meshes.get(parts.next()?.1)?.clone();
        for (_, part) in parts {
            mesh.merge(meshes.get(part)?).ok()?;
        }
        let vertices = mesh.count_vertices();
        let is_partial = |values: &VertexAttributeValues| values.len() != vertices;
        let partial: Vec<_> =
            mesh.attributes().filter(|(_, values)| is_partial(values)).map(|(of, _)| of.id).collect();
        for attribute in partial {
            mesh.remove_attribute(attribute);
        }
        Some(mesh)
    }
}
