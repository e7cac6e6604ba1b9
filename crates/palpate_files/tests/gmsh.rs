//! Gmsh files.

use crate::grid::{self, Element, Grid, Kind, assert_cube, assert_mixed};
use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The encoding of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mode {
    Text,
    Little,
    Big,
}

pub const MODES: [Mode; 3] = [Mode::Text, Mode::Little, Mode::Big];

/// Writes numbers in text or in bytes.
struct Writer {
    bytes: Vec<u8>,
    mode: Mode,
    /// Bytes of a count.
    size: usize,
}

impl Writer {
    fn new(version: &str, mode: Mode, size: usize) -> Self {
        let mut writer = Self { bytes: Vec::new(), mode, size };
        let is_binary = u8::from(mode != Mode::Text);
        writer.line(&format!("$MeshFormat\n{version} {is_binary} {size}"));
        if mode != Mode::Text {
            writer.int(1);
        }
        writer.end("MeshFormat");
        writer
    }

    fn line(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
        self.bytes.push(b'\n');
    }

    fn end(&mut self, section: &str) {
        let line_end = if self.mode == Mode::Text { "" } else { "\n" };
        self.line(&format!("{line_end}$End{section}"));
    }

    fn number(&mut self, text: &str, little: &[u8]) {
        match self.mode {
            Mode::Text => self.line(text),
            Mode::Little => self.bytes.extend(little),
            Mode::Big => self.bytes.extend(little.iter().rev()),
        }
    }

    fn int(&mut self, value: i32) {
        self.number(&value.to_string(), &value.to_le_bytes());
    }

    fn count(&mut self, value: u64) {
        let size = self.size;
        self.number(&value.to_string(), &value.to_le_bytes()[..size]);
    }

    fn position(&mut self, position: [f64; 3]) {
        position.iter().for_each(|x| self.number(&format!("{x:e}"), &x.to_le_bytes()));
    }

    fn names(&mut self) {
        self.line("$PhysicalNames\n3\n2 7 \"skin\"\n3 7 \"the \"\"left\"\" lobe\"\n3 2 \"vessel é\"\n$EndPhysicalNames");
    }
}

pub fn version_2(grid: &Grid, mode: Mode, has_names: bool) -> Vec<u8> {
    let mut writer = Writer::new("2.2", mode, 8);
    if has_names {
        writer.names();
    }
    writer.line(&format!("$Nodes\n{}", grid.nodes.len()));
    for (number, position) in &grid.nodes {
        writer.int(*number as i32);
        writer.position(*position);
    }
    writer.end("Nodes");
    writer.line(&format!("$Elements\n{}", grid.elements.len()));
    for (place, element) in grid.elements.iter().enumerate() {
        let tags = [element.group, element.entity, 1];
        if mode == Mode::Text {
            writer.int(place as i32 + 100);
            [element.kind.gmsh(), 3].iter().chain(&tags).for_each(|number| writer.int(*number));
        } else {
            [element.kind.gmsh(), 1, 3, place as i32 + 100].iter().for_each(|number| writer.int(*number));
            tags.iter().for_each(|number| writer.int(*number));
        }
        element.nodes.iter().for_each(|node| writer.int(grid.nodes[*node].0 as i32));
    }
    writer.end("Elements");
    writer.line("$NodeData\n1\n\"$Elements of a view\"\n$EndNodeData");
    writer.bytes
}

