//! Expected and actual outcome of a fault.

use super::scene::{FAULT_TICK, LIMITS, SceneRun, intact_force_n};
use glam::DVec3;
use palpate_haptics::LoopEventKind;
use serde::Serialize;

/// Outcome of a fault.
#[derive(Debug, Serialize)]
pub(super) struct Outcome {
    pub(super) name: &'static str,
    /// Whether every force was finite and within the limits of magnitude and growth, the force became zero in time, the fault was
    /// reported, and the force came back where it should.
    pub(super) survived: bool,
    /// Maximum force written, N.
    pub(super) max_force_n: f64,
    /// Maximum growth of the force in a tick, N.
    pub(super) max_slew_n_per_ms: f64,
    /// Ticks from the fault to zero force; 0 where the fault is bridged.
    pub(super) ticks_to_safe: u64,
    #[serde(skip)]
    pub(super) is_bridged: bool,
    /// Whether the force at the end equals the force without a fault.
    pub(super) recovered: bool,
    /// First report to the app about the fault: cause and remedy.
    #[serde(rename = "told")]
    pub(super) reported: String,
    /// Reason why the fault was not survived.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) why: Option<String>,
}

/// Expected outcome of a fault.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    /// Maximum number of ticks from the fault to zero force; `None` where the fault is bridged without zero force.
    pub(crate) zero_within: Option<u64>,
    /// Whether the force returns to that without a fault before the end.
    pub(crate) recovers: bool,
    /// Test for the event that reports the fault; `None` where nothing must be reported.
    pub(crate) reports: Option<fn(&LoopEventKind) -> bool>,
}

/// Number of ticks for which the force must stay zero to be safe, and minimum number of correct ticks at the end to have recovered.
const STAYS: usize = 50;

