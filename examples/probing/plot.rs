//! Plot of force over time: the whole run, and the strongest contact magnified.

use super::report::Run;
use bevy_palpate::prelude::Scheme;
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;

type PlotResult<T = ()> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// A part of the picture.
type Canvas<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// A curve's name, colour and points (s, N).
struct Curve {
    name: &'static str,
    color: RGBColor,
    points: Vec<(f64, f64)>,
}

/// Half the time shown around the strongest contact, s.
const NEAR_S: f64 = 0.35;

/// Writes the plot to `path`.
pub fn force_over_time(run: &Run, path: &Path) -> PlotResult {
    let curves = curves(run);
    let (Some(first), Some(last)) = (run.samples.first(), run.samples.last()) else { return Ok(()) };
    let oracle = run.comparison.oracle_n.iter().zip(run.samples);
    let peak = oracle.max_by(|a, b| a.0.y.total_cmp(&b.0.y)).map_or(first.time_s, |(_, s)| s.time_s);
    let whole = first.time_s..last.time_s;
    let near = (peak - NEAR_S).max(whole.start)..(peak + NEAR_S).min(whole.end);

    let area = SVGBackend::new(path, (1000, 800)).into_drawing_area();
    area.fill(&WHITE).map_err(text)?;
    let (panels, legend) = area.split_horizontally(830);
    let (upper, lower) = panels.split_vertically(400);
    panel(&upper, "Force along the surface normal", whole, &curves)?;
    panel(&lower, "Strongest contact", near, &curves)?;
    draw_legend(&legend, &curves)?;
    area.present().map_err(text)
}

/// Draws the names next to the panels.
fn draw_legend(area: &Canvas, curves: &[Curve]) -> PlotResult {
    for (line, curve) in curves.iter().enumerate() {
        let y = 60 + 22 * line as i32;
        let stroke = PathElement::new([(4, y), (24, y)], curve.color.stroke_width(2));
        area.draw(&stroke).map_err(text)?;
        area.draw(&Text::new(curve.name, (30, y - 6), ("sans-serif", 12))).map_err(text)?;
    }
    Ok(())
}

fn curves(run: &Run) -> Vec<Curve> {
    let along = |forces: &[glam::DVec3]| -> Vec<(f64, f64)> {
        run.samples.iter().zip(forces).map(|(s, f)| (s.time_s, f.y)).collect()
    };
    let colors = [
        RGBColor(213, 94, 0),
        RGBColor(230, 159, 0),
        RGBColor(0, 158, 115),
        RGBColor(204, 121, 167),
        RGBColor(86, 180, 233),
        RGBColor(240, 228, 66),
    ];
    let mut curves: Vec<Curve> = Scheme::ALL
        .into_iter()
        .zip(colors)
        .filter_map(|(scheme, color)| {
            Some(Curve { name: scheme.name(), color, points: along(run.comparison.displayed(scheme)?) })
        })
        .collect();
    curves.push(Curve { name: "full body at 1 kHz", color: BLACK, points: along(&run.comparison.oracle_n) });
    let written = run.records.iter().filter_map(|r| Some((r.sample?.time_s, r.force_n.y))).collect();
    curves.push(Curve { name: "written to the device", color: RGBColor(0, 114, 178), points: written });
    curves
}

fn panel(area: &Canvas, title: &str, time: Range<f64>, curves: &[Curve]) -> PlotResult {
    let shown = |curve: &Curve| -> Vec<(f64, f64)> {
        curve.points.iter().copied().filter(|(t, _)| time.contains(t)).collect()
    };
    let top = curves.iter().flat_map(&shown).map(|(_, f)| f).fold(0.1, f64::max);
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(56)
        .build_cartesian_2d(time.clone(), -0.05 * top..1.1 * top)
        .map_err(text)?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .y_desc("force, N")
        .light_line_style(WHITE)
        .draw()
        .map_err(text)?;
    for curve in curves {
        let color = curve.color;
        chart.draw_series(LineSeries::new(shown(curve), color.stroke_width(1))).map_err(text)?;
    }
    Ok(())
}

/// Converts an error of plotters, which has references to its canvas, to text.
fn text(error: impl std::fmt::Display) -> Box<dyn std::error::Error + Send + Sync> {
    error.to_string().into()
}
