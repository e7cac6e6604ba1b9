//! What a volume file has besides tetrahedra.

use std::fmt;

/// Numbers of elements and nodes of a volume file that are left out, split, or reduced to their corners.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[non_exhaustive]
pub struct ElementCounts {
    /// Elements of one node, left out.
    pub points: usize,
    /// Lines, left out.
    pub lines: usize,
    /// Triangles, quadrangles and other faces, left out.
    pub faces: usize,
    /// Hexahedra and voxels, each split into six tetrahedra.
    pub hexahedra: usize,
    /// Prisms, each split into three tetrahedra.
    pub prisms: usize,
    /// Pyramids, each split into two tetrahedra.
    pub pyramids: usize,
    /// Elements of three dimensions with nodes besides their corners, which are left out.
    pub high_order: usize,
    /// Tetrahedra that have a node twice, left out. Collapsed hexahedra, prisms and pyramids have such tetrahedra.
    pub collapsed: usize,
    /// Nodes that no tetrahedron has, left out.
    pub unused_nodes: usize,
}

impl fmt::Display for ElementCounts {
    /// Writes the numbers of elements that are not 0, otherwise `no elements`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = [
            (self.points, "points"),
            (self.lines, "lines"),
            (self.faces, "triangles or other faces"),
            (self.hexahedra, "hexahedra"),
            (self.prisms, "prisms"),
            (self.pyramids, "pyramids"),
            (self.collapsed, "tetrahedra that have a node twice"),
        ];
        let mut is_first = true;
        for (count, of) in counts.into_iter().filter(|(count, _)| *count > 0) {
            write!(f, "{}{count} {of}", if is_first { "" } else { ", " })?;
            is_first = false;
        }
        if is_first { f.write_str("no elements") } else { Ok(()) }
    }
}
