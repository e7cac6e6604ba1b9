//! The shape of a primitive: positions, normals and triangles in the frame of its mesh, with its morph targets.

use super::accessors::{accessor, denormalized, indices, vectors};
use super::buffers::Buffers;
use super::document::{Document, Draco, Primitive};
use super::draco;
use super::invalid::not_valid;
use crate::error::MeshFileError;
use crate::piece::MAX_ELEMENTS;
use crate::polygon::{fan, strip};

const TRIANGLES: u32 = 4;
const TRIANGLE_STRIP: u32 = 5;
const TRIANGLE_FAN: u32 = 6;

/// A primitive in the frame of its mesh.
pub(super) struct Shape {
    /// Index of the primitive in its mesh.
    pub primitive: usize,
    pub positions: Vec<[f64; 3]>,
    pub normals: Option<Vec<[f64; 3]>>,
    pub triangles: Vec<[u32; 3]>,
}

/// Number of vertices or triangles that have been read, with those of morph targets. A short file may name the same accessors many times.
#[derive(Default)]
pub(super) struct ReadCount(usize);

/// Maximum of [`ReadCount`].
const MAX_READ: usize = 5 * MAX_ELEMENTS;

impl ReadCount {
    fn add(&mut self, count: usize) -> Result<(), MeshFileError> {
        self.0 += count;
        check_count("number of vertices, triangles and displacements of morph targets", self.0, MAX_READ)
    }
}

fn check_count(what: &'static str, count: usize, max: usize) -> Result<(), MeshFileError> {
    if count > max {
        return Err(MeshFileError::TooLarge { what, value: count as u64, max: max as u64 });
    }
    Ok(())
}

/// Shapes of the primitives of a mesh that consist of triangles, with its morph targets weighted by `weights`.
pub(super) fn shapes(
    document: &Document,
    buffers: &Buffers,
    mesh: usize,
    weights: &[f64],
    read_count: &mut ReadCount,
) -> Result<Vec<Shape>, MeshFileError> {
    let Some(of) = document.meshes.get(mesh) else {
        return Err(not_valid(format!("mesh {mesh} does not exist")));
    };
    let mut shapes = Vec::new();
    let mut held = 0;
    for (index, primitive) in of.primitives.iter().enumerate() {
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        if !(TRIANGLES..=TRIANGLE_FAN).contains(&mode) || primitive.attributes.position.is_none() {
            continue;
        }
        let mut shape = read(document, buffers, primitive, mode)?;
        shape.primitive = index;
        let element_count = shape.positions.len().max(shape.triangles.len());
        held += element_count;
        check_count("number of vertices or triangles of a mesh", held, MAX_ELEMENTS)?;
        read_count.add(element_count)?;
        for (target, weight) in primitive.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            read_count.add(shape.positions.len())?;
            if let Some(position) = target.position {
                add(&mut shape.positions, &vectors(document, buffers, position)?, *weight)?;
            }
            if let (Some(normals), Some(normal)) = (&mut shape.normals, target.normal) {
                add(normals, &vectors(document, buffers, normal)?, *weight)?;
            }
        }
        let vertex_count = shape.positions.len();
        if shape.normals.as_ref().is_some_and(|normals| normals.len() != vertex_count) {
            return Err(not_valid(format!(
                "primitive {index} of mesh {mesh} has not one normal for each vertex"
            )));
        }
        if let Some(index_) =
            shape.triangles.iter().flatten().find(|corner| **corner as usize >= vertex_count)
        {
            let of = format!("primitive {index} of mesh {mesh}");
            return Err(MeshFileError::IndexOutOfRange { of, index: u64::from(*index_), vertex_count });
        }
        shapes.push(shape);
    }
    Ok(shapes)
}

fn read(
    document: &Document,
    buffers: &Buffers,
    primitive: &Primitive,
    mode: u32,
) -> Result<Shape, MeshFileError> {
    if let Some(compressed) = &primitive.extensions.draco
        && (draco::IS_BUILT || !has_fallback(document, primitive))
    {
        return read_compressed(document, buffers, primitive, compressed);
    }
    let attributes = &primitive.attributes;
    let position = attributes.position.ok_or_else(|| not_valid("a primitive has no POSITION".into()))?;
    let positions = vectors(document, buffers, position)?;
    let normals = attributes.normal.map(|normal| vectors(document, buffers, normal)).transpose()?;
    let corners = match primitive.indices {
        Some(index) => indices(document, buffers, index)?,
        None => (0..).take(positions.len()).collect(),
    };
    let triangles = match mode {
        TRIANGLE_STRIP => strip(&corners).collect(),
        // The order of the corners of a fan is another one in the specification; the triangles are the same.
        TRIANGLE_FAN => fan(&corners).collect(),
        _ => {
            let (triangles, rest) = corners.as_chunks::<3>();
            if !rest.is_empty() {
                let count = corners.len();
                return Err(not_valid(format!(
                    "triangles have {count} corners; their number must be a multiple of 3"
                )));
            }
            triangles.to_vec()
        }
    };
    Ok(Shape { primitive: 0, positions, normals, triangles })
}

/// True where the content of a compressed primitive is present without compression as well.
fn has_fallback(document: &Document, primitive: &Primitive) -> bool {
    let position = primitive.attributes.position.and_then(|index| document.accessors.get(index));
    position.is_some_and(|accessor| accessor.buffer_view.is_some())
}

fn read_compressed(
    document: &Document,
    buffers: &Buffers,
    primitive: &Primitive,
    compressed: &Draco,
) -> Result<Shape, MeshFileError> {
    let (source, _) = buffers.view(compressed.buffer_view)?;
    let mut decoded = draco::decode(source, &compressed.attributes)?;
    let attributes = &primitive.attributes;
    let stored =
        [(attributes.position, Some(&mut decoded.positions)), (attributes.normal, decoded.normals.as_mut())];
    for (index, values) in stored {
        let (Some(index), Some(values)) = (index, values) else { continue };
        let accessor = accessor(document, index)?;
        for value in values.iter_mut().flatten() {
            *value = denormalized(*value, accessor)?;
        }
    }
    let draco::Decoded { positions, normals, triangles } = decoded;
    Ok(Shape { primitive: 0, positions, normals, triangles })
}

/// Adds the displacements of a morph target.
fn add(values: &mut [[f64; 3]], displacements: &[[f64; 3]], weight: f64) -> Result<(), MeshFileError> {
    if values.len() != displacements.len() {
        let (has, must) = (displacements.len(), values.len());
        return Err(not_valid(format!("a morph target has {has} vertices; it must have {must}")));
    }
    for (value, displacement) in values.iter_mut().flatten().zip(displacements.iter().flatten()) {
        *value += weight * displacement;
    }
    Ok(())
}
