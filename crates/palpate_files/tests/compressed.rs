//! Compressed glTF files.

use crate::cube;
use crate::gltf_builder::Builder;
use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder,
    PointAttribute, PointIndex,
};
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    ExpMode, IndexEncoding, VertexEncoding, encode_filter_exp, encode_filter_oct, encode_index_buffer,
    encode_index_sequence, encode_vertex_buffer,
};
use palpate_files::{MeshFile, MeshFileError};
use serde_json::json;

const NORMAL: [f32; 3] = [0.0, 0.0, -1.0];

/// Compressed bytes of a view, with the count and the size of its elements.
struct Compressed {
    bytes: Vec<u8>,
    count: usize,
    stride: usize,
    mode: &'static str,
    filter: &'static str,
}

fn vertices(bytes: &[u8], stride: usize, version: u8, filter: &'static str) -> Compressed {
    let count = bytes.len() / stride;
    let encoding = VertexEncoding::new(version, 2).unwrap();
    let bytes = encode_vertex_buffer(bytes, count, stride, encoding, &mut Workspace::default()).unwrap();
    Compressed { bytes, count, stride, mode: "ATTRIBUTES", filter }
}

/// Adds the view to `builder`, with its content in a buffer that exists only when decoded.
fn add_view(builder: &mut Builder, extension: &str, compressed: &Compressed) -> usize {
    let Compressed { bytes, count, stride, mode, filter } = compressed;
    let source = builder.view(bytes);
    let mut of_view = builder.json["bufferViews"][source].clone();
    of_view["byteStride"] = json!(stride);
    of_view["count"] = json!(count);
    of_view["mode"] = json!(mode);
    of_view["filter"] = json!(filter);
    let length = count * stride;
    builder.json["buffers"] =
        json!([{ "byteLength": 4096, "extensions": { extension: { "fallback": true } } }]);
    let mut view = json!({ "buffer": 1, "byteLength": length, "extensions": { extension: of_view } });
    if *mode == "ATTRIBUTES" {
        view["byteStride"] = json!(stride);
    }
    builder.add("bufferViews", view)
}

/// The cube with compressed positions, indices and normals.
pub fn meshopt_cube(extension: &str, version: u8, are_triangles: bool) -> Builder {
    let mut workspace = Workspace::default();
    let mut builder = Builder::new();
    builder.json["extensionsRequired"] = json!([extension, "KHR_mesh_quantization"]);
    // Mantissas of 15 bits hold the coordinates 0 and 1 exactly.
    let numbers = cube::VERTICES.as_flattened();
    let filtered = encode_filter_exp(8, 12, 15, numbers, ExpMode::Separate, &mut workspace).unwrap();
    let positions = vertices(&filtered, 12, version, "EXPONENTIAL");
    let normals: Vec<f32> = [NORMAL[0], NORMAL[1], NORMAL[2], 0.0].repeat(8);
    let normals = encode_filter_oct(8, 4, 8, &normals, &mut workspace).unwrap();
    let normals = vertices(&normals, 4, version, "OCTAHEDRAL");
    let corners = cube::triangles().concat();
    let (mode, bytes) = if are_triangles {
        ("TRIANGLES", encode_index_buffer(&corners, IndexEncoding::DEFAULT, &mut workspace).unwrap())
    } else {
        ("INDICES", encode_index_sequence(&corners, IndexEncoding::DEFAULT, &mut workspace).unwrap())
    };
    let indices = Compressed { bytes, count: 36, stride: 2, mode, filter: "NONE" };
    let [positions, normals, indices] =
        [&positions, &normals, &indices].map(|compressed| add_view(&mut builder, extension, compressed));
    let accessor = |view: usize, code: u32, count: usize, shape: &str| {
        let (view, code) = (json!(view), json!(code));
        json!({ "bufferView": view, "componentType": code, "count": count, "type": shape })
    };
    let positions = builder.add("accessors", accessor(positions, 5126, 8, "VEC3"));
    let mut of_normals = accessor(normals, 5120, 8, "VEC3");
    of_normals["normalized"] = json!(true);
    let normals = builder.add("accessors", of_normals);
    let indices = builder.add("accessors", accessor(indices, 5123, 36, "SCALAR"));
    builder.mesh(json!({ "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": indices }));
    builder
}

