//! The mesh and volume assets of bodies.

use super::mesh_source::{self, Source};
use super::shape::{DeformableBody, MeshShape};
use super::tetrahedral_volume::{TetrahedralShape, TetrahedralVolume};
use crate::fault::MeshFault;
use bevy::asset::{AssetLoadError, LoadState, UntypedAssetId};
use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// The mesh and volume assets of the app, and those that have changed.
#[derive(SystemParam)]
pub(super) struct Meshes<'w, 's> {
    assets: Option<Res<'w, Assets<Mesh>>>,
    server: Option<Res<'w, AssetServer>>,
    events: Option<Res<'w, Messages<AssetEvent<Mesh>>>>,
    cursor: Local<'s, MessageCursor<AssetEvent<Mesh>>>,
    changed: Local<'s, Vec<AssetId<Mesh>>>,
    volumes: Option<Res<'w, Assets<TetrahedralVolume>>>,
    volume_events: Option<Res<'w, Messages<AssetEvent<TetrahedralVolume>>>>,
    volume_cursor: Local<'s, MessageCursor<AssetEvent<TetrahedralVolume>>>,
    changed_volumes: Local<'s, Vec<AssetId<TetrahedralVolume>>>,
}

impl Meshes<'_, '_> {
    /// Collects the assets for which `is_source` is true and that have changed since the last call. Meshes that show bodies change in
    /// every frame and are left out. Added assets are detected by [`Self::source`].
    pub(super) fn update(&mut self, is_source: impl Fn(AssetId<Mesh>) -> bool) {
        self.changed_volumes.clear();
        if let Some(events) = &self.volume_events {
            let modified = self.volume_cursor.read(events).filter_map(|event| match event {
                AssetEvent::Modified { id } => Some(*id),
                _ => None,
            });
            self.changed_volumes.extend(modified);
        }
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
        self.changed.iter().any(|id| shape.is_made_of(*id))
            || self.changed_volumes.iter().any(|id| shape.is_volume(*id))
    }

    /// The mesh of `shape` with its parts; `None` while one is being loaded.
    pub(super) fn source(&self, shape: &MeshShape) -> Result<Option<Source>, MeshFault> {
        let assets = self.assets.as_ref().ok_or(MeshFault::NoMeshes)?;
        for handle in shape.handles().filter(|handle| !assets.contains(*handle)) {
            self.check_load(handle.id().untyped())?;
        }
        // The data are copied once all parts are there, not in every frame before.
        let Some(meshes) = shape.handles().map(|handle| assets.get(handle)).collect::<Option<Vec<_>>>()
        else {
            return Ok(None);
        };
        let parts = meshes.into_iter().map(mesh_source::read).collect::<Result<_, _>>()?;
        Source::raw(parts, shape).map(Some)
    }

    /// The volume of `shape`; `None` while it is being loaded.
    pub(super) fn volume(&self, shape: &TetrahedralShape) -> Result<Option<Source>, MeshFault> {
        let volumes = self.volumes.as_ref().ok_or(MeshFault::NoMeshes)?;
        match volumes.get(&shape.volume) {
            Some(volume) => Source::volume(volume, shape).map(Some),
            None => self.check_load(shape.volume.id().untyped()).map(|()| None),
        }
    }

    /// Rejects an asset that failed to load.
    fn check_load(&self, id: UntypedAssetId) -> Result<(), MeshFault> {
        let state = self.server.as_ref().and_then(|server| server.get_load_state(id));
        let Some(LoadState::Failed(error)) = state else { return Ok(()) };
        Err(match &*error {
            AssetLoadError::MissingAssetLoader { asset_path, .. } => MeshFault::NoLoader(asset_path.clone()),
            error => MeshFault::NotLoaded(error.to_string()),
        })
    }
}
