//! Asset plugins for the repository's `assets` and for files of the user.

use bevy::asset::UnapprovedPathMode;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;

/// The plugin for the repository's assets and absolute paths.
pub(crate) fn plugin() -> AssetPlugin {
    AssetPlugin {
        file_path: concat!(env!("CARGO_MANIFEST_DIR"), "/../assets").into(),
        // A scene may load a file of the user.
        unapproved_path_mode: UnapprovedPathMode::Allow,
        ..default()
    }
}

/// Adds the plugins that load meshes without a renderer.
pub(crate) fn add_without_window(app: &mut App) {
    app.add_plugins((plugin(), MeshPlugin));
}