impl Outcome {
    /// Compares a run with the expected outcome. A force may grow in a tick by `growth` times the limit.
    pub(super) fn of(name: &'static str, expected: Expected, run: &SceneRun, growth: f64) -> Self {
        let lengths: Vec<f64> = run.forces.iter().map(|(_, force)| force.length()).collect();
        let max_force_n = lengths.iter().copied().fold(0.0, f64::max);
        let grown = |pair: &[(u64, DVec3)]| {
            let ((_, before), (_, now)) = (pair[0], pair[1]);
            now.length() - now.try_normalize().map_or(0.0, |along| before.dot(along).max(0.0))
        };
        let max_slew_n_per_ms = run.forces.windows(2).map(grown).fold(0.0, f64::max);
        let fault = run.forces.iter().position(|(tick, _)| *tick >= FAULT_TICK).unwrap_or(lengths.len());
        let is_zero = |from: usize| lengths[from..].iter().take(STAYS).all(|f| *f == 0.0);
        let zero_after = (fault..lengths.len()).find(|&i| is_zero(i)).map(|i| run.forces[i].0 - FAULT_TICK);
        let differs_by_n = |(tick, force): &(u64, DVec3)| (force.z - intact_force_n(*tick)).abs();
        // Shortly before the loop is stopped, with zero force.
        let end = run.ticks - 150..run.ticks - 50;
        let last: Vec<_> = run.forces.iter().filter(|(tick, _)| end.contains(tick)).collect();
        let recovered = last.len() >= STAYS && last.into_iter().all(|at| differs_by_n(at) < 0.15);
        let event = match expected.reports {
            Some(is_expected) => run.events.iter().find(|event| is_expected(event)),
            None => run.events.first(),
        };
        let max_growth_n = LIMITS.slew_n_per_s * 1e-3 * growth;
        // While a fault is bridged, the force may be off by the movement of the hand during the fault.
        let is_bridged = run.forces[fault..].iter().take(200).all(|at| differs_by_n(at) < 0.5);
        let within = expected.zero_within;
        let problems = [
            (!lengths.iter().all(|f| f.is_finite()), "a force was not finite".to_owned()),
            (max_force_n > LIMITS.force_n * (1.0 + 1e-9), format!("the force reached {max_force_n} N")),
            (
                max_slew_n_per_ms > max_growth_n * (1.0 + 1e-9),
                format!("the force grew by {max_slew_n_per_ms} N in a tick"),
            ),
            (
                within.is_some_and(|within| zero_after.is_none_or(|ticks| ticks > within)),
                format!("the force was zero after {zero_after:?} ticks, not within {within:?}"),
            ),
            (within.is_none() && !is_bridged, "the force did not continue".to_owned()),
            (recovered && !expected.recovers, "the force came back and should not".to_owned()),
            (!recovered && expected.recovers, "the force did not come back".to_owned()),
            (
                expected.reports.is_some() && event.is_none(),
                format!("the fault was not reported; events: {:?}", run.events),
            ),
            (
                expected.reports.is_none() && event.is_some(),
                format!("{event:?} was reported without a fault"),
            ),
        ];
        let why = problems.into_iter().find(|(is_so, _)| *is_so).map(|(_, why)| why);
        Self {
            name,
            survived: why.is_none(),
            max_force_n,
            max_slew_n_per_ms,
            ticks_to_safe: within.and(zero_after).unwrap_or(0),
            is_bridged: within.is_none(),
            recovered,
            reported: event.map(|event| palpate_haptics::report(event)).unwrap_or_default(),
            why,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::TICKS;
    use super::*;

    const FADES: Expected = Expected {
        zero_within: Some(100),
        recovers: true,
        reports: Some(|event| matches!(event, LoopEventKind::ForceNotFinite)),
    };

    /// Forces without a fault, except for 50 ticks of zero from 80 ticks after the fault and a ramp after them.
    fn faded() -> SceneRun {
        let gain = |tick: u64| match tick.saturating_sub(FAULT_TICK) {
            0..80 => 1.0,
            since => (since.saturating_sub(130) as f64 / 20.0).min(1.0),
        };
        let force = |tick| gain(tick) * intact_force_n(tick);
        let forces = (1..=TICKS).map(|tick| (tick, DVec3::Z * force(tick))).collect();
        SceneRun { forces, events: vec![LoopEventKind::ForceNotFinite], ticks: TICKS }
    }

    fn why(expected: Expected, run: &SceneRun) -> String {
        Outcome::of("a fault", expected, run, 1.0).why.unwrap_or_default()
    }

    #[test]
    fn expected_outcome_is_survived() {
        let outcome = Outcome::of("a fault", FADES, &faded(), 1.0);
        assert_eq!((outcome.survived, outcome.why, outcome.ticks_to_safe), (true, None, 80));
        assert!(outcome.recovered && outcome.reported == LoopEventKind::ForceNotFinite.to_string());
    }

    #[test]
    fn detects_every_deviation_from_the_expected_outcome() {
        let tick = FAULT_TICK as usize;
        let changed = |change: fn(&mut Vec<(u64, DVec3)>, usize)| {
            let mut run = faded();
            change(&mut run.forces, tick);
            run
        };
        let other_event = SceneRun { events: vec![LoopEventKind::EmergencyStopped], ..faded() };
        let bridged = Expected { zero_within: None, ..FADES };
        for (expected, run, problem) in [
            (FADES, changed(|forces, at| forces[at].1.x = f64::NAN), "not finite"),
            (FADES, changed(|forces, _| forces[9].1.z = 10.1), "reached 10.1 N"),
            (FADES, changed(|forces, at| forces[at + 100].1.z = 2.1), "grew by 2.1 N"),
            (Expected { zero_within: Some(79), ..FADES }, faded(), "zero after Some(80) ticks"),
            (FADES, changed(|forces, at| forces[at + 100].1.z = 1e-9), "ticks, not within Some(100)"),
            (bridged, faded(), "did not continue"),
            (Expected { recovers: false, ..FADES }, faded(), "came back and should not"),
            (FADES, changed(|forces, _| forces[3899].1.z += 0.2), "did not come back"),
            (FADES, changed(|forces, _| forces.truncate(3860)), "did not come back"),
            (FADES, other_event, "was not reported"),
            (Expected { reports: None, ..FADES }, faded(), "was reported without a fault"),
        ] {
            assert!(why(expected, &run).contains(problem), "{problem}: {}", why(expected, &run));
        }
    }
}
