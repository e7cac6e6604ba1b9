//! The filled share of each cell.

use super::cell_grid::CellGrid;
use crate::ClosedMesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// Intersection of a mesh with the cells of a grid.
pub(super) struct Fill {
    /// Share φ of the volume of each cell that is inside.
    pub share: Vec<f64>,
    /// Bounds of the surface in each cell that it meets, 0 to 1 along each side.
    pub surface: BTreeMap<usize, [DVec3; 2]>,
}

/// A convex piece of a triangle: three corners, plus one for each plane that has cut it.
type Piece = Vec<DVec3>;

/// Computes the share of every cell, exact up to rounding.
///
/// For a row of cells along x, the volume inside within the footprint of one cell is Σ ± ∫ (x_T − x_i) dy dz over the
/// pieces of triangles in and beyond it. A piece in cell i with projected area A and mean x̄ adds A (x̄ − x_i) to
/// that cell, and A to each cell before it.
pub(super) fn fill(mesh: &ClosedMesh, grid: &CellGrid) -> Fill {
    let mut fill = Fill { share: vec![0.0; grid.cell_total()], surface: BTreeMap::new() };
    let mut before = vec![0.0; grid.cell_total()];
    for t in mesh.closed_triangles() {
        let corners = t.map(|point| grid.in_cells(mesh.enclosing_points_m()[point]));
        slabs(corners.to_vec(), 2, grid.cells[2], |z, piece| {
            slabs(piece, 1, grid.cells[1], |y, piece| {
                slabs(piece, 0, grid.cells[0], |x, piece| {
                    let cell = grid.index([x, y, z]);
                    let corner = DVec3::new(x as f64, y as f64, z as f64);
                    let (area, moment) = projected(&piece, corner.x);
                    fill.share[cell] += moment;
                    before[cell] += area;
                    let bounds = fill.surface.entry(cell).or_insert([DVec3::INFINITY, DVec3::NEG_INFINITY]);
                    for p in piece {
                        let at = (p - corner).clamp(DVec3::ZERO, DVec3::ONE);
                        *bounds = [bounds[0].min(at), bounds[1].max(at)];
                    }
                });
            });
        });
    }
    for row in 0..grid.cells[1] * grid.cells[2] {
        let first = row * grid.cells[0];
        let mut ahead = 0.0;
        for cell in (first..first + grid.cells[0]).rev() {
            fill.share[cell] += ahead;
            ahead += before[cell];
        }
    }
    fill
}

/// Cuts `piece` at the integers along `axis`, and calls `each` with every part and the integer below it, from 0 to
/// `cells` − 1.
fn slabs(mut piece: Piece, axis: usize, cells: usize, mut each: impl FnMut(usize, Piece)) {
    let low = piece.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let high = piece.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    // Rounding may leave the outermost corners just outside the grid.
    let slab = |at: f64| (at.max(0.0) as usize).min(cells - 1);
    for number in slab(low)..slab(high) {
        let (below, above) = split(&piece, axis, (number + 1) as f64);
        piece = above;
        if below.len() >= 3 {
            each(number, below);
        }
    }
    if piece.len() >= 3 {
        each(slab(high), piece);
    }
}

/// Parts of a convex piece below and above a plane.
fn split(piece: &Piece, axis: usize, plane: f64) -> (Piece, Piece) {
    let (mut below, mut above) =
        (Piece::with_capacity(piece.len() + 1), Piece::with_capacity(piece.len() + 1));
    for (i, &p) in piece.iter().enumerate() {
        let q = piece[(i + 1) % piece.len()];
        if p[axis] <= plane {
            below.push(p);
        }
        if p[axis] >= plane {
            above.push(p);
        }
        if (p[axis] < plane) != (q[axis] < plane) && p[axis] != plane && q[axis] != plane {
            let mut cut = p + (q - p) * ((plane - p[axis]) / (q[axis] - p[axis]));
            cut[axis] = plane;
            below.push(cut);
            above.push(cut);
        }
    }
    (below, above)
}

/// Signed area of a piece projected along x, and its integral of x − `from`.
fn projected(piece: &Piece, from: f64) -> (f64, f64) {
    let (mut area, mut moment) = (0.0, 0.0);
    for i in 1..piece.len() - 1 {
        let [a, b, c] = [piece[0], piece[i], piece[i + 1]];
        let part = 0.5 * (b - a).cross(c - a).x;
        area += part;
        moment += part * ((a.x + b.x + c.x) / 3.0 - from);
    }
    (area, moment)
}
