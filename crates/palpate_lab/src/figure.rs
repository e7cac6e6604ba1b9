//! Figures: panels of curves, with units and a legend.

use crate::error::LabError;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

/// Drawing area of an SVG file.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Curve of a panel.
#[derive(Clone)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Points (x, y).
    pub points: Vec<(f64, f64)>,
    /// Line width, pixels.
    pub width: u32,
}

/// Scale of a panel's axes.
#[derive(Clone, Copy, PartialEq)]
pub enum Scale {
    /// Both axes linear.
    Linear,
    /// Both axes logarithmic.
    Log,
    /// Horizontal axis logarithmic.
    LogX,
    /// Vertical axis logarithmic.
    LogY,
}

/// Curves over one horizontal axis.
pub struct Panel {
    /// Title above the chart.
    pub title: String,
    /// Label of the horizontal axis, with its unit.
    pub x: &'static str,
    /// Label of the vertical axis, with its unit.
    pub y: &'static str,
    /// Scale of both axes.
    pub scale: Scale,
    /// Curves; later ones are drawn on top.
    pub curves: Vec<Curve>,
}

impl Curve {
    /// Curve with a narrow line.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), points: points.into_iter().collect(), width: 1 }
    }

    /// Curve with a broad, pale line: the reference that other curves are compared with.
    pub fn broad(self) -> Self {
        Self { width: 4, ..self }
    }
}

/// Colours that are distinguishable with colour vision deficiency (Okabe and Ito).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
];

/// Colour of broad lines: pale, to leave the narrow lines on them visible.
const PALE: RGBColor = RGBColor(110, 190, 235);

/// Panels in `columns` as the text of an SVG file. The legend is that of the first panel.
///
/// # Errors
/// [`LabError::Figure`] when a panel cannot be drawn.
pub fn svg(panels: &[Panel], columns: usize) -> Result<String, LabError> {
    let rows = panels.len().div_ceil(columns);
    let (width, height) =
        if panels.len() == 1 { (760, 400) } else { (500 * columns as u32, 290 * rows as u32) };
    let legend = Legend::new(entries(panels.first().map_or(&[][..], |panel| &panel.curves)), width);
    canvas((width, height + 12 + legend.height()), |area| {
        let (charts, below) = area.split_vertically(height);
        for (panel, place) in panels.iter().zip(charts.split_evenly((rows, columns))) {
            panel.draw(&place, None, &[])?;
        }
        legend.draw(&below)
    })
}

/// Coloured bands behind the curves: the time spans in which a condition holds.
pub struct Bands {
    /// Name in the legend.
    pub name: &'static str,
    /// Start and end of each span on the horizontal axis.
    pub spans: Vec<(f64, f64)>,
    /// Fill colour.
    pub color: RGBColor,
}

/// Panels one below the other over one horizontal axis, each with its legend, and `bands` behind all of them.
///
/// # Errors
/// [`LabError::Figure`] when a panel cannot be drawn.
pub fn stacked(panels: &[Panel], bands: &[Bands]) -> Result<String, LabError> {
    const SIZE: (u32, u32) = (960, 250);
    let all = panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
    let x = range(all.map(|point| point.0), false);
    let legends: Vec<Legend> =
        panels.iter().map(|panel| Legend::new(entries(&panel.curves), SIZE.0)).collect();
    let shown = bands.iter().filter(|band| !band.spans.is_empty());
    let behind = Legend::new(shown.map(|band| (band.name.into(), band.color, 12)).collect(), SIZE.0);
    let height = legends.iter().map(|legend| SIZE.1 + legend.height()).sum::<u32>() + 12 + behind.height();
    canvas((SIZE.0, height), |area| {
        let mut rest = area.clone();
        for (panel, legend) in panels.iter().zip(&legends) {
            let (chart, below) = rest.split_vertically(SIZE.1);
            let (below, next) = below.split_vertically(legend.height());
            panel.draw(&chart, Some(x), bands)?;
            legend.draw(&below)?;
            rest = next;
        }
        behind.draw(&rest)
    })
}

/// Legend: names next to strokes, broken into lines of the figure's width.
struct Legend {
    entries: Vec<(String, RGBColor, u32)>,
    /// Lengths of the entries, pixels, line by line.
    lines: Vec<Vec<i32>>,
    width: u32,
}

/// Legend entries of `curves`: name, colour and line width.
fn entries(curves: &[Curve]) -> Vec<(String, RGBColor, u32)> {
    let each = curves.iter().zip(colors(curves));
    each.map(|(curve, color)| (curve.name.clone(), color, curve.width.max(2))).collect()
}

impl Legend {
    /// Height of a line, pixels.
    const LINE: u32 = 22;

    fn new(entries: Vec<(String, RGBColor, u32)>, width: u32) -> Self {
        let mut lines: Vec<Vec<i32>> = vec![Vec::new()];
        // Letters of this size are about 7 pixels wide.
        for length in entries.iter().map(|(name, ..)| 60 + 7 * name.len() as i32) {
            let is_full = lines.last().is_some_and(|line| line.iter().sum::<i32>() + length > width as i32);
            if is_full && lines.last().is_some_and(|line| !line.is_empty()) {
                lines.push(Vec::new());
            }
            if let Some(line) = lines.last_mut() {
                line.push(length);
            }
        }
        Self { entries, lines, width }
    }

