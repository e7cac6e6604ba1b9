//! The scripted device: down in steps, and up again, once for every tip.

use bevy_palpate::prelude::*;
use palpate_haptics::Reading;

/// Depths of the steps, m.
pub const DEPTHS_M: [f64; 4] = [0.002, 0.004, 0.006, 0.008];
/// Time of a step, s: a third of it for the motion.
const STAIR_S: f64 = 0.5;
/// Height over the surface at which the tip changes, m.
const HIGH_M: f64 = 0.05;
/// Half the time for a change of the tip, s.
pub const CHANGE_S: f64 = 0.15;
/// Time for the way to the surface, and for the way back, s.
const WAY_S: f64 = 0.35;
/// Time for a tip, s.
pub const SECONDS: f64 = 2.0 * (CHANGE_S + WAY_S) + STAIR_S * DEPTHS_M.len() as f64;

/// Height of a tip over the surface, m, `t` s after its start. The lowest point of the tip is `low_m` below its position.
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

/// The step at `t`, and the elapsed share of its time.
fn stair(t: f64) -> Option<(usize, f64)> {
    let pressed = (t - CHANGE_S - WAY_S) / STAIR_S;
    (0.0..DEPTHS_M.len() as f64).contains(&pressed).then(|| (pressed as usize, pressed.fract()))
}

/// The step at `t` if the body has come to rest on it.
pub fn waited_on(t: f64) -> Option<usize> {
    stair(t).filter(|(_, share)| *share > 0.85).map(|(stair, _)| stair)
}

/// The reading at time `t`, s, for one tip after the other. The surface is at height `top_m`, the lowest point of tip i is `low_m[i]` below
/// its position.
pub fn reading(t: f64, top_m: f64, low_m: &[f64]) -> Reading {
    let tip = ((t / SECONDS) as usize).min(low_m.len() - 1);
    Reading::at(DVec3::Y * (top_m + height_m(t - tip as f64 * SECONDS, low_m[tip])))
}