pub fn version_4(grid: &Grid, mode: Mode, is_41: bool, size: usize, has_names: bool) -> Vec<u8> {
    let mut writer = Writer::new(if is_41 { "4.1" } else { "4" }, mode, size);
    if has_names {
        writer.names();
    }
    let mut blocks: BTreeMap<(i32, i32, i32), Vec<&Element>> = BTreeMap::new();
    let mut volumes: BTreeMap<i32, i32> = BTreeMap::new();
    for element in &grid.elements {
        let key = (element.kind.dimension(), element.entity, element.kind.gmsh());
        blocks.entry(key).or_default().push(element);
        if element.kind.dimension() == 3 {
            volumes.insert(element.entity, element.group);
        }
    }
    writer.line("$Entities");
    [1, 0, 1, volumes.len() as u64].iter().for_each(|count| writer.count(*count));
    let corners = [[0.0; 3], [1.0; 3]];
    // A point with a position in version 4.1, and with a box in version 4.0.
    writer.int(1);
    corners.iter().skip(usize::from(is_41)).for_each(|corner| writer.position(*corner));
    writer.count(0);
    // A surface of two groups with two curves.
    writer.int(1);
    corners.iter().for_each(|corner| writer.position(*corner));
    writer.count(2);
    writer.int(7);
    writer.int(8);
    writer.count(2);
    writer.int(1);
    writer.int(-2);
    for (entity, group) in volumes {
        writer.int(entity);
        corners.iter().for_each(|corner| writer.position(*corner));
        writer.count(u64::from(group != 0));
        if group != 0 {
            writer.int(-group);
        }
        writer.count(1);
        writer.int(1);
    }
    writer.end("Entities");

    writer.line("$Nodes");
    // Two nodes on a surface, with parameters, an empty block, and the others in a volume.
    let parts = [(2, 1, &grid.nodes[..2]), (1, 0, &grid.nodes[..0]), (3, 0, &grid.nodes[2..])];
    writer.count(3);
    writer.count(grid.nodes.len() as u64);
    if is_41 {
        writer.count(1);
        writer.count(u64::from(u32::MAX));
    }
    for (dimension, is_parametric, nodes) in parts {
        let entity = if is_41 { [dimension, 5] } else { [5, dimension] };
        entity.iter().for_each(|number| writer.int(*number));
        writer.int(is_parametric);
        writer.count(nodes.len() as u64);
        if is_41 {
            nodes.iter().for_each(|(number, _)| writer.count(*number));
        }
        for (number, position) in nodes {
            if !is_41 {
                writer.int(*number as i32);
            }
            writer.position(*position);
            (0..dimension * is_parametric).for_each(|_| writer.number("0.25", &0.25_f64.to_le_bytes()));
        }
    }
    writer.end("Nodes");

    writer.line("$Elements");
    writer.count(blocks.len() as u64);
    writer.count(grid.elements.len() as u64);
    if is_41 {
        writer.count(1);
        writer.count(grid.elements.len() as u64);
    }
    // Volumes with their tetrahedra in the order of the file come first.
    for ((dimension, entity, kind), elements) in blocks.into_iter().rev() {
        let entity = if is_41 { [dimension, entity] } else { [entity, dimension] };
        entity.iter().for_each(|number| writer.int(*number));
        writer.int(kind);
        writer.count(elements.len() as u64);
        for element in elements {
            let number = |writer: &mut Writer, value: u64| match is_41 {
                true => writer.count(value),
                false => writer.int(value as i32),
            };
            number(&mut writer, 77);
            element.nodes.iter().for_each(|node| number(&mut writer, grid.nodes[*node].0));
        }
    }
    writer.end("Elements");
    writer.bytes
}

fn read(bytes: &[u8]) -> Result<TetrahedralFile, MeshFileError> {
    TetrahedralFile::from_bytes(bytes, TetrahedralFormat::Gmsh, None)
}

/// Each version and encoding of a grid.
pub fn all(grid: &Grid, has_names: bool) -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for mode in MODES {
        files.push(version_2(grid, mode, has_names));
        files.push(version_4(grid, mode, false, 8, has_names));
        files.push(version_4(grid, mode, true, 8, has_names));
        files.push(version_4(grid, mode, true, 4, has_names));
    }
    files
}

fn names(file: &TetrahedralFile) -> Vec<(i64, Option<&str>)> {
    file.region_list.iter().map(|region| (region.number, region.name.as_deref())).collect()
}

#[test]
fn reads_cube_with_names_of_groups_in_each_version_and_encoding() {
    for bytes in all(&grid::cube(), true) {
        let file = read(&bytes).unwrap();
        assert_cube(&file, 7, 2);
        assert_eq!(names(&file), [(2, Some("vessel é")), (7, Some("the \"\"left\"\" lobe"))]);
        let counts = file.counts;
        assert_eq!([counts.points, counts.lines, counts.faces, counts.unused_nodes], [1; 4]);
        assert_eq!([counts.hexahedra, counts.high_order, counts.collapsed], [0; 3]);
    }
    for bytes in all(&grid::cube(), false) {
        assert_eq!(names(&read(&bytes).unwrap()), [(2, None), (7, None)]);
    }
}

