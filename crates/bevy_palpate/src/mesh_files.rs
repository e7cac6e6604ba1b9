//! Mesh files as assets.

use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, AssetPath, LoadContext, RenderAssetUsages};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy::tasks::futures::now_or_never;
use palpate_files::{MeshFile, MeshFileError, MeshFormat, MeshPiece, MeshSelection};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Extensions of the files that are read.
const EXTENSIONS: [&str; 5] = ["glb", "gltf", "obj", "stl", "ply"];

/// Loads a [`Mesh`] from a GLB, glTF, OBJ, STL or PLY file, without a renderer and without Bevy's loader of glTF.
/// [`BodyPlugin`](crate::BodyPlugin) adds it.
///
/// The asset is the joined triangles of the file, at the places that its nodes give them, in the unit of the file: set
/// [`MeshShape::metres_per_unit`](crate::MeshShape::metres_per_unit) for a file in millimetres. It has normals if every piece has some, and
/// no colours, materials or pictures. [`palpate_files`] states what is read of each format; compressed glTF needs the
/// features `draco` or `meshopt`. [`MeshFileSettings`] selects a part of the file.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::{BodyRegion, Inclusion, Inclusions, MeshFileSettings, MeshShape, palpate_files::MeshSelection, prelude::*};
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // The whole file.
///     let shape = MeshShape { metres_per_unit: 0.001, ..MeshShape::new(assets.load("liver.stl")) };
///     commands.spawn(DeformableBody::Mesh(shape));
///     // One node of a scene.
///     let node = |settings: &mut MeshFileSettings| settings.selection = MeshSelection::Node("kidney".into());
///     commands.spawn(DeformableBody::from_mesh(assets.load_builder().with_settings(node).load("abdomen.glb")));
///     // Two materials, two tissues.
///     let shape = MeshShape {
///         parts: vec![assets.load("breast.obj#Piece1")],
///         ..MeshShape::new(assets.load("breast.obj#Piece0"))
///     };
///     let tumour = Tissue { youngs_modulus_pa: 100e3, ..default() };
///     let inclusion = Inclusion { region: BodyRegion::Part(0), tissue: tumour };
///     commands.spawn((DeformableBody::Mesh(shape), Inclusions(vec![inclusion])));
/// }
/// ```
///
/// # Pieces
///
/// The labels `Piece0`, `Piece1`, … name the pieces of the file in its order: the primitives of glTF as its nodes place them, the materials
/// of an object of OBJ, the solids of STL. A settings' selection does not change them. `palpate-lab mesh FILE --list` and the scene
/// `your_mesh FILE --list` print the pieces in this order, with their names and materials.
///
/// # Other loaders
///
/// Bevy selects the loader of a path without a label by the type of the asset. A `Handle<Mesh>` of `"liver.glb"` is therefore read by this
/// loader, and a `Handle<Gltf>` by Bevy's, in the same app.
///
/// The loader of a path with a label is selected by the extension, and what another loader claims is left to it. With Bevy's `GltfPlugin`
/// the labels of GLB and glTF files are Bevy's: `"liver.glb#Mesh0/Primitive0"` is a primitive as stored, without the transforms of nodes.
/// A file `liver.glb.meta` next to the file reserves it for this loader, with its labels and its settings:
///
/// ```ron
/// (
///     meta_format_version: "1.0",
///     asset: Load(
///         loader: "bevy_palpate::mesh_files::MeshFileLoader",
///         settings: (selection: Node("liver")),
///     ),
/// )
/// ```
///
/// Bevy identifies an asset by its path and type. A file that is loaded twice with different settings has those of the first load.
#[derive(Clone, Debug, TypePath)]
pub struct MeshFileLoader {
    extensions: Vec<&'static str>,
}

impl Default for MeshFileLoader {
    /// A loader of all formats.
    fn default() -> Self {
        Self { extensions: EXTENSIONS.to_vec() }
    }
}

/// Settings of [`MeshFileLoader`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct MeshFileSettings {
    /// Which pieces of the file are joined; by default all.
    pub selection: MeshSelection,
}

/// The reason why a mesh file is not loaded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshFileLoadError {
    /// The source of the asset cannot be read.
    #[error("the mesh file cannot be read ({0})")]
    CannotBeRead(#[source] io::Error),
    /// The file is compressed, and the decoder is not part of this build.
    #[error(
        "the glTF file is compressed with {extension}; enable the feature `{feature}` of bevy_palpate to decode it"
    )]
    NeedsDecoder {
        /// Name of the glTF extension.
        extension: &'static str,
        /// Feature of this crate that contains the decoder.
        feature: &'static str,
    },
    /// No piece of the file is selected.
    #[error(
        "MeshFileSettings::selection is {selection}, which the file does not contain; it must be one of its pieces: {pieces}"
    )]
    NothingSelected {
        /// What is selected.
        selection: String,
        /// The first pieces of the file.
        pieces: String,
    },
    /// The file is rejected.
    #[error(transparent)]
    File(MeshFileError),
}

