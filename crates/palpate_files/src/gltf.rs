//! glTF 2.0 files: JSON with buffers beside it or in it, and GLB.

mod accessors;
mod buffers;
mod container;
mod document;
mod draco;
mod extensions;
mod invalid;
mod meshopt;
mod nodes;
mod shape;
mod transform;

use crate::error::MeshFileError;
use crate::piece::{MAX_ELEMENTS, MeshPiece, unit};
use buffers::Buffers;
use document::Document;
use invalid::not_valid;
use nodes::Placement;
use shape::{ReadCount, Shape};
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

pub(crate) use buffers::BufferFiles;
pub(crate) use invalid::NAME;

/// Paths of the buffers that are files of their own, relative to the glTF file.
pub(crate) fn buffer_paths(bytes: &[u8]) -> Result<BTreeSet<PathBuf>, MeshFileError> {
    let (document, _) = parse(bytes)?;
    let uris = document.buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
    Ok(uris.filter_map(buffers::relative_path).collect())
}

/// The document of a glTF file, and the buffer that a GLB file contains.
fn parse(bytes: &[u8]) -> Result<(Document, Option<&[u8]>), MeshFileError> {
    let (json, binary) = container::split(bytes)?;
    let document =
        serde_json::from_slice(json).map_err(|cause| not_valid(format!("its JSON is wrong: {cause}")))?;
    Ok((document, binary))
}

/// Reads the pieces of a glTF file: one for each primitive of each mesh that a node places.
pub(crate) fn read(bytes: &[u8], files: BufferFiles) -> Result<Vec<MeshPiece>, MeshFileError> {
    let (document, binary) = parse(bytes)?;
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        return Err(not_valid(format!("its version is `{version}`; it must be 2.0")));
    }
    extensions::check(&document)?;
    let buffers = Buffers::new(&document, binary, files);
    // Several nodes may place one mesh with the same weights.
    let mut known: HashMap<(usize, Vec<u64>), Vec<Shape>> = HashMap::new();
    let mut pieces = Vec::new();
    let mut element_count = 0;
    let mut read_count = ReadCount::default();
    for placement in nodes::placements(&document)? {
        let weights = weights(&document, &placement);
        let key = (placement.mesh, weights.iter().map(|weight| weight.to_bits()).collect());
        if !known.contains_key(&key) {
            let shapes = shape::shapes(&document, &buffers, placement.mesh, weights, &mut read_count)?;
            known.insert(key.clone(), shapes);
        }
        for shape in known.get(&key).map(Vec::as_slice).unwrap_or_default() {
            element_count += shape.positions.len().max(shape.triangles.len());
            if element_count > MAX_ELEMENTS {
                let (value, max) = (element_count as u64, MAX_ELEMENTS as u64);
                return Err(MeshFileError::TooLarge { what: "number of vertices or triangles", value, max });
            }
            if !shape.triangles.is_empty() {
                pieces.push(placed(&document, &placement, shape));
            }
        }
    }
    Ok(pieces)
}

/// Weights of the morph targets: those of the node, otherwise those of its mesh.
fn weights<'a>(document: &'a Document, placement: &Placement) -> &'a [f64] {
    let of_node = placement.node.and_then(|node| document.nodes.get(node)).map(|node| &node.weights);
    let of_mesh = document.meshes.get(placement.mesh).map(|mesh| &mesh.weights);
    let weights = of_node.filter(|weights| !weights.is_empty()).or(of_mesh);
    weights.map(Vec::as_slice).unwrap_or_default()
}

/// `shape` at its place in the scene.
fn placed(document: &Document, placement: &Placement, shape: &Shape) -> MeshPiece {
    let transform = &placement.transform;
    let mesh = document.meshes.get(placement.mesh);
    let primitive = mesh.and_then(|mesh| mesh.primitives.get(shape.primitive));
    let material = primitive.and_then(|primitive| document.materials.get(primitive.material?));
    let node = placement.node.and_then(|node| document.nodes.get(node));
    let is_mirror = transform.is_mirror();
    let outward = |[a, b, c]: [u32; 3]| if is_mirror { [a, c, b] } else { [a, b, c] };
    let to_f32 = |vector: [f64; 3]| vector.map(|x| x as f32);
    let normals = shape.normals.as_ref();
    MeshPiece {
        node: node.and_then(|node| node.name.clone()),
        mesh: placement.mesh,
        mesh_name: mesh.and_then(|mesh| mesh.name.clone()),
        primitive: shape.primitive,
        material: material.and_then(|material| material.name.clone()),
        vertices: shape.positions.iter().map(|position| to_f32(transform.point(*position))).collect(),
        normals: normals
            .map(|normals| normals.iter().map(|normal| unit(transform.normal(*normal))).collect()),
        triangles: shape.triangles.iter().map(|triangle| outward(*triangle)).collect(),
    }
}
