//! The glTF extensions that a file may require.

use super::document::Document;
use crate::error::MeshFileError;

/// Extensions that are read.
const READ: [&str; 4] = [
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
];

/// Beginnings of the names of extensions that change no surface.
const WITHOUT_EFFECT: [&str; 8] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_animation_",
    "KHR_xmp",
];

/// Rejects a document that requires an extension which is not read and may change the surface.
pub(super) fn check(document: &Document) -> Result<(), MeshFileError> {
    let is_known =
        |name: &str| READ.contains(&name) || WITHOUT_EFFECT.iter().any(|start| name.starts_with(start));
    match document.extensions_required.iter().find(|name| !is_known(name)) {
        Some(extension) => Err(MeshFileError::ExtensionNotKnown { extension: extension.clone() }),
        None => Ok(()),
    }
}
