//! The scripted device: grasps the left edge, pulls it across, releases it, waits, grasps the right edge and pulls it away.

use super::wound::TOP_M;
use bevy_palpate::prelude::*;
use palpate_haptics::Reading;

/// Radius of the tool, m.
pub const RADIUS_M: f64 = 0.004;
/// Duration of the motion, s.
pub const SECONDS: f64 = 5.2;

/// Times, s, positions of the tool's lowest point, mm across, over the top and along the wound, and whether the grasp is closed from then
/// on. The tool moves the edge back to the threads before it opens.
const WAY: [(f64, [f64; 3], bool); 15] = [
    (0.0, [-9.0, 20.0, 0.0], false),
    (0.4, [-8.0, -0.3, 0.0], false),
    (0.55, [-8.0, -0.3, 0.0], true),
    (0.65, [-8.0, -0.3, 0.0], true),
    (1.25, [2.0, 1.5, 0.0], true),
    (1.5, [2.0, 1.5, 0.0], true),
    (2.0, [-5.0, 0.5, 0.0], true),
    (2.05, [-5.0, 0.5, 0.0], false),
    (2.2, [-5.0, 1.0, 0.0], false),
    (2.5, [-4.0, 25.0, 0.0], false),
    (3.1, [10.0, 20.0, 0.0], false),
    (3.4, [7.0, -0.5, 0.0], false),
    (3.55, [7.0, -0.5, 0.0], true),
    (3.65, [7.0, -0.5, 0.0], true),
    (4.75, [26.0, 5.0, 0.0], true),
];

/// The reading at time `t`, s.
pub fn reading(t: f64) -> Reading {
    let later = WAY.iter().position(|(at, ..)| *at > t).unwrap_or(WAY.len());
    let (from, to) = (WAY[later.max(1) - 1], WAY[later.min(WAY.len() - 1)]);
    let way = if to.0 > from.0 { ((t - from.0) / (to.0 - from.0)).clamp(0.0, 1.0) } else { 1.0 };
    let smooth = way * way * (3.0 - 2.0 * way);
    let at = 1e-3 * DVec3::from(from.1).lerp(DVec3::from(to.1), smooth);
    let buttons = u32::from(from.2);
    Reading { buttons, ..Reading::at(at + DVec3::Y * (TOP_M + RADIUS_M)) }
}
