//! Files that are rejected, with the kind of each error.

use crate::cube;
use crate::gltf_builder::Builder;
use palpate_files::{MeshFile, MeshFileError, MeshFormat};
use serde_json::json;
use std::path::Path;

fn error_of(change: impl FnOnce(&mut Builder)) -> MeshFileError {
    let mut builder = Builder::cube();
    change(&mut builder);
    builder.read().unwrap_err()
}

fn assert_not_valid(error: &MeshFileError, part: &str) {
    assert!(matches!(error, MeshFileError::NotValid { format: "glTF", .. }), "{error}");
    assert!(error.to_string().contains(part), "{error}");
}

#[test]
fn rejects_file_that_does_not_exist() {
    let error = MeshFile::read(Path::new("no such file.glb")).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::CannotBeRead { path, .. } if path == Path::new("no such file.glb"))
    );
    assert!(error.to_string().contains("`no such file.glb`"), "{error}");
}

#[test]
fn rejects_unknown_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.dcm");
    std::fs::write(&path, b"DICM").unwrap();
    assert!(matches!(MeshFile::read(&path).unwrap_err(), MeshFileError::FormatNotKnown { .. }));
}

#[test]
fn format_is_recognised_by_content_before_the_extension() {
    let of = |name: &str, bytes: &[u8]| MeshFormat::recognize(Path::new(name), bytes);
    assert_eq!(of("a.obj", b"glTF"), Some(MeshFormat::Gltf));
    assert_eq!(of("a", b"ply\nformat"), Some(MeshFormat::Ply));
    assert_eq!(of("a", b" {"), Some(MeshFormat::Gltf));
    assert_eq!(of("A.STL", b"solid"), Some(MeshFormat::Stl));
    assert_eq!(of("a.b.Obj", b"v 0 0 0"), Some(MeshFormat::Obj));
    assert_eq!(of("a.txt", b"v 0 0 0"), None);
}

#[test]
fn names_the_missing_buffer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.gltf");
    std::fs::write(&path, Builder::cube().gltf("cube%20data.bin")).unwrap();
    let error = MeshFile::read(&path).unwrap_err();
    let missing = folder.path().join("cube data.bin");
    assert!(
        matches!(&error, MeshFileError::MissingBuffer { buffer: 0, path, .. } if *path == missing),
        "{error}"
    );
    assert!(error.to_string().contains("cube data.bin"), "{error}");
    // A folder is no file.
    std::fs::create_dir(missing).unwrap();
    assert!(matches!(MeshFile::read(&path).unwrap_err(), MeshFileError::MissingBuffer { .. }));
}

#[test]
fn names_the_buffer_that_a_function_cannot_read() {
    let text = Builder::cube().gltf("parts/cube.bin");
    let read = |_: &Path| Err(std::io::ErrorKind::NotFound.into());
    let error = MeshFile::from_bytes_with(&text, MeshFormat::Gltf, &read).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::MissingBuffer { buffer: 0, path, .. } if path == Path::new("parts/cube.bin")),
        "{error}"
    );
    let error = MeshFile::buffer_paths(b"{", MeshFormat::Gltf).unwrap_err();
    assert!(matches!(error, MeshFileError::NotValid { format: "glTF", .. }), "{error}");
}

#[test]
fn rejects_buffers_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    for uri in ["https://example.org/cube.bin", "/dev/zero", "file:///dev/zero"] {
        let error = MeshFile::from_bytes(&Builder::cube().gltf(uri), MeshFormat::Gltf, Some(folder.path()));
        let error = error.unwrap_err();
        assert!(
            matches!(&error, MeshFileError::BufferNotReachable { buffer: 0, uri: of } if of == uri),
            "{error}"
        );
    }
    let without_folder = MeshFile::from_bytes(&Builder::cube().gltf("cube.bin"), MeshFormat::Gltf, None);
    assert!(matches!(without_folder.unwrap_err(), MeshFileError::BufferNotReachable { .. }));
}

#[test]
fn buffer_that_no_mesh_needs_may_be_missing() {
    let mut builder = Builder::cube();
    builder.json["buffers"] = json!([{ "byteLength": 100, "uri": "animation.bin" }]);
    builder.add("bufferViews", json!({ "buffer": 1, "byteLength": 100 }));
    assert!(builder.read().is_ok());
}

#[test]
fn rejects_file_without_triangles() {
    let error = error_of(|builder| builder.json["meshes"][0]["primitives"][0]["mode"] = json!(0));
    assert!(matches!(error, MeshFileError::NoTriangles { format: "glTF" }), "{error}");
    for (format, text) in [
        (MeshFormat::Obj, "v 0 0 0"),
        (MeshFormat::Stl, "solid\nendsolid"),
        (MeshFormat::Ply, "ply\nformat ascii 1.0\nelement nothing 9\nend_header\n"),
    ] {
        let error = MeshFile::from_bytes(text.as_bytes(), format, None).unwrap_err();
        assert!(matches!(error, MeshFileError::NoTriangles { .. }), "{error}");
    }
}

#[test]
fn rejects_index_out_of_range() {
    let error = error_of(|builder| builder.json["accessors"][0]["count"] = json!(7));
    assert!(matches!(error, MeshFileError::IndexOutOfRange { index: 7, vertex_count: 7, .. }), "{error}");
    assert!(error.to_string().contains("primitive 0 of mesh 0"), "{error}");
}

