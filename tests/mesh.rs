//! Meshes, bodies from meshes, and a tool for them, in lock step.

pub use crate::app::force_n as force;
use crate::app::{lockstep_app, spawn_tool};
use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, MeshPlugin, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyRegion, MeshCellSize, MeshShape, SimulatedBody};
use palpate_haptics::{Reading, ScriptedDevice};

/// Radius of the ball, m.
pub const RADIUS: f64 = 0.06;

/// Returns an app in lock step with mesh assets.
pub fn mesh_app() -> App {
    let mut app = lockstep_app();
    app.add_plugins((AssetPlugin::default(), MeshPlugin));
    app
}

/// Returns a ball of [`RADIUS`], centred at the origin.
#[must_use]
pub fn ball() -> Mesh {
    Sphere::new(RADIUS as f32).mesh().ico(20).unwrap_or_else(|_| Sphere::new(RADIUS as f32).mesh().build())
}

/// Returns a mesh of corners and triangles.
#[must_use]
pub fn mesh_of(corners: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners.to_vec())
        .with_inserted_indices(Indices::U32(triangles.iter().flatten().copied().collect()))
}

/// Triangles of a box whose corner `i` is at +x if bit 0 of `i` is set, at +y for bit 1, at +z for bit 2.
pub const BOX: [[u32; 3]; 12] = [
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
];

/// Returns a box from `low` to `high`, with the corners in the order of [`BOX`].
#[must_use]
pub fn cuboid(low: Vec3, high: Vec3) -> Mesh {
    let corner = |i: u32| {
        let at = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
        [at(0), at(1), at(2)]
    };
    mesh_of(&(0..8).map(corner).collect::<Vec<_>>(), &BOX)
}

/// Returns two meshes as one.
#[must_use]
pub fn both(mut a: Mesh, b: &Mesh) -> Mesh {
    // Cannot fail: both have positions and indices.
    let _ = a.merge(b);
    a
}

/// Returns `mesh` without its first ten triangles.
#[must_use]
pub fn torn(mut mesh: Mesh) -> Mesh {
    let left = mesh.indices().map(|indices| indices.iter().skip(30).map(|i| i as u32).collect());
    mesh.insert_indices(Indices::U32(left.unwrap_or_default()));
    mesh
}

/// Adds `mesh` to the app's assets.
pub fn add(app: &mut App, mesh: Mesh) -> Handle<Mesh> {
    app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh)
}

/// Replaces the mesh of `handle`.
pub fn replace(app: &mut App, handle: &Handle<Mesh>, mesh: Mesh) {
    // Cannot fail for a handle of `add`.
    let _ = app.world_mut().resource_mut::<Assets<Mesh>>().insert(handle, mesh);
}

/// Returns a device that presses the top of a ball at the origin to a depth of 6 mm within 0.3 s.
#[must_use]
pub fn presser() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let depth = 0.007 * (n as f64 / 300.0).min(1.0) - 0.001;
        Ok(Reading::at(DVec3::new(0.002, RADIUS + 0.005 - depth, 0.001)))
    })
}

/// Spawns a tool with that device.
pub fn hand(app: &mut App) -> Entity {
    spawn_tool(app, presser)
}

/// Spawns a body of `mesh`, which must be closed, with eight cells along its longest side, fixed below −[`RADIUS`]/2.
pub fn spawn(app: &mut App, mesh: Mesh) -> Entity {
    let mesh = add(app, mesh);
    spawn_of(app, mesh)
}

/// Spawns that body of an existing mesh.
pub fn spawn_of(app: &mut App, mesh: Handle<Mesh>) -> Entity {
    let floor = BodyRegion::HalfSpace { point_m: DVec3::Y * -0.5 * RADIUS, outward: DVec3::Y };
    let shape = MeshShape { cells: MeshCellSize::Along(8), strict: true, ..MeshShape::new(mesh) };
    let shape = DeformableBody::Mesh(shape);
    app.world_mut().spawn((shape, FixedRegion::Regions(vec![floor]))).id()
}

/// Returns the simulated body of an entity.
#[must_use]
pub fn body(app: &App, entity: Entity) -> Option<&SimulatedBody> {
    app.world().get::<SimulatedBody>(entity)
}

/// Returns positions or normals of the mesh that an entity shows; empty without one.
#[must_use]
pub fn shown(app: &App, entity: Entity, normals: bool) -> Vec<Vec3> {
    let id = if normals { Mesh::ATTRIBUTE_NORMAL } else { Mesh::ATTRIBUTE_POSITION };
    let mesh = app.world().get::<Mesh3d>(entity);
    let mesh = mesh.and_then(|mesh| app.world().resource::<Assets<Mesh>>().get(&mesh.0));
    match mesh.and_then(|mesh| mesh.attribute(id)) {
        Some(VertexAttributeValues::Float32x3(values)) => {
            values.iter().map(|v| Vec3::from_array(*v)).collect()
        }
        _ => Vec::new(),
    }
}

/// Number of writes to meshes.
#[derive(Resource, Default)]
pub struct Written(pub usize);

/// Starts to count the writes to meshes.
pub fn count_writes(app: &mut App) {
    app.init_resource::<Written>().add_systems(
        Last,
        |mut events: MessageReader<AssetEvent<Mesh>>, mut written: ResMut<Written>| {
            written.0 += events.read().filter(|e| matches!(e, AssetEvent::Modified { .. })).count();
        },
    );
}

/// Returns the number of writes since the last call.
pub fn take_writes(app: &mut App) -> usize {
    std::mem::take(&mut app.world_mut().resource_mut::<Written>().0)
}
