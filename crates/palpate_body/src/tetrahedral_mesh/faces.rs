//! Faces of tetrahedra and their boundary.

use super::report::TetrahedralReport;
use crate::disjoint_sets::DisjointSets;
use std::collections::HashMap;

/// Faces of an element, counter-clockwise as seen from outside; face i is opposite to corner i.
pub(super) fn faces_of([o, a, b, c]: [usize; 4]) -> [[usize; 3]; 4] {
    [[a, b, c], [o, c, b], [o, a, c], [o, b, a]]
}

fn sorted<const N: usize>(mut nodes: [usize; N]) -> [usize; N] {
    nodes.sort_unstable();
    nodes
}

fn edges_of([a, b, c]: [usize; 3]) -> [[usize; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(sorted)
}

/// The faces of one element only, counter-clockwise as seen from outside. Reports overlaps, edges where the boundary is no surface, and parts.
pub(super) fn boundary(elements: &[[usize; 4]], report: &mut TetrahedralReport) -> Vec<[usize; 3]> {
    let mut owners: HashMap<[usize; 3], (usize, usize)> = HashMap::with_capacity(2 * elements.len());
    let mut parts = DisjointSets::new(elements.len());
    for (index, nodes) in elements.iter().enumerate() {
        for face in faces_of(*nodes) {
            let (first, count) = owners.entry(sorted(face)).or_insert((index, 0));
            *count += 1;
            parts.unite(*first, index);
        }
    }
    report.face_parts = (0..elements.len()).filter(|&index| parts.find(index) == index).count();
    report.overlapping_faces = owners.values().filter(|(_, count)| *count > 2).count();
    let is_open = |face: &[usize; 3]| owners.get(&sorted(*face)).is_some_and(|(_, count)| *count == 1);
    let boundary: Vec<[usize; 3]> =
        elements.iter().flat_map(|nodes| faces_of(*nodes)).filter(is_open).collect();
    let mut edges: HashMap<[usize; 2], usize> = HashMap::with_capacity(2 * boundary.len());
    boundary.iter().flat_map(|face| edges_of(*face)).for_each(|edge| *edges.entry(edge).or_default() += 1);
    report.nonmanifold_edges = edges.values().filter(|count| **count != 2).count();
    boundary
}

/// The boundary of a mesh from which elements are removed.
pub(super) struct OpenBoundary {
    /// Number of elements of each face.
    faces: HashMap<[usize; 3], usize>,
    /// Number of boundary faces of each edge and each vertex.
    edges: HashMap<[usize; 2], usize>,
    vertices: HashMap<usize, usize>,
}

impl OpenBoundary {
    pub(super) fn new(elements: impl Iterator<Item = [usize; 4]>) -> Self {
        let mut faces = HashMap::new();
        elements.flat_map(faces_of).for_each(|face| *faces.entry(sorted(face)).or_insert(0) += 1);
        let open: Vec<[usize; 3]> =
            faces.iter().filter(|(_, count)| **count == 1).map(|(face, _)| *face).collect();
        let mut boundary = Self { faces, edges: HashMap::new(), vertices: HashMap::new() };
        open.into_iter().for_each(|face| boundary.add(face));
        boundary
    }

    fn add(&mut self, face: [usize; 3]) {
        edges_of(face).into_iter().for_each(|edge| *self.edges.entry(edge).or_insert(0) += 1);
        face.into_iter().for_each(|vertex| *self.vertices.entry(vertex).or_insert(0) += 1);
    }

    fn take_away(&mut self, face: [usize; 3]) {
        edges_of(face).into_iter().for_each(|edge| *self.edges.entry(edge).or_insert(1) -= 1);
        face.into_iter().for_each(|vertex| *self.vertices.entry(vertex).or_insert(1) -= 1);
    }

    fn is_open(&self, face: [usize; 3]) -> bool {
        self.faces.get(&sorted(face)) == Some(&1)
    }

    /// Removes an element at the boundary, if the boundary stays a surface: an element with one boundary face has its fourth corner inside, one
    /// with two has the opposite edge inside.
    pub(super) fn remove(&mut self, nodes: [usize; 4]) -> bool {
        let faces = faces_of(nodes);
        let closed: Vec<usize> = (0..4).filter(|&i| !self.is_open(faces[i])).collect();
        let touches = match closed[..] {
            [] | [_] => false,
            // The closed faces are opposite to corners i and j: they share the edge of the others.
            [i, j] => {
                let mut others = (0..4).filter(|corner| *corner != i && *corner != j).map(|c| nodes[c]);
                let edge = [others.next(), others.next()].map(Option::unwrap_or_default);
                self.edges.get(&sorted(edge)).is_some_and(|count| *count > 0)
            }
            // The corner opposite to the open face.
            [_, _, _] => {
                let corner = (0..4).find(|i| !closed.contains(i)).map_or(0, |i| nodes[i]);
                self.vertices.get(&corner).is_some_and(|count| *count > 0)
            }
            _ => true,
        };
        if touches {
            return false;
        }
        for face in faces {
            let key = sorted(face);
            let count = self.faces.entry(key).or_insert(1);
            *count -= 1;
            match *count {
                0 => self.take_away(face),
                1 => self.add(face),
                _ => {}
            }
        }
        true
    }
}
