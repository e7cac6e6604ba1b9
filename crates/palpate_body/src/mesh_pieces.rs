//! Pieces of a mesh that are not connected.

use crate::{CellLattice, CellSize, ClosedMesh, MeshError};
use glam::DVec3;

/// A piece of a mesh: nothing inside connects it with another piece, however near that is.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPiece {
    /// Indices of its triangles in [`ClosedMesh::triangles`], ascending.
    pub triangles: Vec<usize>,
    /// Enclosed volume, m³.
    pub volume_m3: f64,
    /// Minimum and maximum coordinates of its triangles, m.
    pub bounds_m: [DVec3; 2],
}

/// Which pieces of a mesh become the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PieceSelection {
    /// The piece of the largest volume.
    #[default]
    Largest,
    /// The piece with this index, from 0, in the order of descending volumes.
    Index(usize),
    /// All pieces, as one body.
    All,
}

impl PieceSelection {
    /// Indices of the selected ones of `count` pieces.
    ///
    /// # Errors
    /// [`MeshError::Piece`] for an index that does not exist.
    pub(crate) fn index(self, count: usize) -> Result<Option<usize>, MeshError> {
        match self {
            Self::All => Ok(None),
            Self::Largest => Ok(Some(0)),
            Self::Index(index) if index < count => Ok(Some(index)),
            Self::Index(index) => Err(MeshError::Piece { index, count }),
        }
    }
}

impl ClosedMesh {
    /// The pieces of the mesh, found with cells of size `size`, in the order of descending volumes. Of a mesh of one piece it is all of its
    /// triangles.
    ///
    /// # Errors
    /// As [`CellLattice::fit`], and [`MeshError::TooManyNodes`].
    pub fn pieces(&self, size: CellSize) -> Result<Vec<MeshPiece>, MeshError> {
        self.pieces_of_cells(&CellLattice::fit(self, size)?)
    }

    /// The pieces of the mesh, found with the cells of `lattice`, which are fitted to it.
    pub(crate) fn pieces_of_cells(&self, lattice: &CellLattice<'_>) -> Result<Vec<MeshPiece>, MeshError> {
        let at_vertex = |vertex: usize| self.vertices_m()[vertex];
        let places = self.triangles().iter().map(|t| {
            let [a, b, c] = t.map(at_vertex);
            ((a + b + c) / 3.0 - self.center_m(), (b - a).cross(c - a))
        });
        let (volumes_m3, piece_of) = lattice.pieces(places)?;
        let empty = |&volume_m3: &f64| MeshPiece {
            triangles: Vec::new(),
            volume_m3,
            bounds_m: [DVec3::INFINITY, DVec3::NEG_INFINITY],
        };
        let mut pieces: Vec<MeshPiece> = volumes_m3.iter().map(empty).collect();
        for (index, (t, piece)) in self.triangles().iter().zip(piece_of).enumerate() {
            let MeshPiece { triangles, bounds_m: [low, high], .. } = &mut pieces[piece];
            triangles.push(index);
            for x in t.map(at_vertex) {
                (*low, *high) = (low.min(x), high.max(x));
            }
        }
        pieces.sort_by(|a, b| b.volume_m3.total_cmp(&a.volume_m3));
        Ok(pieces)
    }
}
