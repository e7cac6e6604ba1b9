//! Forces of the last seconds, and errors of the schemes against the full body.

use crate::tool::ForceError;
use glam::DVec3;
use palpate_local::Scheme;
use std::collections::VecDeque;

/// Maximum number of ticks in a history.
pub(super) const MAX_TICKS: usize = 20_000;

/// Maximum number of missing ticks in a curve that is drawn without a break.
pub(super) const MAX_GAP: u64 = 60;

/// Forces by the sequence number of their sample, ascending.
#[derive(Clone, Debug, Default)]
pub(super) struct Curve {
    points: VecDeque<(u64, DVec3)>,
}

/// The drawn component of a force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ForceComponent {
    #[default]
    Length,
    X,
    Y,
    Z,
}

impl ForceComponent {
    pub(super) const ALL: [(Self, &str); 4] =
        [(Self::Length, "length"), (Self::X, "x"), (Self::Y, "y"), (Self::Z, "z")];

    fn of(self, force_n: DVec3) -> f64 {
        match self {
            Self::Length => force_n.length(),
            Self::X => force_n.x,
            Self::Y => force_n.y,
            Self::Z => force_n.z,
        }
    }
}

impl Curve {
    /// Adds the newest force; one that is not newer than the last restarts the curve.
    pub(super) fn push(&mut self, sequence: u64, force_n: DVec3) {
        if self.newest().is_some_and(|newest| sequence <= newest) {
            self.points.clear();
        }
        if self.points.len() == MAX_TICKS {
            self.points.pop_front();
        }
        self.points.push_back((sequence, force_n));
    }

    pub(super) fn clear(&mut self) {
        self.points.clear();
    }

    pub(super) fn newest(&self) -> Option<u64> {
        self.points.back().map(|(sequence, _)| *sequence)
    }

    /// The points after `sequence`, oldest first.
    fn after(&self, sequence: u64) -> impl Iterator<Item = &(u64, DVec3)> {
        self.points.range(self.points.partition_point(|(s, _)| *s <= sequence)..)
    }

    /// Emits the minimum and the maximum of every `stride` ticks after `from` in order of time, as (sequence, force), which preserves peaks
    /// of one tick. Emits a NaN where more than [`MAX_GAP`] ticks are missing.
    pub(super) fn decimate(
        &self,
        along: ForceComponent,
        from: u64,
        stride: u64,
        mut emit: impl FnMut(u64, f64),
    ) {
        let mut bucket: Option<(u64, [(u64, f64); 2])> = None;
        let mut emit_extremes = |[low, high]: [(u64, f64); 2]| {
            let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            emit(first.0, first.1);
            if second.0 != first.0 {
                emit(second.0, second.1);
            }
        };
        let mut last = None;
        for &(sequence, force_n) in self.after(from) {
            if last.replace(sequence).is_some_and(|last| sequence - last > MAX_GAP) {
                bucket.take().into_iter().for_each(|(_, extremes)| emit_extremes(extremes));
                emit_extremes([(sequence - 1, f64::NAN); 2]);
            }
            let (index, point) = (sequence / stride.max(1), (sequence, along.of(force_n)));
            match &mut bucket {
                Some((at, [low, high])) if *at == index => {
                    if point.1 < low.1 {
                        *low = point;
                    }
                    if point.1 > high.1 {
                        *high = point;
                    }
                }
                other => {
                    if let Some((_, extremes)) = other.replace((index, [point; 2])) {
                        emit_extremes(extremes);
                    }
                }
            }
        }
        if let Some((_, extremes)) = bucket {
            emit_extremes(extremes);
        }
    }

    /// Error against `full` at the common ticks after `from`.
    pub(super) fn error_against(&self, full: &Self, from: u64) -> ForceError {
        let mut reference = full.after(from).peekable();
        let pairs = self.after(from).filter_map(|&(sequence, rendered)| {
            while reference.next_if(|(s, _)| *s < sequence).is_some() {}
            reference.next_if(|(s, _)| *s == sequence).map(|(_, full)| (rendered, *full))
        });
        ForceError::of(pairs)
    }
}

/// Values by sequence number, one for every model step.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    pub(super) points: VecDeque<(u64, f64)>,
}

impl Trace {
    /// Adds the newest value; one that is not newer than the last restarts the trace.
    pub(super) fn push(&mut self, sequence: u64, value: f64) {
        if self.points.back().is_some_and(|(newest, _)| sequence <= *newest) {
            self.points.clear();
        }
        if self.points.len() == MAX_TICKS / 10 {
            self.points.pop_front();
        }
        self.points.push_back((sequence, value));
    }
}

/// Index of `scheme` in [`Scheme::ALL`].
pub(super) fn index_of(scheme: Scheme) -> usize {
    Scheme::ALL.iter().position(|other| *other == scheme).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(points: impl IntoIterator<Item = (u64, f64)>) -> Curve {
        let mut curve = Curve::default();
        points.into_iter().for_each(|(sequence, y)| curve.push(sequence, DVec3::Y * y));
        curve
    }

    fn decimated(curve: &Curve, from: u64, stride: u64) -> Vec<(u64, f64)> {
        let mut points = Vec::new();
        curve.decimate(ForceComponent::Y, from, stride, |sequence, y| points.push((sequence, y)));
        points
    }

    #[test]
    fn decimation_preserves_a_peak_of_one_tick_for_every_stride() {
        let spike = curve((1..=1000).map(|s| (s, if s == 537 { 9.0 } else { 0.001 * s as f64 })));
        for stride in [1, 7, 10, 50, 1000] {
            let points = decimated(&spike, 0, stride);
            assert!(points.contains(&(537, 9.0)), "{stride}");
            assert!(points.len() as u64 <= 2 * (1000 / stride + 1));
            assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0), "{stride}");
        }
        assert_eq!(decimated(&spike, 997, 1), [(998, 0.998), (999, 0.999), (1000, 1.0)]);
    }

    #[test]
    fn gap_breaks_the_curve() {
        let broken = curve((1..=10).chain(200..=210).map(|s| (s, 1.0)));
        let points = decimated(&broken, 0, 5);
        let breaks: Vec<usize> = (0..points.len()).filter(|&i| points[i].1.is_nan()).collect();
        assert_eq!(breaks.len(), 1);
        assert!(points[breaks[0] - 1].0 <= 10 && points[breaks[0] + 1].0 >= 200, "{points:?}");
    }

    #[test]
    fn error_is_that_of_the_common_ticks() {
        let full = curve((10..20).map(|s| (s, 2.0)));
        let scheme = curve([(8, 5.0), (11, 2.2), (12, 1.8), (25, 7.0)]);
        let error = scheme.error_against(&full, 0);
        assert_eq!(error.ticks, 2);
        assert!((error.relative.unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(scheme.error_against(&full, 11).ticks, 1);
        assert_eq!(scheme.error_against(&full, 12).ticks, 0);
    }

    #[test]
    fn restarted_samples_restart_the_curve_and_its_length_is_bounded() {
        let mut restarted = curve((100..200).map(|s| (s, 1.0)));
        restarted.push(3, DVec3::Y);
        assert_eq!(decimated(&restarted, 0, 1), [(3, 1.0)]);
        let long = curve((0..3 * MAX_TICKS as u64).map(|s| (s, 0.0)));
        assert_eq!(long.points.len(), MAX_TICKS);
    }
}
