//! Report of a mesh of tetrahedra.

use super::quality::mean_ratio;
use crate::disjoint_sets::DisjointSets;
use glam::DVec3;
use std::fmt;

/// Repairs of a mesh of tetrahedra, and its problems. `Display` writes them as one sentence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TetrahedralReport {
    /// Number of elements of the body.
    pub elements: usize,
    /// Number of nodes of the body.
    pub nodes: usize,
    /// Volume, m³.
    pub volume_m3: f64,
    /// Number of inverted elements, which were reoriented.
    pub reoriented: usize,
    /// Number of elements with the vertices of an earlier one, which were left out.
    pub duplicates: usize,
    /// Number of elements with a vertex twice, which were left out.
    pub degenerate: usize,
    /// Number of flat elements at the boundary, which were left out.
    pub flat: usize,
    /// Number of slivers, which are part of the body: elements with a mean ratio below [`TetrahedralReport::SLIVER`].
    pub slivers: usize,
    /// Minimum mean ratio of an element: 12 (3V)^⅔ over the sum of its squared edges, 1 for a regular tetrahedron and 0 for a flat one.
    pub min_quality: f64,
    /// Number of vertices without an element, which were left out.
    pub unused_vertices: usize,
    /// Number of faces of more than two elements: elements overlap.
    pub overlapping_faces: usize,
    /// Number of edges of the boundary with other than two boundary faces.
    pub nonmanifold_edges: usize,
    /// Number of parts that share no node.
    pub parts: usize,
    /// Number of parts that share no face. Where it is larger than `parts`, some hang together by an edge or a vertex only.
    pub face_parts: usize,
}

impl TetrahedralReport {
    /// Mean ratio below which an element is a sliver. Slivers shorten the steps of an explicit integrator.
    pub const SLIVER: f64 = 0.1;

    /// Whether nothing was repaired, and nothing is a problem.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        let Self { reoriented, duplicates, degenerate, flat, slivers, unused_vertices, .. } = *self;
        let repairs = reoriented + duplicates + degenerate + flat + slivers + unused_vertices;
        repairs + self.overlapping_faces + self.nonmanifold_edges == 0 && self.face_parts == 1
    }

    /// Writes numbers, volume, quality and parts.
    pub(super) fn measure(&mut self, vertices_m: &[DVec3], elements: &[[usize; 4]]) {
        (self.elements, self.nodes, self.min_quality) = (elements.len(), vertices_m.len(), 1.0);
        let mut sets = DisjointSets::new(vertices_m.len());
        for nodes in elements {
            let corners = nodes.map(|node| vertices_m[node]);
            let quality = mean_ratio(corners);
            self.slivers += usize::from(quality < Self::SLIVER);
            self.min_quality = self.min_quality.min(quality);
            let [o, a, b, c] = corners;
            self.volume_m3 += (a - o).dot((b - o).cross(c - o)) / 6.0;
            nodes[1..].iter().for_each(|node| sets.unite(nodes[0], *node));
        }
        self.parts = (0..vertices_m.len()).filter(|&node| sets.find(node) == node).count();
    }
}

impl fmt::Display for TetrahedralReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { elements, nodes, min_quality, parts, face_parts, .. } = *self;
        write!(f, "{elements} tetrahedra with {nodes} nodes")?;
        for (count, what) in [
            (self.reoriented, "inverted ones are reoriented"),
            (self.duplicates, "repeated ones are left out"),
            (self.degenerate, "with a vertex twice are left out"),
            (self.flat, "flat ones at the boundary are left out"),
            (self.unused_vertices, "vertices without a tetrahedron are left out"),
            (self.overlapping_faces, "faces belong to more than two tetrahedra: some overlap"),
            (self.nonmanifold_edges, "edges of the boundary do not have two faces"),
        ] {
            if count > 0 {
                write!(f, "; {count} {what}")?;
            }
        }
        if self.slivers > 0 {
            write!(
                f,
                "; {} are slivers (mean ratio down to {min_quality:.3}), which shorten the steps: remesh the volume",
                self.slivers
            )?;
        }
        if parts > 1 {
            write!(f, "; there are {parts} separate parts")?;
        } else if face_parts > 1 {
            write!(f, "; {face_parts} parts share only an edge or a vertex")?;
        }
        Ok(())
    }
}
