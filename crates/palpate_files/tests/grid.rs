//! Volumes from which tests make their files, and what they check of the tetrahedra.

use crate::cube;
use palpate_files::TetrahedralFile;
use std::collections::HashMap;

/// A type of elements: its number in Gmsh and in VTK, its dimension and its nodes.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Kind {
    Point,
    Line,
    Triangle,
    Tetrahedron,
    /// With 10 nodes.
    QuadraticTetrahedron,
    Hexahedron,
    Prism,
    Pyramid,
}

impl Kind {
    pub fn gmsh(self) -> i32 {
        [15, 1, 2, 4, 11, 5, 6, 7][self as usize]
    }

    pub fn vtk(self) -> u8 {
        [1, 3, 5, 10, 24, 12, 13, 14][self as usize]
    }

    pub fn dimension(self) -> i32 {
        [0, 1, 2, 3, 3, 3, 3, 3][self as usize]
    }
}

#[derive(Clone, Debug)]
pub struct Element {
    pub kind: Kind,
    /// Indices of nodes, in the order of Gmsh.
    pub nodes: Vec<usize>,
    /// Physical group, 0 without one.
    pub group: i32,
    /// Entity of the geometry.
    pub entity: i32,
}

impl Element {
    pub fn new(kind: Kind, nodes: &[usize], group: i32) -> Self {
        Self { kind, nodes: nodes.to_vec(), group, entity: group + 10 }
    }

    /// Nodes in the order of VTK: the first triangle of a wedge is counter-clockwise seen from outside.
    pub fn vtk_nodes(&self) -> Vec<usize> {
        let order: &[usize] = if self.kind == Kind::Prism { &[0, 2, 1, 3, 5, 4] } else { &[] };
        if order.is_empty() {
            self.nodes.clone()
        } else {
            order.iter().map(|place| self.nodes[*place]).collect()
        }
    }
}

/// Nodes and elements.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Number and position of each node.
    pub nodes: Vec<(u64, [f64; 3])>,
    pub elements: Vec<Element>,
}

