//! Damaged volume files of every format: they are read or rejected, without a panic, a wait or an allocation beyond the size of the file.
//!
//! ```sh
//! FILES=100000 cargo test --release -p palpate_files --test suite broken_volumes -- --nocapture
//! ```

use crate::broken::{Random, damage, file_count};
use crate::{gmsh, grid, tetgen, vtk};
use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat};
use std::time::{Duration, Instant};

/// Reads a file, and checks the result and the memory that it takes.
fn read(bytes: &[u8], format: TetrahedralFormat, companion: Option<&[u8]>, of: &str) {
    let mut result = None;
    let measured = allocation_counter::measure(|| {
        result = Some(TetrahedralFile::from_bytes(bytes, format, companion));
    });
    // Compressed arrays expand up to a thousand times.
    let factor = if format == TetrahedralFormat::Vtu { 1000 } else { 100 };
    let limit = (1 << 16) + factor * (bytes.len() + companion.map_or(0, <[u8]>::len)) as u64;
    assert!(measured.bytes_max < limit, "{of}: {} bytes", measured.bytes_max);
    let Some(Ok(file)) = result else { return };
    assert!(!file.tetrahedra.is_empty(), "{of}");
    assert_eq!(file.tetrahedra.len(), file.regions.len(), "{of}");
    let mut is_used = vec![false; file.vertices.len()];
    for tetrahedron in &file.tetrahedra {
        tetrahedron.iter().for_each(|corner| is_used[*corner as usize] = true);
        let is_distinct = (0..4).all(|place| !tetrahedron[..place].contains(&tetrahedron[place]));
        assert!(is_distinct, "{of}");
    }
    assert!(is_used.iter().all(|is_used| *is_used), "{of}");
    assert!(file.vertices.iter().flatten().all(|x| x.is_finite()), "{of}");
    let mut is_used = vec![false; file.region_list.len()];
    file.regions.iter().for_each(|region| is_used[*region as usize] = true);
    assert!(is_used.iter().all(|is_used| *is_used), "{of}");
}

#[expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "reports the slowest input; nothing depends on it"
)]
fn check(bytes: &[u8], format: TetrahedralFormat, companion: Option<&[u8]>) {
    TetrahedralFile::from_bytes(bytes, format, companion).unwrap();
    let mut slowest = (Duration::ZERO, String::new());
    let mut timed = |bytes: &[u8], of: String| {
        let begin = Instant::now();
        read(bytes, format, companion, &of);
        slowest = std::mem::take(&mut slowest).max((begin.elapsed(), of));
    };
    for length in 0..bytes.len() {
        timed(&bytes[..length], format!("length {length}"));
    }
    for seed in 0..file_count() {
        timed(&damage(bytes, 0, &mut Random(seed)), format!("seed {seed}"));
    }
    let count = file_count() + bytes.len() as u64;
    println!("{count} files of {format:?}; the slowest took {:?}, {}", slowest.0, slowest.1);
}

#[test]
fn damaged_gmsh_is_read_or_rejected() {
    for bytes in gmsh::all(&grid::cube(), true) {
        check(&bytes, TetrahedralFormat::Gmsh, None);
    }
}

#[test]
fn damaged_vtk_is_read_or_rejected() {
    for bytes in vtk::all(&grid::mixed(1)) {
        check(&bytes, TetrahedralFormat::Vtk, None);
    }
}

#[test]
#[cfg(feature = "vtu")]
fn damaged_vtu_is_read_or_rejected() {
    for form in crate::vtu::forms().into_iter().step_by(4) {
        check(&crate::vtu::file(&[grid::cube()], form), TetrahedralFormat::Vtu, None);
    }
}

#[test]
fn damaged_tetgen_is_read_or_rejected() {
    let [nodes, elements] = tetgen::files(&grid::cube(), 1).map(String::into_bytes);
    check(&nodes, TetrahedralFormat::TetGenNode, Some(&elements));
    check(&elements, TetrahedralFormat::TetGenEle, Some(&nodes));
}

