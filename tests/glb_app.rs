//! A body from a GLB file, loaded by the asset server, on no thread of ours.

use bevy::gltf::{Gltf, GltfAssetLabel, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_palpate::SimulatedBody;
use bevy_palpate::prelude::*;
use palpate_tests::app::{Contacts, lockstep_app, step, take_faults};
use palpate_tests::glb::{glb, jpeg, png};
use palpate_tests::mesh::{RADIUS, ball, body, force, hand, shown, spawn_of, torn};

fn app() -> App {
    app_in(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets"))
}

fn app_in(assets: &str) -> App {
    let mut app = lockstep_app();
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
    let body =
        app.world_mut().spawn((DeformableBody::from_mesh(mesh), FixedRegion::Face(BoxFace::Bottom))).id();
    assert!(until(&mut app, |app| app.world().get::<SimulatedBody>(body).is_some()), "it was built");
    let tool = app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id();
    step(&mut app, 40);
    let force = app.world().get::<ToolForce>(tool).unwrap().force_n;
    assert!(force.y > 0.5, "{force}");
    let error = app.world().get::<ForceError>(tool).unwrap().relative.unwrap();
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

#[test]
fn files_with_pictures_in_them_are_bodies_without_a_renderer() {
    let folder = tempfile::tempdir().unwrap();
    for (name, pictures) in [
        ("bare.glb", vec![]),
        ("png.glb", vec![png()]),
        ("jpeg.glb", vec![jpeg()]),
        ("both.glb", vec![png(), jpeg()]),
    ] {
        std::fs::write(folder.path().join(name), glb(&ball(), &pictures)).unwrap();
        let mut app = app_in(folder.path().to_str().unwrap());
        let mesh = load(&app, name);
        let entity = spawn_of(&mut app, mesh);
        let mut said = Vec::new();
        let is_done = until(&mut app, |app| {
            said.extend(take_faults(app));
            body(app, entity).is_some() || !said.is_empty()
        });
        assert!(is_done && said.is_empty(), "{name}: {said:?}");
        // Without normals in the file every triangle has vertices of its own.
        assert_eq!(shown(&app, entity, false).len(), ball().indices().unwrap().len());
    }
}

/// The file changes on disk and is loaded anew while the hand is on the body.
#[test]
fn a_file_that_is_loaded_anew_while_it_is_touched_is_another_body() {
    let folder = tempfile::tempdir().unwrap();
    let write = |mesh: &Mesh| std::fs::write(folder.path().join("ball.glb"), glb(mesh, &[])).unwrap();
    write(&ball());
    let mut app = app_in(folder.path().to_str().unwrap());
    let mesh = load(&app, "ball.glb");
    // What is to be loaded anew has to be held as a whole, unless files are watched.
    let file: Handle<Gltf> = app.world().resource::<AssetServer>().load("ball.glb");
    let entity = spawn_of(&mut app, mesh);
    assert!(until(&mut app, |app| body(app, entity).is_some()));
    let tool = hand(&mut app);
    step(&mut app, 15);
    assert!(force(&app, tool).y > 0.5, "{}", force(&app, tool));
    let epoch = |app: &App| body(app, entity).unwrap().epoch();
    let first = epoch(&app);
    // Another ball, 2 cm lower: the hand is off it.
    write(&ball().translated_by(Vec3::Y * -0.02));
    app.world().resource::<AssetServer>().reload("ball.glb");
    assert!(until(&mut app, |app| epoch(app) > first), "it was built anew");
    step(&mut app, 5);
    assert_eq!(force(&app, tool), DVec3::ZERO);
    assert_eq!(app.world().resource::<Contacts>().0, ["began", "ended"]);
    for x in shown(&app, entity, false) {
        assert!((f64::from((x + 0.02 * Vec3::Y).length()) - RADIUS).abs() < 1e-5, "{x}");
    }
    assert_eq!(take_faults(&mut app), [""; 0]);
    // With holes it is refused, and the body stays as it was.
    let second = epoch(&app);
    write(&torn(ball()));
    app.world().resource::<AssetServer>().reload("ball.glb");
    let mut said = Vec::new();
    assert!(until(&mut app, |app| {
        said.extend(take_faults(app));
        !said.is_empty()
    }));
    assert!(said.len() == 1 && said[0].contains("holes"), "{said:?}");
    assert_eq!(epoch(&app), second);
    drop(file);
}
