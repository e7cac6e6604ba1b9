//! What a mesh encloses of each cell.

use super::cell_grid::CellGrid;
use crate::ClosedMesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// Intersection of a mesh with the cells of a grid.
pub(super) struct Fill {
    /// Share φ of the volume of each cell that is inside.
    pub share: Vec<f64>,
    /// The surface in each cell that it meets.
    pub surface: BTreeMap<usize, CellSurface>,
    /// Share of the lower face of each cell along each axis through which the inside continues into the cell before it.
    pub open: Vec<DVec3>,
}

impl Fill {
    /// Number of cells with a larger φ than `share`.
    pub(super) fn cells_above(&self, share: f64) -> usize {
        self.share.iter().filter(|filled| **filled > share).count()
    }
}

/// The surface of a mesh in a cell.
pub(super) struct CellSurface {
    /// Its bounds, 0 to 1 along each side of the cell.
    pub bounds: [DVec3; 2],
    /// Indices of the triangles of the enclosing surface, ascending.
    pub triangles: Vec<usize>,
}

/// A convex piece of a triangle: three corners, plus one for each plane that has cut it.
type Piece = Vec<DVec3>;

/// Computes the share of every cell, exact up to rounding.
///
/// For a row of cells along x, the volume inside within the footprint of one cell is Σ ± ∫ (x_T − x_i) dy dz over the
/// pieces of triangles in and beyond it. A piece in cell i with projected area A and mean x̄ adds A (x̄ − x_i) to
/// that cell, and A to each cell before it. The sums of A in each direction are the areas inside on the faces of cells.
pub(super) fn fill(mesh: &ClosedMesh, grid: &CellGrid) -> Fill {
    let total = grid.cell_total();
    let mut fill = Fill { share: vec![0.0; total], surface: BTreeMap::new(), open: vec![DVec3::ZERO; total] };
    // Projected areas of the pieces in each cell, and of those on its lower faces.
    let (mut within, mut on_face) = (vec![DVec3::ZERO; total], vec![DVec3::ZERO; total]);
    for (index, t) in mesh.closed_triangles().iter().enumerate() {
        let corners = t.map(|point| grid.in_cells(mesh.enclosing_points_m()[point]));
        slabs(corners.to_vec(), 2, grid.cells[2], |z, piece| {
            slabs(piece, 1, grid.cells[1], |y, piece| {
                slabs(piece, 0, grid.cells[0], |x, piece| {
                    let cell = grid.index([x, y, z]);
                    let corner = DVec3::new(x as f64, y as f64, z as f64);
                    let (area, moment) = projected(&piece, corner.x);
                    fill.share[cell] += moment;
                    within[cell] += area;
                    for axis in 0..3 {
                        if piece.iter().all(|p| p[axis] == corner[axis]) {
                            on_face[cell][axis] += area[axis];
                        }
                    }
                    let surface = fill.surface.entry(cell).or_insert_with(|| CellSurface {
                        bounds: [DVec3::INFINITY, DVec3::NEG_INFINITY],
                        triangles: Vec::new(),
                    });
                    if surface.triangles.last() != Some(&index) {
                        surface.triangles.push(index);
                    }
                    for p in piece {
                        let at = (p - corner).clamp(DVec3::ZERO, DVec3::ONE);
                        surface.bounds = [surface.bounds[0].min(at), surface.bounds[1].max(at)];
                    }
                });
            });
        });
    }
    let strides = [1, grid.cells[0], grid.cells[0] * grid.cells[1]];
    for first in 0..total {
        let place = grid.place(first);
        for axis in (0..3).filter(|&axis| place[axis] == 0) {
            let mut ahead = 0.0;
            for along in (0..grid.cells[axis]).rev() {
                let cell = first + along * strides[axis];
                if axis == 0 {
                    fill.share[cell] += ahead;
                }
                ahead += within[cell][axis];
                // Just before the face and just behind it.
                fill.open[cell][axis] = ahead.min(ahead - on_face[cell][axis]);
            }
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

/// Signed areas of a piece projected along the axes, and the integral of x − `from` over the one along x.
fn projected(piece: &Piece, from: f64) -> (DVec3, f64) {
    let (mut area, mut moment) = (DVec3::ZERO, 0.0);
    for i in 1..piece.len() - 1 {
        let [a, b, c] = [piece[0], piece[i], piece[i + 1]];
        let part = 0.5 * (b - a).cross(c - a);
        area += part;
        moment += part.x * ((a.x + b.x + c.x) / 3.0 - from);
    }
    (area, moment)
}
