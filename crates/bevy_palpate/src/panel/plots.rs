//! The panel's plots.

use super::history::ForceComponent;
use super::theme;
use super::tool_history::ToolHistory;
use bevy_egui::egui::{self, Color32};
use egui_plot::{
    AxisHints, GridInput, GridMark, HLine, Line, LineStyle, Plot, PlotPoint, PlotPoints, PlotUi, VLine,
};
use palpate_haptics::TimeHistogram;
use palpate_local::Scheme;
use palpate_reduce::{Bode, BodePoint};
use std::ops::RangeInclusive;

/// Length of a tick, s.
const TICK_S: f64 = 1e-3;
/// Number of buckets in a curve, with two points each.
const BUCKETS: u64 = 250;
const HEIGHT: f32 = 118.0;
/// Width of the y axis.
const WIDTH: f32 = 44.0;

/// Points of the drawn curves. Reused in every frame, to reuse their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct CurvePoints {
    of: Option<(u64, u64, ForceComponent)>,
    full: Vec<PlotPoint>,
    schemes: [Vec<PlotPoint>; 6],
    errors: [Vec<PlotPoint>; 6],
}

impl CurvePoints {
    /// Computes the points of the last `seconds`, if a curve has changed.
    pub(super) fn refresh(&mut self, history: &ToolHistory, seconds: f64, along: ForceComponent) {
        let newest = history.newest.unwrap_or(0);
        let ticks = (seconds / TICK_S) as u64;
        // Curves that are computed in the background lag behind their samples.
        let progress: u64 = history.schemes.iter().filter_map(super::history::Curve::newest).sum();
        let now = (newest + progress, ticks, along);
        if self.of.replace(now) == Some(now) {
            return;
        }
        let from = newest.saturating_sub(ticks);
        let at = |sequence: u64| (sequence as f64 - newest as f64) * TICK_S;
        let curves = std::iter::once((&history.full, &mut self.full));
        for (curve, points) in curves.chain(history.schemes.iter().zip(&mut self.schemes)) {
            points.clear();
            let emit = |sequence, y| points.push(PlotPoint::new(at(sequence), y));
            curve.decimate(along, from, (ticks / BUCKETS).max(1), emit);
        }
        for (trace, points) in history.errors.iter().zip(&mut self.errors) {
            points.clear();
            let recent = trace.points.iter().filter(|(sequence, _)| *sequence > from);
            points.extend(recent.map(|(sequence, share)| PlotPoint::new(at(*sequence), log(100.0 * share))));
        }
    }

    /// Draws the force of the full body and of the schemes for which `draws` is true, the running one on top.
    pub(super) fn force(
        &self,
        ui: &mut egui::Ui,
        seconds: f64,
        running: Scheme,
        draws: impl Fn(Scheme) -> bool,
    ) {
        plain("palpate_force")
            .height(HEIGHT)
            .include_x(-seconds)
            .include_x(0.0)
            .include_y(0.0)
            .include_y(0.1)
            .custom_x_axes(vec![seconds_axis()])
            .custom_y_axes(vec![y_axis(|mark| format!("{} N", egui_plot::format_number(mark.value, 2)))])
            .show(ui, |plot| {
                draw(plot, &self.full, theme::FULL, 3.0);
                for (scheme, points) in in_order(&self.schemes, running).filter(|(s, _)| draws(*s)) {
                    draw(plot, points, theme::color(scheme), if scheme == running { 1.6 } else { 1.1 });
                }
            });
    }

    /// Draws the errors relative to the full body's force on a logarithmic scale, with the just noticeable difference.
    pub(super) fn error(
        &self,
        ui: &mut egui::Ui,
        seconds: f64,
        running: Scheme,
        draws: impl Fn(Scheme) -> bool,
    ) {
        let jnd = log(100.0 * crate::tool::ForceError::FORCE_JND);
        plain("palpate_error")
            .height(HEIGHT)
            .include_x(-seconds)
            .include_x(0.0)
            .include_y(-1.0)
            .include_y(2.0)
            .y_grid_spacer(decades)
            .custom_x_axes(vec![seconds_axis()])
            .custom_y_axes(vec![y_axis(|mark| of_decade(mark, |percent| format!("{percent} %")))])
            .show(ui, |plot| {
                let line = HLine::new("just noticeable, 7 %", jnd).color(theme::RED);
                plot.hline(line.style(LineStyle::dashed_dense()).width(1.2));
                for (scheme, points) in in_order(&self.errors, running).filter(|(s, _)| draws(*s)) {
                    draw(plot, points, theme::color(scheme), if scheme == running { 2.0 } else { 1.2 });
                }
            });
    }
}