#[test]
fn regions_without_groups_are_entities() {
    let mut grid = grid::cube();
    grid.elements.iter_mut().for_each(|element| element.group = 0);
    for bytes in all(&grid, true) {
        let file = read(&bytes).unwrap();
        assert_cube(&file, 17, 12);
        assert_eq!(names(&file), [(12, None), (17, None)]);
    }
    // With a group of some elements, the others have the region 0.
    grid.elements.iter_mut().take(2).for_each(|element| element.group = 7);
    for bytes in all(&grid, true) {
        assert_cube(&read(&bytes).unwrap(), 7, 0);
    }
}

#[test]
fn reads_sparse_numbers_of_nodes() {
    let mut grid = grid::cube();
    for (place, (number, _)) in grid.nodes.iter_mut().enumerate() {
        *number = [7, 2_000_000_000, 5, 1_000_000, 12, 2_147_483_647, 1, 99, 1_999_999_999][place];
    }
    for bytes in all(&grid, true) {
        assert_cube(&read(&bytes).unwrap(), 7, 2);
    }
}

#[test]
fn reads_corners_of_quadratic_tetrahedra() {
    for bytes in all(&grid::cube().quadratic(), true) {
        let file = read(&bytes).unwrap();
        assert_cube(&file, 7, 2);
        assert_eq!([file.counts.high_order, file.counts.unused_nodes], [6, 37]);
    }
}

#[test]
fn reads_corners_of_each_order() {
    // Number, nodes, and tetrahedra of an element.
    let types = [
        (4, 4, 1),
        (11, 10, 1),
        (29, 20, 1),
        (30, 35, 1),
        (31, 56, 1),
        (71, 84, 1),
        (75, 286, 1),
        (5, 8, 6),
        (12, 27, 6),
        (17, 20, 6),
        (92, 64, 6),
        (98, 1000, 6),
        (6, 6, 3),
        (13, 18, 3),
        (18, 15, 3),
        (90, 40, 3),
        (91, 75, 3),
        (7, 5, 2),
        (14, 14, 2),
        (19, 13, 2),
    ];
    for (kind, node_count, tetrahedron_count) in types {
        let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{node_count}\n");
        (1..=node_count).for_each(|node| writeln!(text, "{node} {node} {} 1", node * node).unwrap());
        write!(text, "$EndNodes\n$Elements\n1\n1 {kind} 0").unwrap();
        (1..=node_count).for_each(|node| write!(text, " {node}").unwrap());
        let file = read(format!("{text}\n$EndElements\n").as_bytes()).unwrap();
        assert_eq!(file.tetrahedra.len(), tetrahedron_count, "{kind}");
        assert_eq!(file.counts.high_order, usize::from(![4, 5, 6, 7].contains(&kind)));
        assert!(file.tetrahedra.iter().flatten().all(|corner| *corner < 8));
    }
    // Elements of less than three dimensions.
    let types = [
        (15, 1),
        (1, 2),
        (8, 3),
        (26, 4),
        (28, 6),
        (62, 7),
        (66, 11),
        (2, 3),
        (9, 6),
        (21, 10),
        (25, 21),
        (42, 28),
        (46, 66),
        (52, 18),
        (56, 30),
        (3, 4),
        (10, 9),
        (16, 8),
        (36, 16),
        (38, 36),
        (41, 20),
        (47, 49),
        (51, 121),
        (57, 24),
        (61, 40),
    ];
    for (kind, node_count) in types {
        let mut grid = grid::cube();
        grid.elements.truncate(6);
        let text = String::from_utf8(version_2(&grid, Mode::Text, false)).unwrap();
        let element = format!("$Elements\n7\n1 {kind} 1 4{}\n", " 4".repeat(node_count));
        assert_cube(&read(text.replace("$Elements\n6\n", &element).as_bytes()).unwrap(), 7, 2);
    }
}

