//! The hand: down in stairs, and up again, once for every tip.

use bevy_palpate::prelude::*;

/// The depths at which it waits, m.
pub const DEPTHS_M: [f64; 4] = [0.002, 0.004, 0.006, 0.008];
/// Time on a stair, s: a third of it on the way there.
const STAIR_S: f64 = 0.5;
/// Height over the surface at which the tip is changed, m, and half the time that this takes, s.
const HIGH_M: f64 = 0.05;
pub const CHANGE_S: f64 = 0.15;
/// Time for the way to the surface and for that back, s.
const WAY_S: f64 = 0.35;
/// Time that it takes for one tip, s.
pub const SECONDS: f64 = 2.0 * (CHANGE_S + WAY_S) + STAIR_S * DEPTHS_M.len() as f64;

/// Height over the surface of a tip whose lowest point is `low_m` below its position, `t` (s) after its turn began, m.
fn height_m(t: f64, low_m: f64) -> f64 {
    // Smooth at both ends.
    let between = |from: f64, to: f64, share: f64| {
        let share = share.clamp(0.0, 1.0);
        from + (to - from) * share * share * (3.0 - 2.0 * share)
    };
    match stair(t) {
        None if t < SECONDS / 2.0 => between(HIGH_M, low_m, (t - CHANGE_S) / WAY_S),
        None => between(low_m - DEPTHS_M[DEPTHS_M.len() - 1], HIGH_M, 1.0 - (SECONDS - CHANGE_S - t) / WAY_S),
        Some((stair, share)) => {
            let from = stair.checked_sub(1).map_or(0.0, |before| DEPTHS_M[before]);
            low_m - between(from, DEPTHS_M[stair], 3.0 * share)
        }
    }
}

/// The stair on which it is at `t`, and how much of its time there is over.
fn stair(t: f64) -> Option<(usize, f64)> {
    let pressed = (t - CHANGE_S - WAY_S) / STAIR_S;
    (0.0..DEPTHS_M.len() as f64).contains(&pressed).then(|| (pressed as usize, pressed.fract()))
}

/// The stair on which it has been waiting at `t`, so long that the body is at rest.
pub fn waited_on(t: f64) -> Option<usize> {
    stair(t).filter(|(_, share)| *share > 0.85).map(|(stair, _)| stair)
}

/// What the hand does at time `t` (s) when it presses one tip after the other, the surface at height `top_m`, the tip's lowest point
/// `low_m[i]` below its position.
pub fn reading(t: f64, top_m: f64, low_m: &[f64]) -> Reading {
    let tip = ((t / SECONDS) as usize).min(low_m.len() - 1);
    Reading::at(DVec3::Y * (top_m + height_m(t - tip as f64 * SECONDS, low_m[tip])))
}
