//! The meshes of the app, as bodies see them.

use super::mesh_source::Source;
use super::shape::{DeformableBody, MeshShape};
use crate::fault::MeshFault;
use bevy::asset::LoadState;
use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// The meshes of the app, and which of them have changed.
#[derive(SystemParam)]
pub(super) struct Meshes<'w, 's> {
    assets: Option<Res<'w, Assets<Mesh>>>,
    server: Option<Res<'w, AssetServer>>,
    events: Option<Res<'w, Messages<AssetEvent<Mesh>>>>,
    cursor: Local<'s, MessageCursor<AssetEvent<Mesh>>>,
    changed: Local<'s, Vec<AssetId<Mesh>>>,
}

impl Meshes<'_, '_> {
    /// Notes which have changed since the last call, of those that `is_wanted`; not what bodies are drawn by, which changes
    /// whenever they move. What is new is waited for where it is wanted.
    pub(super) fn update(&mut self, is_wanted: impl Fn(AssetId<Mesh>) -> bool) {
        self.changed.clear();
        let Some(events) = &self.events else { return };
        let id = |event: &AssetEvent<Mesh>| match event {
            AssetEvent::Modified { id } => Some(*id),
            _ => None,
        };
        self.changed.extend(self.cursor.read(events).filter_map(id).filter(|id| is_wanted(*id)));
    }

    /// Whether the mesh of `shape` was found changed when it was last looked for.
    pub(super) fn has_changed(&self, shape: &DeformableBody) -> bool {
        shape.mesh().is_some_and(|shape| self.changed.contains(&shape.mesh.id()))
    }

    /// What is to be filled; `None` while it is being loaded.
    pub(super) fn source(&self, shape: &MeshShape) -> Result<Option<Source>, MeshFault> {
        let assets = self.assets.as_ref().ok_or(MeshFault::NoMeshes)?;
        if let Some(mesh) = assets.get(&shape.mesh) {
            return Source::read(mesh, shape).map(Some);
        }
        match self.server.as_ref().and_then(|server| server.get_load_state(&shape.mesh)) {
            Some(LoadState::Failed(error)) => Err(MeshFault::NotLoaded(error.to_string())),
            _ => Ok(None),
        }
    }
}