#[test]
fn splits_mixed_elements_into_conforming_tetrahedra() {
    for seed in 0..200 {
        let file = read(&version_2(&grid::mixed(seed), Mode::Text, false)).unwrap();
        assert_mixed(&file);
    }
    for bytes in all(&grid::mixed(0), false) {
        assert_mixed(&read(&bytes).unwrap());
    }
}

#[test]
fn splits_blocks_of_hexahedra_into_conforming_tetrahedra() {
    for seed in 0..100 {
        let mut grid = Grid::default();
        for place in 0..27 {
            grid.nodes.push((0, [f64::from(place % 3), f64::from(place / 3 % 3), f64::from(place / 9)]));
        }
        for first in [0, 1, 3, 4, 9, 10, 12, 13] {
            let nodes = [0, 1, 4, 3, 9, 10, 13, 12].map(|step| first + step);
            grid.elements.push(Element::new(Kind::Hexahedron, &nodes, 1));
        }
        let file = read(&version_2(&grid.shuffled(seed), Mode::Text, false)).unwrap();
        assert_eq!(grid::six_fold_volumes(&file), [1.0; 48]);
        grid::assert_conforming(&file);
    }
}

#[test]
fn collapsed_hexahedron_is_a_prism() {
    let mut grid = grid::mixed(3);
    grid.elements.truncate(2);
    let [a, b, c, e, f, g] = grid.elements[1].nodes[..] else { panic!() };
    grid.elements[1] = Element::new(Kind::Hexahedron, &[a, b, c, c, e, f, g, g], 2);
    let file = read(&version_2(&grid, Mode::Text, false)).unwrap();
    assert_eq!(file.tetrahedra.len(), 9);
    assert_eq!(file.counts.collapsed, 3);
    assert_eq!(grid::six_fold_volumes(&file).iter().sum::<f64>(), 9.0);
    // The grid of two prisms has common faces, as without the collapsed one.
    let mut whole = grid::mixed(3);
    whole.elements[1] = grid.elements[1].clone();
    grid::assert_conforming(&read(&version_2(&whole, Mode::Text, false)).unwrap());
}

#[test]
fn partitions_have_the_region_of_their_volume() {
    let text = String::from_utf8(version_4(&grid::cube(), Mode::Text, true, 8, true)).unwrap();
    let partitions = "$PartitionedEntities\n2\n1\n9 1\n0 0 0 2\n\
                      12 3 50 1 1 0 0 0 1 1 1 1 2 0\n17 3 50 2 1 2 0 0 0 1 1 1 0 0\n$EndPartitionedEntities\n$Nodes\n";
    let text = text.replace("$Nodes\n", partitions).replace("$EndPartitionedEntities\n$EndNodes", "");
    let file = read(text.as_bytes()).unwrap();
    // The first partition has the group 2, the second has none.
    assert_cube(&file, 0, 2);
}

#[test]
fn accepts_comments_other_line_ends_and_equal_nodes_of_one_number() {
    let text = String::from_utf8(version_2(&grid::cube(), Mode::Text, true)).unwrap();
    let text = format!("$Comments\nmade by hand\n$EndComments\n{text}")
        .replace("$Nodes\n9\n", "$Nodes\n10\n4 0 0 0\n");
    let file = read(text.replace('\n', "\r\n").as_bytes()).unwrap();
    assert_cube(&file, 7, 2);
    assert_eq!(file.counts.unused_nodes, 2);
}