/// The triangles as sets of corners, each beginning with its smallest corner: independent of the order of vertices and triangles.
fn corner_sets(vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[[i64; 3]; 3]> {
    let corner = |index: u32| vertices[index as usize].map(|x| (f64::from(x) * 1e6).round() as i64);
    let mut sets: Vec<_> = triangles
        .iter()
        .map(|triangle| {
            let mut corners = triangle.map(corner);
            let least = (0..3).min_by_key(|place| corners[*place]).unwrap();
            corners.rotate_left(least);
            corners
        })
        .collect();
    sets.sort_unstable();
    sets
}

fn assert_cube(file: &MeshFile) {
    assert_eq!(file.pieces.len(), 1);
    let piece = &file.pieces[0];
    let expected = corner_sets(&cube::VERTICES, &cube::triangles());
    assert_eq!(corner_sets(&piece.vertices, &piece.triangles), expected);
    let normals = piece.normals.as_ref().unwrap();
    assert_eq!(normals.len(), piece.vertices.len());
    for normal in normals {
        assert!(normal.iter().zip(NORMAL).all(|(n, e)| (n - e).abs() < 1e-2), "{normal:?}");
    }
}

#[test]
fn meshopt_is_decoded_or_names_its_feature() {
    for (extension, version) in [("EXT_meshopt_compression", 0), ("KHR_meshopt_compression", 1)] {
        for are_triangles in [true, false] {
            let read = meshopt_cube(extension, version, are_triangles).read();
            if cfg!(feature = "meshopt") {
                let file = read.unwrap();
                assert_eq!(file.pieces[0].vertices, cube::VERTICES);
                assert_cube(&file);
            } else {
                let error = read.unwrap_err();
                assert!(matches!(error, MeshFileError::NeedsDecoder { feature: "meshopt", .. }), "{error}");
                assert!(error.to_string().contains(extension), "{error}");
            }
        }
    }
}

#[test]
#[cfg(feature = "meshopt")]
fn rejects_broken_meshopt_data() {
    let change = |place: &str, value: serde_json::Value| {
        let mut builder = meshopt_cube("EXT_meshopt_compression", 0, true);
        builder.json["bufferViews"][3]["extensions"]["EXT_meshopt_compression"][place] = value;
        let read = builder.read();
        assert!(read.is_err(), "{place}");
        read.unwrap_err()
    };
    let cases = [
        ("count", json!(7)),
        ("count", json!(1_000_000)),
        ("byteStride", json!(10)),
        ("mode", json!("OTHER")),
        ("filter", json!("COLOR")),
        ("byteLength", json!(4)),
    ];
    for (place, value) in cases {
        let error = change(place, value.clone());
        assert!(matches!(error, MeshFileError::CannotBeDecoded { .. }), "{place} {value}: {error}");
    }
    assert!(matches!(change("count", json!(1_u64 << 60)), MeshFileError::TooLarge { .. }));
}

/// The cube in Draco's format, with attribute 0 the positions and attribute 1 the normals.
fn draco_bytes(method: i32) -> Vec<u8> {
    let mut mesh = Mesh::new();
    for (kind, vectors) in
        [(GeometryAttributeType::Position, cube::VERTICES), (GeometryAttributeType::Normal, [NORMAL; 8])]
    {
        let mut attribute = PointAttribute::new();
        attribute.init(kind, 3, DataType::Float32, false, 8);
        attribute.buffer_mut().write(0, &cube::position_bytes(&vectors));
        mesh.add_attribute(attribute);
    }
    let triangles = cube::triangles();
    mesh.set_num_faces(triangles.len());
    for (face, corners) in triangles.iter().enumerate() {
        mesh.set_face(FaceIndex(face as u32), corners.map(PointIndex));
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut options = EncoderOptions::new();
    options.set_encoding_method(method);
    options.set_attribute_quantization(0, 11);
    options.set_attribute_quantization(1, 8);
    let mut encoded = EncoderBuffer::new();
    encoder.encode(&options, &mut encoded).unwrap();
    encoded.data().to_vec()
}

/// The cube, compressed in order (`method` 0) or by its edges (1).
pub fn draco_cube(method: i32) -> Builder {
    let mut builder = Builder::new();
    builder.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let view = builder.view(&draco_bytes(method));
    let vectors = json!({ "componentType": 5126, "count": 8, "type": "VEC3" });
    let (positions, normals) = (builder.add("accessors", vectors.clone()), builder.add("accessors", vectors));
    let indices = builder.add("accessors", json!({ "componentType": 5123, "count": 36, "type": "SCALAR" }));
    builder.mesh(json!({
        "attributes": { "POSITION": positions, "NORMAL": normals },
        "indices": indices,
        "extensions": {
            "KHR_draco_mesh_compression": { "bufferView": view, "attributes": { "POSITION": 0, "NORMAL": 1 } },
        },
    }));
    builder
}

#[test]
fn draco_is_decoded_or_names_its_feature() {
    for method in [0, 1] {
        let read = draco_cube(method).read();
        if cfg!(feature = "draco") {
            assert_cube(&read.unwrap());
        } else {
            let error = read.unwrap_err();
            assert!(matches!(error, MeshFileError::NeedsDecoder { feature: "draco", .. }), "{error}");
        }
    }
}

#[test]
#[cfg(feature = "draco")]
fn rejects_broken_draco_data() {
    let mut builder = draco_cube(1);
    builder.json["bufferViews"][0]["byteLength"] = json!(30);
    assert!(matches!(builder.read().unwrap_err(), MeshFileError::CannotBeDecoded { .. }));
    let mut builder = draco_cube(1);
    builder.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] =
        json!(7);
    assert!(matches!(builder.read().unwrap_err(), MeshFileError::CannotBeDecoded { .. }));
}

#[test]
fn content_without_compression_is_read_where_a_decoder_is_missing() {
    // The cube without compression, and Draco's data that only a decoder reads: they are a triangle fewer.
    let mut builder = Builder::cube();
    let bytes = draco_bytes(0);
    let view = builder.view(&bytes);
    builder.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({ "KHR_draco_mesh_compression": { "bufferView": view, "attributes": { "POSITION": 0 } } });
    let file = builder.read().unwrap();
    assert_eq!(file.triangle_count(), 12);
    assert_eq!(file.bounds(), Some([[0.0; 3], [1.0; 3]]));
}
