//! Bevy's loader of glTF and that of palpate in one app.

use bevy::gltf::{Gltf, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_palpate::MeshFileLoader;
use palpate_tests::app::update_until_done;
use palpate_tests::mesh_files::{HALF, app_in, bounds, folder, gltf_boxes, load};

fn add_gltf(app: &mut App) {
    app.add_plugins((ImagePlugin::default(), WorldSerializationPlugin, GltfPlugin::default()));
}

fn add_nothing(_: &mut App) {}

/// Bevy selects between the loaders by the type of the asset, and by the extension for a path with a label.
#[test]
fn both_loaders_of_gltf_serve_one_app() {
    let [text, binary] = gltf_boxes();
    let meta = r#"(meta_format_version: "1.0", asset: Load(
        loader: "bevy_palpate::mesh_files::MeshFileLoader", settings: (selection: Node("right"))))"#;
    let files = [
        ("boxes.gltf", text.clone()),
        ("cube data.bin", binary),
        ("reserved.gltf", text),
        ("reserved.gltf.meta", meta.into()),
    ];
    assert!(meta.contains(MeshFileLoader::type_path()));
    let orders: [[fn(&mut App); 2]; 2] = [[add_gltf, add_nothing], [add_nothing, add_gltf]];
    for [before, after] in orders {
        let mut app = app_in(&folder(&files), before, after);
        let scene: Handle<Gltf> = app.world().resource::<AssetServer>().load("boxes.gltf");
        let primitive = load(&app, "boxes.gltf#Mesh0/Primitive0");
        let (center, size) = bounds(&mut app, &primitive);
        assert!(center.length() < 1e-6 && (size - 2.0 * HALF).length() < 1e-6, "{center} {size}");
        let whole = load(&app, "boxes.gltf");
        assert!((bounds(&mut app, &whole).0 - 0.02 * Vec3::X).length() < 1e-6);
        assert!(update_until_done(&mut app, |app| app.world().resource::<Assets<Gltf>>().contains(&scene)));
    }
    let mut app = app_in(&folder(&files), add_gltf, add_nothing);
    let right = load(&app, "reserved.gltf");
    assert!((bounds(&mut app, &right).0 - 0.1 * Vec3::X).length() < 1e-6);
    let left = load(&app, "reserved.gltf#Piece0");
    assert!((bounds(&mut app, &left).0 + 0.1 * Vec3::X).length() < 1e-6);
}
