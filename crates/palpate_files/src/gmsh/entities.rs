//! Entities of the geometry, which have the physical groups of elements since version 4.

use super::header::{Layout, Version};
use crate::error::MeshFileError;
use crate::scanner::{Scalar, Scanner};
use crate::volume::RegionKey;
use std::collections::HashMap;

/// Region of each volume that has a physical group or a parent, by its number.
#[derive(Default)]
pub(super) struct Entities {
    volumes: HashMap<i64, RegionKey>,
}

impl Entities {
    /// Region of the elements of the volume `entity`.
    pub fn region(&self, entity: i64) -> RegionKey {
        self.volumes.get(&entity).copied().unwrap_or([0, entity])
    }

    /// Reads the section `$Entities`.
    pub fn read(&mut self, scanner: &mut Scanner, layout: Layout) -> Result<(), MeshFileError> {
        self.read_entities(scanner, layout, false)
    }

    /// Reads the section `$PartitionedEntities`. A partition of a volume belongs to the region of that volume.
    pub fn read_partitioned(&mut self, scanner: &mut Scanner, layout: Layout) -> Result<(), MeshFileError> {
        scanner.count(layout.size)?;
        for _ in 0..scanner.count(layout.size)? {
            // A ghost entity and its partition.
            scanner.skip(Scalar::I32, 2)?;
        }
        self.read_entities(scanner, layout, true)
    }

    fn read_entities(
        &mut self,
        scanner: &mut Scanner,
        layout: Layout,
        is_partition: bool,
    ) -> Result<(), MeshFileError> {
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = scanner.count(layout.size)?;
        }
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let entity = scanner.integer(Scalar::I32)?;
                let mut parent = entity;
                if is_partition {
                    scanner.skip(Scalar::I32, 1)?;
                    parent = scanner.integer(Scalar::I32)?;
                    skip_list(scanner, layout)?;
                }
                // A position or a box.
                let is_point = dimension == 0 && layout.version == Version::V41;
                scanner.skip(Scalar::F64, if is_point { 3 } else { 6 })?;
                let group_count = scanner.count(layout.size)?;
                let mut group = 0;
                for place in 0..group_count {
                    let number = scanner.integer(Scalar::I32)?;
                    if place == 0 {
                        // A negative number reverses the orientation of the group.
                        group = number.saturating_abs();
                    }
                }
                if dimension > 0 {
                    skip_list(scanner, layout)?;
                }
                if dimension == 3 {
                    self.volumes.insert(entity, [group, parent]);
                }
            }
        }
        Ok(())
    }
}

/// Skips a list of numbers after their count.
fn skip_list(scanner: &mut Scanner, layout: Layout) -> Result<(), MeshFileError> {
    let count = scanner.count(layout.size)?;
    scanner.skip(Scalar::I32, usize::try_from(count).unwrap_or(usize::MAX))
}