/// The schemes with their elements of `of`, the running one last.
fn in_order<T>(of: &[T; 6], running: Scheme) -> impl Iterator<Item = (Scheme, &T)> {
    let all = || Scheme::ALL.into_iter().zip(of);
    all().filter(move |(s, _)| *s != running).chain(all().filter(move |(s, _)| *s == running))
}

/// Draws a line through `points`, broken at each NaN.
fn draw<'a>(plot: &mut PlotUi<'a>, points: &'a [PlotPoint], color: Color32, width: f32) {
    for part in points.split(|point| point.y.is_nan()).filter(|part| !part.is_empty()) {
        plot.line(Line::new("", PlotPoints::Borrowed(part)).color(color).width(width).allow_hover(false));
    }
}

/// An axis with a label at every mark, as far as the space allows.
fn labelled<'a>(axis: AxisHints<'a>, label: impl Fn(GridMark) -> String + 'a) -> AxisHints<'a> {
    let formatter = move |mark: GridMark, _: &RangeInclusive<f64>| label(mark);
    axis.formatter(formatter).label_spacing(egui::Rangef::new(9.0, 18.0)).min_thickness(14.0)
}

/// The time axis, in seconds before now.
fn seconds_axis() -> AxisHints<'static> {
    labelled(AxisHints::new_x(), |mark| format!("{} s", mark.value))
}

/// The y axis, with the same width in all plots, to align them.
fn y_axis<'a>(label: impl Fn(GridMark) -> String + 'a) -> AxisHints<'a> {
    labelled(AxisHints::new_y(), label).min_thickness(WIDTH)
}

/// A plot without interaction: it follows its data, and the wheel scrolls the panel.
fn plain(id: &str) -> Plot<'_> {
    Plot::new(id)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_double_click_reset(false)
        .allow_axis_zoom_drag(false)
        .set_margin_fraction(egui::vec2(0.0, 0.05))
        .label_formatter(|_| None)
}

/// log₁₀, with a lower bound for zero.
fn log(value: f64) -> f64 {
    value.max(1e-3).log10()
}

/// Marks at whole decades, fine ones between.
fn decades(input: GridInput) -> Vec<GridMark> {
    let (low, high) = (input.bounds.0.floor() as i32, input.bounds.1.ceil() as i32);
    let fine = |decade: i32| {
        (2..10).map(move |i| GridMark { value: f64::from(decade) + f64::from(i).log10(), step_size: 0.1 })
    };
    let marks = (low..=high).flat_map(|decade| {
        std::iter::once(GridMark { value: f64::from(decade), step_size: 1.0 }).chain(fine(decade))
    });
    // Labels of marks outside the bounds would be drawn outside the plot.
    marks.filter(|mark| (input.bounds.0..=input.bounds.1).contains(&mark.value)).collect()
}

/// The label of a whole decade; empty for marks in between.
fn of_decade(mark: GridMark, label: impl Fn(f64) -> String) -> String {
    let is_whole = (mark.value - mark.value.round()).abs() < 1e-9;
    if is_whole { label(10f64.powi(mark.value.round() as i32)) } else { String::new() }
}

/// Number of bars of a histogram in a decade.
const BARS_PER_DECADE: f64 = 6.0;
/// Lower end of the histogram, 100 ns, as log₁₀ of µs; the upper end is 100 ms.
const FROM: f64 = -1.0;
const BARS: usize = 36;

/// Draws the histogram of lateness with two logarithmic axes, which keep a single late tick visible.
pub(super) fn lateness(ui: &mut egui::Ui, histogram: &TimeHistogram) {
    let counts = bars(histogram.recorded_us());
    let max = counts.iter().copied().max().unwrap_or(0).max(9) as f64;
    plain("palpate_lateness")
        .height(100.0)
        .include_x(FROM)
        .include_x(FROM + BARS as f64 / BARS_PER_DECADE)
        .include_y(0.0)
        .include_y((1.0 + max).log10())
        .x_grid_spacer(decades)
        .y_grid_spacer(decades)
        .custom_x_axes(vec![labelled(AxisHints::new_x(), |mark| of_decade(mark, microseconds))])
        .custom_y_axes(vec![y_axis(|mark| of_decade(mark, |count| format!("{count}×")))])
        .show(ui, |plot| {
            for (i, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
                let left = FROM + i as f64 / BARS_PER_DECADE;
                let right = left + 0.92 / BARS_PER_DECADE;
                let color = if right > 3.0 { theme::RED } else { theme::color(Scheme::KrylovLinear) };
                let height = (1.0 + count as f64).log10();
                let corners = vec![[left, 0.0], [left, height], [right, height], [right, 0.0]];
                let bar = egui_plot::Polygon::new("", corners).fill_color(color.gamma_multiply(0.8));
                plot.polygon(bar.stroke(egui::Stroke::new(0.5, color)));
            }
            plot.vline(VLine::new("deadline", 3.0).color(theme::RED).style(LineStyle::dashed_dense()));
        });
}