#[test]
fn rejects_required_extension_that_changes_the_surface() {
    let error = error_of(|builder| builder.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]));
    assert!(
        matches!(&error, MeshFileError::ExtensionNotKnown { extension } if extension == "EXT_mesh_gpu_instancing")
    );
    let mut builder = Builder::cube();
    builder.json["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_texture_basisu"]);
    assert!(builder.read().is_ok());
}

#[test]
fn rejects_absurd_counts() {
    let error = error_of(|builder| builder.json["accessors"][0]["count"] = json!(u64::MAX));
    assert!(matches!(error, MeshFileError::TooLarge { .. }), "{error}");
    let error = error_of(|builder| {
        builder.json["accessors"][0] = json!({ "componentType": 5126, "count": 10_000_000, "type": "VEC3" });
    });
    assert!(matches!(error, MeshFileError::TooLarge { .. }), "{error}");
    // One mesh of 3 million vertices at seven places.
    let error = error_of(|builder| {
        builder.json["accessors"][0] = json!({ "componentType": 5126, "count": 3_000_000, "type": "VEC3" });
        builder.json["meshes"][0]["primitives"][0]["mode"] = json!(6);
        builder.binary.fill(0);
        builder.json["nodes"] = json!(vec![json!({ "mesh": 0 }); 7]);
    });
    assert!(matches!(error, MeshFileError::TooLarge { value: 21_000_000, max: 20_000_000, .. }), "{error}");
}

#[test]
fn rejects_broken_node_graphs() {
    let cycle = error_of(|builder| {
        builder.json["nodes"] = json!([{ "children": [1] }, { "children": [0], "mesh": 0 }]);
        builder.json["scenes"] = json!([{ "nodes": [0] }]);
    });
    assert_not_valid(&cycle, "node 0 is below itself or has two parents");
    let two_parents =
        error_of(|builder| builder.json["nodes"] = json!([{ "children": [1, 1] }, { "mesh": 0 }]));
    assert_not_valid(&two_parents, "node 1 is below itself or has two parents");
    let missing = error_of(|builder| builder.json["nodes"] = json!([{ "children": [4] }]));
    assert_not_valid(&missing, "node 4 does not exist");
    let scene = error_of(|builder| builder.json["scene"] = json!(3));
    assert_not_valid(&scene, "scene 3 does not exist");
    let mesh = error_of(|builder| builder.json["nodes"] = json!([{ "mesh": 2 }]));
    assert_not_valid(&mesh, "mesh 2 does not exist");
}

#[test]
fn rejects_contradictions_with_their_place() {
    type Change = fn(&mut Builder);
    let cases: [(Change, &str); 13] = [
        (|b| b.json["asset"]["version"] = json!("1.0"), "its version is `1.0`"),
        (|b| b.json["bufferViews"][0]["byteLength"] = json!(95), "accessor 0: 8 elements from byte 0 exceed"),
        (|b| b.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "buffer 0, which has 168 bytes"),
        (|b| b.json["bufferViews"][0]["buffer"] = json!(5), "buffer 5 does not exist"),
        (|b| b.json["bufferViews"][0]["byteStride"] = json!(8), "every 8 bytes; they have 12"),
        (|b| b.json["accessors"][0]["bufferView"] = json!(9), "buffer view 9 does not exist"),
        (|b| b.json["accessors"][0]["type"] = json!("VEC4"), "accessor 0 has the type VEC4"),
        (|b| b.json["accessors"][0]["componentType"] = json!(5124), "a component type is 5124"),
        (|b| b.json["accessors"][1]["componentType"] = json!(5122), "accessor 1 of indices has the type"),
        (|b| b.json["accessors"][1]["count"] = json!(35), "triangles have 35 corners"),
        (|b| b.json["meshes"][0]["primitives"][0]["indices"] = json!(9), "accessor 9 does not exist"),
        (|b| b.json["meshes"][0]["primitives"] = json!(9), "its JSON is wrong"),
        (
            |b| b.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 2 }]),
            "a morph target has 1 vertices",
        ),
    ];
    for (change, part) in cases {
        let error = error_of(|builder| {
            builder.json["meshes"][0]["weights"] = json!([1]);
            let one = builder.vectors(5126, &cube::position_bytes(&[[0.0; 3]]), 1);
            builder.json["accessors"][one]["name"] = json!("one");
            builder.binary.truncate(168);
            builder.json["bufferViews"][2]["byteOffset"] = json!(0);
            change(builder);
        });
        assert_not_valid(&error, part);
    }
}

#[test]
fn rejects_broken_containers() {
    let glb = Builder::cube().glb();
    let read = |bytes: &[u8]| MeshFile::from_bytes(bytes, MeshFormat::Gltf, None).unwrap_err();
    assert_not_valid(&read(&glb[..glb.len() - 1]), "so a part of it is missing");
    assert_not_valid(&read(&glb[..14]), "ends within the header of a chunk");
    assert_not_valid(&read(&glb[..12]), "has no JSON chunk");
    assert_not_valid(&read(&[b"glTF", &1_u32.to_le_bytes(), &glb[8..]].concat()), "its version is 1");
    assert_not_valid(&read(b""), "its JSON is wrong");
    let text = String::from_utf8(Builder::cube().gltf_with_data()).unwrap();
    assert_not_valid(
        &read(text.replace("base64,", "base64,!").as_bytes()),
        "the data URI of buffer 0 is broken",
    );
    assert_not_valid(&read(text.replace(";base64,", ",").as_bytes()), "is not in base64");
    let deep = format!("{{\"extras\":{}", "[".repeat(100_000));
    assert_not_valid(&read(deep.as_bytes()), "its JSON is wrong");
}
