//! Figures of `palpate-lab probe`.

use super::press::PressAt;
use super::report::Report;
use crate::error::LabError;
use crate::figure::{Curve, Panel, Scale, svg};
use crate::multirate::TICK_S;

/// Maximum number of presses in a figure.
const MAX_DRAWN: usize = 4;

/// Normal force over time and over depth, of all presses or of some of them.
pub(super) fn forces(presses: &[PressAt]) -> Result<String, LabError> {
    let drawn = drawn(presses.len());
    let panel = |over: &str, x, points: &dyn Fn(&PressAt, usize) -> f64| {
        let curve = |press: &PressAt, of: &str, forces: &[glam::DVec3]| {
            let name = format!("{}, {} mm: {of}", press.place.x_mm, press.place.z_mm);
            Curve::new(name, forces.iter().enumerate().map(|(tick, f)| (points(press, tick), f.y)))
        };
        let shown = || drawn.iter().filter_map(|&index| presses.get(index));
        // Broad lines lie below narrow ones.
        let bodies = shown().map(|press| curve(press, "full body", &press.press.body_n).broad());
        let loops = shown().map(|press| curve(press, "loop", &press.press.loop_n));
        let some = if drawn.len() < presses.len() {
            format!(", {} of {} presses", drawn.len(), presses.len())
        } else {
            String::new()
        };
        Panel {
            title: format!("Normal force over {over}{some}"),
            x,
            y: "normal force, N",
            scale: Scale::Linear,
            curves: bodies.chain(loops).collect(),
        }
    };
    let time = panel("time", "time, s", &|_, tick| TICK_S * tick as f64);
    let depth = panel("depth", "depth of the hand, mm", &|press, tick| 1e3 * press.press.depth_m[tick]);
    svg(&[time, depth], 2)
}

/// Normal force at the end of the presses along the scan; `None` without one.
pub(super) fn scan(report: &Report, at_count: usize) -> Result<Option<String>, LabError> {
    let presses = &report.presses[at_count..];
    if presses.is_empty() {
        return Ok(None);
    }
    let body = presses.iter().map(|press| (press.x_mm, press.body_force_n[1]));
    let in_loop = presses.iter().map(|press| (press.x_mm, press.loop_force_n[1]));
    let panel = Panel {
        title: "Normal force along the scan".into(),
        x: "x, mm",
        y: "normal force, N",
        scale: Scale::Linear,
        curves: vec![Curve::new("full body", body).broad(), Curve::new("loop", in_loop)],
    };
    svg(&[panel], 1).map(Some)
}

/// Indices of the presses that are drawn: evenly spread, with the first and the last.
fn drawn(count: usize) -> Vec<usize> {
    let shown = count.min(MAX_DRAWN);
    (0..shown).map(|i| if shown > 1 { i * (count - 1) / (shown - 1) } else { 0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::drawn;

    #[test]
    fn drawn_presses_include_the_first_and_the_last() {
        assert_eq!(drawn(1), [0]);
        assert_eq!(drawn(3), [0, 1, 2]);
        assert_eq!(drawn(41), [0, 13, 26, 40]);
    }
}
