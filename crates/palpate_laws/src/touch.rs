//! Where a tool and a triangulated surface touch.

use crate::smooth_step::smooth_step;
use crate::{LawError, MAX_CORRECTION_SPEED_M_PER_S, SeriesCompliance};
use glam::DVec3;

/// Most nodes that carry a point of a surface: those of a cell.
pub const POINT_NODES: usize = 8;

/// The part of a tool that touches, rigid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolShape {
    /// A ball round the tool's position.
    Sphere {
        /// Its radius, m.
        radius_m: f64,
    },
    /// A flat disc round the tool's position, the end of a cylinder: everything behind it is tool.
    FlatPunch {
        /// Its radius, m.
        radius_m: f64,
        /// Unit vector along the cylinder, the way it presses.
        axis: DVec3,
    },
}

/// A row with less weight than `FULL_LEVER` on nodes that can move pushes less, and with less than `NO_LEVER` not at all.
const FULL_LEVER: f64 = 0.1;
const NO_LEVER: f64 = 0.01;
/// The same for rows without a compliance of their own: to move them their nodes would have to go far. Less is enough for one that pushes already,
/// so that a touch near what is fixed does not come and go.
const LEAST_LEVER: f64 = 0.3;
const LEAST_LEVER_TOUCHED: f64 = 0.1;

/// The part of its force that a row with a compliance of its own has whose weight on nodes that can move is `free_share`: 0 where it is
/// fixed, 1 where it is not, and smooth between.
#[must_use]
pub fn mobility(free_share: f64) -> f64 {
    smooth_step(free_share, NO_LEVER, FULL_LEVER)
}

/// Whether the weight of a row without a compliance of its own on nodes that can move, `free_share`, is too little for it to push; less is enough
/// for a row that is touched already, `is_touched`.
#[must_use]
pub fn is_out_of_reach(free_share: f64, is_touched: bool) -> bool {
    free_share < if is_touched { LEAST_LEVER_TOUCHED } else { LEAST_LEVER }
}

/// How fast a compliance in series takes up what a tool is in the surface already, m/s: a tool that begins there presses within some hundredths of a
/// second, and does not hit.
const TAKING_UP_M_PER_S: f64 = 0.2;

/// What the compliance in series with a row did in the step before; nothing where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeriesDeflection {
    /// How far it gave way along the normal, m, and across it.
    pub along_m: f64,
    /// See `along_m`.
    pub across_m: DVec3,
    /// Its compliance across the normal, m/N.
    pub across_m_per_n: f64,
    /// See [`SeriesCompliance::takes_up`].
    pub takes_up: f64,
}

impl SeriesDeflection {
    /// That of `series` under a force of `force_n` along the normal and `whole_n` in all, N.
    #[must_use]
    pub fn of(series: Option<SeriesCompliance>, force_n: f64, whole_n: DVec3) -> Self {
        series.map_or(Self::default(), |series| {
            let across_m_per_n = series.across_m_per_n(force_n);
            Self {
                along_m: series.approach_m(force_n),
                across_m: whole_n * across_m_per_n,
                across_m_per_n,
                takes_up: series.gap_uptake(),
            }
        })
    }
}

/// The gap between a tool and a patch in a step, for the rows of [`crate::solve_rows`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactGap {
    /// Along the normal, as far as it is to be closed in this step, m.
    pub normal_m: f64,
    /// The whole, with what the tool moves across the normal, m.
    pub gap_m: DVec3,
    /// The part of it that was there before: positions close it, velocities keep nothing of that, m.
    pub overdue_m: DVec3,
}

impl ContactGap {
    /// The gap in a step of length `h`, s, in which the tool moves by `moved_m`, against a surface along whose inward unit normal `push` the tool
    /// is `apart_m` from it in the end if the surface stands still. A compliance in series, which gave way in the step before, takes up a part
    /// of what is left from before, as if the tool came at a low speed; positions alone close the rest at the closing speed. The tool's
    /// own motion is followed at once.
    #[must_use]
    pub fn new(apart_m: f64, push: DVec3, moved_m: DVec3, series: SeriesDeflection, h: f64) -> Self {
        let before = apart_m + moved_m.dot(push) + series.along_m;
        let left = before.clamp(-h * MAX_CORRECTION_SPEED_M_PER_S, 0.0);
        let taken = before.clamp(-h * TAKING_UP_M_PER_S * series.takes_up, 0.0);
        let normal_m = if before < 0.0 { left + apart_m - before } else { apart_m };
        let gap_m = normal_m * push - (moved_m + series.across_m).reject_from_normalized(push);
        Self { normal_m, gap_m, overdue_m: (left - taken) * push }
    }
}

impl ToolShape {
    /// Refuses a shape that makes no sense.
    ///
    /// # Errors
    /// [`LawError::Radius`] when the radius is not finite and above 0, [`LawError::Normal`] when the axis is not of unit
    /// length.
    pub fn validate(&self) -> Result<(), LawError> {
        let radius_m = self.radius_m();
        if !(radius_m.is_finite() && radius_m > 0.0) {
            return Err(LawError::Radius(radius_m));
        }
        match self {
            Self::FlatPunch { axis, .. } if !axis.is_normalized() => Err(LawError::Normal(axis.length())),
            _ => Ok(()),
        }
    }

    /// Radius, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        match *self {
            Self::Sphere { radius_m } | Self::FlatPunch { radius_m, .. } => radius_m,
        }
    }

    /// A point that is well inside the tool when the tool is at `center_m`, and outside of any body it touches.
    #[must_use]
    pub fn core_m(&self, center_m: DVec3) -> DVec3 {
        match *self {
            Self::Sphere { .. } => center_m,
            Self::FlatPunch { radius_m, axis } => center_m - radius_m * axis,
        }
    }
}

/// Barycentric weights of the point of a triangle nearest to `p`.
#[must_use]
pub fn nearest_weights(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let of = |x: DVec3| (ab.dot(p - x), ac.dot(p - x));
    weights_of_products(of(a), of(b), of(c))
}

/// Barycentric weights of the point of a triangle nearest to p: on a corner, an edge or the face, by the regions of
/// C. Ericson, Real-Time Collision Detection (2005), section 5.1.5, from the products of the edges AB and AC with the way to p from each
/// corner.
#[inline]
pub(crate) fn weights_of_products(
    (d1, d2): (f64, f64),
    (d3, d4): (f64, f64),
    (d5, d6): (f64, f64),
) -> [f64; 3] {
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
    }

    proptest! {
        #[test]
        fn no_point_of_a_triangle_is_nearer_than_the_nearest(
            p in vector(2.0), corners in prop::array::uniform3(vector(1.0)), other in prop::array::uniform3(0.01..1.0f64),
        ) {
            let weights = nearest_weights(p, corners);
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9 && weights.iter().all(|&w| w >= 0.0));
            let sum: f64 = other.iter().sum();
            let place = |weights: [f64; 3]| corners.iter().zip(weights).map(|(x, w)| *x * w).sum::<DVec3>();
            prop_assert!(place(weights).distance(p) <= place(other.map(|w| w / sum)).distance(p) + 1e-9);
        }
    }

    #[test]
    fn tools_that_make_no_sense_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(ToolShape::Sphere { radius_m: bad }.validate(), Err(LawError::Radius(_))));
        }
        let long = ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::Z * 2.0 };
        assert_eq!(long.validate(), Err(LawError::Normal(2.0)));
        assert!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::NAN }.validate().is_err());
        assert_eq!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::X }.validate(), Ok(()));
    }
}
