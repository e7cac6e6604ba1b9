//! A mesh file: its pieces, and how to select them.

use crate::error::MeshFileError;
use crate::format::MeshFormat;
use crate::gltf::BufferFiles;
use crate::piece::{MeshPiece, bounds};
use crate::{gltf, obj, ply, stl};
use std::path::{Path, PathBuf};

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
        Self::from_content(bytes, format, folder.map_or(BufferFiles::Rejected, BufferFiles::Folder))
    }

    /// Reads the content of a file. `read_buffer` returns the content of a buffer that is a file of its own; its argument is one of
    /// [`Self::buffer_paths`]. It is called for the buffers that meshes need.
    ///
    /// ```
    /// use palpate_files::{MeshFile, MeshFormat};
    /// use std::collections::HashMap;
    /// use std::path::PathBuf;
    ///
    /// /// Reads a file whose buffers are elsewhere than in a folder.
    /// fn read(gltf: &[u8], archive: &HashMap<PathBuf, Vec<u8>>) -> Result<MeshFile, palpate_files::MeshFileError> {
    ///     MeshFile::from_bytes_with(gltf, MeshFormat::Gltf, &|path| {
    ///         archive.get(path).cloned().ok_or_else(|| std::io::ErrorKind::NotFound.into())
    ///     })
    /// }
    /// ```
    ///
    /// # Errors
    ///
    /// [`MeshFileError`] with the reason; [`MeshFileError::MissingBuffer`] with the error of `read_buffer`.
    pub fn from_bytes_with(
        bytes: &[u8],
        format: MeshFormat,
        read_buffer: &dyn Fn(&Path) -> std::io::Result<Vec<u8>>,
    ) -> Result<Self, MeshFileError> {
        Self::from_content(bytes, format, BufferFiles::Function(read_buffer))
    }

    /// Paths of the buffers of a glTF file that are files of their own, relative to it, each once, in order. Other formats have none. A
    /// buffer that no mesh needs is among them.
    ///
    /// # Errors
    ///
    /// [`MeshFileError::NotValid`] if the file is not glTF.
    pub fn buffer_paths(bytes: &[u8], format: MeshFormat) -> Result<Vec<PathBuf>, MeshFileError> {
        match format {
            MeshFormat::Gltf => Ok(gltf::buffer_paths(bytes)?.into_iter().collect()),
            MeshFormat::Obj | MeshFormat::Stl | MeshFormat::Ply => Ok(Vec::new()),
        }
    }

    fn from_content(bytes: &[u8], format: MeshFormat, files: BufferFiles) -> Result<Self, MeshFileError> {
        let (pieces, format) = match format {
            MeshFormat::Gltf => (gltf::read(bytes, files)?, gltf::NAME),
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
