//! One press: the hand comes down, stops and holds until the body has settled; the force of the full body and of the loop.

use super::options::{IntegratorKind, Place};
use super::scene::Scene;
use glam::DVec3;
use palpate_body::{Integrator, LinearlyImplicitEuler, SemiImplicitEuler, ToolPoint};
use palpate_haptics::{VelocityEstimator, VelocityState};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use palpate_reduce::{BuilderOptions, LocalIntegrator, LocalModelBuilder, ReduceError};
use std::time::Instant;

/// Length of a tick, s.
pub(super) const TICK_S: f64 = 1e-3;
/// Ticks between two model steps: 20 Hz.
const PERIOD_TICKS: usize = 50;
/// Ticks of rest before the hand moves: two model steps. The loop then has a local model, and the hand moves right after a
/// model step.
const REST_TICKS: usize = 2 * PERIOD_TICKS;
/// Minimum number of ticks down to the surface.
const APPROACH_TICKS: usize = 10;
/// Minimum height of the start, m.
const MIN_APPROACH_M: f64 = 2e-3;
/// Minimum time at depth, ticks: under a very slow hand the body counts as settled before it is at rest.
const MIN_HOLD_TICKS: usize = 2 * PERIOD_TICKS;

/// Movement of the hand.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    pub(super) depth_m: f64,
    pub(super) speed_m_per_s: f64,
    /// Maximum time at depth, s.
    pub(super) hold_s: f64,
    pub(super) integrator: IntegratorKind,
}

/// A press, tick by tick and in numbers. Forces are in the frame of the unturned body, N.
pub(super) struct Press {
    /// Depth of the hand below the position of first touch, m; negative above.
    pub(super) depth_m: Vec<f64>,
    pub(super) body_n: Vec<DVec3>,
    pub(super) loop_n: Vec<DVec3>,
    /// Number of steps of the body, and of ticks of the loop, whose contact solver did not converge.
    pub(super) unconverged_steps: usize,
    pub(super) unconverged_ticks: usize,
    /// Maximum number of inverted cells after a model step: see [`palpate_body::StepReport::inverted_cells`].
    pub(super) inverted_cells: usize,
    /// Time of each model step of the body without its local model, ms.
    pub(super) step_ms: Vec<f64>,
    /// Maximum time of building a local model, ms.
    pub(super) build_ms_max: f64,
    /// Whether the body had come to rest at the end.
    pub(super) is_settled: bool,
}

impl Motion {
    /// Depth at sample `tick`, m.
    fn depth_at_m(&self, tick: usize) -> f64 {
        let moving_s = TICK_S * tick.saturating_sub(REST_TICKS) as f64;
        (self.speed_m_per_s * moving_s - self.approach_m()).min(self.depth_m)
    }

    /// Height of the start, m. The hand crosses the surface in the middle of a tick; rounding cannot change the tick.
    fn approach_m(&self) -> f64 {
        let in_tick_m = self.speed_m_per_s * TICK_S;
        ((MIN_APPROACH_M / in_tick_m).ceil().max(APPROACH_TICKS as f64) + 0.5) * in_tick_m
    }

    /// First sample at which the hand is at its depth.
    fn arrival_tick(&self) -> usize {
        REST_TICKS + ((self.approach_m() + self.depth_m) / (self.speed_m_per_s * TICK_S)).ceil() as usize
    }

    fn integrators(&self) -> (Integrator, LocalIntegrator) {
        match self.integrator {
            IntegratorKind::Explicit => (SemiImplicitEuler::default().into(), LocalIntegrator::Explicit),
            IntegratorKind::Implicit => {
                (LinearlyImplicitEuler::default().into(), LocalIntegrator::Implicit { substeps: 2 })
            }
            IntegratorKind::Auto => (SemiImplicitEuler::default().into(), LocalIntegrator::Auto),
        }
    }
}