#[test]
fn rejects_broken_files_with_the_reason() {
    let text = String::from_utf8(version_2(&grid::cube(), Mode::Text, true)).unwrap();
    let text_4 = String::from_utf8(version_4(&grid::cube(), Mode::Text, true, 8, true)).unwrap();
    let cases = [
        (text.replace("$Nodes\n9\n", "$Nodes\n8\n"), "$Nodes must end with $EndNodes"),
        (text.replace("$Nodes\n9\n", "$Nodes\n10\n"), "a value is `$EndNodes`"),
        (text.replace("$Nodes\n9\n", "$Nodes\nmany\n"), "a count is `many`"),
        (text.replace("$Elements\n9\n", "$Elements\n8\n"), "$Elements must end with $EndElements"),
        (text.replace("$EndNodes", "$EndNode"), "$Nodes must end with $EndNodes"),
        (text.replace("2.2 0 8", "2.2 0 4"), "the size of a number is 4"),
        (text.replace("2.2 0 8", "2.2 2 8"), "the type of the file is 2"),
        (
            text.replace("$MeshFormat", "$Format").replace("$EndMeshFormat", "$EndFormat"),
            "comes before $MeshFormat",
        ),
        (
            text.replace("\n9.5e0\n", "\nnan\n").replace("\n4\n0e0\n0e0\n0e0\n", "\n4\n0\n0\n-inf\n"),
            "a coordinate of a node of an element is -inf",
        ),
        (text.replace("\n5\n1e0\n", "\n4\n1e0\n"), "two nodes have the number 4"),
        (text.replace("3 2 \"vessel é\"", "3 2 vessel"), "line 8: a physical name"),
        (text_4.replace("$Nodes\n3\n9\n", "$Nodes\n3\n8\n"), "have more than 8 nodes"),
        (text_4.replace("$Nodes\n3\n9\n", "$Nodes\n3\n12\n"), "states 12 nodes and has 9"),
        (text_4.replace("$Elements\n5\n9\n", "$Elements\n5\n10\n"), "states 10 elements and has 9"),
        (text_4.replace("$Elements\n5\n9\n", "$Elements\n5\n5\n"), "have more than 5 elements"),
        (text[..text.find("$Elements").unwrap()].to_owned(), "no section $Elements"),
        (text[..text.find("$EndNodeData").unwrap()].to_owned(), "$NodeData has no end"),
        (text.replace("Nodes\n", "ParametricNodes\n"), "must have $Nodes, as without Mesh.SaveParametric"),
        (String::new(), "no section $MeshFormat"),
    ];
    for (broken, expected) in cases {
        assert!(broken != text && broken != text_4, "{expected}");
        let error = read(broken.as_bytes()).unwrap_err();
        assert!(matches!(error, MeshFileError::VolumeNotValid { format: "Gmsh", .. }), "{error}");
        assert!(error.to_string().contains(expected), "{expected}: {error}");
    }
    for (version, expected) in [("1.0", "1.0"), ("3.0", "3.0"), ("4.2", "4.2")] {
        let error = read(text.replace("2.2 0", &format!("{version} 0")).as_bytes()).unwrap_err();
        assert!(
            matches!(&error, MeshFileError::VersionNotRead { version, .. } if version == expected),
            "{error}"
        );
    }
    let error = read(b"$NOD\n1\n1 0 0 0\n$ENDNOD\n").unwrap_err();
    assert!(matches!(error, MeshFileError::VersionNotRead { .. }), "{error}");
}

#[test]
fn rejects_missing_nodes_other_elements_and_absurd_counts() {
    let text = String::from_utf8(version_2(&grid::cube(), Mode::Text, true)).unwrap();
    let error =
        read(text.replace("\n11\n$EndNodes", "").replace("\n4\n5\n7\n11\n", "\n4\n5\n7\n12\n").as_bytes())
            .unwrap_err();
    assert!(matches!(error, MeshFileError::NodeNotFound { node: 12, node_count: 9, .. }), "{error}");
    let error =
        read(text.replace("$Elements\n9\n100\n4\n", "$Elements\n9\n100\n34\n").as_bytes()).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::ElementNotRead { element, count: 1, .. } if element == "34"),
        "{error}"
    );
    let error = read(text.replace("$Nodes\n9\n", "$Nodes\n1000000000\n").as_bytes()).unwrap_err();
    assert!(
        matches!(error, MeshFileError::TooLarge { value: 1_000_000_000, max: 20_000_000, .. }),
        "{error}"
    );
    let mut grid = grid::cube();
    grid.elements.retain(|element| element.kind != Kind::Tetrahedron);
    let error = read(&version_2(&grid, Mode::Little, true)).unwrap_err();
    let surface = "1 points, 1 lines, 1 triangles or other faces";
    assert!(matches!(&error, MeshFileError::NoTetrahedra { content, .. } if content == surface), "{error}");
}
