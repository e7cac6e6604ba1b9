//! Recognition of volume files, and reading from paths.

use crate::{gmsh, grid, vtk};
use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat};
use std::path::Path;

#[test]
fn format_is_recognised_by_content_before_the_extension() {
    let of = |name: &str, bytes: &[u8]| TetrahedralFormat::recognize(Path::new(name), bytes);
    assert_eq!(of("a.vtk", b"$MeshFormat\n2.2 0 8\n"), Some(TetrahedralFormat::Gmsh));
    assert_eq!(of("a", b"$Comments\n"), Some(TetrahedralFormat::Gmsh));
    assert_eq!(of("a", b"# vtk DataFile Version 3.0\n"), Some(TetrahedralFormat::Vtk));
    assert_eq!(of("a.vtk", b"<?xml version=\"1.0\"?>\n<VTKFile type"), Some(TetrahedralFormat::Vtu));
    assert_eq!(of("a", b"\xef\xbb\xbf\n<VTKFile>"), Some(TetrahedralFormat::Vtu));
    assert_eq!(of("a.MSH", b""), Some(TetrahedralFormat::Gmsh));
    assert_eq!(of("a.b.Vtu", b""), Some(TetrahedralFormat::Vtu));
    assert_eq!(of("a.1.node", b"8 3 0 0"), Some(TetrahedralFormat::TetGenNode));
    assert_eq!(of("a.1.ele", b"8 4 0"), Some(TetrahedralFormat::TetGenEle));
    assert_eq!(of("a.xml", b"<?xml version=\"1.0\"?>"), None);
    assert_eq!(of("a.stl", b"solid"), None);
}

#[test]
fn reads_file_by_its_path() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("a.msh", gmsh::version_2(&grid::cube(), gmsh::Mode::Big, true)),
        ("a", vtk::file(&grid::cube(), true, true)),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        grid::assert_cube(&TetrahedralFile::read(&path).unwrap(), 7, 2);
    }
    let path = folder.path().join("a.dcm");
    let error = TetrahedralFile::read(&path).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::CannotBeRead { path: missing, .. } if *missing == path),
        "{error}"
    );
    std::fs::write(&path, b"DICM").unwrap();
    let error = TetrahedralFile::read(&path).unwrap_err();
    assert!(matches!(error, MeshFileError::VolumeFormatNotKnown { .. }), "{error}");
    assert!(error.to_string().contains("the extension must be msh, vtk, vtu, node or ele"), "{error}");
}

#[test]
#[cfg(not(feature = "vtu"))]
fn names_the_feature_that_reads_vtu() {
    let error = TetrahedralFile::from_bytes(b"<VTKFile>", TetrahedralFormat::Vtu, None).unwrap_err();
    assert!(matches!(error, MeshFileError::NeedsReader { feature: "vtu", .. }), "{error}");
}
