//! Checks and repairs of the elements of a mesh.

use super::error::TetrahedralMeshError;
use super::faces::OpenBoundary;
use super::quality::mean_ratio;
use super::report::TetrahedralReport;
use glam::DVec3;
use std::collections::HashSet;

/// Mean ratio below which an element is flat: its height is less than about 10⁻⁴ of its edges.
const FLAT: f64 = 1e-3;

/// An element of the lists given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    /// Index in the list given.
    pub(super) given: usize,
    pub(super) nodes: [usize; 4],
    pub(super) region: u32,
}

/// Creates the elements after a check of the lists.
pub(super) fn elements(
    vertices_m: &[DVec3],
    elements: &[[usize; 4]],
    regions: &[u32],
) -> Result<Vec<Element>, TetrahedralMeshError> {
    if let Some(vertex) = vertices_m.iter().position(|x| !x.is_finite()) {
        return Err(TetrahedralMeshError::Position { vertex });
    }
    if !regions.is_empty() && regions.len() != elements.len() {
        return Err(TetrahedralMeshError::Regions { found: regions.len(), elements: elements.len() });
    }
    let vertices = vertices_m.len();
    let of = |(given, nodes): (usize, &[usize; 4])| match nodes.iter().find(|vertex| **vertex >= vertices) {
        Some(&vertex) => Err(TetrahedralMeshError::Vertex { element: given, vertex, vertices }),
        None => Ok(Element { given, nodes: *nodes, region: regions.get(given).copied().unwrap_or(0) }),
    };
    elements.iter().enumerate().map(of).collect()
}

/// Leaves out elements with a vertex twice, and those with the vertices of an earlier one.
pub(super) fn leave_out_repeated(elements: &mut Vec<Element>, report: &mut TetrahedralReport) {
    let mut seen = HashSet::with_capacity(elements.len());
    elements.retain(|of| {
        let mut nodes = of.nodes;
        nodes.sort_unstable();
        if nodes.windows(2).any(|pair| pair[0] == pair[1]) {
            report.degenerate += 1;
            return false;
        }
        let is_new = seen.insert(nodes);
        report.duplicates += usize::from(!is_new);
        is_new
    });
}

/// Reorients inverted elements.
pub(super) fn reorient(vertices_m: &[DVec3], elements: &mut [Element], report: &mut TetrahedralReport) {
    for of in elements {
        let [o, a, b, c] = of.nodes.map(|node| vertices_m[node]);
        if (a - o).dot((b - o).cross(c - o)) < 0.0 {
            of.nodes.swap(2, 3);
            report.reoriented += 1;
        }
    }
}

/// Leaves out flat elements at the boundary, as long as the boundary stays a surface.
pub(super) fn leave_out_flat(
    vertices_m: &[DVec3],
    elements: &mut Vec<Element>,
    report: &mut TetrahedralReport,
) -> Result<(), TetrahedralMeshError> {
    let count = elements.len();
    let quality = |of: &Element| mean_ratio(of.nodes.map(|node| vertices_m[node]));
    let mut flat: Vec<usize> = (0..count).filter(|&index| quality(&elements[index]) < FLAT).collect();
    if flat.len() == count {
        return Err(TetrahedralMeshError::NoVolume { elements: count });
    }
    if flat.is_empty() {
        return Ok(());
    }
    let mut boundary = OpenBoundary::new(elements.iter().map(|of| of.nodes));
    let mut is_left_out = vec![false; count];
    loop {
        let before = flat.len();
        flat.retain(|&index| {
            let is_removed = boundary.remove(elements[index].nodes);
            is_left_out[index] = is_removed;
            !is_removed
        });
        if flat.len() == before {
            break;
        }
    }
    if let Some(&index) = flat.first() {
        let of = &elements[index];
        return Err(TetrahedralMeshError::Flat { element: of.given, quality: quality(of).max(0.0) });
    }
    report.flat = is_left_out.iter().filter(|is| **is).count();
    let mut is_left_out = is_left_out.into_iter();
    elements.retain(|_| !is_left_out.next().unwrap_or_default());
    Ok(())
}

/// Leaves out vertices without elements: renumbers the nodes of the elements. Returns the index of each kept vertex, in ascending order.
pub(super) fn compact(vertices: usize, elements: &mut [Element]) -> Vec<usize> {
    let mut is_used = vec![false; vertices];
    elements.iter().flat_map(|of| of.nodes).for_each(|node| is_used[node] = true);
    let kept: Vec<usize> = (0..vertices).filter(|&vertex| is_used[vertex]).collect();
    let mut index = vec![0; vertices];
    kept.iter().enumerate().for_each(|(node, vertex)| index[*vertex] = node);
    elements.iter_mut().for_each(|of| of.nodes = of.nodes.map(|node| index[node]));
    kept
}
