//! Types of elements, by their numbers in Gmsh.

use crate::volume::Shape;

/// The shape and the number of nodes of a type of elements. The corners are the first nodes.
pub(super) fn element_type(number: i64) -> Option<(Shape, usize)> {
    let (shape, nodes) = match number {
        15 => (Shape::Point, 1),
        1 => (Shape::Line, 2),
        8 => (Shape::Line, 3),
        26..=28 => (Shape::Line, number - 22),
        62..=66 => (Shape::Line, number - 55),
        2 => (Shape::Face, 3),
        3 => (Shape::Face, 4),
        9 => (Shape::Face, 6),
        10 => (Shape::Face, 9),
        16 => (Shape::Face, 8),
        20 => (Shape::Face, 9),
        21 => (Shape::Face, 10),
        22 => (Shape::Face, 12),
        23 | 24 => (Shape::Face, 15),
        25 => (Shape::Face, 21),
        36 => (Shape::Face, 16),
        37 => (Shape::Face, 25),
        38 => (Shape::Face, 36),
        39 => (Shape::Face, 12),
        40 => (Shape::Face, 16),
        41 => (Shape::Face, 20),
        // Triangles of the orders 6 to 10.
        42..=46 => (Shape::Face, (number - 35) * (number - 34) / 2),
        // Quadrangles of the orders 6 to 10.
        47..=51 => (Shape::Face, (number - 40) * (number - 40)),
        52..=56 => (Shape::Face, 3 * (number - 46)),
        57..=61 => (Shape::Face, 4 * (number - 51)),
        4 => (Shape::Tetrahedron, 4),
        11 => (Shape::Tetrahedron, 10),
        29 => (Shape::Tetrahedron, 20),
        30 => (Shape::Tetrahedron, 35),
        31 => (Shape::Tetrahedron, 56),
        // Of the orders 6 to 10.
        71..=75 => (Shape::Tetrahedron, (number - 64) * (number - 63) * (number - 62) / 6),
        5 => (Shape::Hexahedron, 8),
        12 => (Shape::Hexahedron, 27),
        17 => (Shape::Hexahedron, 20),
        // Of the orders 3 to 9.
        92..=98 => (Shape::Hexahedron, (number - 88) * (number - 88) * (number - 88)),
        6 => (Shape::Prism, 6),
        13 => (Shape::Prism, 18),
        18 => (Shape::Prism, 15),
        90 => (Shape::Prism, 40),
        91 => (Shape::Prism, 75),
        7 => (Shape::Pyramid, 5),
        14 => (Shape::Pyramid, 14),
        19 => (Shape::Pyramid, 13),
        _ => return None,
    };
    Some((shape, nodes as usize))
}
