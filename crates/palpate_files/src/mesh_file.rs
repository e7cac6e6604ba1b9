//! A mesh file: its pieces, and how to select them.

use crate::error::MeshFileError;
use crate::format::MeshFormat;
use crate::piece::{MeshPiece, bounds};
use crate::{gltf, obj, ply, stl};
use std::path::Path;

/// The triangles of a mesh file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFile {
    /// The pieces as placed, in the order of the nodes (glTF) or of the file. At least one, each with at least one triangle.
    pub pieces: Vec<MeshPiece>,
}

impl MeshFile {
    /// Reads the file `path`. Buffers of a glTF file are relative to it.
    ///
    /// # Errors
    ///
    /// [`MeshFileError`] with the reason.
    pub fn read(path: &Path) -> Result<Self, MeshFileError> {
        let bytes = std::fs::read(path)
            .map_err(|cause| MeshFileError::CannotBeRead { path: path.to_owned(), cause })?;
        let Some(format) = MeshFormat::recognize(path, &bytes) else {
            return Err(MeshFileError::FormatNotKnown { path: path.to_owned() });
        };
        Self::from_bytes(&bytes, format, path.parent())
    }

    /// Reads the content of a file. Buffers of a glTF file that are files of their own are relative to `folder`, and are not reachable
    /// without it.
    ///
    /// # Errors
    ///
    /// [`MeshFileError`] with the reason.
    pub fn from_bytes(
        bytes: &[u8],
        format: MeshFormat,
        folder: Option<&Path>,
    ) -> Result<Self, MeshFileError> {
        let (pieces, format) = match format {
            MeshFormat::Gltf => (gltf::read(bytes, folder)?, gltf::NAME),
            MeshFormat::Obj => (obj::read(bytes)?, obj::NAME),
            MeshFormat::Stl => (stl::read(bytes)?, stl::NAME),
            MeshFormat::Ply => (ply::read(bytes)?, ply::NAME),
        };
        if pieces.is_empty() {
            return Err(MeshFileError::NoTriangles { format });
        }
        Ok(Self { pieces })
    }

    /// Pieces of the mesh with the index `mesh` in the file, at all places of it.
    pub fn of_mesh(&self, mesh: usize) -> impl Iterator<Item = &MeshPiece> {
        self.pieces.iter().filter(move |piece| piece.mesh == mesh)
    }

    /// Pieces that the nodes with the name `node` place. Nodes below them are not included.
    pub fn of_node(&self, node: &str) -> impl Iterator<Item = &MeshPiece> {
        self.pieces.iter().filter(move |piece| piece.node.as_deref() == Some(node))
    }

    /// Number of triangles of all pieces.
    pub fn triangle_count(&self) -> usize {
        self.pieces.iter().map(|piece| piece.triangles.len()).sum()
    }

    /// Smallest and largest coordinates of all vertices, in the unit of the file. `None` without vertices. NaN is left out.
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        bounds(self.pieces.iter().flat_map(|piece| &piece.vertices))
    }
}
