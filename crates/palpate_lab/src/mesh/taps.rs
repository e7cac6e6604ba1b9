//! The taps of `palpate-lab mesh`: the force on the hand, and its difference from the force of the full body.

use super::built::BuiltMesh;
use super::places::places;
use crate::app_tool::FRICTION;
use crate::error::LabError;
use crate::multirate::{ModelStep, MultirateRun, PERIOD_TICKS, TICK_S};
use crate::progress;
use crate::top::Top;
use glam::DVec3;
use palpate_body::{Body, BodyError, Integrator, SemiImplicitEuler, ToolContact, ToolShape, VirtualCoupling};
use palpate_reduce::{ReduceError, relative_rms_error};
use std::f64::consts::PI;

/// Duration of a tap, s.
const TAP_S: f64 = 1.5;
/// Model steps of a tap.
const TAP_STEPS: usize = 30;
/// Number of taps of a place.
const REPEATS: usize = 2;
/// Speed of the nodes below which the body is at rest for the next tap, m/s, and maximum number of model steps until it is.
const REST_M_PER_S: f64 = 2e-6;
const MAX_WAITING_STEPS: usize = 1000;
/// RMS of the full body's force in a model step, relative to its maximum in the tap, below which its relative error does not count: the step
/// in which the last tick touches, with a force that no device displays.
const LEAST_FORCE: f64 = 0.01;

/// All taps.
#[derive(Default)]
pub(super) struct Taps {
    pub(super) places: Vec<TappedPlace>,
    /// Error of the loop in each model step with a force of the full body of at least [`LEAST_FORCE`]: the RMS of the difference over the RMS
    /// of that force.
    pub(super) errors: Vec<f64>,
    /// Maximum of these errors over the first such step of each tap.
    pub(super) first_touch: Option<f64>,
    /// Maximum difference of the loop's force from that of the full body in any tick, N.
    pub(super) max_difference_n: f64,
    /// Number of model steps in which the tool touched nodes beyond the support set of its local model.
    pub(super) beyond_support: usize,
}

/// A place that was tapped.
pub(super) struct TappedPlace {
    /// Undeformed surface there, m.
    pub(super) place_m: DVec3,
    /// Maximum force on the hand in each tap, N.
    pub(super) peaks_n: [f64; REPEATS],
}

/// The hand over a place, and its tool.
struct Hand {
    place_m: DVec3,
    radius_m: f64,
    /// Smallest side of the body, m.
    side_m: f64,
    coupling: VirtualCoupling,
}

impl Hand {
    /// Position of the hand at `tick`: from 0.15 of the side above the surface down to 0.1 below it.
    fn position_m(&self, tick: usize) -> DVec3 {
        let down = (PI * TICK_S * tick as f64 / TAP_S).sin().powi(2);
        self.place_m + (self.radius_m + (0.15 - 0.25 * down) * self.side_m) * DVec3::Y
    }
}

