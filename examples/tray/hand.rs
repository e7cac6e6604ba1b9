//! The scripted device: waits above the organ, presses on it, and leaves.

use bevy_palpate::prelude::*;
use palpate_haptics::Reading;

/// Radius of the tool, m.
pub const RADIUS_M: f64 = 0.010;
/// Duration of the motion, s.
pub const SECONDS: f64 = 4.0;
/// Time from which the tool is at its lowest place, and time at which it leaves, s.
pub const PRESSES_S: [f64; 2] = [2.0, 2.8];
/// Highest and lowest place of the tool's centre, m.
const HIGH_M: f64 = 0.09;
const LOW_M: f64 = 0.052;

/// The reading at time `t`, s.
pub fn reading(t: f64) -> Reading {
    let [from, to] = PRESSES_S;
    let down = smooth((t - from + 0.7) / 0.7) - smooth((t - to) / 0.5);
    Reading::at(DVec3::new(-0.045, HIGH_M + (LOW_M - HIGH_M) * down, 0.0))
}

fn smooth(way: f64) -> f64 {
    let way = way.clamp(0.0, 1.0);
    way * way * (3.0 - 2.0 * way)
}
