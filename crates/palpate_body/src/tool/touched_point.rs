//! Where a tool touches, and the force that is displayed there.

use crate::{Body, BodyPoint};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use glam::DVec3;
use palpate_laws::{Coulomb, Patch, SeriesCompliance};

/// A row of a contact patch with which the tool pushed in the last step. A patch is one row, or nine under a contact wider than 0.8 cells: one for
/// its middle and eight for its sides.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchedPoint {
    /// The corners of the triangle under the patch's place, points of the [contact surface](crate::ContactSurface), and the place's weights;
    /// the same for all rows of a patch. On a corner or an edge some are 0.
    pub corners: [(usize, f64); 3],
    /// The nodes that carry it and their weights: the mean of the surface under the row's part of the tool's pressure is Σ w_i x_i.
    pub nodes: Vec<(usize, f64)>,
    /// Unit normal out of the body, towards the tool.
    pub normal: DVec3,
    /// Distance from the tool along the normal at the end of the step, m, to the first order: minus what gives way in series with the
    /// nodes (see [`TouchedPoint::series`]), but for some micrometres where an overdue gap is being closed, because the tool slid over a
    /// slope for instance.
    pub gap_m: f64,
    /// λ, the impulse that the tool gave to the body, N s.
    pub impulse_ns: DVec3,
    /// Velocity relative to the tool at the end of the step, m/s: across the normal that of the slip.
    pub slip_m_per_s: DVec3,
    /// The patch: where the tool is on the surface, and the normal there.
    pub patch: Patch,
    /// Which of the patch's rows it is: 0 all of it or its middle, 1 to 8 its sides.
    pub row: usize,
    /// The normal at rest of the triangle on which the patch began.
    pub rest_normal: DVec3,
    /// The compliance in series with the row: what the grid lacks below a cell, or a twentieth of the smooth law where that is not added
    /// ([`Body::add_compliance`]); `None` in a network without cells.
    pub series: Option<SeriesCompliance>,
    /// Length of the step, s.
    pub(crate) step_s: f64,
}

impl TouchedPoint {
    /// The force with which the tool pressed along the normal in the last step, N.
    #[must_use]
    pub fn pressing_n(&self) -> f64 {
        if self.step_s > 0.0 { (-self.impulse_ns.dot(self.normal) / self.step_s).max(0.0) } else { 0.0 }
    }

    /// The force of the tool on the body in the last step, N.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        if self.step_s > 0.0 { self.impulse_ns / self.step_s } else { DVec3::ZERO }
    }

    /// The energy in the compliance that is in series with it, J: along the normal that of its law, across the normal that of a spring.
    pub(crate) fn stored_j(&self) -> f64 {
        let Some(series) = self.series else { return 0.0 };
        let pressing_n = self.pressing_n();
        let across_n = self.force_n().reject_from_normalized(self.normal);
        series.energy_j(pressing_n) + 0.5 * series.across_m_per_n(pressing_n) * across_n.length_squared()
    }

    /// The mean of the surface under it, as a point of the body.
    #[must_use]
    pub fn body_point(&self) -> BodyPoint {
        BodyPoint::carried_by(self.nodes.clone())
    }

    /// Where that mean is now, m.
    ///
    /// # Panics
    /// When `body` is another one, with fewer nodes.
    #[must_use]
    pub fn point_m(&self, body: &Body) -> DVec3 {
        self.nodes.iter().map(|&(node, w)| w * body.positions_m()[node]).sum()
    }
}

/// What several rows can hardly tell apart, by less than that share of them, is taken from their impulses.
const SHARE: f64 = 1e-2;

/// The sum of the forces on the rows `touched`, N, on the hand.
///
/// With F the internal force on the nodes and H the rows' weights, f = (H Hᵀ)⁻¹ H F: the forces on the rows that come nearest
/// to F at the nodes; for a single row Σ w_i F_i / Σ w_i². At rest it is −λ/h. Several rows of one patch differ by less than the nodes can
/// resolve while the contact is small, and an f fitted to that difference would be noise: there −λ/h counts.
pub(super) fn displayed_force_n(touched: &[TouchedPoint], friction: f64, body: &Body) -> DVec3 {
    let free = |&(node, w): &(usize, f64)| w != 0.0 && !body.network().is_fixed(node);
    let rows: Vec<Vec<(usize, f64)>> =
        touched.iter().map(|point| point.nodes.iter().copied().filter(free).collect()).collect();
    let guess: Vec<DVec3> = touched.iter().map(|point| -point.impulse_ns / point.step_s).collect();
    // What the nodes feel beyond the guess.
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
        if r == s && rows.len() > 1 { product * (1.0 + SHARE) } else { product }
    });
    let mut correction = Mat::from_fn(rows.len(), 3, |r, axis| {
        rest.iter().map(|&(node, f)| of(&rows[r], node) * f[axis]).sum::<f64>()
    });
    match gram.llt(Side::Lower) {
        Ok(factor) => factor.solve_in_place(&mut correction),
        // A row of nothing but fixed nodes: its λ is all there is.
        Err(_) => correction.fill(0.0),
    }
    let force = |(row, point): (usize, &TouchedPoint)| {
        let f = guess[row] + DVec3::from_array([0, 1, 2].map(|axis| correction[(row, axis)]));
        Coulomb::new(point.normal, friction).map_or(DVec3::ZERO, |cone| cone.in_cone(f))
    };
    touched.iter().enumerate().map(force).sum()
}
