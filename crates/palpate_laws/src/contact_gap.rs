//! The gap between a tool and a contact patch in a step.

use crate::smooth_step::smooth_step;
use crate::{MAX_CORRECTION_SPEED_M_PER_S, SeriesCompliance};
use glam::DVec3;

/// Free weight (weight on nodes that can move) from which a row with a series compliance has its full force, and
/// below which it has none.
const FULL_FREE_SHARE: f64 = 0.1;
const ZERO_FREE_SHARE: f64 = 0.01;
/// Minimum free weight of a row without a series compliance. A row with less would have to move its nodes too far.
/// The second value applies to rows that are already in contact and prevents chattering near fixed nodes.
const MIN_FREE_SHARE: f64 = 0.3;
const MIN_FREE_SHARE_TOUCHED: f64 = 0.1;

/// Fraction of its force that a row with a series compliance transmits. `free_share` is its weight on nodes that can
/// move. The result rises smoothly from 0 for a fixed row to 1.
#[must_use]
pub fn mobility(free_share: f64) -> f64 {
    smooth_step(free_share, ZERO_FREE_SHARE, FULL_FREE_SHARE)
}

/// Whether a row without a series compliance has too little weight on nodes that can move, `free_share`, to transmit
/// force. The threshold is lower for a row that is already in contact (`is_touched`).
#[must_use]
pub fn is_out_of_reach(free_share: f64, is_touched: bool) -> bool {
    free_share < if is_touched { MIN_FREE_SHARE_TOUCHED } else { MIN_FREE_SHARE }
}

/// Speed at which a series compliance takes up existing penetration, m/s. A tool that starts inside the surface
/// reaches its force within some hundredths of a second, without an impact.
const UPTAKE_SPEED_M_PER_S: f64 = 0.2;

/// Deflection of the series compliance of a row in the previous step; zero without one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeriesDeflection {
    /// Deflection along the normal, m.
    pub along_m: f64,
    /// Deflection across the normal, m.
    pub across_m: DVec3,
    /// Compliance across the normal, m/N.
    pub across_m_per_n: f64,
    /// Fraction of an existing gap that the compliance takes up; see [`SeriesCompliance::gap_uptake`].
    pub takes_up: f64,
}

impl SeriesDeflection {
    /// Deflection of `series` under a normal force of `force_n` and a total force of `whole_n`, N.
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

/// Gap between a tool and a patch in a step, for a row of [`crate::solve_projected_gauss_seidel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactGap {
    /// Gap along the normal, limited to the part that this step may close, m.
    pub normal_m: f64,
    /// Gap vector, including the tangential motion of the tool, m.
    pub gap_m: DVec3,
    /// Part of the gap that existed before the step, m. The position update closes it, and it leaves no velocity
    /// behind.
    pub initial_violation_m: DVec3,
}

impl ContactGap {
    /// Gap in a step of length `h`, s. The tool moves by `moved_m` and ends `apart_m` away from the resting surface,
    /// measured along the inward unit normal `push`.
    ///
    /// A series compliance takes up part of an existing penetration as if the tool approached at a low speed. The
    /// position update closes the rest at [`MAX_CORRECTION_SPEED_M_PER_S`]. The tool's own motion takes full effect
    /// at once.
    #[must_use]
    pub fn new(apart_m: f64, push: DVec3, moved_m: DVec3, series: SeriesDeflection, h: f64) -> Self {
        let before = apart_m + moved_m.dot(push) + series.along_m;
        let left = before.clamp(-h * MAX_CORRECTION_SPEED_M_PER_S, 0.0);
        let taken = before.clamp(-h * UPTAKE_SPEED_M_PER_S * series.takes_up, 0.0);
        let normal_m = if before < 0.0 { left + apart_m - before } else { apart_m };
        let gap_m = normal_m * push - (moved_m + series.across_m).reject_from_normalized(push);
        Self { normal_m, gap_m, initial_violation_m: (left - taken) * push }
    }
}
