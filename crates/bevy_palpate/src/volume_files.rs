//! Files of tetrahedra as assets.

use crate::body::TetrahedralVolume;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, AssetPath, LoadContext};
use bevy::prelude::*;
use bevy::tasks::futures::now_or_never;
use glam::DVec3;
use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat, TetrahedralRegion};
use std::io;
use thiserror::Error;

/// Extensions of the files that are read.
const EXTENSIONS: [&str; 5] = ["msh", "vtk", "vtu", "node", "ele"];

/// Loads a [`TetrahedralVolume`] from a Gmsh file (`.msh`, versions 2 and 4), a VTK file (`.vtk`, `.vtu`), or the two files of TetGen (`.node` and
/// `.ele`, of which either is the path). [`BodyPlugin`](crate::BodyPlugin) adds it.
///
/// The volume has the unit of the file: set [`TetrahedralShape::metres_per_unit`](crate::TetrahedralShape::metres_per_unit) for a file in millimetres. Its
/// regions are those of the file, by ascending number: physical groups of Gmsh, cell data of VTK, attributes of TetGen. [`palpate_files`] states what is
/// read of each format. VTU files need the feature `vtu`.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::{TetrahedralShape, prelude::*};
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let shape = TetrahedralShape { metres_per_unit: 0.001, ..TetrahedralShape::new(assets.load("liver.msh")) };
///     commands.spawn((DeformableBody::Tetrahedra(shape), Tissue::LIVER, FixedRegion::Face(BoxFace::Bottom)));
/// }
/// ```
#[derive(Clone, Debug, Default, TypePath)]
pub struct TetrahedralFileLoader;

/// The reason why a file of tetrahedra is not loaded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TetrahedralFileLoadError {
    /// The source of the asset cannot be read.
    #[error("the file cannot be read ({0})")]
    CannotBeRead(#[source] io::Error),
    /// The reader of the format is not part of this build.
    #[error(
        "{format} files need the feature `{feature}` of bevy_palpate; enable it, or convert the file to Gmsh or legacy VTK"
    )]
    NeedsReader {
        /// Name of the format.
        format: &'static str,
        /// Feature of this crate that contains the reader.
        feature: &'static str,
    },
    /// The file is rejected.
    #[error(transparent)]
    File(MeshFileError),
}

impl From<MeshFileError> for TetrahedralFileLoadError {
    fn from(error: MeshFileError) -> Self {
        match error {
            // The feature has the same name in both crates.
            MeshFileError::NeedsReader { format, feature } => Self::NeedsReader { format, feature },
            error => Self::File(error),
        }
    }
}

impl AssetLoader for TetrahedralFileLoader {
    type Asset = TetrahedralVolume;
    type Settings = ();
    type Error = TetrahedralFileLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<TetrahedralVolume, TetrahedralFileLoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(TetrahedralFileLoadError::CannotBeRead)?;
        let path = context.path().clone();
        let format = TetrahedralFormat::recognize(path.path(), &bytes)
            .ok_or_else(|| MeshFileError::VolumeFormatNotKnown { path: path.path().to_owned() })?;
        let companion = match format.companion_path(path.path()) {
            Some(beside) => {
                let of_source = AssetPath::from_path(&beside).with_source(path.source().clone_owned());
                let read = context.read_asset_bytes(of_source).await.map_err(io::Error::other);
                Some(read.map_err(|cause| MeshFileError::MissingCompanion { path: beside, cause })?)
            }
            None => None,
        };
        Ok(volume_of(&TetrahedralFile::from_bytes(&bytes, format, companion.as_deref())?))
    }

    fn extensions(&self) -> &[&str] {
        &EXTENSIONS
    }
}

/// Returns the volume of a file, in its unit.
#[must_use]
pub fn volume_of(file: &TetrahedralFile) -> TetrahedralVolume {
    let name = |region: &TetrahedralRegion| region.name.clone().unwrap_or_else(|| region.number.to_string());
    TetrahedralVolume {
        vertices: file.vertices.iter().map(|x| DVec3::from_array(*x)).collect(),
        tetrahedra: file.tetrahedra.clone(),
        regions: file.regions.clone(),
        region_names: file.region_list.iter().map(name).collect(),
    }
}

/// Adds the loader, if the app has assets and does not have it yet.
pub(crate) fn add_tetrahedral_file_loader(app: &mut App) {
    let Some(server) = app.world().get_resource::<AssetServer>() else { return };
    let own = server.get_asset_loader_with_type_name(TetrahedralFileLoader::type_path());
    if !matches!(now_or_never(own), Some(Ok(_))) {
        app.register_asset_loader(TetrahedralFileLoader);
    }
}