impl Taps {
    /// Taps the body at up to `count` places. The body is at rest before each tap.
    pub(super) fn run(
        built: &mut BuiltMesh,
        count: usize,
        coupling: VirtualCoupling,
    ) -> Result<Self, LabError> {
        let top = Top::of(&built.body);
        let side_m = (top.high_m - top.low_m).min_element();
        let radius_m = side_m / 12.0;
        let mut taps = Self::default();
        let bar = progress::bar(count);
        for place_m in places(&built.body, &top, count, radius_m) {
            let hand = Hand { place_m, radius_m, side_m, coupling };
            let tapped = taps.tap(built, &hand);
            let [x_mm, _, z_mm] = (1e3 * place_m).to_array();
            let peaks_n = tapped.map_err(|source| LabError::Press { x_mm, z_mm, source })?;
            taps.places.push(TappedPlace { place_m, peaks_n });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(taps)
    }

    /// Taps one place, and returns the maximum force of each tap.
    fn tap(&mut self, built: &mut BuiltMesh, hand: &Hand) -> Result<[f64; REPEATS], ReduceError> {
        let shape = ToolShape::Sphere { radius_m: hand.radius_m };
        let integrator = SemiImplicitEuler::default().into();
        let mut body = built.body.clone();
        let mut peaks_n = [0.0; REPEATS];
        for (index, peak_n) in peaks_n.iter_mut().enumerate() {
            if index > 0 {
                come_to_rest(&mut body, integrator)?;
            }
            let contact = ToolContact::touch(shape, FRICTION)?.with_coupling(hand.coupling)?;
            let mut run =
                MultirateRun::new((body, contact), &mut built.builder, integrator, hand.position_m(0))?;
            let mut steps = Vec::with_capacity(TAP_STEPS);
            for _ in 0..TAP_STEPS {
                steps.push(run.step(|tick| hand.position_m(tick))?);
            }
            *peak_n = maximum_n(steps.iter().flat_map(|step| &step.loop_n));
            self.record(&steps);
            body = run.into_body();
        }
        Ok(peaks_n)
    }

    /// Adds the model steps of a tap.
    fn record(&mut self, steps: &[ModelStep]) {
        self.beyond_support += steps.iter().filter(|step| step.is_beyond_support).count();
        for (loop_n, body_n) in steps.iter().flat_map(|step| step.loop_n.iter().zip(&step.body_n)) {
            self.max_difference_n = self.max_difference_n.max(loop_n.distance(*body_n));
        }
        let least_n = LEAST_FORCE * maximum_n(steps.iter().flat_map(|step| &step.body_n));
        let counts = |step: &&ModelStep| rms_n(&step.body_n) >= least_n;
        let errors: Vec<f64> = steps
            .iter()
            .filter(counts)
            .filter_map(|step| relative_rms_error(&step.loop_n, &step.body_n))
            .collect();
        self.first_touch = self.first_touch.into_iter().chain(errors.first().copied()).reduce(f64::max);
        self.errors.extend(errors);
    }
}

/// Maximum magnitude of `forces_n`, N.
fn maximum_n<'a>(forces_n: impl Iterator<Item = &'a DVec3>) -> f64 {
    forces_n.map(|force_n| force_n.length()).fold(0.0, f64::max)
}

/// RMS of the magnitudes of `forces_n`, N.
fn rms_n(forces_n: &[DVec3]) -> f64 {
    (forces_n.iter().map(|force_n| force_n.length_squared()).sum::<f64>() / forces_n.len() as f64).sqrt()
}

/// Steps `body` without a tool until it is at rest. A slender body swings for minutes, so all nodes are stopped whenever the kinetic energy
/// has passed a maximum (kinetic damping; P. A. Cundall, "Explicit finite-difference methods in geomechanics", 1976).
fn come_to_rest(body: &mut Body, integrator: Integrator) -> Result<(), BodyError> {
    let mut last_j = 0.0;
    for _ in 0..MAX_WAITING_STEPS {
        body.advance(None, PERIOD_TICKS, integrator)?;
        // Nodes that were stopped move again after a step, unless they are at rest.
        if is_at_rest(body) {
            break;
        }
        let kinetic_j = body.energy().kinetic_j;
        let is_past_maximum = kinetic_j < last_j;
        last_j = if is_past_maximum { 0.0 } else { kinetic_j };
        // A body whose state is set does not fall asleep before it is at rest.
        let x_m = body.positions_m().to_vec();
        let mut v_m_per_s = body.velocities_m_per_s().to_vec();
        if is_past_maximum {
            v_m_per_s.fill(DVec3::ZERO);
        }
        body.set_state(&x_m, &v_m_per_s)?;
    }
    Ok(())
}

/// Whether no node of `body` moves.
fn is_at_rest(body: &Body) -> bool {
    body.velocities_m_per_s().iter().all(|v| v.length() < REST_M_PER_S)
}
