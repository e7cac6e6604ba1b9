//! Edges of triangles.

/// One side of a triangle. Its indices are 32 bits wide, since a mesh has millions of sides.
pub(super) struct Side {
    /// Lower and higher point of the edge.
    pub edge: (u32, u32),
    pub triangle: u32,
    /// Whether the triangle runs from the lower to the higher point.
    pub is_up: bool,
}

/// The sides of all `triangles`, sorted by edge and triangle.
pub(super) fn sides(triangles: &[[usize; 3]]) -> Vec<Side> {
    let mut sides = Vec::with_capacity(3 * triangles.len());
    for (triangle, t) in triangles.iter().enumerate() {
        for corner in 0..3 {
            let (a, b) = (t[corner], t[(corner + 1) % 3]);
            let edge = (a.min(b) as u32, a.max(b) as u32);
            sides.push(Side { edge, triangle: triangle as u32, is_up: a < b });
        }
    }
    sides.sort_unstable_by_key(|side| (side.edge, side.triangle));
    sides
}

/// Directed edges without an opposite among the triangles of the same group, with their group, sorted by group and edge. An edge appears as
/// often as opposites are missing.
pub(super) fn open_edges<G: Copy + Ord>(
    triangles: impl Iterator<Item = ([usize; 3], G)>,
) -> Vec<((usize, usize), G)> {
    let mut edges: Vec<(G, (usize, usize), bool)> = triangles
        .flat_map(|([a, b, c], group)| {
            [(a, b), (b, c), (c, a)].map(|(a, b)| (group, (a.min(b), a.max(b)), a < b))
        })
        .collect();
    edges.sort_unstable();
    let mut open = Vec::new();
    for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let (group, (low, high), _) = same[0];
        let up = same.iter().filter(|(.., is_up)| *is_up).count();
        let down = same.len() - up;
        let edge = if up > down { (low, high) } else { (high, low) };
        open.extend(std::iter::repeat_n((edge, group), up.abs_diff(down)));
    }
    open
}
