//! Legacy VTK files.

use crate::grid::{self, Grid, assert_cube, assert_mixed};
use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat};

fn read(bytes: &[u8]) -> Result<TetrahedralFile, MeshFileError> {
    TetrahedralFile::from_bytes(bytes, TetrahedralFormat::Vtk, None)
}

/// Writes numbers in text, or in bytes with the highest first.
struct Writer {
    bytes: Vec<u8>,
    is_binary: bool,
}

impl Writer {
    fn line(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
        self.bytes.push(b'\n');
    }

    fn numbers(&mut self, values: impl Iterator<Item = f64>, number: fn(f64) -> Vec<u8>) {
        for value in values {
            if self.is_binary {
                self.bytes.extend(number(value));
            } else {
                self.bytes.extend(format!("{value} ").as_bytes());
            }
        }
        self.line("");
    }
}

fn int(value: f64) -> Vec<u8> {
    (value as i32).to_be_bytes().to_vec()
}

fn long(value: f64) -> Vec<u8> {
    (value as i64).to_be_bytes().to_vec()
}

fn float(value: f64) -> Vec<u8> {
    (value as f32).to_be_bytes().to_vec()
}

fn double(value: f64) -> Vec<u8> {
    value.to_be_bytes().to_vec()
}

/// A file of version 3, or of version 5.1 with offsets.
pub fn file(grid: &Grid, is_binary: bool, has_offsets: bool) -> Vec<u8> {
    let mut writer = Writer { bytes: Vec::new(), is_binary };
    let version = if has_offsets { "5.1" } else { "3.0" };
    let encoding = if is_binary { "BINARY" } else { "ASCII" };
    writer
        .line(&format!("# vtk DataFile Version {version}\na volume\n{encoding}\nDATASET UNSTRUCTURED_GRID"));
    writer.line("FIELD FieldData 1\nTIME 1 1 double");
    writer.numbers([0.5].into_iter(), double);
    let (count, cell_count) = (grid.nodes.len(), grid.elements.len());
    let positions = grid.nodes.iter().flat_map(|(_, position)| *position);
    if has_offsets {
        writer.line(&format!("POINTS {count} double"));
        writer.numbers(positions, double);
        writer.line("METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n");
    } else {
        writer.line(&format!("POINTS {count} float"));
        writer.numbers(positions, float);
    }
    let nodes = |place: usize| grid.elements[place].vtk_nodes().into_iter().map(|node| node as f64);
    let size: usize = grid.elements.iter().map(|element| element.nodes.len()).sum();
    if has_offsets {
        writer.line(&format!("CELLS {} {size}\nOFFSETS vtktypeint64", cell_count + 1));
        let ends = grid.elements.iter().scan(0, |end, element| {
            *end += element.nodes.len();
            Some(*end as f64)
        });
        writer.numbers(std::iter::once(0.0).chain(ends), long);
        writer.line("CONNECTIVITY vtktypeint64");
        writer.numbers((0..cell_count).flat_map(nodes), long);
    } else {
        writer.line(&format!("CELLS {cell_count} {}", size + cell_count));
        let length = |place: usize| grid.elements[place].nodes.len() as f64;
        let numbers = (0..cell_count).flat_map(|place| std::iter::once(length(place)).chain(nodes(place)));
        writer.numbers(numbers, int);
    }
    writer.line(&format!("CELL_TYPES {cell_count}"));
    writer.numbers(grid.elements.iter().map(|element| f64::from(element.kind.vtk())), int);

    let fractions = || (0..).map(|place| f64::from(place) + 0.5);
    let groups = || grid.elements.iter().map(|element| f64::from(element.group));
    writer.line(&format!("CELL_DATA {cell_count}\nSCALARS quality double 1\nLOOKUP_TABLE default"));
    writer.numbers(fractions().take(cell_count), double);
    writer.line("VECTORS fibre float");
    writer.numbers(fractions().take(3 * cell_count), float);
    // Ranks: `material` of fractions is none, `label` is below `region`, and both are read before the end.
    writer.line(&format!("FIELD FieldData 5\nmaterial 1 {cell_count} float"));
    writer.numbers(fractions().take(cell_count), float);
    writer.line(&format!("label 1 {cell_count} vtkIdType"));
    writer.numbers(grid.elements.iter().map(|_| 99.0), int);
    writer.line(&format!("names 1 {cell_count} string"));
    for place in 0..cell_count {
        if is_binary {
            // A length of one byte, and one of two bytes.
            writer.bytes.extend(if place % 2 == 0 { b"\xc2ab".as_slice() } else { b"\x80\x03abc" });
        } else {
            writer.line("a%20name");
        }
    }
    writer.line("");
    writer.line(&format!("Region_Id 1 {cell_count} int"));
    writer.numbers(groups(), int);
    writer.line("METADATA\nINFORMATION 0\n");
    writer.line(&format!("flags 1 {cell_count} bit"));
    if is_binary {
        writer.bytes.extend(vec![0xff; cell_count.div_ceil(8)]);
        writer.line("");
    } else {
        writer.numbers(groups().map(|_| 1.0), int);
    }
    writer.line(&format!("POINT_DATA {count}\nSCALARS region int\nLOOKUP_TABLE table"));
    writer.numbers(grid.nodes.iter().map(|_| 1.0), int);
    writer.line("LOOKUP_TABLE table 2");
    writer.numbers([0.0, 1.0, 0.0, 1.0].repeat(2).into_iter(), |value| vec![value as u8]);
    writer.line("COLOR_SCALARS colours 3");
    writer.numbers((0..3 * count).map(|_| 1.0), |value| vec![value as u8]);
    writer.line("TEXTURE_COORDINATES uv 2 float");
    writer.numbers((0..2 * count).map(|_| 1.0), float);
    writer.line("TENSORS stress float");
    writer.numbers((0..9 * count).map(|_| 1.0), float);
    writer.bytes
}

