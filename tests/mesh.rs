//! Meshes, bodies of them and a hand for them, in lock step.

use crate::app::lockstep_app;
use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, MeshPlugin, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy_palpate::SimulatedBody;
use bevy_palpate::prelude::*;

/// 6 cm in radius.
pub const RADIUS: f64 = 0.06;

/// A lock step app that has meshes.
pub fn mesh_app() -> App {
    let mut app = lockstep_app();
    app.add_plugins((AssetPlugin::default(), MeshPlugin));
    app
}

/// A ball of [`RADIUS`] round the origin.
#[must_use]
pub fn ball() -> Mesh {
    Sphere::new(RADIUS as f32).mesh().ico(20).unwrap_or_else(|_| Sphere::new(RADIUS as f32).mesh().build())
}

/// Corners and triangles as a mesh.
#[must_use]
pub fn mesh_of(corners: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners.to_vec())
        .with_inserted_indices(Indices::U32(triangles.iter().flatten().copied().collect()))
}

/// The triangles of a box whose corner `i` is at +x if bit 0 of `i` is set, at +y for bit 1, at +z for bit 2.
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

/// A box from `low` to `high`, corners in the order of [`BOX`].
#[must_use]
pub fn cuboid(low: Vec3, high: Vec3) -> Mesh {
    let corner = |i: u32| {
        let at = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
        [at(0), at(1), at(2)]
    };
    mesh_of(&(0..8).map(corner).collect::<Vec<_>>(), &BOX)
}

/// Two meshes as one.
#[must_use]
pub fn both(mut a: Mesh, b: &Mesh) -> Mesh {
    // Both have positions and indices alike.
    let _ = a.merge(b);
    a
}

/// `mesh` without its first ten triangles.
#[must_use]
pub fn torn(mut mesh: Mesh) -> Mesh {
    let left = mesh.indices().map(|indices| indices.iter().skip(30).map(|i| i as u32).collect());
    mesh.insert_indices(Indices::U32(left.unwrap_or_default()));
    mesh
}

/// Adds `mesh` to the app's.
pub fn add(app: &mut App, mesh: Mesh) -> Handle<Mesh> {
    app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh)
}

/// Changes the mesh that `handle` names.
pub fn replace(app: &mut App, handle: &Handle<Mesh>, mesh: Mesh) {
    // A handle of `add` may be written to.
    let _ = app.world_mut().resource_mut::<Assets<Mesh>>().insert(handle, mesh);
}

/// Presses the top of a ball at the origin, 6 mm deep within 0.3 s, and stays.
#[must_use]
pub fn presser() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let depth = 0.007 * (n as f64 / 300.0).min(1.0) - 0.001;
        Ok(Reading::at(DVec3::new(0.002, RADIUS + 0.005 - depth, 0.001)))
    })
}

/// A tool with that device.
pub fn hand(app: &mut App) -> Entity {
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || Ok(presser()));
    app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id()
}

/// A body of `mesh` with eight cells along, fixed below −[`RADIUS`]/2.
pub fn spawn(app: &mut App, mesh: Mesh) -> Entity {
    let mesh = add(app, mesh);
    spawn_of(app, mesh)
}

/// The same of a mesh that is there.
pub fn spawn_of(app: &mut App, mesh: Handle<Mesh>) -> Entity {
    let floor = BodyRegion::HalfSpace { point_m: DVec3::Y * -0.5 * RADIUS, outward: DVec3::Y };
    let shape = DeformableBody::Mesh(MeshShape { cells_along_longest_axis: 8, ..MeshShape::new(mesh) });
    app.world_mut().spawn((shape, FixedRegion::Regions(vec![floor]))).id()
}

/// What a tool's device is given, N.
///
/// # Panics
/// When there is no such tool.
#[must_use]
pub fn force(app: &App, tool: Entity) -> DVec3 {
    app.world().entity(tool).get::<ToolForce>().map_or(DVec3::NAN, |force| force.force_n)
}

/// The body of an entity.
#[must_use]
pub fn body(app: &App, entity: Entity) -> Option<&SimulatedBody> {
    app.world().get::<SimulatedBody>(entity)
}

/// Positions or normals of what an entity shows; empty if it shows nothing.
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

/// How often meshes were written, those of bodies among them.
#[derive(Resource, Default)]
pub struct Written(pub usize);

/// Counts from now on.
pub fn count_writes(app: &mut App) {
    app.init_resource::<Written>().add_systems(
        Last,
        |mut events: MessageReader<AssetEvent<Mesh>>, mut written: ResMut<Written>| {
            written.0 += events.read().filter(|e| matches!(e, AssetEvent::Modified { .. })).count();
        },
    );
}

/// The writes since the last call.
pub fn take_writes(app: &mut App) -> usize {
    std::mem::take(&mut app.world_mut().resource_mut::<Written>().0)
}
