//! Types of cells, by their numbers in VTK.

use crate::volume::Shape;

/// The shape of a type of cells, and the place of each of its corners in a cell.
pub(super) fn cell_type(number: i64) -> Option<(Shape, &'static [usize])> {
    Some(match number {
        // A vertex and several.
        1 | 2 => (Shape::Point, &[0]),
        // Lines and curves of higher order.
        3 | 4 | 21 | 35 | 60 | 68 | 75 => (Shape::Line, &[0, 1]),
        // Triangles, strips, polygons and quadrangles, and those of higher order.
        5..=9 | 22 | 23 | 28 | 30 | 34 | 36 | 61..=63 | 69 | 70 | 76 | 77 => (Shape::Face, &[0, 1, 2]),
        // Also those with 10 nodes, of any order, and of Lagrange and Bézier.
        10 | 24 | 64 | 71 | 78 => (Shape::Tetrahedron, &[0, 1, 2, 3]),
        // Corners of a voxel are in the order of x, y and z.
        11 => (Shape::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6]),
        // Also those with 20, 24 and 27 nodes.
        12 | 25 | 29 | 33 | 65 | 72 | 79 => (Shape::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]),
        // The first triangle of a wedge is counter-clockwise seen from outside. Also those with 12, 15 and 18 nodes.
        13 | 26 | 31 | 32 | 66 | 73 | 80 => (Shape::Prism, &[0, 2, 1, 3, 5, 4]),
        // Also those with 13 and 19 nodes.
        14 | 27 | 37 | 67 | 74 | 81 => (Shape::Pyramid, &[0, 1, 2, 3, 4]),
        _ => return None,
    })
}

/// Number and name of a type without a shape.
pub(super) fn type_name(number: i64) -> String {
    let name = match number {
        0 => "empty cell",
        15 => "pentagonal prism",
        16 => "hexagonal prism",
        41 => "convex point set",
        42 => "polyhedron",
        51..=56 => "parametric cell",
        _ => return number.to_string(),
    };
    format!("{number} ({name})")
}
