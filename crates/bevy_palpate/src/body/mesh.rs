//! The picture of a body: a mesh whose vertices are its surface nodes.

use super::SimulatedBody;
use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;

/// The mesh that a body has been given, and the vertices it shows.
#[derive(Clone, Debug, Default)]
pub(super) struct Picture {
    mesh: Handle<Mesh>,
    /// Which shape of the body the mesh was made for.
    shape: u64,
    shown: Vec<[f32; 3]>,
}

impl Picture {
    pub(super) fn is_shown_by(&self, mesh: &Mesh3d) -> bool {
        self.mesh == mesh.0
    }
}

/// Gives every new body a mesh, if the app has meshes. A body that brings its own [`Mesh3d`] keeps it.
pub(super) fn give_meshes(
    mut commands: Commands,
    meshes: Option<ResMut<Assets<Mesh>>>,
    mut bodies: Query<(Entity, &mut SimulatedBody), (Added<SimulatedBody>, Without<Mesh3d>)>,
    transforms: TransformHelper,
) {
    let Some(mut meshes) = meshes else { return };
    for (entity, mut simulated) in &mut bodies {
        let place = transforms.compute_global_transform(entity).unwrap_or_default();
        let shown: Vec<[f32; 3]> = vertices(&simulated, &place).collect();
        let mesh = meshes.add(make_mesh(&simulated, &shown));
        commands.entity(entity).try_insert(Mesh3d(mesh.clone()));
        simulated.picture = Picture { mesh, shape: simulated.shape, shown };
    }
}

/// Moves the vertices of every body's mesh to their nodes. A mesh whose body has not moved is not touched, so
/// nothing is uploaded for it.
pub(super) fn write_meshes(
    meshes: Option<ResMut<Assets<Mesh>>>,
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    transforms: TransformHelper,
) {
    let Some(mut meshes) = meshes else { return };
    for (entity, mut simulated) in &mut bodies {
        let place = transforms.compute_global_transform(entity).unwrap_or_default();
        if vertices(&simulated, &place).eq(simulated.picture.shown.iter().copied()) {
            continue;
        }
        let mut picture = std::mem::take(&mut simulated.picture);
        picture.shown.clear();
        picture.shown.extend(vertices(&simulated, &place));
        if let Some(mut mesh) = meshes.get_mut(&picture.mesh) {
            match mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION) {
                Some(VertexAttributeValues::Float32x3(positions))
                    if picture.shape == simulated.shape && positions.len() == picture.shown.len() =>
                {
                    positions.copy_from_slice(&picture.shown);
                    mesh.compute_normals();
                }
                _ => *mesh = make_mesh(&simulated, &picture.shown),
            }
            picture.shape = simulated.shape;
        }
        simulated.picture = picture;
    }
}

fn make_mesh(simulated: &SimulatedBody, shown: &[[f32; 3]]) -> Mesh {
    let surface = simulated.body.surface();
    let indices = surface.triangles.iter().flatten().map(|&v| v as u32).collect();
    let usage = RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD;
    Mesh::new(PrimitiveTopology::TriangleList, usage)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, shown.to_vec())
        .with_inserted_indices(Indices::U32(indices))
        .with_computed_normals()
}

/// The vertices in the frame of the entity at `place`.
fn vertices<'a>(
    simulated: &'a SimulatedBody,
    place: &GlobalTransform,
) -> impl Iterator<Item = [f32; 3]> + 'a {
    let to_local = place.affine().inverse();
    let (surface, x) = (simulated.body.surface(), simulated.body.positions_m());
    let at = |&point: &usize| surface.points[point].of(x).as_vec3();
    surface.vertices.iter().map(move |vertex| to_local.transform_point3(at(vertex)).to_array())
}