    fn height(&self) -> u32 {
        Self::LINE * self.lines.len() as u32
    }

    fn draw(&self, area: &Area<'_>) -> Result<(), LabError> {
        let mut entries = self.entries.iter();
        for (i, line) in self.lines.iter().enumerate() {
            let y = 14 + (Self::LINE as usize * i) as i32;
            let mut x = (self.width as i32 - line.iter().sum::<i32>()).max(0) / 2;
            for (length, (name, color, width)) in line.iter().zip(&mut entries) {
                let stroke = PathElement::new([(x, y), (x + 26, y)], color.stroke_width(*width));
                area.draw(&stroke).map_err(failed)?;
                let name = Text::new(name.clone(), (x + 32, y - 6), ("sans-serif", 12));
                area.draw(&name).map_err(failed)?;
                x += length;
            }
        }
        Ok(())
    }
}

/// SVG text of `size` pixels with the result of `draw` on white.
///
/// # Errors
/// The error of `draw`; [`LabError::Figure`] when the figure cannot be completed.
pub fn canvas(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), LabError>,
) -> Result<String, LabError> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        draw(&area)?;
        area.present().map_err(failed)?;
    }
    Ok(text)
}

/// Error of a drawing operation.
pub fn failed(error: impl std::fmt::Display) -> LabError {
    LabError::Figure(error.to_string())
}

/// Axis label of `value`, without trailing zeros.
fn label(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn colors(curves: &[Curve]) -> impl Iterator<Item = RGBColor> {
    let mut narrow = COLORS.iter().cycle();
    curves.iter().map(move |curve| if curve.width > 1 { PALE } else { *narrow.next().unwrap_or(&BLACK) })
}

/// Axis range of `values` with a margin. A logarithmic range ignores values that are not positive.
fn range(values: impl Iterator<Item = f64>, log: bool) -> (f64, f64) {
    let values = values.filter(|v| v.is_finite() && (!log || *v > 0.0));
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match (low <= high, log) {
        (false, _) => (1.0, 10.0),
        (true, true) => (0.8 * low, 1.25 * high),
        (true, false) => {
            let pad = if low < high { 0.05 * (high - low) } else { 1.0 };
            (low - pad, high + pad)
        }
    }
}

impl Panel {
    /// Draws the panel, over the horizontal range `x` if it is given.
    fn draw(&self, area: &Area<'_>, x: Option<(f64, f64)>, bands: &[Bands]) -> Result<(), LabError> {
        let (log_x, log_y) = match self.scale {
            Scale::Linear => (false, false),
            Scale::Log => (true, true),
            Scale::LogX => (true, false),
            Scale::LogY => (false, true),
        };
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let (x0, x1) = x.unwrap_or_else(|| range(points().map(|point| point.0), log_x));
        let (y0, y1) = range(points().map(|point| point.1), log_y);
        match (log_x, log_y) {
            (false, false) => self.chart(area, x0..x1, y0..y1, (y0, y1), bands),
            (false, true) => self.chart(area, x0..x1, (y0..y1).log_scale(), (y0, y1), bands),
            (true, false) => self.chart(area, (x0..x1).log_scale(), y0..y1, (y0, y1), bands),
            (true, true) => self.chart(area, (x0..x1).log_scale(), (y0..y1).log_scale(), (y0, y1), bands),
        }
    }

    fn chart<X, Y>(
        &self,
        area: &Area<'_>,
        x: X,
        y: Y,
        (low, high): (f64, f64),
        bands: &[Bands],
    ) -> Result<(), LabError>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 16))
            .margin(10)
            .x_label_area_size(if self.x.is_empty() { 22 } else { 38 })
            .y_label_area_size(62)
            .build_cartesian_2d(x, y)
            .map_err(failed)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.x).y_desc(self.y).light_line_style(TRANSPARENT).x_labels(8).y_labels(6);
        mesh.x_label_formatter(&|v| label(*v)).y_label_formatter(&|v| label(*v));
        mesh.label_style(("sans-serif", 11)).axis_desc_style(("sans-serif", 12)).draw().map_err(failed)?;
        for band in bands {
            // A line on the left keeps a single tick visible.
            let span =
                |&(from, to): &(f64, f64)| Rectangle::new([(from, low), (to, high)], band.color.filled());
            chart.draw_series(band.spans.iter().map(span)).map_err(failed)?;
            let line = |&(from, _): &(f64, f64)| PathElement::new([(from, low), (from, high)], band.color);
            chart.draw_series(band.spans.iter().map(line)).map_err(failed)?;
        }
        for (curve, color) in self.curves.iter().zip(colors(&self.curves)) {
            let line = LineSeries::new(curve.points.iter().copied(), color.stroke_width(curve.width));
            chart.draw_series(line).map_err(failed)?;
        }
        Ok(())
    }
}
