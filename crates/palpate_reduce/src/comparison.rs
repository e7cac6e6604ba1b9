//! Comparison of schemes with the full body on the same samples.

use crate::{BuilderOptions, LocalModelBuilder, ReduceError};
use glam::DVec3;
use palpate_body::{Body, Integrator, ToolContact, ToolPoint};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use std::collections::VecDeque;

/// Options of a comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonOptions {
    /// Number of ticks between two model steps, 1 to 100000.
    pub period_ticks: usize,
    /// Delay of a local model from its model step to the loop, in ticks, at most 100000.
    pub delay_ticks: usize,
    /// Maximum number of samples replayed in one tick: see [`HandOverSettings::replay_per_tick`].
    pub replay_per_tick: usize,
    /// Integrator of the full body. A step must take one tick.
    pub integrator: Integrator,
    /// Options of the local models.
    pub builder: BuilderOptions,
}

impl Default for ComparisonOptions {
    /// Model steps at 20 Hz for a tick of 1 ms, no delay, and 8 samples replayed a tick.
    fn default() -> Self {
        Self {
            period_ticks: 50,
            delay_ticks: 0,
            replay_per_tick: HandOverSettings::default().replay_per_tick,
            integrator: Integrator::default(),
            builder: BuilderOptions::default(),
        }
    }
}

/// The force of the oracle and the force that each scheme displays, tick by tick.
///
/// The oracle is the full body, stepped every tick with the same samples. The path of the tool is prescribed, so the local models are
/// built from the same run of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Force of the oracle at every sample, N.
    pub oracle_n: Vec<DVec3>,
    /// Force displayed by each scheme at every sample, before the safety chain, N.
    pub displayed_n: Vec<(Scheme, Vec<DVec3>)>,
    /// Maximum absolute force of the oracle along x, y and z, N.
    pub oracle_peak_n: DVec3,
    /// Number of local models with the clamped tangent, by scheme.
    pub clamped: Vec<(Scheme, usize)>,
}

/// A scheme with its hand-over.
struct Runner {
    scheme: Scheme,
    hand_over: HandOver,
    /// Delayed models with the tick at which they arrive.
    pending: VecDeque<(usize, LocalModel)>,
    displayed: Vec<DVec3>,
    clamped: usize,
}

impl Comparison {
    /// Runs `body` from its current state along `samples`, one a tick, with the tool in `contact`, and all `schemes` with it. The first
    /// sample is the start of the tool.
    ///
    /// # Errors
    /// [`ReduceError::Option`] for an option out of range, [`ReduceError::Samples`] for samples that are not consecutive,
    /// [`ReduceError::Body`] and [`ReduceError::LocalModel`] when the body or a local model fails.
    pub fn run(
        body: &Body,
        contact: &ToolContact,
        samples: &[Sample],
        schemes: &[Scheme],
        options: &ComparisonOptions,
    ) -> Result<Self, ReduceError> {
        validate(samples, options)?;
        let mut body = body.clone();
        let mut contact = contact.clone();
        let mut builder = LocalModelBuilder::new(&body, options.builder)?;
        let settings = HandOverSettings {
            tick_s: options.integrator.tick_s(),
            capacity: builder.capacity(),
            replay_per_tick: options.replay_per_tick,
            history: options.period_ticks + options.delay_ticks + HandOverSettings::default().history,
            ..HandOverSettings::default()
        };
        let mut runners = Vec::with_capacity(schemes.len());
        for &scheme in schemes {
            let (pending, displayed) = (VecDeque::new(), Vec::with_capacity(samples.len()));
            runners.push(Runner {
                scheme,
                hand_over: HandOver::new(settings)?,
                pending,
                displayed,
                clamped: 0,
            });
        }
        let path: Vec<ToolPoint> = samples.iter().map(tool_point).collect();
        let mut oracle = vec![DVec3::ZERO; samples.len()];
        if let Some(first) = oracle.first_mut() {
            contact.validate(&body)?;
            *first = contact.displayed_force_n(&body);
        }
        let mut stepped = 0;
        for (i, sample) in samples.iter().enumerate() {
            let due = i > 0 && i % options.period_ticks == 0;
            if due || i + 1 == samples.len() {
                let forces = &mut oracle[stepped..=i];
                let along = Some((&mut contact, &path[stepped..=i]));
                body.advance_observed(along, i - stepped, options.integrator, |tick, f| {
                    forces[tick] = f;
                })?;
                stepped = i;
            }
            for runner in &mut runners {
                if due {
                    let mut model = LocalModel::empty(builder.capacity());
                    let id = ModelId { body: 0, epoch: 0, sequence: sample.sequence };
                    builder.build(runner.scheme, &body, &contact, path[i], id, &mut model)?;
                    runner.clamped += usize::from(model.clamped);
                    runner.pending.push_back((i + options.delay_ticks, model));
                }
                runner.tick(i, *sample)?;
            }
        }
        let oracle_peak_n = oracle.iter().fold(DVec3::ZERO, |peak, f| peak.max(f.abs()));
        let clamped = runners.iter().map(|r| (r.scheme, r.clamped)).collect();
        let displayed_n = runners.into_iter().map(|r| (r.scheme, r.displayed)).collect();
        Ok(Self { oracle_n: oracle, displayed_n, oracle_peak_n, clamped })
    }

