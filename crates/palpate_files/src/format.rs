//! The formats that are read, and how a file is recognised.

use std::path::Path;

/// The format of a mesh file.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[non_exhaustive]
pub enum MeshFormat {
    /// glTF 2.0, as GLB or as JSON. The first bytes distinguish them.
    Gltf,
    /// Wavefront OBJ.
    Obj,
    /// STL, binary or text. The length and the first bytes distinguish them.
    Stl,
    /// PLY, binary or text. The header distinguishes them.
    Ply,
}

impl MeshFormat {
    /// The format of a file with the name `path` and the content `bytes`. The first bytes count more than the extension. `None` if
    /// neither is known.
    pub fn recognize(path: &Path, bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"glTF") {
            return Some(Self::Gltf);
        }
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        match extension.as_ref().and_then(|extension| extension.to_str()) {
            Some("glb" | "gltf") => Some(Self::Gltf),
            Some("obj") => Some(Self::Obj),
            Some("stl") => Some(Self::Stl),
            Some("ply") => Some(Self::Ply),
            _ => bytes.trim_ascii_start().starts_with(b"{").then_some(Self::Gltf),
        }
    }
}
