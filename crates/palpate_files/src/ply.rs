//! PLY files: text and binary, with polygons or triangle strips.

mod header;
mod numbers;

use crate::error::MeshFileError;
use crate::piece::{MAX_ELEMENTS, MeshPiece, unit};
use crate::polygon::{fan, strip};
use header::{Element, Property, not_valid};
use numbers::Numbers;

pub(crate) use header::NAME;

/// Reads the mesh of a PLY file.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<MeshPiece>, MeshFileError> {
    let (header, rest) = header::read(bytes)?;
    let mut numbers = Numbers::new(header.encoding, rest);
    let mut piece = MeshPiece::default();
    for element in &header.elements {
        if element.count > MAX_ELEMENTS as u64 {
            let max = MAX_ELEMENTS as u64;
            return Err(MeshFileError::TooLarge { what: "number of elements", value: element.count, max });
        }
        match element.name.as_str() {
            "vertex" => read_vertices(element, &mut numbers, &mut piece)?,
            "face" => read_lists(element, &mut numbers, |polygon| piece.triangles.extend(fan(polygon)))?,
            "tristrips" => read_lists(element, &mut numbers, |vertices| {
                // The index -1 ends a strip.
                let strips = vertices.split(|vertex| *vertex == u32::MAX);
                piece.triangles.extend(strips.flat_map(strip));
            })?,
            _ => skip(element, &mut numbers)?,
        }
        if piece.triangles.len() > MAX_ELEMENTS {
            let (value, max) = (piece.triangles.len() as u64, MAX_ELEMENTS as u64);
            return Err(MeshFileError::TooLarge { what: "number of triangles", value, max });
        }
    }
    let vertex_count = piece.vertices.len();
    if let Some(index) = piece.triangles.iter().flatten().find(|index| **index as usize >= vertex_count) {
        let (of, index) = ("the PLY file".into(), u64::from(*index));
        return Err(MeshFileError::IndexOutOfRange { of, index, vertex_count });
    }
    Ok(if piece.triangles.is_empty() { Vec::new() } else { vec![piece] })
}

fn read_vertices(
    element: &Element,
    numbers: &mut Numbers,
    piece: &mut MeshPiece,
) -> Result<(), MeshFileError> {
    if !piece.vertices.is_empty() {
        return Err(not_valid("it has two elements `vertex`".into()));
    }
    let place = |name: &str| element.properties.iter().position(|property| property.name == name);
    let places = |names: [&str; 3]| Some([place(names[0])?, place(names[1])?, place(names[2])?]);
    let Some(position_at) = places(["x", "y", "z"]) else {
        return Err(not_valid("the element `vertex` has no properties `x`, `y` and `z`".into()));
    };
    let normal_at = places(["nx", "ny", "nz"]);
    let mut normals = Vec::new();
    let mut row = vec![0.0; element.properties.len()];
    for _ in 0..element.count {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            *value = match property.count {
                Some(_) => {
                    skip_list(property, numbers)?;
                    0.0
                }
                None => numbers.next(property.scalar)?,
            };
        }
        piece.vertices.push(position_at.map(|at| row[at] as f32));
        normals.extend(normal_at.map(|places| unit(places.map(|at| row[at]))));
    }
    piece.normals = normal_at.is_some().then_some(normals);
    Ok(())
}

/// Reads an element with a list of vertices.
fn read_lists(
    element: &Element,
    numbers: &mut Numbers,
    mut read: impl FnMut(&[u32]),
) -> Result<(), MeshFileError> {
    let is_list = |property: &Property| matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
    if element.count > 0 && !element.properties.iter().any(is_list) {
        return Err(not_valid(format!("the element `{}` has no list `vertex_indices`", element.name)));
    }
    let mut list = Vec::new();
    for _ in 0..element.count {
        for property in &element.properties {
            let Some(count) = property.count.filter(|_| is_list(property)) else {
                skip_property(property, numbers)?;
                continue;
            };
            list.clear();
            for _ in 0..length(numbers.next(count)?)? {
                let index = numbers.next(property.scalar)?;
                let is_index = index.fract() == 0.0 && (-1.0..f64::from(u32::MAX)).contains(&index);
                if !is_index {
                    return Err(not_valid(format!("an index is {index}; it must be a whole number from 0")));
                }
                // The index -1, which ends a strip, becomes the largest number.
                list.push(index as i64 as u32);
            }
            read(&list);
        }
    }
    Ok(())
}

fn skip(element: &Element, numbers: &mut Numbers) -> Result<(), MeshFileError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        element.properties.iter().try_for_each(|property| skip_property(property, numbers))?;
    }
    Ok(())
}

fn skip_property(property: &Property, numbers: &mut Numbers) -> Result<(), MeshFileError> {
    match property.count {
        Some(_) => skip_list(property, numbers),
        None => numbers.next(property.scalar).map(|_| ()),
    }
}

fn skip_list(property: &Property, numbers: &mut Numbers) -> Result<(), MeshFileError> {
    let Some(count) = property.count else { return Ok(()) };
    for _ in 0..length(numbers.next(count)?)? {
        numbers.next(property.scalar)?;
    }
    Ok(())
}

/// The length of a list. Each of its numbers takes at least one byte, so a length beyond the file ends in an error.
fn length(count: f64) -> Result<u64, MeshFileError> {
    if count.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&count) {
        Ok(count as u64)
    } else {
        Err(not_valid(format!("the length of a list is {count}; it must be a whole number from 0")))
    }
}