/// Number of times (µs, count) in each bar; values out of range count in the first or last one.
fn bars(times: impl Iterator<Item = (f64, u64)>) -> [u64; BARS] {
    let mut counts = [0; BARS];
    for (us, count) in times {
        let bar = ((us.max(1e-3).log10() - FROM) * BARS_PER_DECADE).clamp(0.0, BARS as f64 - 1.0);
        counts[bar as usize] += count;
    }
    counts
}

fn microseconds(us: f64) -> String {
    if us >= 1000.0 { format!("{} ms", us / 1000.0) } else { format!("{us} µs") }
}

fn hertz(hz: f64) -> String {
    if hz >= 1000.0 { format!("{} kHz", hz / 1000.0) } else { format!("{hz} Hz") }
}

/// Draws gain and phase of full body and local model.
pub(super) fn bode(ui: &mut egui::Ui, bode: &Bode) {
    let color = theme::color(bode.scheme);
    let gain = |p: &BodePoint| p.gain_db;
    half(ui, ("palpate_gain", 110.0), bode, color, gain, (" dB", false));
    half(ui, ("palpate_phase", 90.0), bode, color, |p| p.phase_deg, ("°", true));
}

fn half(
    ui: &mut egui::Ui,
    (id, height): (&str, f32),
    bode: &Bode,
    color: Color32,
    of: impl Fn(&BodePoint) -> f64,
    (unit, is_phase): (&'static str, bool),
) {
    let of_all = |points: &[BodePoint]| -> Vec<PlotPoint> {
        points.iter().map(|p| PlotPoint::new(p.frequency_hz.log10(), of(p))).collect()
    };
    let (full, local) = (of_all(&bode.full), of_all(&bode.local));
    let mut plot = plain(id)
        .height(height)
        .include_x(-1.05)
        .include_x(3.2)
        .x_grid_spacer(decades)
        .custom_x_axes(vec![labelled(AxisHints::new_x(), |mark| of_decade(mark, hertz))])
        .custom_y_axes(vec![y_axis(move |mark| format!("{}{unit}", mark.value))]);
    if is_phase {
        let marks = |i: i32| GridMark { value: 90.0 * f64::from(i), step_size: 90.0 };
        plot = plot.include_y(0.0).include_y(180.0).y_grid_spacer(move |_| (-2..=2).map(marks).collect());
    }
    plot.show(ui, |plot| {
        draw(plot, &full, theme::FULL, 3.0);
        draw(plot, &local, color, 1.6);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_time_counts_in_one_bar() {
        let times = [(0.01, 1), (0.1, 2), (0.99, 3), (1.0, 4), (999.0, 5), (1000.0, 6), (1e9, 7)];
        let counts = bars(times.into_iter());
        assert_eq!(counts.iter().sum::<u64>(), 28);
        assert_eq!((counts[0], counts[5], counts[6], counts[23], counts[24], counts[35]), (3, 3, 4, 5, 6, 7));
    }

    #[test]
    fn only_whole_decades_have_labels() {
        let label = |value| of_decade(GridMark { value, step_size: 1.0 }, microseconds);
        assert_eq!((label(0.0), label(3.0), label(-1.0)), ("1 µs".into(), "1 ms".into(), "0.1 µs".into()));
        assert_eq!(label(2f64.log10()), "");
        let marks = decades(GridInput { bounds: (-0.5, 1.2), base_step_size: 0.1 });
        let whole: Vec<f64> = marks.iter().filter(|m| m.step_size == 1.0).map(|m| m.value).collect();
        assert_eq!(whole, [0.0, 1.0]);
    }

    #[test]
    fn running_scheme_is_drawn_on_top() {
        let of = [0, 1, 2, 3, 4, 5];
        let order: Vec<i32> = in_order(&of, Scheme::Tangent).map(|(_, i)| *i).collect();
        assert_eq!(order, [0, 1, 3, 4, 5, 2]);
    }
}
