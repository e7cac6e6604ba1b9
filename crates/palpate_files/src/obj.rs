//! Wavefront OBJ files: positions, normals, polygons, objects, groups and names of materials.

use crate::error::MeshFileError;
use crate::piece::{MAX_ELEMENTS, MeshPiece, unit};
use crate::polygon::fan;
use std::collections::HashMap;

pub(crate) const NAME: &str = "OBJ";

/// Polygons of one object and material.
struct Part {
    object: usize,
    material: Option<String>,
    triangles: Vec<[u32; 3]>,
    /// Normal of each vertex, by the indices of the file. `None` once a corner has no normal, or a vertex has two.
    normals: Option<HashMap<u32, u32>>,
}

#[derive(Default)]
struct Reader {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    objects: Vec<Option<String>>,
    object_of: HashMap<Option<String>, usize>,
    parts: Vec<Part>,
    part_of: HashMap<(Option<String>, Option<String>), usize>,
    object: Option<String>,
    material: Option<String>,
    /// The part of the current object and material, if it is known.
    current: Option<usize>,
    triangle_count: usize,
}

/// Reads the pieces of an OBJ file: one for each object or group and material.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<MeshPiece>, MeshFileError> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::default();
    let mut statement = String::new();
    for (line, content) in text.lines().enumerate() {
        let content = content.trim();
        if let Some(first_half) = content.strip_suffix('\\') {
            statement.push_str(first_half);
            statement.push(' ');
        } else if statement.is_empty() {
            reader.read_statement(content, line + 1)?;
        } else {
            statement.push_str(content);
            reader.read_statement(&statement, line + 1)?;
            statement.clear();
        }
    }
    reader.read_statement(&statement, text.lines().count())?;
    Ok(reader.into_pieces())
}

impl Reader {
    fn read_statement(&mut self, statement: &str, line: usize) -> Result<(), MeshFileError> {
        // Names of materials may contain the mark of a comment, at the beginning of a word too.
        let mut words = statement.split_whitespace();
        let name =
            |word: &str| Some(statement.get(word.len()..)?.trim().to_owned()).filter(|name| !name.is_empty());
        match words.next() {
            Some("v") => self.positions.push(three_numbers(words, line)?),
            Some("vn") => self.normals.push(three_numbers(words, line)?),
            Some("f") => self.read_polygon(words, line)?,
            Some(word @ ("o" | "g")) => (self.object, self.current) = (name(word), None),
            Some(word @ "usemtl") => (self.material, self.current) = (name(word), None),
            _ => {}
        }
        Ok(())
    }

    fn read_polygon<'a>(
        &mut self,
        corners: impl Iterator<Item = &'a str>,
        line: usize,
    ) -> Result<(), MeshFileError> {
        let corners: Vec<(u32, Option<u32>)> = corners
            .take_while(|corner| !corner.starts_with('#'))
            .map(|corner| {
                let mut indices = corner.split('/');
                let vertex = indices.next().unwrap_or_default();
                let vertex = index(vertex, self.positions.len(), line, "vertex")?;
                let normal = indices.nth(1).filter(|text| !text.is_empty());
                let normal =
                    normal.map(|text| index(text, self.normals.len(), line, "normal")).transpose()?;
                Ok((vertex, normal))
            })
            .collect::<Result<_, MeshFileError>>()?;
        if corners.len() < 3 {
            return Err(not_valid(
                line,
                format!("a face has {} vertices; it must have at least 3", corners.len()),
            ));
        }
        let part = self.part();
        for (vertex, normal) in &corners {
            let is_the_same = match (&mut part.normals, normal) {
                (Some(normals), Some(normal)) => *normals.entry(*vertex).or_insert(*normal) == *normal,
                _ => false,
            };
            if !is_the_same {
                part.normals = None;
            }
        }
        let polygon: Vec<u32> = corners.iter().map(|(vertex, _)| *vertex).collect();
        let before = part.triangles.len();
        part.triangles.extend(fan(&polygon));
        self.triangle_count += part.triangles.len() - before;
        if self.triangle_count > MAX_ELEMENTS {
            let value = self.triangle_count as u64;
            return Err(MeshFileError::TooLarge {
                what: "number of triangles",
                value,
                max: MAX_ELEMENTS as u64,
            });
        }
        Ok(())
    }

    /// The part of the current object and material.
    fn part(&mut self) -> &mut Part {
        let place = self.current.unwrap_or_else(|| self.find_part());
        self.current = Some(place);
        &mut self.parts[place]
    }

    fn find_part(&mut self) -> usize {
        let next = self.parts.len();
        let place = *self.part_of.entry((self.object.clone(), self.material.clone())).or_insert(next);
        if place == next {
            let object = *self.object_of.entry(self.object.clone()).or_insert(self.objects.len());
            if object == self.objects.len() {
                self.objects.push(self.object.clone());
            }
            let material = self.material.clone();
            self.parts.push(Part { object, material, triangles: Vec::new(), normals: Some(HashMap::new()) });
        }
        place
    }

    fn into_pieces(self) -> Vec<MeshPiece> {
        let mut part_counts = vec![0; self.objects.len()];
        let parts = self.parts.into_iter().filter(|part| !part.triangles.is_empty());
        parts
            .map(|part| {
                let primitive = part_counts[part.object];
                part_counts[part.object] += 1;
                let mut used: Vec<u32> = part.triangles.iter().flatten().copied().collect();
                used.sort_unstable();
                used.dedup();
                let place: HashMap<u32, u32> = used.iter().copied().zip(0..).collect();
                let normal = |normals: &HashMap<u32, u32>, vertex: &u32| {
                    self.normals.get(*normals.get(vertex)? as usize).map(|normal| unit(normal.map(f64::from)))
                };
                let name = self.objects[part.object].clone();
                MeshPiece {
                    node: name.clone(),
                    mesh: part.object,
                    mesh_name: name,
                    primitive,
                    material: part.material,
                    vertices: used.iter().map(|vertex| self.positions[*vertex as usize]).collect(),
                    normals: part
                        .normals
                        .and_then(|normals| used.iter().map(|vertex| normal(&normals, vertex)).collect()),
                    triangles: part
                        .triangles
                        .iter()
                        .map(|corners| corners.map(|corner| place[&corner]))
                        .collect(),
                }
            })
            .collect()
    }
}

fn three_numbers<'a>(
    mut words: impl Iterator<Item = &'a str>,
    line: usize,
) -> Result<[f32; 3], MeshFileError> {
    let mut number = || {
        let word = words.next().unwrap_or_default();
        word.parse().map_err(|_| not_valid(line, format!("a coordinate is `{word}`; it must be a number")))
    };
    Ok([number()?, number()?, number()?])
}

/// The index that `text` names: from 1 counted from the first element, negative counted back from the latest one.
fn index(text: &str, count: usize, line: usize, of: &str) -> Result<u32, MeshFileError> {
    let wrong = || {
        not_valid(line, format!("a face has the {of} `{text}`; it must be 1 to {count} or -{count} to -1"))
    };
    let number: i64 = text.parse().map_err(|_| wrong())?;
    let from_zero = if number > 0 { number - 1 } else { number.saturating_add(count as i64) };
    if number == 0 || from_zero < 0 || from_zero >= count as i64 {
        return Err(wrong());
    }
    u32::try_from(from_zero).map_err(|_| wrong())
}

fn not_valid(line: usize, problem: String) -> MeshFileError {
    MeshFileError::NotValid { format: NAME, problem: format!("line {line}: {problem}") }
}
