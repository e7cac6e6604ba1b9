//! Figure of a black box: position, force and times over time.

use crate::error::LabError;
use crate::figure::{Bands, Curve, Panel, Scale, stacked};
use palpate_haptics::BlackBoxTick;
use plotters::style::RGBColor;

/// Maximum number of points of a curve, more than two for each pixel; longer curves are thinned.
const MAX_POINTS: usize = 4096;

/// Minimum time on the logarithmic axis, µs.
const MIN_US: f64 = 0.1;

/// The figure of `ticks`.
pub(super) fn figure(ticks: &[BlackBoxTick]) -> Result<String, LabError> {
    let curve = |name: &str, value: &dyn Fn(&BlackBoxTick) -> Option<f64>| {
        let points = ticks.iter().filter_map(|tick| Some((tick.time_s, value(tick)?)));
        Curve::new(name, thinned(points.filter(|point| point.1.is_finite()).collect()))
    };
    let origin = ticks.iter().find_map(|tick| tick.sample).map_or(glam::DVec3::ZERO, |s| s.position_m);
    let along = |axis: usize| {
        move |tick: &BlackBoxTick| tick.sample.map(|sample| 1e3 * (sample.position_m - origin)[axis])
    };
    let us = |ns: u64| Some((ns as f64 * 1e-3).max(MIN_US));
    let position = Panel {
        title: "Position of the tool, from its first sample".into(),
        x: "",
        y: "displacement, mm",
        scale: Scale::Linear,
        curves: vec![curve("x", &along(0)), curve("y", &along(1)), curve("z", &along(2))],
    };
    let force = Panel {
        title: "Magnitude of the force on the hand".into(),
        x: "",
        y: "force, N",
        scale: Scale::Linear,
        curves: vec![
            curve("before the safety chain", &|tick| Some(tick.before_n.length())).broad(),
            curve("after it, as written", &|tick| Some(tick.written_n.length())),
        ],
    };
    let times = Panel {
        title: "Times of the loop".into(),
        x: "time since the loop's start, s",
        y: "time, µs",
        scale: Scale::LogY,
        curves: vec![
            curve("cost of the tick", &|tick| us(tick.timing.cost_ns)),
            curve("lateness", &|tick| us(tick.timing.lateness_ns)),
        ],
    };
    let bands = [
        Bands {
            name: "deadlines missed",
            spans: spans(ticks, |tick| tick.elapsed > 1),
            color: RGBColor(252, 226, 160),
        },
        Bands {
            name: "device error",
            spans: spans(ticks, |tick| tick.read_failed.is_some() || tick.write_failed.is_some()),
            color: RGBColor(250, 190, 190),
        },
    ];
    stacked(&[position, force, times], &bands)
}

/// Thins a curve to the lowest and highest point of each group, which keeps every peak.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= MAX_POINTS {
        return points;
    }
    let few = (2 * points.len()).div_ceil(MAX_POINTS);
    let ends = |chunk: &[(f64, f64)]| {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (low, high) = (chunk.iter().min_by(by_value), chunk.iter().max_by(by_value));
        let mut ends: Vec<(f64, f64)> = low.into_iter().chain(high).copied().collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends
    };
    points.chunks(few).flat_map(ends).collect()
}

/// Time spans in which `test` holds, each from the tick before. Spans closer than a pixel are merged.
fn spans(ticks: &[BlackBoxTick], test: impl Fn(&BlackBoxTick) -> bool) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (ticks.first(), ticks.last()) else { return Vec::new() };
    let pixel_s = (last.time_s - first.time_s) * 1e-3;
    let mut spans: Vec<(f64, f64)> = Vec::new();
    for (before, tick) in ticks.iter().zip(ticks.iter().skip(1)).filter(|(_, tick)| test(tick)) {
        match spans.last_mut() {
            Some(span) if before.time_s <= span.1 + pixel_s => span.1 = tick.time_s,
            _ => spans.push((before.time_s, tick.time_s)),
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_every_peak() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 1.0)).collect();
        (points[777].1, points[60_001].1) = (9.0, -5.0);
        let thin = thinned(points);
        assert!(thin.len() <= MAX_POINTS && thin.is_sorted_by(|a, b| a.0 <= b.0));
        assert!(thin.contains(&(777.0, 9.0)) && thin.contains(&(60_001.0, -5.0)));
        assert_eq!(thinned(vec![(0.0, 1.0); 10]).len(), 10);
    }

    #[test]
    fn consecutive_ticks_form_one_span() {
        let ticks: Vec<BlackBoxTick> = (0..1000)
            .map(|i| BlackBoxTick { sequence: i, time_s: i as f64, elapsed: 1, ..BlackBoxTick::default() })
            .collect();
        let failed = |tick: &BlackBoxTick| (100..200).contains(&tick.sequence) || tick.sequence == 500;
        assert_eq!(spans(&ticks, failed), [(99.0, 199.0), (499.0, 500.0)]);
        assert!(spans(&ticks[..0], failed).is_empty());
    }
}
