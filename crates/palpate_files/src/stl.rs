//! STL files, binary and text.

use crate::error::MeshFileError;
use crate::piece::{MAX_ELEMENTS, MeshPiece};
use crate::polygon::fan;

pub(crate) const NAME: &str = "STL";
/// Bytes of a binary file before its first triangle: a free header and the number of triangles.
const HEADER_BYTES: usize = 84;
/// Bytes of a triangle: a normal, three vertices and two bytes without a meaning.
const TRIANGLE_BYTES: usize = 50;

/// Polygons with a position for each corner: STL has no indices.
#[derive(Default)]
struct Solid {
    name: Option<String>,
    corners: Vec<[f32; 3]>,
    /// Number of corners up to the end of each polygon.
    ends: Vec<usize>,
}

impl Solid {
    /// The triangles of the solid. Corners at equal positions are one vertex, numbered in their order.
    fn into_piece(self) -> MeshPiece {
        // The sum has no negative zero.
        let key = |position: [f32; 3]| position.map(|x| (x + 0.0).to_bits());
        let mut sorted: Vec<([u32; 3], u32)> = self.corners.iter().map(|x| key(*x)).zip(0..).collect();
        sorted.sort_unstable();
        // The first corner at the position of each corner, then its vertex.
        let mut vertex_of = vec![0_u32; sorted.len()];
        for same in sorted.chunk_by(|a, b| a.0 == b.0) {
            same.iter().for_each(|(_, corner)| vertex_of[*corner as usize] = same[0].1);
        }
        drop(sorted);
        let mut vertices = Vec::new();
        for corner in 0..vertex_of.len() {
            let first = vertex_of[corner] as usize;
            if first == corner {
                vertex_of[corner] = vertices.len() as u32;
                vertices.push(self.corners[corner]);
            } else {
                vertex_of[corner] = vertex_of[first];
            }
        }
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let polygons = starts.zip(&self.ends).map(|(start, end)| &vertex_of[start..*end]);
        MeshPiece {
            node: self.name.clone(),
            mesh_name: self.name,
            vertices,
            triangles: polygons.flat_map(fan).collect(),
            ..MeshPiece::default()
        }
    }
}

/// Reads the solids of an STL file.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<MeshPiece>, MeshFileError> {
    let solids = if is_text(bytes) { read_text(bytes)? } else { vec![read_binary(bytes)?] };
    let pieces = solids.into_iter().map(Solid::into_piece).filter(|piece| !piece.triangles.is_empty());
    Ok(pieces.enumerate().map(|(mesh, piece)| MeshPiece { mesh, ..piece }).collect())
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
        // A normal, then three corners.
        let (vectors, _) = numbers.as_chunks::<3>();
        solid.corners.extend(vectors.iter().skip(1).map(|vector| vector.map(f32::from_le_bytes)));
        solid.ends.push(solid.corners.len());
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
                solid.corners.push(position);
                check_count(solid.corners.len() / 3)?;
            }
            "endfacet" => {
                let count = solid.corners.len() - solid.ends.last().copied().unwrap_or_default();
                if count < 3 {
                    let problem = format!("a facet has {count} vertices; it must have at least 3");
                    return Err(not_valid(problem));
                }
                solid.ends.push(solid.corners.len());
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
    Ok(solids)
}
