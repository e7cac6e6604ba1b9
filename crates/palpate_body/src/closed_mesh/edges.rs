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
/// often as opposites are missing. `sides` are those of the triangles as given, of which some are turned; `group` and `is_turned` are those of
/// a triangle.
pub(super) fn open_edges<G: Copy + Ord>(
    sides: &[Side],
    group: impl Fn(usize) -> G,
    is_turned: impl Fn(usize) -> bool,
) -> Vec<((usize, usize), G)> {
    let mut open = Vec::new();
    let mut around: Vec<(G, bool)> = Vec::new();
    for same in sides.chunk_by(|a, b| a.edge == b.edge) {
        let (low, high) = (same[0].edge.0 as usize, same[0].edge.1 as usize);
        around.clear();
        around.extend(same.iter().map(|side| {
            let triangle = side.triangle as usize;
            (group(triangle), side.is_up != is_turned(triangle))
        }));
        around.sort_unstable();
        for of_group in around.chunk_by(|a, b| a.0 == b.0) {
            let up = of_group.iter().filter(|(_, is_up)| *is_up).count();
            let down = of_group.len() - up;
            let edge = if up > down { (low, high) } else { (high, low) };
            open.extend(std::iter::repeat_n((edge, of_group[0].0), up.abs_diff(down)));
        }
    }
    open.sort_by_key(|(_, group)| *group);
    open
}
