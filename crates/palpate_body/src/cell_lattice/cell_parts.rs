//! The parts of cells, and their connections.

use super::cell_grid::CellGrid;
use super::cell_samples::CellSamples;
use super::fill::{CellSurface, Fill};
use crate::ClosedMesh;
use crate::disjoint_sets::DisjointSets;
use crate::parallel;
use glam::DVec3;
use std::collections::BTreeMap;

/// What is inside a cell, or one of several components of it that are not connected within the cell.
#[derive(Debug)]
pub(super) struct CellPart {
    /// Index of the cell in the grid.
    pub cell: usize,
    /// Share of the volume of the cell.
    pub share: f64,
    /// Bounds of its surface, 0 to 1 along each side of the cell; `None` for a cell without surface.
    pub surface: Option<[DVec3; 2]>,
}

/// Parts of all cells that have something inside (Nesme et al., ACM Trans. Graph. 28 (2009) 52: each component of a cell is an element of its
/// own). Two parts are connected if their cells share a face through which the inside continues.
#[derive(Debug)]
pub(super) struct CellParts {
    /// Parts, in the order of their cells.
    pub parts: Vec<CellPart>,
    /// Parts of cell i: `first[i]..first[i + 1]`.
    first: Vec<usize>,
    /// Connected parts of each part, ascending.
    links: Vec<Vec<usize>>,
    /// Samples of the cells that may have several parts.
    samples: BTreeMap<usize, CellSamples>,
}

/// Minimum share of a face through which two cells are connected.
const OPEN_FACE: f64 = 1e-9;
/// Share of a cell up to which it is empty: the surface lies on its sides.
const EMPTY: f64 = 1e-12;

impl CellParts {
    /// Finds the parts of the cells of `grid`.
    pub(super) fn new(mesh: &ClosedMesh, grid: &CellGrid, fill: Fill) -> Self {
        let mut made = Self {
            parts: Vec::new(),
            first: Vec::with_capacity(grid.cell_total() + 1),
            links: Vec::new(),
            samples: BTreeMap::new(),
        };
        let met: Vec<(&usize, &CellSurface)> =
            fill.surface.iter().filter(|(cell, _)| fill.share[**cell] >= EMPTY).collect();
        let samples = parallel::map_long(met.len(), |range| {
            let new = |&(&cell, surface): &(&usize, &CellSurface)| {
                CellSamples::new(mesh, grid, grid.place(cell), surface, fill.share[cell])
                    .map(|samples| (cell, samples))
            };
            met[range].iter().filter_map(new).collect()
        });
        made.samples = samples.into_iter().collect();
        // Triangles of the surface that each part meets.
        let mut triangles_of: Vec<Vec<usize>> = Vec::new();
        for (cell, &share) in fill.share.iter().enumerate() {
            made.first.push(made.parts.len());
            if share < EMPTY {
                continue;
            }
            // A cell without surface is entirely inside or outside.
            let Some(surface) = fill.surface.get(&cell) else {
                if share > 0.5 {
                    made.parts.push(CellPart { cell, share, surface: None });
                    triangles_of.push(Vec::new());
                }
                continue;
            };
            let Some(samples) = made.samples.get(&cell) else {
                made.parts.push(CellPart { cell, share, surface: Some(surface.bounds) });
                triangles_of.push(surface.triangles.clone());
                continue;
            };
            for (part, bounds) in samples.shares.iter().zip(&samples.bounds) {
                made.parts.push(CellPart { cell, share: share * part, surface: Some(*bounds) });
            }
            triangles_of.extend_from_slice(&samples.triangles);
        }
        made.first.push(made.parts.len());
        made.links = vec![Vec::new(); made.parts.len()];
        made.link_through_faces(grid, &fill.open);
        made.link_shells(grid, &shells(mesh), &triangles_of);
        made
    }

    /// Connects the parts of neighbouring cells through their common faces.
    fn link_through_faces(&mut self, grid: &CellGrid, open: &[DVec3]) {
        for (cell, open) in open.iter().enumerate() {
            for (axis, share) in open.to_array().into_iter().enumerate() {
                let Some(before) = grid.before(cell, axis).filter(|_| share > OPEN_FACE) else {
                    continue;
                };
                // Where a surface folds over itself, a face may be open although nothing counts as inside on one side.
                if self.of_cell(before).is_empty() || self.of_cell(cell).is_empty() {
                    continue;
                }
                let (this, next) = (self.samples.get(&before), self.samples.get(&cell));
                for (a, b) in CellSamples::through(this, next, axis) {
                    self.link(self.first[before] + a, self.first[cell] + b);
                }
            }
        }
    }

