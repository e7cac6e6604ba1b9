//! Bodies from GLB files of the asset server, with loops in lock step.

use bevy::gltf::{Gltf, GltfAssetLabel, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_palpate::prelude::*;
use bevy_palpate::{ForceError, HapticFaultKind, MeshFault, SimulatedBody};
use palpate_body::{BodyError, MeshError};
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{
    assert_no_faults, contacts, lockstep_app, spawn_tool, step, take_kinds, update_until_done,
};
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

/// Updates until there are faults; returns their kinds.
fn next_kinds(app: &mut App) -> Vec<HapticFaultKind> {
    let mut kinds = Vec::new();
    assert!(update_until_done(app, |app| {
        kinds.extend(take_kinds(app));
        !kinds.is_empty()
    }));
    kinds
}

#[test]
fn organ_is_loaded_built_and_touched() {
    let mut app = app();
    let mesh = load(&app, "meshes/organ.glb");
    let body =
        app.world_mut().spawn((DeformableBody::from_mesh(mesh), FixedRegion::Face(BoxFace::Bottom))).id();
    let is_built = |app: &mut App| app.world().get::<SimulatedBody>(body).is_some();
    assert!(update_until_done(&mut app, is_built), "the body is built");
    // Descends until the force is 1 N.
    let tool = spawn_tool(&mut app, || {
        let mut height = 0.08;
        ScriptedDevice::new(move |_, force_n| {
            height -= if force_n.y < 1.0 { 5e-5 } else { 0.0 };
            Ok(Reading::at(DVec3::Y * height))
        })
    });
    step(&mut app, 40);
    let force = app.world().get::<ToolForce>(tool).unwrap().force_n;
    assert!(force.y > 0.5, "{force}");
    let error = app.world().get::<ForceError>(tool).unwrap().relative.unwrap();
    assert!(error < 5e-3, "{error}");
    assert_no_faults(&mut app);
}

#[test]
fn missing_file_is_reported_once_with_its_path() {
    let mut app = app();
    let mesh = load(&app, "meshes/nothing.glb");
    app.world_mut().spawn(DeformableBody::from_mesh(mesh));
    let kinds = next_kinds(&mut app);
    let [HapticFaultKind::Mesh(MeshFault::NotLoaded(reason))] = &kinds[..] else { panic!("{kinds:?}") };
    assert!(reason.contains("nothing.glb"), "{reason}");
    step(&mut app, 5);
    assert_no_faults(&mut app);
}

#[test]
fn files_with_pictures_become_bodies_without_a_renderer() {
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
        let mut kinds = Vec::new();
        let is_done = update_until_done(&mut app, |app| {
            kinds.extend(take_kinds(app));
            body(app, entity).is_some() || !kinds.is_empty()
        });
        assert!(is_done && kinds.is_empty(), "{name}: {kinds:?}");
        // Without normals in the file every triangle has its own vertices.
        assert_eq!(shown(&app, entity, false).len(), ball().indices().unwrap().len());
    }
}

/// The file changes on disk and is loaded again during contact.
#[test]
fn file_reloaded_during_contact_becomes_another_body() {
    let folder = tempfile::tempdir().unwrap();
    let write = |mesh: &Mesh| std::fs::write(folder.path().join("ball.glb"), glb(mesh, &[])).unwrap();
    write(&ball());
    let mut app = app_in(folder.path().to_str().unwrap());
    let mesh = load(&app, "ball.glb");
    // Without watching files, only an asset with a handle of the whole file is loaded again.
    let file: Handle<Gltf> = app.world().resource::<AssetServer>().load("ball.glb");
    let entity = spawn_of(&mut app, mesh);
    assert!(update_until_done(&mut app, |app| body(app, entity).is_some()));
    let tool = hand(&mut app);
    step(&mut app, 15);
    assert!(force(&app, tool).y > 0.5, "{}", force(&app, tool));
    let epoch = |app: &App| body(app, entity).unwrap().epoch();
    let first = epoch(&app);
    // Another ball, 2 cm lower: the tool does not touch it.
    write(&ball().translated_by(Vec3::Y * -0.02));
    app.world().resource::<AssetServer>().reload("ball.glb");
    assert!(update_until_done(&mut app, |app| epoch(app) > first), "the body is built again");
    step(&mut app, 5);
    assert_eq!(force(&app, tool), DVec3::ZERO);
    assert_eq!(contacts(&app), [Start, End]);
    for x in shown(&app, entity, false) {
        assert!((f64::from((x + 0.02 * Vec3::Y).length()) - RADIUS).abs() < 1e-5, "{x}");
    }
    assert_no_faults(&mut app);
    // A mesh with holes is rejected, and the body stays as it was.
    let second = epoch(&app);
    write(&torn(ball()));
    app.world().resource::<AssetServer>().reload("ball.glb");
    let kinds = next_kinds(&mut app);
    let is_holes =
        matches!(kinds[..], [HapticFaultKind::BuildBody(BodyError::Mesh(MeshError::Holes { .. }))]);
    assert!(is_holes, "{kinds:?}");
    assert_eq!(epoch(&app), second);
    drop(file);
}
