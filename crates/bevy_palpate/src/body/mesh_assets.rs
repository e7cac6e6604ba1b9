//! The mesh assets of bodies.

use super::mesh_source::Source;
use super::shape::{DeformableBody, MeshShape};
use crate::fault::MeshFault;
use bevy::asset::LoadState;
use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// The mesh assets of the app, and those that have changed.
#[derive(SystemParam)]
pub(super) struct Meshes<'w, 's> {
    assets: Option<Res<'w, Assets<Mesh>>>,
    server: Option<Res<'w, AssetServer>>,
    events: Option<Res<'w, Messages<AssetEvent<Mesh>>>>,
    cursor: Local<'s, MessageCursor<AssetEvent<Mesh>>>,
    changed: Local<'s, Vec<AssetId<Mesh>>>,
}

impl Meshes<'_, '_> {
    /// Collects the assets for which `is_source` is true and that have changed since the last call. Meshes that show bodies change in
    /// every frame and are left out. Added assets are detected by [`Self::source`].
    pub(super) fn update(&mut self, is_source: impl Fn(AssetId<Mesh>) -> bool) {
        self.changed.clear();
        let Some(events) = &self.events else { return };
        let id = |event: &AssetEvent<Mesh>| match event {
            AssetEvent::Modified { id } => Some(*id),
            _ => None,
        };
        self.changed.extend(self.cursor.read(events).filter_map(id).filter(|id| is_source(*id)));
    }

    /// Whether the mesh of `shape` had changed at the last call of [`Self::update`].
    pub(super) fn has_changed(&self, shape: &DeformableBody) -> bool {
        shape.mesh().is_some_and(|shape| self.changed.contains(&shape.mesh.id()))
    }

    /// The mesh of `shape`; `None` while it is being loaded.
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
