//! Contacts of a run, with their stiffness, which reveals the lump.

use super::report::Run;
use glam::DVec3;
use palpate_body::{Body, SurfaceTree};
use std::io::Write;

/// A contact, at the time of its maximum force.
pub struct Touch {
    /// Time, s.
    time_s: f64,
    /// Position of the tool, m.
    position_m: DVec3,
    /// Force, N.
    force_n: f64,
    /// Depth of the tool below the undeformed surface, m.
    depth_m: f64,
}

/// Finds the contacts of `run`, of a ball of `radius_m`, on a body that is `at_rest`.
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
    // Discards contacts below the threshold of perception.
    touches.retain(|touch| touch.force_n > 0.05);
    touches
}

/// The contacts as JSON.
pub fn json(touches: &[Touch]) -> String {
    let one = |Touch { time_s, position_m: DVec3 { x, z, .. }, force_n, depth_m }: &Touch| {
        format!(
            r#"{{"time_s":{time_s:.3},"x_m":{x:.5},"z_m":{z:.5},"depth_m":{depth_m:.6},"force_n":{force_n:.4}}}"#
        )
    };
    format!("[{}]", touches.iter().map(one).collect::<Vec<_>>().join(","))
}

/// Prints a row for each contact.
pub fn print(touches: &[Touch]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "\ncontacts at x, z, mm         depth, mm   force, N   N/mm")?;
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
