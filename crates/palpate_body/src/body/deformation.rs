//! Deformation of a body at a place inside it.

use super::Body;
use crate::BodyPoint;
use glam::{DMat3, DVec3};

/// A place in a cell of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPlace {
    /// Index of the cell in [`Network::cells`](crate::Network::cells).
    pub cell: usize,
    /// Coordinates in the cell, 0 to 1 along each of its axes.
    pub local: DVec3,
}

/// Deformation of a body at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deformation {
    /// Deformation gradient F = ∂x/∂X, from the rest shape to the present one.
    pub gradient: DMat3,
    /// The material point at rest, m.
    pub rest_m: DVec3,
}

/// Maximum number of Newton steps to find a place in a cell; a convex cell takes about four.
const MAX_NEWTON_STEPS: usize = 20;
/// Tolerance of the local coordinates.
const LOCAL_TOLERANCE: f64 = 1e-9;

impl Deformation {
    /// Green–Lagrange strain E = (FᵀF − 1)/2, with axes of the rest shape. Zero for a rigid motion.
    #[must_use]
    pub fn strain(&self) -> DMat3 {
        (self.gradient.transpose() * self.gradient - DMat3::IDENTITY) * 0.5
    }

    /// Ratio of the present volume to that at rest, det F; negative in an inverted cell.
    #[must_use]
    pub fn volume_ratio(&self) -> f64 {
        self.gradient.determinant()
    }
}

impl Body {
    /// Finds the cell that contains `place_m`, m, in the present shape. `None` outside of all cells, and for a network without cells.
    ///
    /// The cells of a body from a mesh extend beyond its surface by up to a cell.
    #[must_use]
    pub fn cell_at(&self, place_m: DVec3) -> Option<CellPlace> {
        (0..self.network().cells().len()).find_map(|cell| self.place_in_cell(cell, place_m))
    }

    /// The place in `cell` at `place_m`, m, in the present shape; `None` outside of it.
    pub(super) fn place_in_cell(&self, cell: usize, place_m: DVec3) -> Option<CellPlace> {
        let corners = self.network().cells()[cell].map(|node| self.positions_m()[node]);
        let low = corners.iter().copied().reduce(DVec3::min)?;
        let high = corners.iter().copied().reduce(DVec3::max)?;
        let margin = DVec3::splat(LOCAL_TOLERANCE * (high - low).max_element());
        let is_in_box = place_m.cmpge(low - margin).all() && place_m.cmple(high + margin).all();
        let local = is_in_box.then(|| local_coordinates(&corners, place_m))??;
        Some(CellPlace { cell, local })
    }

    /// Deformation at a place of a cell, from the trilinear interpolation between its nodes.
    ///
    /// # Panics
    /// If the cell does not exist.
    #[must_use]
    pub fn deformation(&self, place: CellPlace) -> Deformation {
        let nodes = self.network().cells()[place.cell];
        let (now, rest) =
            (nodes.map(|node| self.positions_m()[node]), nodes.map(|node| self.network().rest_m()[node]));
        let (rest_m, rest_jacobian) = interpolate(&rest, place.local);
        let (_, jacobian) = interpolate(&now, place.local);
        Deformation { gradient: jacobian * rest_jacobian.inverse(), rest_m }
    }

    /// Deformation at `place_m`, m, in the present shape: of the cell or of the tetrahedron there. `None` outside of both.
    #[must_use]
    pub fn deformation_at(&self, place_m: DVec3) -> Option<Deformation> {
        if let Some(place) = self.cell_at(place_m) {
            return Some(self.deformation(place));
        }
        let mut tetrahedra = 0..self.network().tetrahedra().len();
        let (nodes, weights) =
            tetrahedra.find_map(|element| self.weights_in_tetrahedron(element, place_m))?;
        let edges = |of: &[DVec3]| {
            let [o, a, b, c] = nodes.map(|node| of[node]);
            DMat3::from_cols(a - o, b - o, c - o)
        };
        let rest_m = self.network().rest_m();
        let gradient = edges(self.positions_m()) * edges(rest_m).inverse();
        Some(Deformation {
            gradient,
            rest_m: nodes.iter().zip(weights).map(|(node, w)| w * rest_m[*node]).sum(),
        })
    }

    /// Nodes of the tetrahedron `element` with their weights at `place_m`, m, in the present shape. `None` outside of it.
    pub(super) fn weights_in_tetrahedron(
        &self,
        element: usize,
        place_m: DVec3,
    ) -> Option<([usize; 4], [f64; 4])> {
        let nodes = self.network().tetrahedra().get(element);
        let [o, a, b, c] = nodes.map(|node| self.positions_m()[node]);
        let of = DMat3::from_cols(a - o, b - o, c - o).inverse() * (place_m - o);
        let weights = [1.0 - of.element_sum(), of.x, of.y, of.z];
        // The inverse of a flat tetrahedron is not finite.
        weights.iter().all(|w| *w >= -LOCAL_TOLERANCE).then_some((nodes, weights))
    }