/// The unit cube as six tetrahedra about its diagonal from 0 to 7.
pub const TETRAHEDRA: [[u32; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// The unit cube in two groups, the first two tetrahedra in group 7 and the others in group 2; with a node that nothing uses, a triangle,
/// a line and a point.
pub fn cube() -> Grid {
    let mut grid = Grid::default();
    grid.nodes.push((3, [9.0, 9.5, -9.25]));
    let positions = cube::VERTICES.iter().map(|position| position.map(f64::from));
    grid.nodes.extend((4..).zip(positions));
    for (place, nodes) in TETRAHEDRA.iter().enumerate() {
        let nodes = nodes.map(|node| node as usize + 1);
        grid.elements.push(Element::new(Kind::Tetrahedron, &nodes, if place < 2 { 7 } else { 2 }));
    }
    grid.elements.push(Element::new(Kind::Triangle, &[1, 2, 4], 5));
    grid.elements.push(Element::new(Kind::Line, &[1, 2], 5));
    grid.elements.push(Element::new(Kind::Point, &[1], 5));
    grid
}

/// A box of 3 × 1 × 1: a hexahedron, two prisms and six pyramids. Nodes are numbered in a random order.
pub fn mixed(seed: u64) -> Grid {
    let mut grid = Grid::default();
    // Node x + 4 y + 8 z, then the centre of the last cube.
    for place in 0..16 {
        grid.nodes.push((0, [f64::from(place % 4), f64::from(place / 4 % 2), f64::from(place / 8)]));
    }
    grid.nodes.push((0, [2.5, 0.5, 0.5]));
    let hexahedron = |x: usize| [x, x + 1, x + 5, x + 4, x + 8, x + 9, x + 13, x + 12];
    grid.elements.push(Element::new(Kind::Hexahedron, &hexahedron(0), 1));
    let [a, b, c, d, e, f, g, h] = hexahedron(1);
    grid.elements.push(Element::new(Kind::Prism, &[a, b, c, e, f, g], 2));
    grid.elements.push(Element::new(Kind::Prism, &[a, c, d, e, g, h], 2));
    let [a, b, c, d, e, f, g, h] = hexahedron(2);
    // Each base counter-clockwise seen from the centre.
    for base in [[a, b, c, d], [h, g, f, e], [e, f, b, a], [f, g, c, b], [g, h, d, c], [h, e, a, d]] {
        let [a, b, c, d] = base;
        grid.elements.push(Element::new(Kind::Pyramid, &[a, b, c, d, 16], 3));
    }
    grid.shuffled(seed)
}

impl Grid {
    /// The same grid with its nodes in a random order, numbered from 1.
    pub fn shuffled(&self, seed: u64) -> Self {
        let mut order: Vec<usize> = (0..self.nodes.len()).collect();
        let mut state = seed;
        for place in (1..order.len()).rev() {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            order.swap(place, (state >> 33) as usize % (place + 1));
        }
        let mut grid = self.clone();
        for (node, place) in order.iter().enumerate() {
            grid.nodes[*place] = (*place as u64 + 1, self.nodes[node].1);
        }
        grid.elements.iter_mut().flat_map(|element| &mut element.nodes).for_each(|node| *node = order[*node]);
        grid
    }

    /// The same grid with each tetrahedron of 10 nodes: its mid nodes are numbered after the others, and none is shared.
    pub fn quadratic(&self) -> Self {
        let mut grid = self.clone();
        let mut next = self.nodes.iter().map(|(number, _)| number + 1).max().unwrap();
        for element in grid.elements.iter_mut().filter(|element| element.kind == Kind::Tetrahedron) {
            element.kind = Kind::QuadraticTetrahedron;
            for [a, b] in [[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]] {
                let position = |place: usize| self.nodes[element.nodes[place]].1;
                let middle = std::array::from_fn(|axis| f64::midpoint(position(a)[axis], position(b)[axis]));
                element.nodes.push(grid.nodes.len());
                grid.nodes.push((next, middle));
                next += 1;
            }
        }
        grid
    }
}

/// Six times the volume of each tetrahedron.
pub fn six_fold_volumes(file: &TetrahedralFile) -> Vec<f64> {
    let volume = |corners: &[u32; 4]| {
        let [a, b, c, d] = corners.map(|corner| file.vertices[corner as usize]);
        let [b, c, d] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        b[0] * (c[1] * d[2] - c[2] * d[1])
            + b[1] * (c[2] * d[0] - c[0] * d[2])
            + b[2] * (c[0] * d[1] - c[1] * d[0])
    };
    file.tetrahedra.iter().map(volume).collect()
}

/// Checks that each face belongs to two tetrahedra, which lie on both sides of it, or to one and to the boundary of the box `bounds`.
pub fn assert_conforming(file: &TetrahedralFile) {
    let mut sides: HashMap<[u32; 3], Vec<bool>> = HashMap::new();
    for [a, b, c, d] in &file.tetrahedra {
        for face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let mut sorted = face.map(|corner| *corner);
            sorted.sort_unstable();
            let is_even = (0..3).any(|turn| (0..3).all(|place| sorted[place] == *face[(place + turn) % 3]));
            sides.entry(sorted).or_default().push(is_even);
        }
    }
    let bounds = file.bounds();
    for (face, sides) in sides {
        let is_outside = (0..3).any(|axis| {
            bounds
                .iter()
                .any(|bound| face.iter().all(|corner| file.vertices[*corner as usize][axis] == bound[axis]))
        });
        let is_shared = sides.len() == 2 && sides[0] != sides[1];
        assert!(if is_outside { sides.len() == 1 } else { is_shared }, "{face:?} {sides:?}");
    }
}

/// Checks the cube of [`cube`]: numbers of regions are `first` for the first two tetrahedra and `others`.
pub fn assert_cube(file: &TetrahedralFile, first: i64, others: i64) {
    assert_eq!(file.vertices, cube::VERTICES.map(|position| position.map(f64::from)));
    assert_eq!(file.tetrahedra, TETRAHEDRA);
    assert_eq!(six_fold_volumes(file), [1.0; 6]);
    assert_eq!(file.bounds(), [[0.0; 3], [1.0; 3]]);
    let numbers: Vec<i64> = file.region_list.iter().map(|region| region.number).collect();
    assert!(numbers.is_sorted());
    let of: Vec<i64> = file.regions.iter().map(|region| numbers[*region as usize]).collect();
    assert_eq!(of, [first, first, others, others, others, others]);
    assert_eq!(numbers.len(), if first == others { 1 } else { 2 });
    assert_conforming(file);
}

/// Checks the box of [`mixed`].
pub fn assert_mixed(file: &TetrahedralFile) {
    assert_eq!(file.vertices.len(), 17);
    let volumes = six_fold_volumes(file);
    assert_eq!(volumes.len(), 6 + 2 * 3 + 6 * 2);
    assert!(volumes.iter().all(|volume| *volume > 0.0), "{volumes:?}");
    assert_eq!(volumes.iter().sum::<f64>(), 18.0);
    let volume_of = |number: usize| {
        let of = file.regions.iter().zip(&volumes).filter(|(region, _)| **region as usize == number);
        of.map(|(_, volume)| volume).sum::<f64>()
    };
    assert_eq!([0, 1, 2].map(volume_of), [6.0; 3]);
    let counts = &file.counts;
    assert_eq!([counts.hexahedra, counts.prisms, counts.pyramids, counts.collapsed], [1, 2, 6, 0]);
    assert_conforming(file);
}
