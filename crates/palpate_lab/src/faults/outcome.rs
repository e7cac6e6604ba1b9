//! Expected and actual outcome of a fault.

use super::scene::{self, BREAKS_AT, LIMITS, Turned};
use serde::Serialize;

/// What came of one fault.
#[derive(Debug, Serialize)]
pub(crate) struct Outcome {
    pub(super) name: &'static str,
    /// Every force was finite and within the limits of magnitude and growth; it was safe in time; the fault was told; force came
    /// back if it should.
    pub(super) survived: bool,
    /// The largest force that was written, N.
    pub(super) max_force_n: f64,
    /// The largest growth of the force within a tick, N.
    pub(super) max_slew_n_per_ms: f64,
    /// Ticks from the fault to zero force; 0 where the fault is bridged.
    pub(super) ticks_to_safe: u64,
    #[serde(skip)]
    pub(super) is_bridged: bool,
    /// Whether the force at the end was that without a fault.
    pub(super) recovered: bool,
    /// What the app was told first: cause and remedy.
    pub(super) told: String,
    /// Why it was not survived.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) why: Option<String>,
}

/// What must come of a fault.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    /// Zero force within so many ticks of the fault; `None`: the fault is bridged, and the force goes on.
    pub(crate) zero_within: Option<u64>,
    /// Whether the force comes back to that without a fault before the end.
    pub(crate) recovers: bool,
    /// A part of what the app must be told; empty where nothing is wrong.
    pub(crate) told: &'static str,
}

/// Ticks for which the force must stay zero to be safe, and at least as many at the end be right to have recovered.
const STAYS: usize = 50;

