//! Mesh files of an asset source in memory.

use crate::app::{collect_messages, update_until_done};
use crate::mesh::BOX;
use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::asset::io::{AssetSourceBuilder, AssetSourceId};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticSchedulePlugin, LoopMode};
use std::path::Path;
use std::time::Duration;

/// Half of the box's sides, m: 80 × 40 × 40 mm, 128 g.
pub const HALF: Vec3 = Vec3::new(0.04, 0.02, 0.02);

/// Names and contents of files.
pub type Files<'a> = &'a [(&'a str, Vec<u8>)];

/// A folder in memory. A file with the extension `meta` describes the file of the same name without it.
pub fn folder(files: Files) -> Dir {
    let root = Dir::default();
    for (name, content) in files {
        match name.strip_suffix(".meta") {
            Some(name) => root.insert_meta(Path::new(name), content.clone()),
            None => root.insert_asset(Path::new(name), content.clone()),
        }
    }
    root
}

/// An app whose assets are in `root`, with what `before` and `after` add to it before and after palpate.
pub fn app_in(root: &Dir, before: impl Fn(&mut App), after: impl Fn(&mut App)) -> App {
    let mut app = App::new();
    let root = root.clone();
    app.register_asset_source(
        AssetSourceId::Default,
        AssetSourceBuilder::new(move || Box::new(MemoryAssetReader { root: root.clone() })),
    );
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin));
    before(&mut app);
    app.add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
    after(&mut app);
    collect_messages(&mut app);
    app.finish();
    app.cleanup();
    app
}

/// The mesh at `path`.
pub fn load(app: &App, path: &str) -> Handle<Mesh> {
    app.world().resource::<AssetServer>().load(path.to_owned())
}

/// Updates until the mesh of `handle` is loaded; returns the centre and the size of its bounds.
pub fn bounds(app: &mut App, handle: &Handle<Mesh>) -> (Vec3, Vec3) {
    let is_loaded = |app: &mut App| app.world().resource::<Assets<Mesh>>().contains(handle);
    let state = |app: &App| app.world().resource::<AssetServer>().load_state(handle);
    assert!(update_until_done(app, is_loaded), "{:?}", state(app));
    let mesh = app.world().resource::<Assets<Mesh>>().get(handle).unwrap();
    let points: Vec<Vec3> = mesh
        .attribute(Mesh::ATTRIBUTE_POSITION)
        .and_then(|positions| positions.as_float3())
        .unwrap()
        .iter()
        .map(|x| Vec3::from_array(*x))
        .collect();
    let corner = |pick: fn(Vec3, Vec3) -> Vec3| points.iter().copied().reduce(pick).unwrap();
    let (low, high) = (corner(Vec3::min), corner(Vec3::max));
    (0.5 * (low + high), high - low)
}

/// Corners of a box around `center`.
pub fn corners(center: Vec3, half: Vec3) -> impl Iterator<Item = Vec3> {
    (0..8).map(move |i| {
        center + half * Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 }))
    })
}

/// The box as glTF with the buffer `cube.bin`, placed by the nodes `left` and `right`, 20 cm apart; `right` is twice as large.
pub fn gltf_boxes() -> [Vec<u8>; 2] {
    let mut binary: Vec<u8> =
        corners(Vec3::ZERO, HALF).flat_map(|x| x.to_array()).flat_map(f32::to_le_bytes).collect();
    binary.extend(BOX.as_flattened().iter().flat_map(|corner| corner.to_le_bytes()));
    let text = r#"{
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0, 1] }], "scene": 0,
        "nodes": [
            { "name": "left", "mesh": 0, "translation": [-0.1, 0, 0] },
            { "name": "right", "mesh": 0, "translation": [0.1, 0, 0], "scale": [2, 2, 2] }
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            {
                "bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3",
                "min": [-0.04, -0.02, -0.02], "max": [0.04, 0.02, 0.02]
            },
            { "bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 96 }, { "buffer": 0, "byteOffset": 96, "byteLength": 144 }
        ],
        "buffers": [{ "byteLength": 240, "uri": "cube%20data.bin" }]
    }"#;
    [text.into(), binary]
}