    /// Connects the parts on one closed shell of the surface where the lines are too coarse to show that they are connected. `shells` has
    /// the shell of each triangle, and `triangles_of` the triangles of each part.
    fn link_shells(&mut self, grid: &CellGrid, shells: &[usize], triangles_of: &[Vec<usize>]) {
        let mut sets = DisjointSets::new(self.parts.len());
        for (part, linked) in self.links.iter().enumerate() {
            linked.iter().for_each(|&other| sets.unite(part, other));
        }
        // Shells on which parts are not connected. Of most meshes it is none.
        let mut set_of = vec![None; shells.len()];
        let mut is_divided = vec![false; shells.len()];
        for (part, triangles) in triangles_of.iter().enumerate() {
            let own = sets.find(part);
            for shell in triangles.iter().map(|&triangle| shells[triangle]) {
                is_divided[shell] |= *set_of[shell].get_or_insert(own) != own;
            }
        }
        if !is_divided.contains(&true) {
            return;
        }
        let mut on_triangle: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (part, triangles) in triangles_of.iter().enumerate() {
            for &triangle in triangles.iter().filter(|triangle| is_divided[shells[**triangle]]) {
                on_triangle.entry(triangle).or_default().push(part);
            }
        }
        let mut on_shell: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (&triangle, parts) in &on_triangle {
            on_shell.entry(shells[triangle]).or_default().extend(parts);
        }
        for parts in on_shell.values_mut() {
            parts.sort_unstable();
            parts.dedup();
        }
        // First through faces that a triangle crosses, then within cells, through any face, and where the shell meets itself at an edge or a
        // corner.
        let stages = [(&on_triangle, 1), (&on_shell, 0), (&on_shell, 1), (&on_shell, 2), (&on_shell, 3)];
        for (groups, faces) in stages {
            for parts in groups.values() {
                let first = sets.find(parts[0]);
                if parts.iter().all(|&part| sets.find(part) == first) {
                    continue;
                }
                for (index, &a) in parts.iter().enumerate() {
                    for &b in &parts[index + 1..] {
                        let is_near =
                            grid.faces_between(self.parts[a].cell, self.parts[b].cell) == Some(faces);
                        if is_near && sets.find(a) != sets.find(b) {
                            sets.unite(a, b);
                            self.link(a, b);
                        }
                    }
                }
            }
        }
    }

    fn link(&mut self, a: usize, b: usize) {
        for (from, to) in [(a, b), (b, a)] {
            if let Err(at) = self.links[from].binary_search(&to) {
                self.links[from].insert(at, to);
            }
        }
    }

    /// Indices of the parts of a cell.
    pub(super) fn of_cell(&self, cell: usize) -> std::ops::Range<usize> {
        self.first[cell]..self.first[cell + 1]
    }

    /// Parts connected with `part`.
    pub(super) fn linked(&self, part: usize) -> &[usize] {
        &self.links[part]
    }

    /// The part of `cell` at a place in it; see [`CellSamples::component_at`]. `None` for a cell without parts.
    pub(super) fn part_at(&self, cell: usize, at: DVec3, normal: DVec3) -> Option<usize> {
        let parts = self.of_cell(cell);
        let component = self.samples.get(&cell).map_or(0, |samples| samples.component_at(at, normal));
        parts.clone().nth(component)
    }
}

/// The closed shell of each triangle of the enclosing surface: the lowest triangle that edges connect with it.
fn shells(mesh: &ClosedMesh) -> Vec<usize> {
    let mut sets = DisjointSets::new(mesh.enclosing_points_m().len());
    for &[a, b, c] in mesh.closed_triangles() {
        sets.unite(a, b);
        sets.unite(b, c);
    }
    let mut first = vec![None; mesh.enclosing_points_m().len()];
    let shell = |(triangle, t): (usize, &[usize; 3])| *first[sets.find(t[0])].get_or_insert(triangle);
    mesh.closed_triangles().iter().enumerate().map(shell).collect()
}