/// Whether what was felt is what must come of a fault.
pub(super) fn judge(name: &'static str, expected: Expected, turned: &Turned, growth: f64) -> Outcome {
    let lengths: Vec<f64> = turned.forces.iter().map(|(_, force)| force.length()).collect();
    let max_force_n = lengths.iter().copied().fold(0.0, f64::max);
    let grown = |pair: &[(u64, glam::DVec3)]| {
        let ((_, before), (_, now)) = (pair[0], pair[1]);
        now.length() - now.try_normalize().map_or(0.0, |along| before.dot(along).max(0.0))
    };
    let max_slew_n_per_ms = turned.forces.windows(2).map(grown).fold(0.0, f64::max);
    let broken = turned.forces.iter().position(|(tick, _)| *tick >= BREAKS_AT).unwrap_or(lengths.len());
    let is_zero = |from: usize| lengths[from..].iter().take(STAYS).all(|f| *f == 0.0);
    let safe = (broken..lengths.len()).find(|&i| is_zero(i)).map(|i| turned.forces[i].0 - BREAKS_AT);
    let right = |(tick, force): &(u64, glam::DVec3)| (force.z - scene::sound_n(*tick)).abs() < 0.15;
    // Shortly before the loop is stopped, with zero force.
    let last: Vec<_> = turned
        .forces
        .iter()
        .filter(|(tick, _)| (turned.ticks - 150..turned.ticks - 50).contains(tick))
        .collect();
    let recovered = last.len() >= STAYS && last.into_iter().all(right);
    let told = if expected.told.is_empty() {
        turned.told.first()
    } else {
        turned.told.iter().find(|told| told.contains(expected.told))
    };
    let slew_n = LIMITS.slew_n_per_s * 1e-3 * growth;
    // While a fault is bridged the force may be off by what the hand did meanwhile.
    let bridged = turned.forces[broken..]
        .iter()
        .take(200)
        .all(|(tick, force)| (force.z - scene::sound_n(*tick)).abs() < 0.5);
    let complaints = [
        (!lengths.iter().all(|f| f.is_finite()), "a force was not finite".to_owned()),
        (max_force_n > LIMITS.force_n * (1.0 + 1e-9), format!("the force came to {max_force_n} N")),
        (
            max_slew_n_per_ms > slew_n * (1.0 + 1e-9),
            format!("the force grew by {max_slew_n_per_ms} N in a tick"),
        ),
        (
            expected.zero_within.is_some_and(|within| safe.is_none_or(|ticks| ticks > within)),
            format!("the force was zero after {safe:?} ticks, not within {:?}", expected.zero_within),
        ),
        (expected.zero_within.is_none() && !bridged, "the force did not go on".to_owned()),
        (
            recovered != expected.recovers,
            "the force came back when it should not, or did not when it should".to_owned(),
        ),
        (
            !expected.told.is_empty() && told.is_none(),
            format!("nothing was told of it; told was: {:?}", turned.told),
        ),
        (
            expected.told.is_empty() && told.is_some(),
            format!("something was told that is no fault: {told:?}"),
        ),
    ];
    let why = complaints.into_iter().find(|(is_so, _)| *is_so).map(|(_, why)| why);
    Outcome {
        name,
        survived: why.is_none(),
        max_force_n,
        max_slew_n_per_ms,
        ticks_to_safe: expected.zero_within.and(safe).unwrap_or(0),
        is_bridged: expected.zero_within.is_none(),
        recovered,
        told: told.cloned().unwrap_or_default(),
        why,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const FADES: Expected = Expected { zero_within: Some(100), recovers: true, told: "it broke" };

    /// What is felt where nothing is wrong, but for 50 ticks of zero from 80 ticks after the fault on and a ramp after them.
    fn faded() -> Turned {
        let gain = |tick: u64| match tick.saturating_sub(BREAKS_AT) {
            0..80 => 1.0,
            since => (since.saturating_sub(130) as f64 / 20.0).min(1.0),
        };
        let force = |tick| gain(tick) * scene::sound_n(tick);
        let forces = (1..=scene::TICKS).map(|tick| (tick, DVec3::Z * force(tick))).collect();
        Turned { forces, told: vec!["it broke: mend it".into()], ticks: scene::TICKS }
    }

    /// What is held against `turned`.
    fn why(expected: Expected, turned: &Turned) -> String {
        judge("a fault", expected, turned, 1.0).why.unwrap_or_default()
    }

    #[test]
    fn what_is_as_it_must_be_is_survived() {
        let outcome = judge("a fault", FADES, &faded(), 1.0);
        assert_eq!((outcome.survived, outcome.why, outcome.ticks_to_safe), (true, None, 80));
        assert!(outcome.recovered && outcome.told == "it broke: mend it");
    }

    #[test]
    fn everything_that_must_not_be_is_found() {
        let tick = BREAKS_AT as usize;
        let spoilt = |spoil: fn(&mut Vec<(u64, DVec3)>, usize)| {
            let mut turned = faded();
            spoil(&mut turned.forces, tick);
            turned
        };
        let untold = Turned { told: vec!["something else".into()], ..faded() };
        let bridged = Expected { zero_within: None, ..FADES };
        for (expected, turned, says) in [
            (FADES, spoilt(|forces, at| forces[at].1.x = f64::NAN), "not finite"),
            (FADES, spoilt(|forces, _| forces[9].1.z = 10.1), "came to 10.1 N"),
            (FADES, spoilt(|forces, at| forces[at + 100].1.z = 2.1), "grew by 2.1 N"),
            (Expected { zero_within: Some(79), ..FADES }, faded(), "zero after Some(80) ticks"),
            (FADES, spoilt(|forces, at| forces[at + 100].1.z = 1e-9), "ticks, not within Some(100)"),
            (bridged, faded(), "did not go on"),
            (Expected { recovers: false, ..FADES }, faded(), "came back when it should not"),
            (FADES, spoilt(|forces, _| forces[3899].1.z += 0.2), "did not when it should"),
            (FADES, spoilt(|forces, _| forces.truncate(3860)), "did not when it should"),
            (FADES, untold, "nothing was told of it"),
            (Expected { told: "", ..FADES }, faded(), "told that is no fault"),
        ] {
            assert!(why(expected, &turned).contains(says), "{says}: {}", why(expected, &turned));
        }
    }
}