    /// Force displayed by `scheme` at every sample, N; `None` if the scheme was not run.
    #[must_use]
    pub fn displayed(&self, scheme: Scheme) -> Option<&[DVec3]> {
        self.displayed_n.iter().find(|(s, _)| *s == scheme).map(|(_, forces)| forces.as_slice())
    }

    /// Relative RMS error of `scheme` over the samples from index `from`: see [`relative_rms_error`]. `None` if the scheme was not run, there
    /// is no sample from `from`, or the force of the oracle is zero throughout.
    #[must_use]
    pub fn relative_rms_error(&self, scheme: Scheme, from: usize) -> Option<f64> {
        relative_rms_error(self.displayed(scheme)?.get(from..)?, self.oracle_n.get(from..)?)
    }
}

/// RMS of `displayed` − `oracle` divided by the RMS of `oracle`, over all components; `None` when the latter is zero.
#[must_use]
pub fn relative_rms_error(displayed: &[DVec3], oracle: &[DVec3]) -> Option<f64> {
    let error: f64 = displayed.iter().zip(oracle).map(|(d, o)| (*d - *o).length_squared()).sum();
    let reference: f64 = oracle.iter().map(|o| o.length_squared()).sum();
    (reference > 0.0).then(|| (error / reference).sqrt())
}

impl Runner {
    fn tick(&mut self, i: usize, sample: Sample) -> Result<(), ReduceError> {
        self.hand_over.push(sample);
        if self.hand_over.is_ready() {
            // Only the newest model that has arrived is submitted, as in the loop's triple buffer.
            let arrived = self.pending.iter().take_while(|(at, _)| *at <= i).count();
            if let Some((_, model)) = self.pending.drain(..arrived).next_back()
                && let SubmitResult::Rejected(error) = self.hand_over.submit(&model)
            {
                return Err(error.into());
            }
        }
        self.displayed.push(self.hand_over.render().force_n);
        Ok(())
    }
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}

fn validate(samples: &[Sample], options: &ComparisonOptions) -> Result<(), ReduceError> {
    let ComparisonOptions { period_ticks, delay_ticks, integrator, builder, .. } = *options;
    let spanned = integrator.ticks_per_step();
    let step = builder.tick_s / integrator.tick_s();
    for (what, value, ok, allowed) in [
        (
            "ticks between two model steps",
            period_ticks as f64,
            (1..=100_000).contains(&period_ticks),
            "1 to 100000",
        ),
        ("ticks of delay", delay_ticks as f64, delay_ticks <= 100_000, "at most 100000"),
        ("ticks that a step of the integrator spans", spanned as f64, spanned == 1, "1"),
        ("the builder's tick as a multiple of the integrator's", step, (step - 1.0).abs() < 1e-9, "1"),
    ] {
        if !ok {
            return Err(ReduceError::Option { what, value, allowed });
        }
    }
    for (index, pair) in samples.windows(2).enumerate() {
        let (expected, found) = (pair[0].sequence.saturating_add(1), pair[1].sequence);
        if found != expected {
            return Err(ReduceError::Samples { index: index + 1, found, expected });
        }
    }
    Ok(())
}
