//! Positions and triangles of a mesh file.

use crate::error::LabError;
use glam::DVec3;
use palpate_files::MeshFile;
use std::path::Path;

/// All triangles of a file, in its units.
pub(super) struct Triangles {
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[usize; 3]>,
}

/// Reads the triangles of a mesh file, with the transforms of its nodes applied.
pub(super) fn read(path: &Path) -> Result<Triangles, LabError> {
    let file = MeshFile::read(path)
        .map_err(|error| LabError::Mesh { path: path.to_owned(), why: error.to_string() })?;
    let mut all = Triangles { positions: Vec::new(), triangles: Vec::new() };
    for piece in &file.pieces {
        let first = all.positions.len();
        all.positions.extend(piece.vertices.iter().map(|x| DVec3::from_array(x.map(f64::from))));
        all.triangles.extend(piece.triangles.iter().map(|t| t.map(|corner| first + corner as usize)));
    }
    Ok(all)
}
