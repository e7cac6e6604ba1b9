//! STL files.

use crate::cube;
use palpate_files::{MeshFile, MeshFileError, MeshFormat, MeshPiece};

fn read(bytes: &[u8]) -> Result<MeshFile, MeshFileError> {
    MeshFile::from_bytes(bytes, MeshFormat::Stl, None)
}

/// The cube as a binary file with a header that begins with `start`.
pub fn binary_cube(start: &[u8]) -> Vec<u8> {
    let mut bytes = start.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(12_u32.to_le_bytes());
    for triangle in cube::triangles() {
        bytes.extend([0; 12]);
        bytes.extend(cube::position_bytes(&triangle.map(|corner| cube::VERTICES[corner as usize])));
        bytes.extend([0; 2]);
    }
    bytes
}

pub fn text_cube(name: &str) -> String {
    let facet = |triangle: [u32; 3]| {
        let vertices = triangle.map(|corner| {
            let [x, y, z] = cube::VERTICES[corner as usize];
            format!("      vertex {x:e} {y} {z}\n")
        });
        format!("  facet normal 0 0 0\n    outer loop\n{}    endloop\n  endfacet\n", vertices.concat())
    };
    format!("solid {name}\n{}endsolid {name}\n", cube::triangles().into_iter().map(facet).collect::<String>())
}

/// Equal corners are one vertex, in the order of their first use.
fn assert_cube(piece: &MeshPiece) {
    let order = [0, 4, 6, 2, 1, 3, 7, 5];
    assert_eq!(piece.vertices, order.map(|corner| cube::VERTICES[corner]));
    let place = |corner: u32| order.iter().position(|other| *other == corner as usize).unwrap() as u32;
    assert_eq!(
        piece.triangles,
        cube::triangles().iter().map(|corners| corners.map(place)).collect::<Vec<_>>()
    );
    assert_eq!(cube::volume(piece), 1.0);
}

#[test]
fn reads_binary_cube_whatever_its_header_is() {
    for header in [b"".as_slice(), b"solid made by a program", b"\xff\x00"] {
        let file = read(&binary_cube(header)).unwrap();
        assert_eq!(file.pieces.len(), 1);
        assert_cube(&file.pieces[0]);
    }
}

#[test]
fn reads_solids_of_a_text_file() {
    let text = format!("{}\n{}", text_cube("first one"), text_cube("").to_uppercase());
    let file = read(text.as_bytes()).unwrap();
    let names: Vec<_> = file.pieces.iter().map(|piece| (piece.node.as_deref(), piece.mesh)).collect();
    assert_eq!(names, [(Some("first one"), 0), (None, 1)]);
    file.pieces.iter().for_each(assert_cube);
}

#[test]
fn negative_zero_is_zero() {
    let text = text_cube("").replace("vertex 0e0 0 0", "vertex -0 0 -0");
    assert_eq!(read(text.as_bytes()).unwrap().pieces[0].vertices.len(), 8);
}

#[test]
fn rejects_files_of_which_a_part_is_missing() {
    let binary = binary_cube(b"");
    let text = text_cube("cube");
    let cases: [(&[u8], &str); 5] = [
        (&binary[..binary.len() - 1], "states 12 triangles and ends after 11"),
        (&binary[..40], "has 40 bytes"),
        (&text.as_bytes()[..text.len() - 14], "ends without `endsolid`"),
        (b"solid a\nfacet normal 0 0 0\nvertex 0 0\n", "line 3: a coordinate is ``"),
        (b"solid a\nfacet\nvertex 0 0 0\nendfacet\nendsolid", "line 4: a facet has 1 vertices"),
    ];
    for (bytes, expected) in cases {
        let error = read(bytes).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
}
