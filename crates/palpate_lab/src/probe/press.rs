//! One press: the hand comes down, stops and holds until the body has settled; the force of the full body and of the loop.

use super::options::{IntegratorKind, Place};
use super::scene::Scene;
use crate::multirate::{MultirateRun, PERIOD_TICKS, TICK_S};
use glam::DVec3;
use palpate_body::{Integrator, LinearlyImplicitEuler, SemiImplicitEuler};
use palpate_reduce::{BuilderOptions, LocalIntegrator, LocalModelBuilder, ReduceError};

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
        let options = BuilderOptions { integrator: local, ..BuilderOptions::of(&scene.body) };
        let mut builder = LocalModelBuilder::new(&scene.body, options)?;
        let unturn = scene.turn.conjugate();
        let position_m = |tick: usize| scene.turn * (touching_m - motion.depth_at_m(tick) * DVec3::Y);
        let under_tool = (scene.body.clone(), scene.contact.clone());
        let mut run = MultirateRun::new(under_tool, &mut builder, integrator, position_m(0))?;
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
        while run.tick() < arrival || (!press.is_settled && run.tick() < arrival + hold) {
            press
                .depth_m
                .extend((run.tick() + 1..=run.tick() + PERIOD_TICKS).map(|tick| motion.depth_at_m(tick)));
            let step = run.step(position_m)?;
            press.body_n.extend(step.body_n.into_iter().map(|force_n| unturn * force_n));
            press.loop_n.extend(step.loop_n.into_iter().map(|force_n| unturn * force_n));
            press.unconverged_ticks += step.unconverged_ticks;
            press.unconverged_steps += step.report.unconverged;
            press.inverted_cells = press.inverted_cells.max(step.report.inverted_cells);
            press.step_ms.push(step.step_ms);
            press.build_ms_max = press.build_ms_max.max(1e3 * step.built.time_s);
            press.is_settled = run.tick() >= arrival + MIN_HOLD_TICKS && run.body().is_settled();
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

/// A press and its place.
pub(super) struct PressAt {
    pub(super) place: Place,
    pub(super) press: Press,
}
