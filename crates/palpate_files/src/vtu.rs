//! VTU files: unstructured grids of VTK in XML.

mod base64_stream;
mod data_array;
mod document;

use crate::error::MeshFileError;
use crate::volume::{TetrahedralRegion, Volume, VolumeBuilder};
use crate::vtk::{Cells, MAX_CORNERS, push_cells, rank};
use data_array::DataReader;
use document::{NAME, Parts, not_valid};
use roxmltree::Node;

/// Reads the cells of a VTU file: all pieces.
pub(crate) fn read(bytes: &[u8]) -> Result<Volume, MeshFileError> {
    let parts = Parts::new(bytes)?;
    let document = document::parse(&parts)?;
    let root = document.root_element();
    if !root.has_tag_name("VTKFile") {
        return Err(not_valid("its root must be <VTKFile>".into()));
    }
    let content = root.attribute("type").unwrap_or_default();
    if content != "UnstructuredGrid" {
        let content = crate::scanner::shorten(content);
        return Err(MeshFileError::OtherDataSet { format: NAME, content });
    }
    let data = DataReader::new(root, &parts)?;
    let mut builder = VolumeBuilder::new(NAME);
    let pieces = children(root, "UnstructuredGrid").flat_map(|grid| children(grid, "Piece"));
    for (place, piece) in pieces.enumerate() {
        read_piece(place, piece, &data, &mut builder)?;
    }
    builder.finish(|[number, _]| TetrahedralRegion { number, name: None })
}

fn children<'a, 'input>(
    node: Node<'a, 'input>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'input>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

fn read_piece(
    place: usize,
    piece: Node,
    data: &DataReader,
    builder: &mut VolumeBuilder,
) -> Result<(), MeshFileError> {
    let count = |name: &'static str, of: &'static str| {
        let value = piece.attribute(name).and_then(|text| text.trim().parse().ok());
        let Some(value) = value else {
            return Err(not_valid(format!("piece {place} must have a whole number {name}")));
        };
        VolumeBuilder::check_count(of, value)
    };
    let node_count = count("NumberOfPoints", "number of nodes")?;
    let cell_count = count("NumberOfCells", "number of cells")?;
    // A file may have an empty piece, without arrays.
    if cell_count == 0 {
        return Ok(());
    }
    let first_node = builder.nodes().len();
    VolumeBuilder::check_count("number of nodes", (first_node + node_count) as u64)?;

    let array = |section: &'static str, name: Option<&str>| {
        let mut arrays = children(piece, section).flat_map(|section| children(section, "DataArray"));
        let array = arrays.find(|array| name.is_none_or(|name| array.attribute("Name") == Some(name)));
        array.ok_or_else(|| {
            let name = name.map(|name| format!(" {name}")).unwrap_or_default();
            not_valid(format!("piece {place} must have an array{name} in <{section}>"))
        })
    };
    let positions = data.floats(array("Points", None)?, 3 * node_count)?;
    positions.as_chunks::<3>().0.iter().for_each(|position| builder.push_node(*position));
    drop(positions);

    let ends = data.integers(array("Cells", Some("offsets"))?, cell_count)?;
    let node_count = ends.last().copied().unwrap_or_default();
    let max = (MAX_CORNERS * cell_count) as u64;
    let node_count = match u64::try_from(node_count) {
        Ok(value) if value > max => {
            return Err(MeshFileError::TooLarge { what: "number of nodes of all cells", value, max });
        }
        Ok(value) => value as usize,
        Err(_) => return Err(not_valid(format!("the last offset is {node_count}; it must be from 0"))),
    };
    let nodes = data.integers(array("Cells", Some("connectivity"))?, node_count)?;
    let offsets = std::iter::once(0).chain(ends).collect();
    let cells = Cells::new(NAME, offsets, nodes)?;
    let types = data.integers(array("Cells", Some("types"))?, cell_count)?;
    let regions = read_regions(piece, data, cell_count);
    push_cells(builder, NAME, first_node, &cells, &types, regions.as_deref())
}

/// Region of each cell: the first of the arrays of regions that contains whole numbers.
fn read_regions(piece: Node, data: &DataReader, cell_count: usize) -> Option<Vec<i64>> {
    let arrays = children(piece, "CellData").flat_map(|section| children(section, "DataArray"));
    let mut ranked: Vec<(usize, Node)> = arrays
        .filter(|array| matches!(array.attribute("NumberOfComponents"), None | Some("1")))
        .filter_map(|array| Some((rank(array.attribute("Name")?)?, array)))
        .collect();
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.into_iter().find_map(|(_, array)| data.integers(array, cell_count).ok())
}
