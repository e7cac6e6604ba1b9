//! Every scheme against the oracle on the same samples.

use crate::{BuilderOptions, LocalModelBuilder, ReduceError};
use glam::DVec3;
use palpate_body::{Body, Integrator, ToolContact, ToolPoint};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use std::collections::VecDeque;

/// How a comparison is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonOptions {
    /// Ticks between two model steps.
    pub period_ticks: usize,
    /// Ticks that a local model takes from its model step to the loop.
    pub delay_ticks: usize,
    /// Samples replayed at a hand-over in one tick, at most.
    pub replay_per_tick: usize,
    /// Integrator of the full body, for the model steps and the oracle.
    pub integrator: Integrator,
    /// How local models are built.
    pub builder: BuilderOptions,
}

impl Default for ComparisonOptions {
    /// Model steps at 20 Hz, no delay, 8 samples replayed a tick.
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

/// The oracle's force and what each scheme displayed, tick by tick.
///
/// The oracle is the full body stepped at every tick with the same samples. Because the tool's path is given,
/// it is the same run of the body from which the local models are built.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Force of the oracle at every sample, N.
    pub oracle_n: Vec<DVec3>,
    /// Force displayed by each scheme at every sample, before any safety chain, N.
    pub displayed_n: Vec<(Scheme, Vec<DVec3>)>,
    /// Largest absolute force of the oracle along x, y and z, N.
    pub oracle_peak_n: DVec3,
    /// How many local models needed the clamped tangent, by scheme.
    pub clamped: Vec<(Scheme, usize)>,
}

struct Runner {
    scheme: Scheme,
    hand_over: HandOver,
    /// Models on their way: the tick at which they arrive.
    pending: VecDeque<(usize, LocalModel)>,
    displayed: Vec<DVec3>,
    clamped: usize,
}

impl Comparison {
    /// Runs `body` from its present state with a tool in `contact` along `samples` (the first is where the tool
    /// starts; the others follow at one a tick), and every scheme of `schemes` beside it.
    ///
    /// # Errors
    /// [`ReduceError`] when an option makes no sense, the samples have holes, or the body fails.
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

    /// What `scheme` displayed; `None` if it was not run.
    #[must_use]
    pub fn displayed(&self, scheme: Scheme) -> Option<&[DVec3]> {
        self.displayed_n.iter().find(|(s, _)| *s == scheme).map(|(_, forces)| forces.as_slice())
    }

    /// RMS over the samples from index `from` on, and all three components, of the scheme's force minus the
    /// oracle's, divided by the RMS of the oracle. `None` when the scheme was not run, nothing is left after
    /// `from`, or the oracle's force is zero throughout.
    #[must_use]
    pub fn relative_rms_error(&self, scheme: Scheme, from: usize) -> Option<f64> {
        relative_rms_error(self.displayed(scheme)?.get(from..)?, self.oracle_n.get(from..)?)
    }
}

/// RMS of `displayed` − `oracle` over RMS of `oracle`, all components; `None` when the latter is zero.
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
            // The newest that has arrived counts, as in the loop's triple buffer.
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
        (
            "ticks that a step of the integrator spans",
            spanned as f64,
            spanned == 1,
            "1: the oracle speaks at every tick",
        ),
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
