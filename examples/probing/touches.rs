//! Where the hand pressed, and how stiff it was there: how a lump is found.

use crate::report::Run;
use glam::DVec3;
use palpate_body::{Body, SurfaceTree};
use std::io::Write;

/// One touch, from the first force to the last.
pub struct Touch {
    /// When its force was greatest, s, where the tool was, m, and that force, N.
    time_s: f64,
    position_m: DVec3,
    force_n: f64,
    /// How deep the tool was below the surface as it is at rest, m.
    depth_m: f64,
}

/// The touches of `run`, of a ball of `radius_m`, on a body that is `at_rest`.
pub fn find(run: &Run, at_rest: &Body, radius_m: f64) -> Vec<Touch> {
    let tree = SurfaceTree::new(at_rest);
    let mut touches: Vec<Touch> = Vec::new();
    let mut is_touching = false;
    for (sample, force) in run.samples.iter().zip(&run.comparison.oracle_n) {
        let force_n = force.length();
        let was_touching = std::mem::replace(&mut is_touching, force_n > 0.0);
        if !is_touching {
            continue;
        }
        if !was_touching {
            touches.push(Touch { time_s: 0.0, position_m: DVec3::ZERO, force_n: 0.0, depth_m: 0.0 });
        }
        if let Some(touch) = touches.last_mut().filter(|touch| touch.force_n < force_n) {
            *touch = Touch { time_s: sample.time_s, position_m: sample.position_m, force_n, depth_m: 0.0 };
        }
    }
    for touch in &mut touches {
        let closest = tree.closest(touch.position_m, 2.0 * radius_m + 0.05);
        touch.depth_m = closest.map_or(0.0, |closest| radius_m - closest.distance_m);
    }
    // What is a touch to a hand.
    touches.retain(|touch| touch.force_n > 0.05);
    touches
}

/// All of them as JSON.
pub fn json(touches: &[Touch]) -> String {
    let one = |Touch { time_s, position_m: DVec3 { x, z, .. }, force_n, depth_m }: &Touch| {
        format!(
            r#"{{"time_s":{time_s:.3},"x_m":{x:.5},"z_m":{z:.5},"depth_m":{depth_m:.6},"force_n":{force_n:.4}}}"#
        )
    };
    format!("[{}]", touches.iter().map(one).collect::<Vec<_>>().join(","))
}

/// A row for each.
pub fn print(touches: &[Touch]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "\nwhere it pressed, x, z, mm   depth, mm   force, N   N/mm")?;
    for Touch { time_s, position_m, force_n, depth_m } in touches {
        let [x, _, z] = (1e3 * *position_m).to_array();
        let depth_mm = 1e3 * depth_m;
        writeln!(
            out,
            "  at {time_s:5.2} s   {x:6.1} {z:6.1}   {depth_mm:9.2}   {force_n:8.3}   {:5.3}",
            force_n / depth_mm
        )?;
    }
    Ok(())
}
