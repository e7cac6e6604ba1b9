//! A full body and the loop in lock step: the body is stepped at 20 Hz, and a loop at 1 kHz renders the force of its local models.

use glam::DVec3;
use palpate_body::{Body, Integrator, StepReport, ToolContact, ToolPoint};
use palpate_haptics::{VelocityEstimator, VelocityState};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use palpate_reduce::{BuildReport, LocalModelBuilder, ReduceError};
use std::time::Instant;

/// Length of a tick, s.
pub(crate) const TICK_S: f64 = 1e-3;
/// Ticks between two model steps: 20 Hz.
pub(crate) const PERIOD_TICKS: usize = 50;

/// A body, a tool and the loop that renders its force. The loop uses a local model from the tick after its model step.
pub(crate) struct MultirateRun<'a> {
    body: Body,
    contact: ToolContact,
    builder: &'a mut LocalModelBuilder,
    integrator: Integrator,
    hand_over: HandOver,
    model: LocalModel,
    velocity: VelocityState,
    /// Newest sample.
    newest: Sample,
}

/// A model step of [`PERIOD_TICKS`] ticks.
pub(crate) struct ModelStep {
    /// Force of the full body on the hand at each tick, N.
    pub(crate) body_n: Vec<DVec3>,
    /// Force of the loop on the hand at the same ticks, N.
    pub(crate) loop_n: Vec<DVec3>,
    /// Number of ticks whose contact solver did not converge.
    pub(crate) unconverged_ticks: usize,
    /// Report of the full body.
    pub(crate) report: StepReport,
    /// Time of the step of the full body, ms.
    pub(crate) step_ms: f64,
    /// Report of the local model that the loop used.
    pub(crate) built: BuildReport,
    /// Whether the tool touches, at the end of the step, nodes beyond the support set of that local model.
    pub(crate) is_beyond_support: bool,
}

impl<'a> MultirateRun<'a> {
    /// `body` with the tool of `contact`, whose hand is at rest at `start_m`. `builder` is the body's.
    ///
    /// # Errors
    /// [`ReduceError`] if the hand-over cannot be created.
    pub(crate) fn new(
        (body, contact): (Body, ToolContact),
        builder: &'a mut LocalModelBuilder,
        integrator: Integrator,
        start_m: DVec3,
    ) -> Result<Self, ReduceError> {
        let settings = HandOverSettings { capacity: builder.capacity(), ..HandOverSettings::default() };
        let mut hand_over = HandOver::new(settings)?;
        let mut velocity = VelocityState::default();
        let newest = sample(0, start_m, &mut velocity);
        hand_over.push(newest);
        let model = LocalModel::empty(builder.capacity());
        Ok(Self { body, contact, builder, integrator, hand_over, model, velocity, newest })
    }

    /// The full body.
    pub(crate) fn body(&self) -> &Body {
        &self.body
    }

    /// Number of ticks so far.
    pub(crate) fn tick(&self) -> usize {
        self.newest.sequence as usize
    }

    /// Ends the run, and returns the full body.
    pub(crate) fn into_body(self) -> Body {
        self.body
    }

    /// Builds a local model, and runs the loop and the full body over the next model step. The hand is at `position_m(tick)`, m.
    ///
    /// # Errors
    /// [`ReduceError`] if no local model can be built, or the body cannot be stepped.
    pub(crate) fn step(&mut self, position_m: impl Fn(usize) -> DVec3) -> Result<ModelStep, ReduceError> {
        let id = ModelId { body: 0, epoch: 0, sequence: self.newest.sequence };
        let at = tool_point(&self.newest);
        let scheme = Scheme::NearFieldExact;
        let built = self.builder.build(scheme, &self.body, &self.contact, at, id, &mut self.model)?;
        let (mut is_waiting, mut unconverged_ticks) = (true, 0);
        let (mut path, mut loop_n) = (vec![at], Vec::with_capacity(PERIOD_TICKS));
        for tick in self.tick() + 1..=self.tick() + PERIOD_TICKS {
            self.newest = sample(tick, position_m(tick), &mut self.velocity);
            path.push(tool_point(&self.newest));
            self.hand_over.push(self.newest);
            if is_waiting && self.hand_over.is_ready() {
                match self.hand_over.submit(&self.model) {
                    SubmitResult::Accepted => is_waiting = false,
                    SubmitResult::Busy => {}
                    SubmitResult::Rejected(error) => return Err(error.into()),
                }
            }
            let rendered = self.hand_over.render();
            unconverged_ticks += usize::from(rendered.unconverged);
            loop_n.push(rendered.force_n);
        }
        let mut body_n = Vec::with_capacity(PERIOD_TICKS);
        let observe = |_: usize, force_n: DVec3| body_n.push(force_n);
        let start = now();
        let tool = Some((&mut self.contact, &path[..]));
        let report = self.body.advance_observed(tool, PERIOD_TICKS, self.integrator, observe)?;
        let step_ms = ms_since(start);
        let support = self.builder.support();
        let is_beyond_support = self.contact.touched_nodes().iter().any(|node| !support.contains(node));
        Ok(ModelStep { body_n, loop_n, unconverged_ticks, report, step_ms, built, is_beyond_support })
    }
}

fn sample(tick: usize, position_m: DVec3, velocity: &mut VelocityState) -> Sample {
    Sample {
        sequence: tick as u64,
        time_s: TICK_S * tick as f64,
        position_m,
        velocity_m_per_s: velocity.step(VelocityEstimator::default(), position_m, None, TICK_S),
        ..Sample::default()
    }
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}

/// Time of a measurement that is reported.
#[expect(clippy::disallowed_methods, reason = "the time is reported and affects no result")]
pub(crate) fn now() -> Instant {
    Instant::now()
}

/// Time since `start`, ms.
pub(crate) fn ms_since(start: Instant) -> f64 {
    1e3 * (now() - start).as_secs_f64()
}