pub fn all(grid: &Grid) -> [Vec<u8>; 4] {
    [file(grid, false, false), file(grid, true, false), file(grid, false, true), file(grid, true, true)]
}

#[test]
fn reads_cube_with_regions_in_each_version_and_encoding() {
    for bytes in all(&grid::cube()) {
        let file = read(&bytes).unwrap();
        assert_cube(&file, 7, 2);
        let counts = file.counts;
        assert_eq!([counts.points, counts.lines, counts.faces, counts.unused_nodes], [1; 4]);
    }
    for bytes in all(&grid::cube().quadratic()) {
        let file = read(&bytes).unwrap();
        assert_cube(&file, 7, 2);
        assert_eq!(file.counts.high_order, 6);
    }
}

#[test]
fn splits_mixed_elements_into_conforming_tetrahedra() {
    for seed in 0..20 {
        for bytes in all(&grid::mixed(seed)) {
            assert_mixed(&read(&bytes).unwrap());
        }
    }
}

fn text(cells: &str, types: &str, data: &str) -> String {
    let points =
        grid::cube().nodes[1..].iter().map(|(_, [x, y, z])| format!("{x} {y} {z}\n")).collect::<String>();
    format!(
        "# vtk DataFile Version 2.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 float\n{points}{cells}\n{types}\n{data}"
    )
}

#[test]
fn reads_voxels_and_cells_without_regions() {
    // The corners of a voxel are those of the cube.
    let file = read(text("CELLS 1 9\n8 0 1 2 3 4 5 6 7", "CELL_TYPES 1\n11", "").as_bytes()).unwrap();
    assert_eq!(grid::six_fold_volumes(&file), [1.0; 6]);
    grid::assert_conforming(&file);
    assert_eq!((file.counts.hexahedra, file.regions), (1, vec![0; 6]));
    assert_eq!((file.region_list.len(), file.region_list[0].number), (1, 0));
}

#[test]
fn selects_array_of_regions_by_rank() {
    let data = |names: [&str; 2]| {
        let array =
            |(name, number): (&str, i32)| format!("SCALARS {name} int\nLOOKUP_TABLE default\n{number}\n");
        format!("CELL_DATA 1\n{}{}", array((names[0], 5)), array((names[1], 6)))
    };
    for (names, expected) in [
        (["gmsh:physical", "gmsh:geometrical"], 5),
        (["gmsh:geometrical", "gmsh:physical"], 6),
        (["MaterialID", "region"], 6),
        (["CellEntityIds", "label"], 5),
        (["quality", "cell_tags"], 6),
        (["regional", "quality"], 0),
    ] {
        let file = read(text("CELLS 1 5\n4 0 1 2 4", "CELL_TYPES 1\n10", &data(names)).as_bytes()).unwrap();
        assert_eq!(file.region_list[0].number, expected, "{names:?}");
    }
}

