//! PLY files.

use crate::cube;
use palpate_files::{MeshFile, MeshFileError, MeshFormat};

fn read(bytes: &[u8]) -> Result<MeshFile, MeshFileError> {
    MeshFile::from_bytes(bytes, MeshFormat::Ply, None)
}

fn header(encoding: &str) -> String {
    format!(
        "ply\nformat {encoding} 1.0\ncomment a cube\nelement vertex 8\nproperty float x\nproperty uchar red\nproperty double y\n\
         property float32 z\nelement edge 1\nproperty list uchar short lengths\nelement face 6\nproperty uchar flag\n\
         property list uchar int vertex_indices\nend_header\n"
    )
}

pub fn text_cube() -> Vec<u8> {
    let vertices = cube::VERTICES.map(|[x, y, z]| format!("{x} 200 {y} {z}\n")).concat();
    let faces = cube::QUADS.map(|[a, b, c, d]| format!("1 4 {a} {b} {c} {d}\n")).concat();
    format!("{}{vertices}2 5 6\n{faces}", header("ascii")).into_bytes()
}

pub fn binary_cube(is_big_endian: bool) -> Vec<u8> {
    let encoding = if is_big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = header(encoding).into_bytes();
    let mut push = |number: &[u8]| {
        let mut number = number.to_vec();
        if is_big_endian {
            number.reverse();
        }
        bytes.extend(number);
    };
    for [x, y, z] in cube::VERTICES {
        push(&x.to_le_bytes());
        push(&[200]);
        push(&f64::from(y).to_le_bytes());
        push(&z.to_le_bytes());
    }
    push(&[2]);
    push(&5_i16.to_le_bytes());
    push(&6_i16.to_le_bytes());
    for quad in cube::QUADS {
        push(&[1]);
        push(&[4]);
        quad.iter().for_each(|corner| push(&corner.to_le_bytes()));
    }
    bytes
}

#[test]
fn reads_cube_in_each_encoding() {
    for bytes in [text_cube(), binary_cube(false), binary_cube(true)] {
        let file = read(&bytes).unwrap();
        assert_eq!(file.pieces.len(), 1);
        assert_eq!(file.pieces[0].vertices, cube::VERTICES);
        assert_eq!(file.pieces[0].triangles, cube::triangles());
        assert_eq!(file.pieces[0].normals, None);
    }
}

#[test]
fn reads_normals_and_other_line_ends() {
    let text = "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n\
                property float nx\r\nproperty float ny\r\nproperty float nz\r\nelement face 1\r\n\
                property list uchar uint vertex_index\r\nend_header\r\n\
                0 0 0 0 0 2\r\n1 0 0 0 0 2\r\n0 1 0 0 0 0\r\n3 0 1 2\r\n";
    let file = read(text.as_bytes()).unwrap();
    assert_eq!(file.pieces[0].triangles, [[0, 1, 2]]);
    assert_eq!(file.pieces[0].normals, Some(vec![[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0; 3]]));
}

#[test]
fn reads_triangle_strips() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty int x\nproperty int y\nproperty int z\nelement tristrips 1\n\
                property list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 2\n8 0 1 2 3 -1 2 3 4\n";
    assert_eq!(read(text.as_bytes()).unwrap().pieces[0].triangles, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
}

#[test]
fn rejects_broken_files_with_the_reason() {
    let text = String::from_utf8(text_cube()).unwrap();
    let cases = [
        (text.replace("ply\n", "plyx\n"), "the first line is not `ply`"),
        (text.replace("end_header", "comment"), "line 15 of the header is `0 200 0 0`"),
        (text.replace("format ascii 1.0\n", ""), "has no line `format`"),
        (text.replace("double y", "double why"), "no properties `x`, `y` and `z`"),
        (text.replace("vertex_indices", "corners"), "no list `vertex_indices`"),
        (text.replace("element face 6", "element face 7"), "ends before the last element"),
        (text.replace("4 5 7 6", "4 5 7.5 6"), "an index is 7.5"),
        (text.replace("4 5 7 6", "4 5 -7 6"), "an index is -7"),
        (text.replace("1 4 4 5 7 6", "1 -4 4 5 7 6"), "the length of a list is -4"),
        (text.replace("1 200 1 1", "1 200 1 one"), "a value is `one`"),
    ];
    for (text, expected) in cases {
        let error = read(text.as_bytes()).unwrap_err();
        assert!(error.to_string().contains(expected), "{expected}: {error}");
    }
    let error = read(text.replace("4 5 7 6", "4 5 8 6").as_bytes()).unwrap_err();
    assert!(matches!(error, MeshFileError::IndexOutOfRange { index: 8, vertex_count: 8, .. }), "{error}");
    let error = read(text.replace("element vertex 8", "element vertex 99999999999").as_bytes()).unwrap_err();
    assert!(matches!(error, MeshFileError::TooLarge { .. }), "{error}");
}