    /// The point of the body at a place of a cell: its nodes with their trilinear weights, to be held or tied. `None` if the cell does not
    /// exist.
    #[must_use]
    pub fn point_at(&self, place: CellPlace) -> Option<BodyPoint> {
        let nodes = self.network().cells().get(place.cell)?;
        let weights = nodes.iter().copied().zip((0..8).map(|corner| weight(corner, place.local)));
        BodyPoint::new(weights.filter(|(_, weight)| *weight != 0.0).collect()).ok()
    }
}

/// Trilinear weight of a corner, whose bits are its coordinates along x, y, z.
fn weight(corner: usize, local: DVec3) -> f64 {
    (0..3).map(|axis| if corner >> axis & 1 == 1 { local[axis] } else { 1.0 - local[axis] }).product()
}

/// Position and Jacobian matrix of the trilinear map at `local`.
fn interpolate(corners: &[DVec3; 8], local: DVec3) -> (DVec3, DMat3) {
    let mut columns = [DVec3::ZERO; 3];
    let mut at = DVec3::ZERO;
    for (corner, x) in corners.iter().enumerate() {
        at += weight(corner, local) * *x;
        for (axis, column) in columns.iter_mut().enumerate() {
            let side = if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let mut on_side = local;
            on_side[axis] = if corner >> axis & 1 == 1 { 1.0 } else { 0.0 };
            *column += side * weight(corner, on_side) * *x;
        }
    }
    (at, DMat3::from_cols(columns[0], columns[1], columns[2]))
}

/// Local coordinates of `place_m` by Newton's method; `None` outside the cell.
fn local_coordinates(corners: &[DVec3; 8], place_m: DVec3) -> Option<DVec3> {
    let mut local = DVec3::splat(0.5);
    for _ in 0..MAX_NEWTON_STEPS {
        let (at, jacobian) = interpolate(corners, local);
        let step = jacobian.inverse() * (at - place_m);
        if !step.is_finite() {
            return None;
        }
        local -= step;
        if step.abs().max_element() < LOCAL_TOLERANCE {
            let is_inside = local.cmpge(DVec3::splat(-2.0 * LOCAL_TOLERANCE)).all()
                && local.cmple(DVec3::splat(1.0 + 2.0 * LOCAL_TOLERANCE)).all();
            return is_inside.then_some(local.clamp(DVec3::ZERO, DVec3::ONE));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Block, Tissue};

    fn block() -> Body {
        let block = Block::new([4, 5, 6], DVec3::new(0.09, 0.12, 0.15)).unwrap().allow_unconstrained();
        let built = block.tissue(&Tissue::default()).unwrap();
        Body::new(built.network, built.surface).unwrap()
    }

    #[test]
    fn affine_motion_has_its_gradient_at_every_place() {
        let mut body = block();
        let gradient = DMat3::from_cols(
            DVec3::new(1.1, 0.2, 0.0),
            DVec3::new(-0.3, 0.9, 0.05),
            DVec3::new(0.0, 0.1, 1.2),
        );
        let moved = DVec3::new(0.3, -0.2, 0.1);
        let x: Vec<DVec3> = body.network().rest_m().iter().map(|x| gradient * *x + moved).collect();
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        let rests = [
            DVec3::ZERO,
            DVec3::new(0.044, -0.059, 0.074),
            DVec3::new(-0.015, 0.03, 0.0),
            DVec3::new(0.045, 0.06, 0.075),
        ];
        for rest_m in rests {
            let place = body.cell_at(gradient * rest_m + moved).unwrap();
            let deformation = body.deformation(place);
            assert!((deformation.rest_m - rest_m).length() < 1e-12, "{deformation:?} at {rest_m}");
            assert!((deformation.gradient - gradient).abs_diff_eq(DMat3::ZERO, 1e-12), "{deformation:?}");
            let strain = (gradient.transpose() * gradient - DMat3::IDENTITY) * 0.5;
            assert!(deformation.strain().abs_diff_eq(strain, 1e-12));
            assert!((deformation.volume_ratio() - gradient.determinant()).abs() < 1e-12);
            let point = body.point_at(place).unwrap();
            assert!((point.of(&x) - (gradient * rest_m + moved)).length() < 1e-12);
        }
    }

    #[test]
    fn places_outside_the_cells_have_none() {
        let body = block();
        for outside in [DVec3::X * 0.0451, DVec3::Y * -0.0601, DVec3::splat(1.0), DVec3::splat(f64::NAN)] {
            assert_eq!(body.cell_at(outside), None, "{outside}");
        }
        // A corner of the block, and a node that eight cells share.
        for inside in [DVec3::new(0.045, 0.06, 0.075), DVec3::new(0.015, 0.0, 0.015)] {
            assert!(body.cell_at(inside).is_some(), "{inside}");
        }
    }
}