impl From<MeshFileError> for MeshFileLoadError {
    fn from(error: MeshFileError) -> Self {
        match error {
            // The features have the same names in both crates.
            MeshFileError::NeedsDecoder { extension, feature } => Self::NeedsDecoder { extension, feature },
            error => Self::File(error),
        }
    }
}

impl AssetLoader for MeshFileLoader {
    type Asset = Mesh;
    type Settings = MeshFileSettings;
    type Error = MeshFileLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &MeshFileSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<Mesh, MeshFileLoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(MeshFileLoadError::CannotBeRead)?;
        let path = context.path().clone();
        let format = MeshFormat::recognize(path.path(), &bytes)
            .ok_or_else(|| MeshFileError::FormatNotKnown { path: path.path().to_owned() })?;
        let mut buffers: HashMap<PathBuf, io::Result<Vec<u8>>> = HashMap::new();
        for relative in MeshFile::buffer_paths(&bytes, format)? {
            let of_source = path.resolve_embed(&AssetPath::from_path(&relative));
            // A missing buffer is an error only if a mesh needs it.
            let content = context.read_asset_bytes(of_source).await.map_err(io::Error::other);
            buffers.insert(relative, content);
        }
        let file = MeshFile::from_bytes_with(&bytes, format, &|path| match buffers.get(path) {
            Some(Ok(content)) => Ok(content.clone()),
            Some(Err(error)) => Err(io::Error::new(error.kind(), error.to_string())),
            None => Err(io::ErrorKind::NotFound.into()),
        })?;
        let selected = file.select(&settings.selection).map_err(|_| nothing_selected(&file, settings))?;
        let mesh = mesh_of_pieces(&selected);
        for (index, piece) in file.pieces.iter().enumerate() {
            context.add_labeled_asset(format!("Piece{index}"), mesh_of_pieces(&[piece]));
        }
        Ok(mesh)
    }

    fn extensions(&self) -> &[&str] {
        &self.extensions
    }
}

fn nothing_selected(file: &MeshFile, settings: &MeshFileSettings) -> MeshFileLoadError {
    const MAX_LISTED: usize = 8;
    let mut pieces: Vec<String> = file.pieces.iter().take(MAX_LISTED).map(ToString::to_string).collect();
    if file.pieces.len() > MAX_LISTED {
        pieces.push(format!("and {} more", file.pieces.len() - MAX_LISTED));
    }
    let selection = settings.selection.to_string();
    MeshFileLoadError::NothingSelected { selection, pieces: pieces.join("; ") }
}

/// Returns `pieces` of a mesh file as one triangle list, in the unit of the file. It has normals if each piece has some.
#[must_use]
pub fn mesh_of_pieces(pieces: &[&MeshPiece]) -> Mesh {
    let (mut positions, mut normals, mut corners) = (Vec::new(), Vec::<[f32; 3]>::new(), Vec::new());
    for piece in pieces {
        let first = positions.len() as u32;
        positions.extend_from_slice(&piece.vertices);
        normals.extend(piece.normals.iter().flatten());
        corners.extend(piece.triangles.iter().flatten().map(|corner| first + corner));
    }
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
    if normals.len() == positions.len() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    }
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    mesh.insert_indices(Indices::U32(corners));
    mesh
}

/// Adds the loader, if the app has assets and does not have it yet. Extensions that other loaders claim are left to them.
pub(crate) fn add_mesh_file_loader(app: &mut App) {
    let Some(server) = app.world().get_resource::<AssetServer>() else { return };
    let own = server.get_asset_loader_with_type_name(MeshFileLoader::type_path());
    if matches!(now_or_never(own), Some(Ok(_))) {
        return;
    }
    // The loader of a plugin that is not finished is claimed already, and its future waits.
    let is_free = |extension: &&str| {
        matches!(now_or_never(server.get_asset_loader_with_extension(extension)), Some(Err(_)))
    };
    let extensions = EXTENSIONS.into_iter().filter(is_free).collect();
    app.register_asset_loader(MeshFileLoader { extensions });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_decoder_names_the_feature_of_this_crate() {
        let error = MeshFileError::NeedsDecoder { extension: "KHR_draco_mesh_compression", feature: "draco" };
        let error = MeshFileLoadError::from(error);
        assert!(matches!(error, MeshFileLoadError::NeedsDecoder { feature: "draco", .. }), "{error}");
        assert!(error.to_string().contains("feature `draco` of bevy_palpate"), "{error}");
    }

    #[test]
    fn joined_mesh_has_normals_if_each_piece_has_some() {
        let with = MeshPiece {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: Some(vec![[0.0, 0.0, 1.0]; 3]),
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        };
        let without = MeshPiece { normals: None, ..with.clone() };
        let both = mesh_of_pieces(&[&with, &with]);
        assert_eq!(both.attribute(Mesh::ATTRIBUTE_NORMAL).map(|normals| normals.len()), Some(6));
        assert_eq!(both.indices().map(|i| i.iter().collect()), Some(vec![0, 1, 2, 3, 4, 5]));
        let mixed = mesh_of_pieces(&[&with, &without]);
        assert!(mixed.attribute(Mesh::ATTRIBUTE_NORMAL).is_none());
        assert_eq!(mixed.count_vertices(), 6);
    }
}
