//! Reads a file as one mesh.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
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
    fn new(path: &Path, source: &palpate_files::MeshFileError) -> Self {
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

/// Joins `pieces`. The mesh has normals if all of them have some.
fn join(pieces: &[&MeshPiece]) -> MeshFile {
    let (mut positions, mut normals, mut corners) = (Vec::new(), Vec::<[f32; 3]>::new(), Vec::new());
    for piece in pieces {
        let first = positions.len() as u32;
        positions.extend_from_slice(&piece.vertices);
        normals.extend(piece.normals.iter().flatten());
        corners.extend(piece.triangles.iter().flatten().map(|corner| first + corner));
    }
    let corner = |pick: fn(DVec3, DVec3) -> DVec3| {
        positions.iter().map(|p| Vec3::from_array(*p).as_dvec3()).reduce(pick).unwrap_or_default()
    };
    let bounds = [corner(DVec3::min), corner(DVec3::max)];
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
    if normals.len() == positions.len() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    }
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    mesh.insert_indices(Indices::U32(corners));
    MeshFile { mesh, bounds, parts: pieces.len() }
}

#[cfg(test)]
mod tests;