#[test]
fn rejects_stated_counts_without_content() {
    let header = |binary: &str| format!("$MeshFormat\n{binary} 8\n$EndMeshFormat\n");
    let bytes = |text: &str, numbers: &[u64]| {
        let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
        let mut bytes = text.replace('~', "\x01\0\0\0\n").into_bytes();
        bytes.extend(numbers);
        bytes
    };
    let binary = header("4.1 1").replace("8\n", "8\n~");
    let vtk = "# vtk DataFile Version 5.1\n\nBINARY\nDATASET UNSTRUCTURED_GRID\n";
    let cases = [
        (bytes(&format!("{}$Nodes\n19999999\n", header("2.2 0")), &[]), false),
        (bytes(&format!("{}$Nodes\n1 20000001 1 1", header("4.1 0")), &[]), true),
        (bytes(&format!("{binary}$Nodes\n"), &[1, 19_999_999, 1, 1, 3, 0, 19_999_999]), false),
        (bytes(&format!("{binary}$Nodes\n"), &[u64::MAX >> 1, u64::MAX >> 1, 1, 1]), true),
        (bytes(&format!("{binary}$Entities\n"), &[0, 0, 0, u64::MAX >> 1]), false),
        (bytes(&format!("{vtk}POINTS 19999999 double\n"), &[]), false),
        (bytes(&format!("{vtk}POINTS 18446744073709551615 double\n"), &[]), true),
        (bytes(&format!("{vtk}CELLS 19999999 18446744073709551615\n"), &[]), false),
        (bytes(&format!("{vtk}CELLS 19999999 1\nOFFSETS vtktypeint64\n"), &[]), false),
        (bytes(&format!("{vtk}CELL_DATA 1\nFIELD data 18446744073709551615\n"), &[]), false),
        (bytes(&format!("{vtk}CELL_DATA 1\nFIELD data 1\na 18446744073709551615 9 string\n"), &[]), false),
        (bytes(&format!("{vtk}CELL_DATA 18446744073709551615\nVECTORS a double\n"), &[]), false),
    ];
    for (bytes, is_too_large) in cases {
        let name = std::path::Path::new("a");
        let format = TetrahedralFormat::recognize(name, &bytes).unwrap();
        let mut error = None;
        let measured = allocation_counter::measure(|| {
            error = TetrahedralFile::from_bytes(&bytes, format, None).err();
        });
        let error = error.unwrap();
        assert!(measured.bytes_max < 1 << 16, "{} bytes: {error}", measured.bytes_max);
        assert_eq!(matches!(error, MeshFileError::TooLarge { .. }), is_too_large, "{error}");
        assert!(is_too_large || matches!(error, MeshFileError::VolumeNotValid { .. }), "{error}");
    }
}

#[test]
fn arbitrary_bytes_are_read_or_rejected() {
    let vtk = b"# vtk DataFile Version 3.0\n\nBINARY\nDATASET UNSTRUCTURED_GRID\n";
    let beginnings: [(&[u8], TetrahedralFormat); 8] = [
        (b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n", TetrahedralFormat::Gmsh),
        (b"$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Entities\n", TetrahedralFormat::Gmsh),
        (b"$MeshFormat\n2.2 1 8\n\0\0\0\x01\n$EndMeshFormat\n$Elements\n9\n", TetrahedralFormat::Gmsh),
        (vtk, TetrahedralFormat::Vtk),
        (&[vtk.as_slice(), b"CELLS 2 9\n"].concat(), TetrahedralFormat::Vtk),
        (&[vtk.as_slice(), b"CELL_DATA 2\nFIELD a 9\n"].concat(), TetrahedralFormat::Vtk),
        (b"<VTKFile type=\"UnstructuredGrid\">", TetrahedralFormat::Vtu),
        (b"", TetrahedralFormat::TetGenNode),
    ];
    for seed in 0..file_count() {
        let random = &mut Random(seed);
        let (beginning, format) = beginnings[random.below(beginnings.len())];
        let mut bytes = beginning.to_vec();
        bytes.extend((0..random.below(300)).map(|_| random.below(256) as u8));
        read(&bytes, format, Some(b"1 4\n1 1 2 3 4\n"), &format!("seed {seed}"));
    }
}
