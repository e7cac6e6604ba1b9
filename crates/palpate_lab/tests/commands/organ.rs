//! `palpate-lab organ` and the organ of the examples.

use glam::{DVec3, Vec3};
use palpate_body::{ClosedMesh, MeshRepairs};
use serde_json::Value;
use std::path::Path;

struct Glb {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
    bytes: usize,
}

/// Reads a file according to the format, independently of the writer.
fn read(path: &Path) -> Glb {
    let file = std::fs::read(path).unwrap();
    let number = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&file[..4], number(4), number(8)), (&b"glTF"[..], 2, file.len()));
    let text = number(12);
    assert_eq!((&file[16..20], text % 4), (&b"JSON"[..], 0));
    let json: Value = serde_json::from_slice(&file[20..20 + text]).unwrap();
    let start = 20 + text;
    assert_eq!((&file[start + 4..start + 8], start + 8 + number(start)), (&b"BIN\0"[..], file.len()));
    let binary = &file[start + 8..];
    let bytes = |accessor: &Value, size: usize| {
        let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let [offset, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
        assert_eq!(length, accessor["count"].as_u64().unwrap() as usize * size);
        assert_eq!(offset % size.min(4), 0);
        &binary[offset..offset + length]
    };
    let primitive = &json["meshes"][0]["primitives"][0];
    let vectors = |accessor: &Value| -> Vec<DVec3> {
        let floats = |x: &[u8]| {
            Vec3::from_array([0, 4, 8].map(|at| f32::from_le_bytes(x[at..at + 4].try_into().unwrap())))
        };
        bytes(accessor, 12).chunks_exact(12).map(|x| floats(x).as_dvec3()).collect()
    };
    let of_indices = &primitive["indices"];
    let kind = json["accessors"][of_indices.as_u64().unwrap() as usize]["componentType"].as_u64().unwrap();
    let indices: Vec<usize> = match kind {
        5123 => bytes(of_indices, 2)
            .chunks_exact(2)
            .map(|x| usize::from(u16::from_le_bytes([x[0], x[1]])))
            .collect(),
        _ => bytes(of_indices, 4)
            .chunks_exact(4)
            .map(|x| u32::from_le_bytes(x.try_into().unwrap()) as usize)
            .collect(),
    };
    Glb {
        positions: vectors(&primitive["attributes"]["POSITION"]),
        normals: vectors(&primitive["attributes"]["NORMAL"]),
        triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        bytes: file.len(),
    }
}

fn organ(vertices: &str) -> (Glb, Value) {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["organ", "--vertices", vertices, "--json", "--out", folder.path().to_str().unwrap()];
    let output = super::run(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (read(&folder.path().join("organ.glb")), serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn organ_is_a_closed_mesh_of_the_requested_size_without_repairs() {
    for (requested, vertices) in [("100", 98), ("10000", 10_088), ("80000", 79_352)] {
        let (glb, report) = organ(requested);
        assert_eq!((glb.positions.len(), report["vertices"].as_u64()), (vertices, Some(vertices as u64)));
        let mesh = ClosedMesh::new(glb.positions, glb.triangles.clone()).unwrap();
        assert_eq!((mesh.repairs(), mesh.parts()), (MeshRepairs::default(), 1));
        assert_eq!(glb.triangles.len(), 2 * vertices - 4, "topology of a sphere");
        let volume = report["volume_m3"].as_f64().unwrap();
        assert!((mesh.volume_m3() / volume - 1.0).abs() < 1e-5);
        for (vertex, normal) in glb.normals.iter().enumerate() {
            assert!((normal.length() - 1.0).abs() < 1e-6, "{vertex}");
        }
    }
}

#[test]
fn organ_of_the_examples_equals_the_output_of_the_command() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/meshes/organ.glb");
    let (here, file) = (organ("10000").0, read(Path::new(path)));
    assert!(file.bytes < 1_000_000);
    assert_eq!(here.triangles, file.triangles);
    // The tangent of another platform may differ in its last bit.
    for (here, file) in here.positions.iter().zip(&file.positions) {
        assert!(here.distance(*file) < 1e-8);
    }
}
