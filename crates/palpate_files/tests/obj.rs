//! OBJ files.

use crate::cube;
use palpate_files::{MeshFile, MeshFileError, MeshFormat};

fn read(text: &str) -> Result<MeshFile, MeshFileError> {
    MeshFile::from_bytes(text.as_bytes(), MeshFormat::Obj, None)
}

/// The cube with quads. Every second face counts back from the last vertex.
pub fn cube_text() -> String {
    let vertices = cube::VERTICES.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    let faces = cube::QUADS.iter().enumerate().map(|(place, quad)| {
        let index = |corner: u32| if place % 2 == 0 { i64::from(corner) + 1 } else { i64::from(corner) - 8 };
        let [a, b, c, d] = quad.map(index);
        format!("f {a}/1/1 {b}//1 {c} {d}/2\n")
    });
    format!("# a cube\nmtllib missing.mtl\nvt 0 0\nvt 1 1\nvn 0 0 1\n{vertices}{}", faces.collect::<String>())
}

#[test]
fn reads_quads_and_negative_indices() {
    let file = read(&cube_text()).unwrap();
    assert_eq!(file.pieces.len(), 1);
    let piece = &file.pieces[0];
    assert_eq!(piece.vertices, cube::VERTICES);
    assert_eq!(piece.triangles, cube::triangles());
    assert_eq!((&piece.node, &piece.material, &piece.normals), (&None, &None, &None));
}

#[test]
fn objects_groups_and_materials_are_pieces_with_their_own_vertices() {
    let text = "
        v 0 0 0
        v 1 0 0
        v 0 1 0
        v 0 0 1
        o left lobe
        usemtl skin
        f 1 2 3
        usemtl fat
        f 1 2 4
        usemtl skin
        f 1 3 4
        g vessels
        f 4 3 2
    ";
    let file = read(text).unwrap();
    let described: Vec<_> = file
        .pieces
        .iter()
        .map(|piece| {
            let (node, material) = (piece.node.as_deref().unwrap(), piece.material.as_deref().unwrap());
            (node, material, piece.mesh, piece.primitive, piece.vertices.len(), piece.triangles.len())
        })
        .collect();
    assert_eq!(
        described,
        [
            ("left lobe", "skin", 0, 0, 4, 2),
            ("left lobe", "fat", 0, 1, 3, 1),
            ("vessels", "skin", 1, 0, 3, 1)
        ]
    );
    let vessels = file.of_node("vessels").next().unwrap();
    assert_eq!(vessels.vertices, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(vessels.triangles, [[2, 1, 0]]);
}

#[test]
fn normals_are_given_where_each_vertex_has_one() {
    let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 0 2\nvn 0 3 0\n";
    let file = read(&format!("{start}f 1//1 2//2 3//1\nf 2//2 4//1 3//1")).unwrap();
    let (z, y) = ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
    assert_eq!(file.pieces[0].normals, Some(vec![z, y, z, z]));
    let file = read(&format!("{start}f 1//1 2//2 3//1\nf 2//1 4//1 3//1")).unwrap();
    assert_eq!(file.pieces[0].normals, None);
}

#[test]
fn statements_continue_after_a_backslash() {
    let file = read("v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\n 2 \\\n 3").unwrap();
    assert_eq!(file.pieces[0].triangles, [[0, 1, 2]]);
}

#[test]
fn comments_are_left_out_and_names_keep_their_marks() {
    let text = "# f 9 9 9\nv 0 0 0 # first\nv 1 0 0\nv 0 1 0\nusemtl Material #27\nf 1 2 3 # 1 2 3\n";
    let piece = &read(text).unwrap().pieces[0];
    assert_eq!(piece.material.as_deref(), Some("Material #27"));
    assert_eq!(piece.triangles, [[0, 1, 2]]);
}

#[test]
fn text_that_is_not_utf8_is_read() {
    let text = b"o f\xe9mur\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3";
    let file = MeshFile::from_bytes(text, MeshFormat::Obj, None).unwrap();
    assert_eq!(file.pieces[0].node.as_deref(), Some("f\u{fffd}mur"));
}

#[test]
fn rejects_wrong_numbers_and_indices_with_the_line() {
    let cases = [
        ("v 0 0 x", "line 1: a coordinate is `x`"),
        ("v 0 0", "line 1: a coordinate is ``"),
        ("v 0 0 0\nf 1 2 3", "line 2: a face has the vertex `2`; it must be 1 to 1 or -1 to -1"),
        ("v 0 0 0\nf 1 0 1", "line 2: a face has the vertex `0`"),
        ("v 0 0 0\nf -2 1 1", "line 2: a face has the vertex `-2`"),
        ("v 0 0 0\nf 1//-9 1//-9 1//-9", "line 2: a face has the normal `-9`"),
        ("v 0 0 0\nf 9223372036854775807 1 1", "line 2: a face has the vertex"),
        ("v 0 0 0\nf -9223372036854775808 1 1", "line 2: a face has the vertex"),
        ("v 0 0 0\nf 1 1", "line 2: a face has 2 vertices"),
    ];
    for (text, expected) in cases {
        let error = read(text).unwrap_err();
        assert!(matches!(error, MeshFileError::NotValid { format: "OBJ", .. }), "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
}
