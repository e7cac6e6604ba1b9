//! The formats of volumes that are read, and how a file is recognised.

use std::path::{Path, PathBuf};

/// The format of a file of tetrahedra.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[non_exhaustive]
pub enum TetrahedralFormat {
    /// Gmsh, versions 2.0 to 2.2, 4.0 and 4.1, text or binary.
    Gmsh,
    /// Legacy VTK, text or binary.
    Vtk,
    /// VTK's unstructured grid in XML.
    Vtu,
    /// The nodes of TetGen. The elements are the companion.
    TetGenNode,
    /// The elements of TetGen. The nodes are the companion.
    TetGenEle,
}

impl TetrahedralFormat {
    /// The format of a file with the name `path` and the content `bytes`. The first bytes count more than the extension. `None` if
    /// neither is known.
    pub fn recognize(path: &Path, bytes: &[u8]) -> Option<Self> {
        let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        if [b"$MeshFormat".as_slice(), b"$Comments", b"$NOD"].iter().any(|word| start.starts_with(word)) {
            return Some(Self::Gmsh);
        }
        if start.starts_with(b"# vtk DataFile") {
            return Some(Self::Vtk);
        }
        let head = &start[..start.len().min(1024)];
        if start.starts_with(b"<") && head.windows(8).any(|word| word == b"<VTKFile") {
            return Some(Self::Vtu);
        }
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        match extension.as_ref().and_then(|extension| extension.to_str()) {
            Some("msh") => Some(Self::Gmsh),
            Some("vtk") => Some(Self::Vtk),
            Some("vtu") => Some(Self::Vtu),
            Some("node") => Some(Self::TetGenNode),
            Some("ele") => Some(Self::TetGenEle),
            _ => None,
        }
    }

    /// Path of the second file of a volume whose first file is `path`: `liver.1.ele` for `liver.1.node`, and the reverse. `None` for
    /// formats of one file.
    pub fn companion_path(self, path: &Path) -> Option<PathBuf> {
        let is_upper = path.extension().is_some_and(|extension| extension.eq("NODE") || extension.eq("ELE"));
        match self {
            Self::TetGenNode => Some(path.with_extension(if is_upper { "ELE" } else { "ele" })),
            Self::TetGenEle => Some(path.with_extension(if is_upper { "NODE" } else { "node" })),
            Self::Gmsh | Self::Vtk | Self::Vtu => None,
        }
    }
}
