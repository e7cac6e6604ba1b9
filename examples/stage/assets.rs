//! Where meshes come from: the repository's `assets`, or any file.

use bevy::asset::UnapprovedPathMode;
use bevy::gltf::GltfPlugin;
use bevy::image::{CompressedImageFormatSupport, CompressedImageFormats, ImagePlugin};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;

/// The folder of the repository's assets; a path that begins at the root is taken as it is.
pub(crate) fn plugin() -> AssetPlugin {
    AssetPlugin {
        file_path: concat!(env!("CARGO_MANIFEST_DIR"), "/../assets").into(),
        // A scene may be given a mesh of the user's.
        unapproved_path_mode: UnapprovedPathMode::Allow,
        ..default()
    }
}

/// What reads meshes where nothing is drawn.
pub(crate) fn add_without_window(app: &mut App) {
    app.insert_resource(CompressedImageFormatSupport(CompressedImageFormats::NONE));
    app.add_plugins((
        plugin(),
        MeshPlugin,
        ImagePlugin::default(),
        bevy::world_serialization::WorldSerializationPlugin,
        GltfPlugin::default(),
    ));
}
