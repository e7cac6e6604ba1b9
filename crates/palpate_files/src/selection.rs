//! Which pieces of a mesh file are used.

use crate::error::MeshFileError;
use crate::mesh_file::MeshFile;
use crate::piece::MeshPiece;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Which pieces of a mesh file are used.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum MeshSelection {
    /// All pieces.
    #[default]
    All,
    /// The pieces of the mesh with this index, at all places of it.
    Mesh(usize),
    /// The pieces that the nodes with this name place. Nodes below them are not included.
    Node(String),
}

impl MeshSelection {
    /// The selection of the mesh with the index `mesh`, otherwise of the nodes with the name `node`, otherwise of everything.
    pub fn new(mesh: Option<usize>, node: Option<&str>) -> Self {
        match (mesh, node) {
            (Some(index), _) => Self::Mesh(index),
            (None, Some(name)) => Self::Node(name.to_owned()),
            (None, None) => Self::All,
        }
    }
}

impl fmt::Display for MeshSelection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("a triangle"),
            Self::Mesh(index) => write!(f, "mesh {index}"),
            Self::Node(name) => write!(f, "a node with the name {name}"),
        }
    }
}

impl MeshFile {
    /// The selected pieces, at least one.
    ///
    /// # Errors
    ///
    /// [`MeshFileError::NothingSelected`] if there is none.
    pub fn select(&self, selection: &MeshSelection) -> Result<Vec<&MeshPiece>, MeshFileError> {
        let pieces: Vec<&MeshPiece> = match selection {
            MeshSelection::All => self.pieces.iter().collect(),
            MeshSelection::Mesh(index) => self.of_mesh(*index).collect(),
            MeshSelection::Node(name) => self.of_node(name).collect(),
        };
        if pieces.is_empty() {
            return Err(MeshFileError::NothingSelected { selection: selection.to_string() });
        }
        Ok(pieces)
    }
}
