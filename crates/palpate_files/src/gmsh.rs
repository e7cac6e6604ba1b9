//! Gmsh files, versions 2.0 to 2.2, 4.0 and 4.1, in text and in both orders of bytes.

mod element_types;
mod elements;
mod entities;
mod header;
mod nodes;
mod sections;

use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scanner};
use crate::volume::{TetrahedralRegion, Volume, VolumeBuilder};
use entities::Entities;
use header::NAME;
use std::collections::HashMap;

/// Reads the elements of a Gmsh file.
pub(crate) fn read(bytes: &[u8]) -> Result<Volume, MeshFileError> {
    let mut scanner = Scanner::new(NAME, bytes, Encoding::Text);
    let mut layout = None;
    let mut names = HashMap::new();
    let mut entities = Entities::default();
    let mut builder = VolumeBuilder::new(NAME);
    let mut numbers = None;
    let mut has_elements = false;
    while let Some(section) = sections::next(&mut scanner)? {
        match (section, layout) {
            ("MeshFormat", None) => layout = Some(header::read(&mut scanner)?),
            ("NOD" | "ELM", None) => return Err(header::version_not_read("1")),
            ("Nodes" | "Elements" | "Entities" | "PartitionedEntities" | "PhysicalNames", None) => {
                return Err(scanner.not_valid(format!("${section} comes before $MeshFormat")));
            }
            ("PhysicalNames", Some(_)) => sections::read_names(&mut scanner, &mut names)?,
            ("Entities", Some(layout)) => entities.read(&mut scanner, layout)?,
            ("PartitionedEntities", Some(layout)) => entities.read_partitioned(&mut scanner, layout)?,
            ("Nodes", Some(layout)) if numbers.is_none() => {
                numbers = Some(nodes::read(&mut scanner, layout, &mut builder)?);
            }
            ("Elements", Some(layout)) if !has_elements => {
                let Some(numbers) = &numbers else {
                    return Err(scanner.not_valid("$Elements comes before $Nodes".into()));
                };
                elements::read(&mut scanner, layout, numbers, &entities, &mut builder)?;
                has_elements = true;
            }
            ("ParametricNodes", _) => {
                let problem = "it has $ParametricNodes; it must have $Nodes, as without Mesh.SaveParametric";
                return Err(scanner.not_valid(problem.into()));
            }
            ("MeshFormat" | "Nodes" | "Elements", _) => {
                return Err(scanner.not_valid(format!("it has two sections ${section}")));
            }
            _ => {
                sections::skip(&mut scanner, section)?;
                continue;
            }
        }
        sections::end(&mut scanner, section)?;
    }
    if layout.is_none() {
        let problem = "it has no section $MeshFormat".into();
        return Err(MeshFileError::VolumeNotValid { format: NAME, problem });
    }
    if !has_elements {
        let problem = "it has no section $Elements".into();
        return Err(MeshFileError::VolumeNotValid { format: NAME, problem });
    }
    // Gmsh saves the elements of physical groups alone, unless all elements are asked for.
    let has_groups = builder.region_keys().iter().any(|[group, _]| *group != 0);
    builder.finish(|[group, entity]| TetrahedralRegion {
        number: if has_groups { group } else { entity },
        name: if has_groups { names.get(&group).cloned() } else { None },
    })
}
