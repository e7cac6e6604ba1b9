//! Linkages between the driven bodies of a board and its tip.

use super::reach::Reach;
use super::{polhem_linkage, woodenhaptics_linkage};
use crate::HidError;

/// Linkage of an arm, with the lengths of its links.
///
/// A Polhem 2 or 3 has the same USB IDs and reports as a WoodenHaptics, so the linkage cannot be detected and has to be set. With the
/// wrong linkage, positions and directions of forces are wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BoardLinkage {
    /// Two links, each driven from the base: WoodenHaptics, AluHaptics, Polhem 1.
    ///
    /// Body B turns link B from the vertical by θ_B, body C turns link C from straight down by θ_C:
    ///
    /// * ρ = L_b sin θ_B + L_c sin θ_C, h = L_n + L_b cos θ_B − L_c cos θ_C;
    /// * the determinant of J is ρ L_b L_c sin(θ_B + θ_C), and the leverage |ρ sin(θ_B + θ_C)| / (L_b + L_c).
    ///
    /// Source: forsslund/haptikfabrikenapi at b8d6c94, `src/kinematics.cpp`.
    WoodenHaptics {
        /// L_n, L_b, L_c: height of the shoulder, 0 to 10 m; lengths of the two links, 0.001 to 10 m.
        length_m: [f64; 3],
    },
    /// Five-bar linkage: Polhem 2 and 3, variant 3 of the interface.
    ///
    /// ```text
    ///            c
    ///           / \ L4
    ///       L3 /    b             The axes of C, on the left, and of B lie L0/2 behind and before that of A; b is the elbow, and
    ///         /    / \            c, b and the tip lie in one line.
    ///        /    /    \ L5
    ///       d    / L1    \
    ///     L2 \  /         tip
    ///        o o
    ///         L0
    /// ```
    ///
    /// Angles are from the plane's outward direction, upwards positive, u(θ) = (cos θ, sin θ) in (ρ, h). Body B turns the upper arm L1,
    /// body C the crank L2; the rod L3 goes from the crank to the rear end of the outer link, which turns about the elbow and whose angle
    /// is λ:
    ///
    /// * b = (L0/2, 0) + L1 u(θ_B), d = (−L0/2, 0) + L2 u(θ_C), c = b − L4 u(λ), tip = b + L5 u(λ);
    /// * |c − d| = L3, so that with w = b − d: λ = arg w − arccos((w² + L4² − L3²) / (2 L4 |w|)), c being clockwise from d as seen
    ///   from b;
    /// * with f = c − d of the angle φ: ∂λ/∂θ_B = L1 sin(φ − θ_B) / (L4 sin(φ − λ)), ∂λ/∂θ_C = −L2 sin(φ − θ_C) / (L4 sin(φ − λ));
    /// * the determinant of J is ±ρ L1 L5 sin(λ − θ_B) ∂λ/∂θ_C. The leverage is |ρ sin(λ − θ_B)| / (L0/2 + L1 + L5) times the lesser of
    ///   |sin(φ − θ_C)|, where it is 0 the crank is at a dead centre, and |sin(φ − λ)|, where it is 0 the rod cannot hold the outer
    ///   link.
    ///
    /// Source: forsslund/hfabapi at aadabaa, `hfab_polhem.h`. It computes λ as θ_B minus three unsigned angles at b: from the axis of B
    /// to that of C, on to d, and on to c. Its positions agree with this linkage while b is above the axes and d clockwise from the axis
    /// of C. They differ where the tip is far out and b below the axes, and near the upper end, where the leverage is below 0.1.
    Polhem {
        /// L0 to L5, m: L0 is 0 to 10, the others are 0.001 to 10.
        length_m: [f64; 6],
    },
}

impl Default for BoardLinkage {
    /// Linkage of the WoodenHaptics of 2015.
    fn default() -> Self {
        Self::WoodenHaptics { length_m: woodenhaptics_linkage::LENGTH_2015_M }
    }
}

impl BoardLinkage {
    /// Validates the lengths.
    pub(super) fn validate(&self) -> Result<(), HidError> {
        let (bases, links): (f64, &[f64]) = match self {
            Self::WoodenHaptics { length_m: [base, links @ ..] } => (*base, links),
            Self::Polhem { length_m: [base, links @ ..] } => (*base, links),
        };
        let error = |what, found: f64, allowed| HidError::Option { what, found: found.to_string(), allowed };
        if !(0.0..=10.0).contains(&bases) {
            return Err(error("first length of a board's linkage, m", bases, "0 to 10"));
        }
        let bad = links.iter().find(|length| !(1e-3..=10.0).contains(*length));
        bad.map_or(Ok(()), |&bad| Err(error("length of a board's links, m", bad, "0.001 to 10")))
    }

    /// Tip position and its derivatives for the angles of bodies B and C, rad.
    pub(super) fn reach(&self, b_rad: f64, c_rad: f64) -> Reach {
        match self {
            Self::WoodenHaptics { length_m } => woodenhaptics_linkage::reach(length_m, b_rad, c_rad),
            Self::Polhem { length_m } => polhem_linkage::reach(length_m, b_rad, c_rad),
        }
    }
}
