//! A body from a GLB file, loaded by the asset server, on no thread of ours.

use bevy::gltf::{GltfAssetLabel, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_palpate::SimulatedBody;
use bevy_palpate::prelude::*;
use palpate_tests::app::{lockstep_app, step, take_faults};

fn app() -> App {
    let mut app = lockstep_app();
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets");
    app.add_plugins((
        AssetPlugin { file_path: assets.into(), ..default() },
        MeshPlugin,
        ImagePlugin::default(),
        WorldSerializationPlugin,
        GltfPlugin::default(),
    ));
    app.finish();
    app.cleanup();
    app
}

fn load(app: &App, file: &'static str) -> Handle<Mesh> {
    let primitive = GltfAssetLabel::Primitive { mesh: 0, primitive: 0 };
    app.world().resource::<AssetServer>().load(primitive.from_asset(file))
}

/// Updates until `done`, 20,000 times at most; whether it came to that.
fn until(app: &mut App, mut done: impl FnMut(&mut App) -> bool) -> bool {
    (0..20_000).any(|_| {
        app.update();
        std::thread::yield_now();
        done(app)
    })
}

#[test]
fn the_organ_is_loaded_built_and_touched() {
    let mut app = app();
    // Down from above until it is felt.
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
        let mut height = 0.08;
        Ok(ScriptedDevice::new(move |_, force_n| {
            height -= if force_n.y < 1.0 { 5e-5 } else { 0.0 };
            Ok(Reading::at(DVec3::Y * height))
        }))
    });
    let mesh = load(&app, "meshes/organ.glb");
    let body = app.world_mut().spawn((DeformableBody::from_mesh(mesh), FixedRegion::Face(Face::Bottom))).id();
    assert!(until(&mut app, |app| app.world().get::<SimulatedBody>(body).is_some()), "it was built");
    let tool = app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id();
    step(&mut app, 40);
    let force = app.world().get::<ToolForce>(tool).unwrap().force_n;
    assert!(force.y > 0.5, "{force}");
    let error = app.world().get::<LocalModelError>(tool).unwrap().relative.unwrap();
    assert!(error < 5e-3, "{error}");
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_file_that_is_not_there_is_a_fault_that_says_which() {
    let mut app = app();
    let mesh = load(&app, "meshes/nothing.glb");
    app.world_mut().spawn(DeformableBody::from_mesh(mesh));
    let mut said = Vec::new();
    assert!(until(&mut app, |app| {
        said.extend(take_faults(app));
        !said.is_empty()
    }));
    assert!(said[0].contains("cannot be loaded") && said[0].contains("nothing.glb"), "{said:?}");
    step(&mut app, 5);
    assert_eq!(take_faults(&mut app), [""; 0], "it is said once");
}
