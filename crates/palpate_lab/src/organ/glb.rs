//! A mesh as a GLB file (glTF 2.0, Khronos Group, section 4.4).

use super::shape::Shape;
use crate::error::LabError;
use glam::{DVec3, Vec3};
use serde_json::json;

// Component types and buffer targets of glTF.
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// GLB file with one mesh: a header, a JSON chunk and a binary chunk.
pub(super) fn glb(name: &str, shape: &Shape) -> Result<Vec<u8>, LabError> {
    let vertices = shape.positions_m.len();
    let vectors = |list: &[DVec3]| -> Vec<u8> {
        list.iter().flat_map(|x| x.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect()
    };
    let all = shape.triangles.iter().flatten();
    // 65535 is the index that restarts a strip.
    let (component, indices): (u32, Vec<u8>) = if vertices < usize::from(u16::MAX) {
        (UNSIGNED_SHORT, all.flat_map(|&vertex| (vertex as u16).to_le_bytes()).collect())
    } else {
        (UNSIGNED_INT, all.flat_map(|&vertex| (vertex as u32).to_le_bytes()).collect())
    };
    let (positions, normals) = (vectors(&shape.positions_m), vectors(&shape.normals));
    // Bounds of the rounded positions.
    let single = || shape.positions_m.iter().map(|x| x.as_vec3());
    let low = single().fold(Vec3::INFINITY, Vec3::min).to_array();
    let high = single().fold(Vec3::NEG_INFINITY, Vec3::max).to_array();
    let (first, second) = (positions.len(), positions.len() + normals.len());
    let view = |offset: usize, length: usize, target: u32| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length, "target": target });
    let mut binary = [positions, normals, indices].concat();
    let described = json!({
        "asset": { "version": "2.0", "generator": concat!("palpate-lab ", env!("CARGO_PKG_VERSION")), "copyright": "The palpate project, MIT OR Apache-2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": name, "mesh": 0 }],
        "meshes": [{ "name": name, "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": FLOAT, "count": vertices, "type": "VEC3", "min": low, "max": high },
            { "bufferView": 1, "componentType": FLOAT, "count": vertices, "type": "VEC3" },
            { "bufferView": 2, "componentType": component, "count": 3 * shape.triangles.len(), "type": "SCALAR" },
        ],
        "bufferViews": [
            view(0, first, ARRAY_BUFFER),
            view(first, second - first, ARRAY_BUFFER),
            view(second, binary.len() - second, ELEMENT_ARRAY_BUFFER),
        ],
        "buffers": [{ "byteLength": binary.len() }],
    });
    let mut text = serde_json::to_vec(&described)?;
    // Chunks are padded to multiples of four bytes.
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + binary.len();
    for number in [2, total as u32, text.len() as u32] {
        file.extend(number.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(text);
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(binary);
    Ok(file)
}
