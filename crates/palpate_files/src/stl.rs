//! STL files, binary and text.

use crate::error::MeshFileError;
use crate::piece::{MAX_ELEMENTS, MeshPiece};
use crate::polygon::fan;
use std::collections::HashMap;

pub(crate) const NAME: &str = "STL";
/// Bytes of a binary file before its first triangle: a free header and the number of triangles.
const HEADER_BYTES: usize = 84;
/// Bytes of a triangle: a normal, three vertices and two bytes without a meaning.
const TRIANGLE_BYTES: usize = 50;

/// Merges equal vertices: STL has no indices, and each triangle repeats its corners.
#[derive(Default)]
struct Solid {
    name: Option<String>,
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    vertex_of: HashMap<[u32; 3], u32>,
}

impl Solid {
    fn vertex(&mut self, position: [f32; 3]) -> u32 {
        // The sum has no negative zero.
        let key = position.map(|x| (x + 0.0).to_bits());
        let count = self.vertices.len() as u32;
        let vertex = *self.vertex_of.entry(key).or_insert(count);
        if vertex == count {
            self.vertices.push(position);
        }
        vertex
    }
}

/// Reads the solids of an STL file.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<MeshPiece>, MeshFileError> {
    let solids = if is_text(bytes) { read_text(bytes)? } else { vec![read_binary(bytes)?] };
    let pieces = solids.into_iter().enumerate().map(|(mesh, solid)| MeshPiece {
        node: solid.name.clone(),
        mesh,
        mesh_name: solid.name,
        vertices: solid.vertices,
        triangles: solid.triangles,
        ..MeshPiece::default()
    });
    Ok(pieces.filter(|piece| !piece.triangles.is_empty()).collect())
}

/// Number of triangles that the header of a binary file states.
fn stated_count(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*count)).ok()
}

/// True for a text file. Many binary files begin with `solid` like a text file; their length is that of the stated triangles.
fn is_text(bytes: &[u8]) -> bool {
    let has_binary_length = stated_count(bytes)
        .and_then(|count| count.checked_mul(TRIANGLE_BYTES)?.checked_add(HEADER_BYTES))
        .is_some_and(|length| length == bytes.len());
    let begins_with_solid =
        bytes.trim_ascii_start().get(..5).is_some_and(|start| start.eq_ignore_ascii_case(b"solid"));
    begins_with_solid && !has_binary_length
}

fn read_binary(bytes: &[u8]) -> Result<Solid, MeshFileError> {
    let not_valid = |problem: String| MeshFileError::NotValid { format: NAME, problem };
    let Some(count) = stated_count(bytes) else {
        return Err(not_valid(format!(
            "it has {} bytes; a binary file has at least {HEADER_BYTES}",
            bytes.len()
        )));
    };
    let body = bytes.get(HEADER_BYTES..).unwrap_or_default();
    let held = body.len() / TRIANGLE_BYTES;
    if held < count {
        return Err(not_valid(format!("it states {count} triangles and ends after {held}")));
    }
    check_count(count)?;
    let mut solid = Solid::default();
    for triangle in body.chunks_exact(TRIANGLE_BYTES).take(count) {
        let (numbers, _) = triangle.as_chunks::<4>();
        let mut corners = numbers.iter().skip(3).map(|number| f32::from_le_bytes(*number));
        let mut corner = || {
            let mut next = || corners.next().unwrap_or_default();
            solid.vertex([next(), next(), next()])
        };
        let polygon = [corner(), corner(), corner()];
        solid.triangles.extend(fan(&polygon));
    }
    Ok(solid)
}

fn check_count(count: usize) -> Result<(), MeshFileError> {
    if count > MAX_ELEMENTS {
        let (value, max) = (count as u64, MAX_ELEMENTS as u64);
        return Err(MeshFileError::TooLarge { what: "number of triangles", value, max });
    }
    Ok(())
}

fn read_text(bytes: &[u8]) -> Result<Vec<Solid>, MeshFileError> {
    let text = String::from_utf8_lossy(bytes);
    let mut solids: Vec<Solid> = Vec::new();
    let mut solid = Solid::default();
    let mut polygon = Vec::new();
    let mut is_in_solid = false;
    for (line, content) in text.lines().enumerate() {
        let not_valid = |problem: String| MeshFileError::NotValid {
            format: NAME,
            problem: format!("line {}: {problem}", line + 1),
        };
        let mut words = content.split_whitespace();
        let Some(keyword) = words.next() else { continue };
        match keyword.to_ascii_lowercase().as_str() {
            "solid" => {
                solids.push(std::mem::take(&mut solid));
                solid.name = Some(words.collect::<Vec<_>>().join(" ")).filter(|name| !name.is_empty());
                is_in_solid = true;
            }
            "vertex" => {
                let mut number = || {
                    let word = words.next().unwrap_or_default();
                    word.parse()
                        .map_err(|_| not_valid(format!("a coordinate is `{word}`; it must be a number")))
                };
                let position = [number()?, number()?, number()?];
                polygon.push(solid.vertex(position));
            }
            "endfacet" => {
                if polygon.len() < 3 {
                    let problem = format!("a facet has {} vertices; it must have at least 3", polygon.len());
                    return Err(not_valid(problem));
                }
                solid.triangles.extend(fan(&polygon));
                polygon.clear();
            }
            "endsolid" => is_in_solid = false,
            "facet" | "outer" | "endloop" => {}
            other => return Err(not_valid(format!("`{other}` is no keyword of STL"))),
        }
    }
    if is_in_solid {
        return Err(MeshFileError::NotValid {
            format: NAME,
            problem: "it ends without `endsolid`, so a part of it is missing".into(),
        });
    }
    solids.push(solid);
    Ok(solids.into_iter().filter(|solid| !solid.triangles.is_empty()).collect())
}
