//! The hand: down in stairs, and up again.

use bevy_palpate::prelude::*;

/// The depths at which it waits, m.
pub const DEPTHS_M: [f64; 4] = [0.0015, 0.003, 0.0045, 0.006];
/// Time on a stair, s: a third of it on the way there.
pub const STAIR_S: f64 = 0.5;
/// Time for the way to the surface, from this height above it, s, m.
const APPROACH_S: f64 = 0.3;
const ABOVE_M: f64 = 0.01;
/// Time that it takes for one tip, s, the way back included.
pub const SECONDS: f64 = APPROACH_S + STAIR_S * DEPTHS_M.len() as f64 + 0.5;

/// How deep the tip is at `t` (s) after it began, m; negative above the surface.
pub fn depth_m(t: f64) -> f64 {
    let pressed = (t - APPROACH_S) / STAIR_S;
    if pressed < 0.0 {
        return -ABOVE_M * (1.0 - t / APPROACH_S);
    }
    let stair = pressed as usize;
    let Some(&to) = DEPTHS_M.get(stair) else {
        let back = ((pressed - DEPTHS_M.len() as f64) * STAIR_S / 0.4).min(1.0);
        return DEPTHS_M[DEPTHS_M.len() - 1] * (1.0 - back) - ABOVE_M * back;
    };
    let from = stair.checked_sub(1).map_or(0.0, |before| DEPTHS_M[before]);
    let way = (3.0 * pressed.fract()).min(1.0);
    // Smooth at both ends.
    from + (to - from) * way * way * (3.0 - 2.0 * way)
}

/// The stair on which it has been waiting at `t` for the rest of it.
pub fn waited_on(t: f64) -> Option<usize> {
    let pressed = (t - APPROACH_S) / STAIR_S;
    let stair = pressed.max(0.0) as usize;
    (pressed >= 0.0 && stair < DEPTHS_M.len() && pressed.fract() > 0.85).then_some(stair)
}

/// A device whose hand presses one tip after the other, the surface at height `top_m`, the tip's lowest point `low_m[i]` below
/// its position.
pub fn device(top_m: f64, low_m: Vec<f64>) -> ScriptedDevice {
    ScriptedDevice::new(move |n, _| {
        let t = n as f64 * 1e-3;
        let tip = ((t / SECONDS) as usize).min(low_m.len() - 1);
        let depth = depth_m(t - tip as f64 * SECONDS);
        Ok(Reading::at(DVec3::Y * (top_m + low_m[tip] - depth)))
    })
}
