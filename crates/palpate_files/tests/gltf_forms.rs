//! Forms of glTF files and of the data in them.

use crate::cube;
use crate::gltf_builder::Builder;
use palpate_files::{MeshFile, MeshFormat, MeshPiece};
use serde_json::json;
use std::path::{Path, PathBuf};

fn only_piece(builder: &Builder) -> MeshPiece {
    let file = builder.read().unwrap();
    assert_eq!(file.pieces.len(), 1);
    file.pieces[0].clone()
}

fn assert_cube(piece: &MeshPiece) {
    assert_eq!(piece.vertices, cube::VERTICES);
    assert_eq!(piece.triangles, cube::triangles());
}

#[test]
fn reads_cube_from_glb() {
    let piece = only_piece(&Builder::cube());
    assert_cube(&piece);
    assert_eq!(piece.mesh_name.as_deref(), Some("mesh"));
    assert_eq!((piece.node, piece.material, piece.normals), (None, None, None));
}

#[test]
fn reads_cube_from_data_uri_with_and_without_padding() {
    let text = Builder::cube().gltf_with_data();
    assert_cube(&MeshFile::from_bytes(&text, MeshFormat::Gltf, None).unwrap().pieces[0]);
    let text = String::from_utf8(text).unwrap().replace('=', "");
    assert_cube(&MeshFile::from_bytes(text.as_bytes(), MeshFormat::Gltf, None).unwrap().pieces[0]);
    let with_mark = format!("\u{feff}{text}");
    assert_cube(&MeshFile::from_bytes(with_mark.as_bytes(), MeshFormat::Gltf, None).unwrap().pieces[0]);
}

#[test]
fn reads_cube_with_binary_file_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let builder = Builder::cube();
    std::fs::write(folder.path().join("a cube.bin"), &builder.binary).unwrap();
    let path = folder.path().join("cube.gltf");
    std::fs::write(&path, builder.gltf("a%20cube.bin")).unwrap();
    assert_cube(&MeshFile::read(&path).unwrap().pieces[0]);
}

#[test]
fn reads_cube_with_buffers_of_a_function() {
    let mut builder = Builder::cube();
    let list = json!([
        { "byteLength": builder.binary.len(), "uri": "parts/a%20cube.bin" },
        { "byteLength": 9, "uri": "parts/a%20cube.bin" },
        { "byteLength": 9, "uri": "animation.bin" },
        { "byteLength": 0, "uri": "data:application/octet-stream;base64," },
        { "byteLength": 9, "uri": "https://example.org/cube.bin" },
        { "byteLength": 9, "uri": "/dev/zero" },
    ]);
    builder.json["buffers"] = list;
    let text = builder.json.to_string().into_bytes();
    let paths = MeshFile::buffer_paths(&text, MeshFormat::Gltf).unwrap();
    assert_eq!(paths, ["animation.bin", "parts/a cube.bin"].map(PathBuf::from));
    let file = MeshFile::from_bytes_with(&text, MeshFormat::Gltf, &|path| {
        assert_eq!(path, Path::new("parts/a cube.bin"), "only what a mesh needs is read");
        Ok(builder.binary.clone())
    });
    assert_cube(&file.unwrap().pieces[0]);
    // The buffer of a GLB file is in it, and other formats have none.
    assert!(MeshFile::buffer_paths(&Builder::cube().glb(), MeshFormat::Gltf).unwrap().is_empty());
    assert!(MeshFile::buffer_paths(b"v 0 0 0", MeshFormat::Obj).unwrap().is_empty());
}

#[test]
fn json_with_the_extension_of_glb_is_read() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["cube.glb", "cube"] {
        let path = folder.path().join(name);
        std::fs::write(&path, Builder::cube().gltf_with_data()).unwrap();
        assert_cube(&MeshFile::read(&path).unwrap().pieces[0]);
    }
}

#[test]
fn vertices_without_indices_are_triangles() {
    let mut builder = Builder::new();
    let corners: Vec<[f32; 3]> =
        cube::triangles().iter().flatten().map(|corner| cube::VERTICES[*corner as usize]).collect();
    let positions = builder.vectors(5126, &cube::position_bytes(&corners), 36);
    builder.mesh(json!({ "attributes": { "POSITION": positions } }));
    let piece = only_piece(&builder);
    assert_eq!(piece.vertices, corners);
    assert_eq!(piece.triangles, (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect::<Vec<_>>());
}

#[test]
fn strip_alternates_its_winding_and_drops_repeated_corners() {
    let mut builder = Builder::new();
    let positions = builder.vectors(5126, &cube::position_bytes(&cube::VERTICES), 8);
    // The faces z = 0 and z = 1, joined by repeated corners.
    let indices = builder.indices(5121, &[0, 2, 1, 3, 3, 4, 4, 5, 6, 7], 10);
    builder.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": 5 }));
    let piece = only_piece(&builder);
    assert_eq!(piece.triangles, [[0, 2, 1], [2, 3, 1], [4, 5, 6], [5, 7, 6]]);
}

#[test]
fn fan_shares_its_first_corner() {
    let mut builder = Builder::new();
    let positions = builder.vectors(5126, &cube::position_bytes(&cube::VERTICES), 8);
    let indices = builder.indices(5125, &[4_u32, 5, 7, 6].map(u32::to_le_bytes).concat(), 4);
    builder.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": 6 }));
    assert_eq!(only_piece(&builder).triangles, [[4, 5, 7], [4, 7, 6]]);
}

#[test]
fn lines_and_points_are_left_out() {
    let mut builder = Builder::cube();
    let lines = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "mode": 1 });
    builder.json["meshes"][0]["primitives"].as_array_mut().unwrap().insert(0, lines);
    let piece = only_piece(&builder);
    assert_eq!(piece.primitive, 1);
    assert_cube(&piece);
}

