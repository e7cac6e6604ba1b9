//! Points of a body that may touch an obstacle within the next steps.

/// Pairs of points and obstacles that may touch until points and obstacles have moved by a certain distance.
///
/// The pairs contain every pair that touches, so results do not depend on when they are searched.
#[derive(Clone, Debug)]
pub(super) struct ObstacleCandidates {
    /// Indices of the point and of the obstacle, ascending.
    pub(super) pairs: Vec<(usize, usize)>,
    /// Lower bound of the gap of every other pair at the time of the search, m.
    pub(super) safe_m: f64,
    /// Upper bound of the approach of any pair since the search, m, without the current step.
    pub(super) travelled_m: f64,
    /// Upper bound of the approach in the current step, m.
    pub(super) step_m: f64,
}

impl Default for ObstacleCandidates {
    fn default() -> Self {
        Self { pairs: Vec::new(), safe_m: f64::NEG_INFINITY, travelled_m: 0.0, step_m: 0.0 }
    }
}

impl ObstacleCandidates {
    /// Whether the pairs are complete for a step in which a pair approaches by at most `step_m`.
    pub(super) fn covers(&self, step_m: f64) -> bool {
        self.travelled_m + step_m <= self.safe_m
    }

    /// Ends the current step.
    pub(super) fn end_step(&mut self) {
        self.travelled_m += self.step_m;
    }

    /// Forgets all pairs.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}
