//! Reads a file as one mesh.

use bevy::prelude::*;
use bevy_palpate::mesh_of_pieces;
use glam::DVec3;
use palpate_files::{MeshPiece, MeshSelection};
use std::path::Path;

/// Content of a file.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// All selected triangles, transformed by the nodes of the file.
    pub mesh: Mesh,
    /// Corners of the bounding box, in the units of the file.
    pub bounds: [DVec3; 2],
    /// Number of joined primitives.
    pub parts: usize,
}

/// Reason why a file cannot be read as a mesh, with the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFileError(String);

impl MeshFileError {
    pub(crate) fn new(path: &Path, source: &palpate_files::MeshFileError) -> Self {
        Self(format!("{}: {source}", path.display()))
    }
}

impl std::fmt::Display for MeshFileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for MeshFileError {}

impl MeshFile {
    /// Reads the selected primitives of the file at `path`.
    ///
    /// # Errors
    /// [`MeshFileError`] if the file cannot be read, or nothing is selected.
    pub fn read(path: &Path, selection: &MeshSelection) -> Result<Self, MeshFileError> {
        let error = |source: palpate_files::MeshFileError| MeshFileError::new(path, &source);
        let file = palpate_files::MeshFile::read(path).map_err(error)?;
        Ok(join(&file.select(selection).map_err(error)?))
    }

    /// Lists the primitives of the file at `path`, a line each.
    ///
    /// # Errors
    /// [`MeshFileError`] if the file cannot be read.
    pub fn list(path: &Path) -> Result<String, MeshFileError> {
        let file = palpate_files::MeshFile::read(path).map_err(|source| MeshFileError::new(path, &source))?;
        Ok(file.pieces.iter().map(|piece| format!("{piece}\n")).collect())
    }
}

/// Joins `pieces`.
fn join(pieces: &[&MeshPiece]) -> MeshFile {
    let corner = |pick: fn(DVec3, DVec3) -> DVec3| {
        let positions = pieces.iter().flat_map(|piece| &piece.vertices);
        positions.map(|p| Vec3::from_array(*p).as_dvec3()).reduce(pick).unwrap_or_default()
    };
    let bounds = [corner(DVec3::min), corner(DVec3::max)];
    MeshFile { mesh: mesh_of_pieces(pieces), bounds, parts: pieces.len() }
}

#[cfg(test)]
mod tests;
