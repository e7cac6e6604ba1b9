//! Touched points of a tool, and the displayed force of a touch.

use crate::{Body, BodyPoint};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use glam::DVec3;
use palpate_laws::{Coulomb, Patch, SeriesCompliance};

/// A row of a contact patch that gave an impulse in the last step. A patch is one row, or nine under a contact wider
/// than 0.8 cells: the middle and eight sides.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchedPoint {
    /// Corners of the triangle under the patch as points of the [contact surface](crate::ContactSurface), with the
    /// weights of the patch's place. All rows of a patch share them. Some weights are 0 on a corner or an edge.
    pub corners: [(usize, f64); 3],
    /// Nodes and weights: the mean of the surface under the row's part of the pressure is Σ w_i x_i.
    pub nodes: Vec<(usize, f64)>,
    /// Outward unit normal, towards the tool.
    pub normal: DVec3,
    /// Distance from the tool along the normal at the end of the step, m, to first order. It is minus the deflection
    /// of the compliance in series (see [`TouchedPoint::series`]), up to some micrometres while an existing gap
    /// closes, for example after sliding over a slope.
    pub gap_m: f64,
    /// Impulse λ of the tool on the body, N s.
    pub impulse_ns: DVec3,
    /// Velocity relative to the tool at the end of the step, m/s. Its tangential part is the slip.
    pub slip_m_per_s: DVec3,
    /// Contact patch.
    pub patch: Patch,
    /// Index of the row in its patch: 0 for a single row or the middle, 1 to 8 for the sides.
    pub row: usize,
    /// Rest normal of the triangle on which the patch started.
    pub rest_normal: DVec3,
    /// Compliance in series with the row: what the grid lacks below a cell, or a twentieth of the smooth law without
    /// added compliance ([`Body::add_compliance`]); `None` in a network without cells.
    pub series: Option<SeriesCompliance>,
    /// Length of the step, s.
    pub(crate) step_s: f64,
}

impl TouchedPoint {
    /// Normal force of the tool in the last step, N.
    #[must_use]
    pub fn pressing_n(&self) -> f64 {
        if self.step_s > 0.0 { (-self.impulse_ns.dot(self.normal) / self.step_s).max(0.0) } else { 0.0 }
    }

    /// Force of the tool on the body in the last step, N.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        if self.step_s > 0.0 { self.impulse_ns / self.step_s } else { DVec3::ZERO }
    }

    /// Energy stored in the series compliance, J: that of its law along the normal, and that of a spring across it.
    pub(crate) fn stored_j(&self) -> f64 {
        let Some(series) = self.series else { return 0.0 };
        let pressing_n = self.pressing_n();
        let across_n = self.force_n().reject_from_normalized(self.normal);
        series.energy_j(pressing_n) + 0.5 * series.across_m_per_n(pressing_n) * across_n.length_squared()
    }

    /// Mean of the surface under the row, as a point of the body.
    #[must_use]
    pub fn body_point(&self) -> BodyPoint {
        BodyPoint::carried_by(self.nodes.clone())
    }

    /// Position of that mean, m.
    ///
    /// # Panics
    /// If `body` has fewer nodes than the touched one.
    #[must_use]
    pub fn point_m(&self, body: &Body) -> DVec3 {
        self.nodes.iter().map(|&(node, w)| w * body.positions_m()[node]).sum()
    }
}

/// Relative regularisation: differences between rows below this share are taken from their impulses.
const REGULARISATION: f64 = 1e-2;

/// Sum of the forces on the rows `touched` on the hand, N.
///
/// With the internal force F on the nodes and the weights H of the rows, f = (H Hᵀ)⁻¹ H F is the least-squares fit of
/// row forces to F; for a single row it is Σ w_i F_i / Σ w_i². At rest it equals −λ/h. The rows of a small patch
/// differ by less than the nodes resolve, and a fit to that difference would be noise. The regularisation keeps −λ/h
/// there.
pub(super) fn displayed_force_n(touched: &[TouchedPoint], friction: f64, body: &Body) -> DVec3 {
    let free = |&(node, w): &(usize, f64)| w != 0.0 && !body.network().is_fixed(node);
    let rows: Vec<Vec<(usize, f64)>> =
        touched.iter().map(|point| point.nodes.iter().copied().filter(free).collect()).collect();
    let guess: Vec<DVec3> = touched.iter().map(|point| -point.impulse_ns / point.step_s).collect();
    // Internal force on the nodes minus that of the guess.
    let mut rest: Vec<(usize, DVec3)> = Vec::new();
    for (row, f) in rows.iter().zip(&guess) {
        for &(node, w) in row {
            let place = rest.iter().position(|(known, _)| *known == node).unwrap_or_else(|| {
                rest.push((node, body.internal_force_on_n(node)));
                rest.len() - 1
            });
            rest[place].1 -= w * *f;
        }
    }
    let of = |row: &[(usize, f64)], node: usize| {
        row.iter().find(|(known, _)| *known == node).map_or(0.0, |(_, w)| *w)
    };
    let gram = Mat::from_fn(rows.len(), rows.len(), |r, s| {
        let product: f64 = rows[r].iter().map(|&(node, w)| w * of(&rows[s], node)).sum();
        if r == s && rows.len() > 1 { product * (1.0 + REGULARISATION) } else { product }
    });
    let mut correction = Mat::from_fn(rows.len(), 3, |r, axis| {
        rest.iter().map(|&(node, f)| of(&rows[r], node) * f[axis]).sum::<f64>()
    });
    match gram.llt(Side::Lower) {
        Ok(factor) => factor.solve_in_place(&mut correction),
        // A row of fixed nodes only: use its impulse.
        Err(_) => correction.fill(0.0),
    }
    let force = |(row, point): (usize, &TouchedPoint)| {
        let f = guess[row] + DVec3::from_array([0, 1, 2].map(|axis| correction[(row, axis)]));
        Coulomb::new(point.normal, friction).map_or(DVec3::ZERO, |cone| cone.in_cone(f))
    };
    touched.iter().enumerate().map(force).sum()
}
