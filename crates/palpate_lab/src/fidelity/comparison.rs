//! Every scheme and the full body at 1 kHz on the same movement.

use crate::error::LabError;
use glam::DVec3;
use palpate_body::{Body, ToolContact};
use palpate_haptics::{VelocityEstimator, VelocityState};
use palpate_local::{Sample, Scheme};
use palpate_reduce::{Comparison, ComparisonOptions, relative_rms_error};

/// First sample that counts: before the first model step there is no local model.
pub(super) const FROM: usize = 200;

/// Samples of a movement.
pub(super) struct Samples {
    /// Samples at the exact positions, for the oracle.
    pub(super) exact: Vec<Sample>,
    /// Samples at the measured positions, for the schemes.
    pub(super) measured: Vec<Sample>,
}

/// Forces of the oracle and of the schemes, N, one for each sample.
pub(super) struct Run {
    pub(super) oracle_n: Vec<DVec3>,
    pub(super) displayed_n: Vec<(Scheme, Vec<DVec3>)>,
}

impl Run {
    /// Runs the oracle along the exact samples and `schemes` along the measured ones.
    pub(super) fn new(
        (body, contact): (&Body, &ToolContact),
        samples: &Samples,
        schemes: &[Scheme],
        options: &ComparisonOptions,
    ) -> Result<Self, LabError> {
        let Samples { exact, measured } = samples;
        let comparison = Comparison::run(body, contact, measured, schemes, options)?;
        let oracle_n = if exact == measured {
            comparison.oracle_n
        } else {
            Comparison::run(body, contact, exact, &[], options)?.oracle_n
        };
        Ok(Self { oracle_n, displayed_n: comparison.displayed_n })
    }

    /// Relative RMS error of `displayed` from sample `from` on; `None` where the oracle has no force.
    pub(super) fn relative_rms_error(&self, displayed: &[DVec3], from: usize) -> Option<f64> {
        relative_rms_error(displayed.get(from..)?, self.oracle_n.get(from..)?)
    }
}

/// Samples at `start` plus `offsets`, one each millisecond.
pub(super) fn samples(offsets: &[DVec3], start: DVec3, estimator: VelocityEstimator) -> Vec<Sample> {
    let mut state = VelocityState::default();
    let sample = |(i, offset): (usize, &DVec3)| Sample {
        sequence: i as u64,
        time_s: i as f64 * 1e-3,
        position_m: start + *offset,
        velocity_m_per_s: state.step(estimator, start + *offset, None, 1e-3),
        ..Sample::default()
    };
    offsets.iter().enumerate().map(sample).collect()
}
