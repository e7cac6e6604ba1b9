//! What was assumed about a mesh that does not enclose a volume by itself.

use std::fmt;

/// Assumptions about a mesh that is not closed, or passes through itself: its inside is where its generalised winding number is beyond 1/2.
///
/// `Display` writes them as one sentence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshAssumptions {
    /// Number of holes that count as closed.
    pub hole_count: usize,
    /// Number of edges along these holes.
    pub open_edge_count: usize,
    /// Number of edges with more than two triangles.
    pub branching_edge_count: usize,
    /// Number of pairs of triangles that cross; the search ends after 1000.
    pub crossing_count: usize,
    /// Number of parts that no edge of two triangles connects.
    pub part_count: usize,
    /// Number of parts that faced inward and were turned.
    pub reoriented_part_count: usize,
    /// Thickness of the open parts, which are sheets, m; `None` if their holes count as closed.
    pub thickness_m: Option<f64>,
    /// Share of the samples of the winding number in the bounds of the mesh that are between 0.1 and 0.9 in magnitude, where the inside is
    /// uncertain.
    pub uncertain_share: f64,
}

impl fmt::Display for MeshAssumptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |count: usize, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            count => Some(format!("{count} {many}")),
        };
        let found: Vec<String> = [
            number(self.hole_count, "hole", "holes"),
            number(self.crossing_count, "pair of crossing triangles", "pairs of crossing triangles"),
            number(
                self.branching_edge_count,
                "edge of more than two triangles",
                "edges of more than two triangles",
            ),
            number(self.reoriented_part_count, "part that faced inward", "parts that faced inward"),
        ]
        .into_iter()
        .flatten()
        .collect();
        match found.split_last() {
            None => write!(f, "the mesh is not closed")?,
            Some((last, [])) => write!(f, "the mesh has {last}")?,
            Some((last, others)) => write!(f, "the mesh has {} and {last}", others.join(", "))?,
        }
        if let Some(thickness_m) = self.thickness_m {
            write!(f, "; its open parts are sheets of {thickness_m} m")?;
        }
        if self.thickness_m.is_none() || self.uncertain_share > 0.0 {
            let percent = 100.0 * self.uncertain_share;
            write!(
                f,
                "; its inside is where its winding number exceeds 1/2, which is uncertain in {percent:.2} % of its bounds"
            )?;
        }
        Ok(())
    }
}
