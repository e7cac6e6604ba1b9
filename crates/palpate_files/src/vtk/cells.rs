//! Cells of VTK: lists of nodes with types.

use super::cell_types::{cell_type, type_name};
use crate::error::MeshFileError;
use crate::volume::VolumeBuilder;

/// Maximum number of nodes of all cells for each cell: bounds what a compressed file can expand to.
#[cfg(feature = "vtu")]
pub(crate) const MAX_CORNERS: usize = 27;

/// The nodes of each cell.
pub(crate) struct Cells {
    /// Place of the first node of each cell in `nodes`, then the number of `nodes`.
    offsets: Vec<usize>,
    nodes: Vec<i64>,
}

impl Cells {
    /// Cells with their `offsets`, of which there is one more than cells. Without cells there may be none.
    pub fn new(format: &'static str, offsets: Vec<i64>, nodes: Vec<i64>) -> Result<Self, MeshFileError> {
        let not_valid = |problem| MeshFileError::VolumeNotValid { format, problem };
        if let Some(pair) = offsets.windows(2).find(|pair| pair[1] < pair[0]) {
            let problem = format!("an offset of a cell is {}; it must be at least {}", pair[1], pair[0]);
            return Err(not_valid(problem));
        }
        let (first, last) = (offsets.first().copied().unwrap_or(0), offsets.last().copied().unwrap_or(0));
        if first != 0 || last != nodes.len() as i64 {
            let problem =
                format!("the offsets of cells are {first} to {last}; they must be 0 to {}", nodes.len());
            return Err(not_valid(problem));
        }
        Ok(Self { offsets: offsets.into_iter().map(|offset| offset as usize).collect(), nodes })
    }

    fn count(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }
}

/// Adds `cells` with their `types` and regions to `builder`. Their nodes are counted from the node `first_node` of `builder`.
pub(crate) fn push_cells(
    builder: &mut VolumeBuilder,
    format: &'static str,
    first_node: usize,
    cells: &Cells,
    types: &[i64],
    regions: Option<&[i64]>,
) -> Result<(), MeshFileError> {
    let not_valid = |problem| MeshFileError::VolumeNotValid { format, problem };
    let count = cells.count();
    if types.len() != count {
        return Err(not_valid(format!("it has {} types of cells; it must have {count}", types.len())));
    }
    if let Some(regions) = regions.filter(|regions| regions.len() != count) {
        let problem = format!("the array of regions has {} values; it must have {count}", regions.len());
        return Err(not_valid(problem));
    }
    for (cell, kind) in types.iter().enumerate() {
        let nodes = &cells.nodes[cells.offsets[cell]..cells.offsets[cell + 1]];
        let Some((shape, places)) = cell_type(*kind) else {
            let count = types.iter().filter(|other| **other == *kind).count() as u64;
            return Err(MeshFileError::ElementNotRead { format, element: type_name(*kind), count });
        };
        if !shape.is_solid() {
            builder.leave_out(shape);
            continue;
        }
        if nodes.len() < places.len() {
            let (held, needed) = (nodes.len(), places.len());
            return Err(not_valid(format!("cell {cell} has {held} nodes; it must have {needed} at least")));
        }
        let mut corners = [0; 8];
        for (corner, place) in corners.iter_mut().zip(places) {
            let node = nodes[*place];
            let index = usize::try_from(node).ok().and_then(|node| node.checked_add(first_node));
            *corner = index.and_then(|index| u32::try_from(index).ok()).ok_or_else(|| {
                if node < 0 {
                    not_valid(format!("cell {cell} has the node {node}; it must be a whole number from 0"))
                } else {
                    builder.node_missing(node as u64)
                }
            })?;
        }
        let region = regions.map_or(0, |regions| regions[cell]);
        builder.push(shape, &corners[..places.len()], nodes.len() > places.len(), [region, 0])?;
    }
    Ok(())
}
