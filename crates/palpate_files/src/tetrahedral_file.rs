//! A file of tetrahedra.

use crate::error::MeshFileError;
use crate::tetrahedral_format::TetrahedralFormat;
use crate::volume::{ElementCounts, TetrahedralRegion, Volume};
#[cfg(feature = "vtu")]
use crate::vtu;
use crate::{gmsh, tetgen, vtk};
use std::path::Path;

/// The tetrahedra of a volume file.
///
/// The coordinates have the unit and the axes of the file. No format prescribes a unit; anatomical models are usually in millimetres.
///
/// The order of the corners is that of the file. A tetrahedron `[a, b, c, d]` has the volume ((b − a) × (c − a)) · (d − a) / 6. Gmsh and
/// VTK prescribe a positive one; inverted and flat tetrahedra are passed on.
#[derive(Clone, Debug, PartialEq)]
pub struct TetrahedralFile {
    /// Positions of the vertices, in the unit of the file, in its order. They are finite, and each belongs to a tetrahedron.
    pub vertices: Vec<[f64; 3]>,
    /// Vertices of each tetrahedron, four different ones. At least one tetrahedron, each index below the number of vertices.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Region of each tetrahedron: an index into [`Self::region_list`]. As many as tetrahedra.
    pub regions: Vec<u32>,
    /// The regions that have tetrahedra, by ascending number. At least one.
    pub region_list: Vec<TetrahedralRegion>,
    /// Numbers of elements that were left out, split, or reduced to their corners.
    pub counts: ElementCounts,
}

impl TetrahedralFile {
    /// Reads the file `path`. The second file of a TetGen volume is beside it.
    ///
    /// # Errors
    ///
    /// [`MeshFileError`] with the reason.
    pub fn read(path: &Path) -> Result<Self, MeshFileError> {
        let bytes = std::fs::read(path)
            .map_err(|cause| MeshFileError::CannotBeRead { path: path.to_owned(), cause })?;
        let Some(format) = TetrahedralFormat::recognize(path, &bytes) else {
            return Err(MeshFileError::VolumeFormatNotKnown { path: path.to_owned() });
        };
        let read =
            |path| std::fs::read(&path).map_err(|cause| MeshFileError::MissingCompanion { path, cause });
        let companion = format.companion_path(path).map(read).transpose()?;
        Self::from_bytes(&bytes, format, companion.as_deref())
    }

    /// Reads the content of a file. `companion` is the content of the file that [`TetrahedralFormat::companion_path`] names; formats of
    /// one file ignore it.
    ///
    /// ```
    /// use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat};
    /// use std::collections::HashMap;
    /// use std::path::{Path, PathBuf};
    ///
    /// /// Reads a file that is elsewhere than in a folder.
    /// fn read(path: &Path, archive: &HashMap<PathBuf, Vec<u8>>) -> Result<TetrahedralFile, MeshFileError> {
    ///     let bytes = &archive[path];
    ///     let Some(format) = TetrahedralFormat::recognize(path, bytes) else {
    ///         return Err(MeshFileError::VolumeFormatNotKnown { path: path.to_owned() });
    ///     };
    ///     let companion = format.companion_path(path).and_then(|path| archive.get(&path));
    ///     TetrahedralFile::from_bytes(bytes, format, companion.map(Vec::as_slice))
    /// }
    /// ```
    ///
    /// # Errors
    ///
    /// [`MeshFileError`] with the reason; [`MeshFileError::NeedsCompanion`] if `companion` is `None` and the format has two files.
    pub fn from_bytes(
        bytes: &[u8],
        format: TetrahedralFormat,
        companion: Option<&[u8]>,
    ) -> Result<Self, MeshFileError> {
        let needed = |given, needed| companion.ok_or(MeshFileError::NeedsCompanion { given, needed });
        let volume = match format {
            TetrahedralFormat::Gmsh => gmsh::read(bytes)?,
            TetrahedralFormat::Vtk => vtk::read(bytes)?,
            #[cfg(feature = "vtu")]
            TetrahedralFormat::Vtu => vtu::read(bytes)?,
            #[cfg(not(feature = "vtu"))]
            TetrahedralFormat::Vtu => {
                return Err(MeshFileError::NeedsReader { format: "VTU", feature: "vtu" });
            }
            TetrahedralFormat::TetGenNode => tetgen::read(bytes, needed("node", "ele")?)?,
            TetrahedralFormat::TetGenEle => tetgen::read(needed("ele", "node")?, bytes)?,
        };
        let Volume { vertices, tetrahedra, regions, region_list, counts } = volume;
        Ok(Self { vertices, tetrahedra, regions, region_list, counts })
    }

    /// Smallest and largest coordinates of the vertices, in the unit of the file.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let first = self.vertices.first().copied().unwrap_or_default();
        self.vertices.iter().fold([first, first], |[low, high], point| {
            [
                [low[0].min(point[0]), low[1].min(point[1]), low[2].min(point[2])],
                [high[0].max(point[0]), high[1].max(point[1]), high[2].max(point[2])],
            ]
        })
    }
}