#[test]
fn quantised_positions_and_normals_are_read_by_type() {
    // Positions as i16 that are not normalised, with the stride 8; the node scales them. Normals as normalised i8.
    let mut builder = Builder::new();
    builder.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let positions: Vec<u8> = [[0_i16, 0, 0], [1000, 0, 0], [0, -2000, 0]]
        .iter()
        .flat_map(|[x, y, z]| [*x, *y, *z, 77])
        .flat_map(i16::to_le_bytes)
        .collect();
    let positions = builder.vectors(5122, &positions, 3);
    builder.json["bufferViews"][0]["byteStride"] = json!(8);
    let normals: [u8; 9] = [[0_i8, 0, 127], [0, 0, -128], [0, 0, 127]]
        .as_flattened()
        .iter()
        .map(|x| *x as u8)
        .collect::<Vec<_>>()
        .try_into()
        .unwrap();
    let normals = builder.vectors(5120, &normals, 3);
    builder.json["accessors"][normals]["normalized"] = json!(true);
    builder.mesh(json!({ "attributes": { "POSITION": positions, "NORMAL": normals } }));
    builder.add("nodes", json!({ "mesh": 0, "scale": [0.001, 0.001, 0.001] }));
    let piece = only_piece(&builder);
    assert_eq!(piece.vertices, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -2.0, 0.0]]);
    assert_eq!(piece.normals, Some(vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]));
}

#[test]
fn normalised_integers_are_fractions_of_their_largest() {
    let cases: [(u32, Vec<u8>); 4] = [
        (5120, vec![127, 0x81, 0x80]),
        (5121, vec![255, 0, 51]),
        (5122, [32767_i16, -32767, -32768].map(i16::to_le_bytes).concat()),
        (5123, [65535_u16, 0, 13107].map(u16::to_le_bytes).concat()),
    ];
    for (code, vector) in cases {
        let mut builder = Builder::new();
        let positions = builder.vectors(code, &vector.repeat(3), 3);
        builder.json["accessors"][positions]["normalized"] = json!(true);
        builder.mesh(json!({ "attributes": { "POSITION": positions } }));
        let expected = if matches!(code, 5120 | 5122) { [1.0, -1.0, -1.0] } else { [1.0, 0.0, 0.2] };
        assert_eq!(only_piece(&builder).vertices, [expected; 3], "{code}");
    }
}

#[test]
fn sparse_accessor_replaces_elements_of_a_view() {
    let mut builder = Builder::cube();
    let (indices, values) =
        (builder.view(&[1, 7]), builder.view(&cube::position_bytes(&[[3.0, 0.0, 0.0], [2.0; 3]])));
    builder.json["accessors"][0]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": 5121 },
        "values": { "bufferView": values },
    });
    let mut expected = cube::VERTICES;
    expected[1] = [3.0, 0.0, 0.0];
    expected[7] = [2.0; 3];
    assert_eq!(only_piece(&builder).vertices, expected);
}

#[test]
fn sparse_accessor_without_view_replaces_zeros() {
    let mut builder = Builder::new();
    let indices = builder.view(&[1_u16, 2].map(u16::to_le_bytes).concat());
    let values = builder.view(&cube::position_bytes(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    let sparse = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": 5123 },
        "values": { "bufferView": values },
    });
    let positions = builder
        .add("accessors", json!({ "componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse }));
    builder.mesh(json!({ "attributes": { "POSITION": positions } }));
    assert_eq!(only_piece(&builder).vertices, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
}

/// The cube with two morph targets: one moves all along x by 10, one moves corner 7 along y by 4.
fn morphing_cube() -> Builder {
    let mut builder = Builder::cube();
    let along_x = builder.vectors(5126, &cube::position_bytes(&[[10.0, 0.0, 0.0]; 8]), 8);
    let (indices, values) = (builder.view(&[7]), builder.view(&cube::position_bytes(&[[0.0, 4.0, 0.0]])));
    let sparse = json!({
        "count": 1,
        "indices": { "bufferView": indices, "componentType": 5121 },
        "values": { "bufferView": values },
    });
    let corner = builder
        .add("accessors", json!({ "componentType": 5126, "count": 8, "type": "VEC3", "sparse": sparse }));
    builder.json["meshes"][0]["primitives"][0]["targets"] =
        json!([{ "POSITION": along_x }, { "POSITION": corner }]);
    builder
}

#[test]
fn morph_targets_have_the_weights_of_the_mesh_or_the_node() {
    let mut builder = morphing_cube();
    assert_cube(&only_piece(&builder));
    builder.json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    let mut expected = cube::VERTICES.map(|[x, y, z]| [x + 5.0, y, z]);
    expected[7][1] += 1.0;
    assert_eq!(only_piece(&builder).vertices, expected);
    // Two nodes with one mesh: the first has weights of its own.
    builder.add("nodes", json!({ "mesh": 0, "weights": [0, 1] }));
    builder.add("nodes", json!({ "mesh": 0 }));
    let file = builder.read().unwrap();
    let mut of_node = cube::VERTICES;
    of_node[7][1] += 4.0;
    assert_eq!(file.pieces[0].vertices, of_node);
    assert_eq!(file.pieces[1].vertices, expected);
}

#[test]
fn values_that_are_not_finite_are_passed_on() {
    let mut builder = Builder::cube();
    builder.binary[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let file = builder.read().unwrap();
    assert!(file.pieces[0].vertices[0][0].is_nan());
    assert_eq!(file.bounds(), Some([[0.0; 3], [1.0; 3]]));
}
