//! Reads a file as a volume of tetrahedra.

use crate::mesh_file::MeshFileError;
use bevy_palpate::{TetrahedralVolume, volume_of};
use glam::DVec3;
use palpate_files::{TetrahedralFile, TetrahedralFormat};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Number of bytes from which a format is recognised.
const HEAD: u64 = 4096;

/// Content of a file of tetrahedra.
#[derive(Clone, Debug)]
pub struct VolumeFile {
    /// The tetrahedra with their regions.
    pub volume: TetrahedralVolume,
    /// Corners of the bounding box, in the units of the file.
    pub bounds: [DVec3; 2],
    /// The regions, a line each.
    pub list: String,
}

impl VolumeFile {
    /// Reads the file at `path`; `None` if it is not a file of tetrahedra.
    ///
    /// # Errors
    /// [`MeshFileError`] if the file cannot be read.
    pub fn read(path: &Path) -> Result<Option<Self>, MeshFileError> {
        // A file that cannot be opened is reported by the reader of its format.
        let mut head = Vec::new();
        let _ = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
        if TetrahedralFormat::recognize(path, &head).is_none() {
            return Ok(None);
        }
        let file = TetrahedralFile::read(path).map_err(|source| MeshFileError::new(path, &source))?;
        let line = |(index, region): (usize, &palpate_files::TetrahedralRegion)| {
            let count = file.regions.iter().filter(|of| **of as usize == index).count();
            let name = region.name.as_deref().map_or_else(String::new, |name| format!(" {name:?}"));
            format!("region {index}: number {}{name}, {count} tetrahedra\n", region.number)
        };
        let list = file.region_list.iter().enumerate().map(line).collect();
        Ok(Some(Self { volume: volume_of(&file), bounds: file.bounds().map(DVec3::from_array), list }))
    }
}
