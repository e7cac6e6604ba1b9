//! Triangles of a mesh file.

use palpate_body::MeshPart;
use palpate_files::{MeshFile, MeshFileError, MeshSelection};

/// The selected triangles of `file`, joined, in its units.
///
/// # Errors
/// [`MeshFileError`] if nothing is selected.
pub(crate) fn join(file: &MeshFile, selection: &MeshSelection) -> Result<MeshPart, MeshFileError> {
    let mut joined = MeshPart::default();
    for piece in file.select(selection)? {
        let first = joined.vertices.len();
        joined.vertices.extend(&piece.vertices);
        joined.triangles.extend(piece.triangles.iter().map(|t| t.map(|corner| first + corner as usize)));
    }
    Ok(joined)
}
