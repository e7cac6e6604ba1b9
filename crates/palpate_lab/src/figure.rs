//! Figures: curves over one axis, with units and a legend.

use crate::error::LabError;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

/// One curve.
pub(crate) struct Curve {
    pub(crate) name: &'static str,
    pub(crate) points: Vec<(f64, f64)>,
}

/// What stands around the curves.
pub(crate) struct Frame {
    pub(crate) title: &'static str,
    pub(crate) x: &'static str,
    pub(crate) y: &'static str,
    /// Both axes logarithmic.
    pub(crate) log: bool,
}

/// Colours that are told apart with any kind of sight (Okabe and Ito).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
];

/// The figure as the text of an SVG file.
pub(crate) fn svg(frame: &Frame, curves: &[Curve]) -> Result<String, LabError> {
    let points = || curves.iter().flat_map(|curve| curve.points.iter().copied());
    let span = |pick: fn((f64, f64)) -> f64| {
        let values = || points().map(pick).filter(|v| v.is_finite() && (!frame.log || *v > 0.0));
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let ((x0, x1), (y0, y1)) = (span(|p| p.0), span(|p| p.1));
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 480)).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        if frame.log {
            draw(&area, frame, curves, (x0..x1).log_scale(), (0.8 * y0..1.25 * y1).log_scale())?;
        } else {
            let pad = 0.05 * (y1 - y0);
            draw(&area, frame, curves, x0..x1, y0 - pad..y1 + pad)?;
        }
        area.present().map_err(failed)?;
    }
    Ok(text)
}

fn draw<X, Y>(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    frame: &Frame,
    curves: &[Curve],
    x: X,
    y: Y,
) -> Result<(), LabError>
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let (left, right) = area.split_horizontally(740);
    let mut chart = ChartBuilder::on(&left)
        .caption(frame.title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)
        .map_err(failed)?;
    chart.configure_mesh().x_desc(frame.x).y_desc(frame.y).light_line_style(WHITE).draw().map_err(failed)?;
    for (line, (curve, color)) in curves.iter().zip(COLORS.iter().cycle()).enumerate() {
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), color.stroke_width(1)))
            .map_err(failed)?;
        let y = 60 + 22 * line as i32;
        right.draw(&PathElement::new([(4, y), (24, y)], color.stroke_width(2))).map_err(failed)?;
        right.draw(&Text::new(curve.name, (30, y - 6), ("sans-serif", 12))).map_err(failed)?;
    }
    Ok(())
}

fn failed(error: impl std::fmt::Display) -> LabError {
    LabError::Figure(error.to_string())
}
