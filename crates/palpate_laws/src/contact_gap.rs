//! The gap between a tool and a contact patch in a step.

use crate::smooth_step::smooth_step;
use crate::{MAX_CORRECTION_SPEED_M_PER_S, SeriesCompliance};
use glam::DVec3;

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