impl Press {
    /// Presses at the place where the tool first touches at `touching_m` (unturned frame). The loop runs in lock step and uses a
    /// local model from the tick after its model step.
    pub(super) fn run(scene: &Scene, touching_m: DVec3, motion: &Motion) -> Result<Self, ReduceError> {
        let (integrator, local) = motion.integrators();
        let (mut body, mut contact) = (scene.body.clone(), scene.contact.clone());
        let options = BuilderOptions { integrator: local, ..BuilderOptions::of(&body) };
        let mut builder = LocalModelBuilder::new(&body, options)?;
        let settings = HandOverSettings { capacity: builder.capacity(), ..HandOverSettings::default() };
        let mut hand_over = HandOver::new(settings)?;
        let mut model = LocalModel::empty(builder.capacity());
        let mut velocity = VelocityState::default();
        let unturn = scene.turn.conjugate();
        let mut sample_at = |tick: usize| {
            let position_m = scene.turn * (touching_m - motion.depth_at_m(tick) * DVec3::Y);
            Sample {
                sequence: tick as u64,
                time_s: TICK_S * tick as f64,
                position_m,
                velocity_m_per_s: velocity.step(VelocityEstimator::default(), position_m, None, TICK_S),
                ..Sample::default()
            }
        };
        let mut newest = sample_at(0);
        hand_over.push(newest);
        let mut press = Self {
            depth_m: vec![motion.depth_at_m(0)],
            body_n: vec![DVec3::ZERO],
            loop_n: vec![DVec3::ZERO],
            unconverged_steps: 0,
            unconverged_ticks: 0,
            inverted_cells: 0,
            step_ms: Vec::new(),
            build_ms_max: 0.0,
            is_settled: false,
        };
        let (arrival, hold) = (motion.arrival_tick(), (motion.hold_s / TICK_S).ceil() as usize);
        let mut tick = 0;
        while tick < arrival || (!press.is_settled && tick < arrival + hold) {
            let id = ModelId { body: 0, epoch: 0, sequence: newest.sequence };
            let built = builder.build(
                Scheme::NearFieldExact,
                &body,
                &contact,
                tool_point(&newest),
                id,
                &mut model,
            )?;
            press.build_ms_max = press.build_ms_max.max(1e3 * built.time_s);
            let mut is_waiting = true;
            let mut path = vec![tool_point(&newest)];
            for _ in 0..PERIOD_TICKS {
                tick += 1;
                newest = sample_at(tick);
                path.push(tool_point(&newest));
                hand_over.push(newest);
                if is_waiting && hand_over.is_ready() {
                    match hand_over.submit(&model) {
                        SubmitResult::Accepted => is_waiting = false,
                        SubmitResult::Busy => {}
                        SubmitResult::Rejected(error) => return Err(error.into()),
                    }
                }
                let rendered = hand_over.render();
                press.unconverged_ticks += usize::from(rendered.unconverged);
                press.loop_n.push(unturn * rendered.force_n);
                press.depth_m.push(motion.depth_at_m(tick));
            }
            let observe = |_: usize, force_n: DVec3| press.body_n.push(unturn * force_n);
            #[expect(
                clippy::disallowed_methods,
                reason = "the time of a step is reported and affects no result"
            )]
            let now = || Instant::now();
            let start = now();
            let report =
                body.advance_observed(Some((&mut contact, &path)), PERIOD_TICKS, integrator, observe)?;
            press.step_ms.push(1e3 * (now() - start).as_secs_f64());
            press.unconverged_steps += report.unconverged;
            press.inverted_cells = press.inverted_cells.max(report.inverted_cells);
            press.is_settled = tick >= arrival + MIN_HOLD_TICKS && body.is_settled();
        }
        Ok(press)
    }

    /// Force at the last tick: of the body and of the loop.
    pub(super) fn end_n(&self) -> [DVec3; 2] {
        [&self.body_n, &self.loop_n].map(|forces| forces.last().copied().unwrap_or_default())
    }

    /// First tick in which the tool overlaps the undeformed surface.
    pub(super) fn crossing_tick(&self) -> Option<usize> {
        self.depth_m.iter().position(|depth_m| *depth_m > 0.0)
    }

    /// First tick with a force: of the body and of the loop.
    pub(super) fn first_force_ticks(&self) -> [Option<usize>; 2] {
        [&self.body_n, &self.loop_n].map(|forces| forces.iter().position(|f| *f != DVec3::ZERO))
    }
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}

/// A press and its place.
pub(super) struct PressAt {
    pub(super) place: Place,
    pub(super) press: Press,
}