#[test]
fn rejects_broken_files_with_the_reason() {
    let [cells, types] = ["CELLS 1 5\n4 0 1 2 4", "CELL_TYPES 1\n10"];
    let cases = [
        (text("CELLS 2 5\n4 0 1 2 4", types, ""), "the 2 cells do not fit into the 5 numbers"),
        (text("CELLS 1 5\n5 0 1 2 4", types, ""), "the 1 cells do not fit"),
        (text("CELLS 1 5\n-4 0 1 2 4", types, ""), "the 1 cells do not fit"),
        (text("CELLS 1 4\n3 0 1 2", types, ""), "cell 0 has 3 nodes; it must have 4 at least"),
        (text("CELLS 1 5\n4 0 1 2 -4", types, ""), "cell 0 has the node -4"),
        (text("CELLS 1 5\n4 0 1 2 1.5", types, ""), "line 15: a value is 1.5; it must be a whole number"),
        (text(cells, "CELL_TYPES 2\n10 10", ""), "it has 2 types of cells; it must have 1"),
        (text(cells, "", ""), "must have the sections CELLS and CELL_TYPES"),
        (text(cells, "CELL_TYPES 3\n10", ""), "it ends before the last"),
        (
            text(cells, types, "CELL_DATA 2\nSCALARS region int\nLOOKUP_TABLE default\n1 1"),
            "the array of regions has 2 values",
        ),
        (text(cells, types, "SCALAR region int"), "`SCALAR` is no keyword"),
        (text(cells, types, "CELL_DATA 1\nSCALARS region"), "`SCALARS region` is not valid"),
        (
            text("CELLS 2 4\nOFFSETS int\n0 3\nCONNECTIVITY int\n0 1 2 4", types, ""),
            "the offsets of cells are 0 to 3",
        ),
        (
            text("CELLS 3 4\nOFFSETS int\n0 5 4\nCONNECTIVITY int\n0 1 2 4", types, ""),
            "an offset of a cell is 4; it must be at least 5",
        ),
        (text("CELLS 2 4\nOFFSETS int\n0 4\nNODES int\n0 1 2 4", types, ""), "the array CONNECTIVITY"),
        (text(cells, types, "").replace("POINTS 8 float", "POINTS 8 string"), "POINTS must have a type"),
        (text(cells, types, "").replace("POINTS 8", "POINTS eight"), "the number of nodes is `eight`"),
        (text(cells, types, "").replace("ASCII", "TEXT"), "the third line is `TEXT`"),
        (text(cells, types, "").replace("# vtk", "vtk"), "the first line must begin"),
        (text(cells, types, "").replace("1 1 1\n", "1 1 1\nPOINTS 1 float\n0 0 0\n"), "two sections POINTS"),
        (
            text(cells, types, "").replace("0 1 0\n", "0 nan 0\n"),
            "a coordinate of a node of an element is NaN",
        ),
    ];
    for (broken, expected) in cases {
        let error = read(broken.as_bytes()).unwrap_err();
        assert!(matches!(error, MeshFileError::VolumeNotValid { format: "VTK", .. }), "{error}");
        assert!(error.to_string().contains(expected), "{expected}: {error}");
    }
    let error = read(text("CELLS 1 5\n4 0 1 2 8", types, "").as_bytes()).unwrap_err();
    assert!(matches!(error, MeshFileError::NodeNotFound { node: 8, node_count: 8, .. }), "{error}");
    let error = read(text(cells, types, "").replace("2.0", "6.0").as_bytes()).unwrap_err();
    assert!(matches!(error, MeshFileError::VersionNotRead { .. }), "{error}");
    let error = read(text(cells, types, "").replace("POINTS 8", "POINTS 1000000000").as_bytes()).unwrap_err();
    assert!(matches!(error, MeshFileError::TooLarge { .. }), "{error}");
    let error = read(text("CELLS 1 5\n4 0 1 2 4", "CELL_TYPES 1\n42", "").as_bytes()).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::ElementNotRead { element, count: 1, .. } if element == "42 (polyhedron)"),
        "{error}"
    );
}

#[test]
fn names_what_a_surface_contains() {
    let error = read(text("CELLS 2 7\n3 0 1 2 2 0 1", "CELL_TYPES 2\n5 3", "").as_bytes()).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::NoTetrahedra { content, .. } if content == "1 lines, 1 triangles or other faces"),
        "{error}"
    );
    let error =
        read(b"# vtk DataFile Version 3.0\nskin\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n").unwrap_err();
    assert!(
        matches!(&error, MeshFileError::OtherDataSet { content, .. } if content == "POLYDATA"),
        "{error}"
    );
}
