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
/// Buckets of a curve: two points each.
const BUCKETS: u64 = 250;
const HEIGHT: f32 = 118.0;
/// Width of the y axis.
const WIDTH: f32 = 44.0;

/// Points to be drawn, kept from frame to frame so that their room is.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlotPoints {
    of: Option<(u64, u64, ForceComponent)>,
    full: Vec<PlotPoint>,
    schemes: [Vec<PlotPoint>; 6],
    errors: [Vec<PlotPoint>; 6],
}

impl PlotPoints {
    /// Makes the points of the last `seconds` where there is anything new.
    pub(super) fn refresh(&mut self, watched: &ToolHistory, seconds: f64, along: ForceComponent) {
        let newest = watched.newest.unwrap_or(0);
        let ticks = (seconds / TICK_S) as u64;
        // Curves that are computed in the background come a little later than their samples.
        let told: u64 = watched.schemes.iter().filter_map(super::history::Curve::newest).sum();
        if self.of.replace((newest + told, ticks, along)) == Some((newest + told, ticks, along)) {
            return;
        }
        let from = newest.saturating_sub(ticks);
        let at = |sequence: u64| (sequence as f64 - newest as f64) * TICK_S;
        let curves = std::iter::once((&watched.full, &mut self.full));
        for (curve, points) in curves.chain(watched.schemes.iter().zip(&mut self.schemes)) {
            points.clear();
            let found = |sequence, y| points.push(PlotPoint::new(at(sequence), y));
            curve.decimate(along, from, (ticks / BUCKETS).max(1), found);
        }
        for (trace, points) in watched.errors.iter().zip(&mut self.errors) {
            points.clear();
            let late = trace.points.iter().filter(|(sequence, _)| *sequence > from);
            points.extend(late.map(|(sequence, share)| PlotPoint::new(at(*sequence), log(100.0 * share))));
        }
    }

    /// The force of the full body and of the schemes that `draws`, the running one on top.
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

    /// The errors as shares of the full body's force, on a logarithmic scale, with what a person just notices.
    pub(super) fn error(
        &self,
        ui: &mut egui::Ui,
        seconds: f64,
        running: Scheme,
        draws: impl Fn(Scheme) -> bool,
    ) {
        let noticeable = log(100.0 * crate::tool::ForceError::FORCE_JND);
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
                let jnd = HLine::new("just noticeable, 7 %", noticeable).color(theme::RED);
                plot.hline(jnd.style(LineStyle::dashed_dense()).width(1.2));
                for (scheme, points) in in_order(&self.errors, running).filter(|(s, _)| draws(*s)) {
                    draw(plot, points, theme::color(scheme), if scheme == running { 2.0 } else { 1.2 });
                }
            });
    }
}

/// The schemes with what belongs to them, the running one last.
fn in_order<T>(of: &[T; 6], running: Scheme) -> impl Iterator<Item = (Scheme, &T)> {
    let all = || Scheme::ALL.into_iter().zip(of);
    all().filter(move |(s, _)| *s != running).chain(all().filter(move |(s, _)| *s == running))
}

/// A line through `points`, broken at each NaN.
fn draw<'a>(plot: &mut PlotUi<'a>, points: &'a [PlotPoint], color: Color32, width: f32) {
    for part in points.split(|point| point.y.is_nan()).filter(|part| !part.is_empty()) {
        plot.line(Line::new("", PlotPoints::Borrowed(part)).color(color).width(width).allow_hover(false));
    }
}

/// An axis whose marks are all named, as long as there is room for them.
fn named<'a>(axis: AxisHints<'a>, words: impl Fn(GridMark) -> String + 'a) -> AxisHints<'a> {
    let formatter = move |mark: GridMark, _: &RangeInclusive<f64>| words(mark);
    axis.formatter(formatter).label_spacing(egui::Rangef::new(9.0, 18.0)).min_thickness(14.0)
}

/// Seconds before now.
fn seconds_axis() -> AxisHints<'static> {
    named(AxisHints::new_x(), |mark| format!("{} s", mark.value))
}

/// The y axis, as wide in all plots so that they stand under each other.
fn y_axis<'a>(words: impl Fn(GridMark) -> String + 'a) -> AxisHints<'a> {
    named(AxisHints::new_y(), words).min_thickness(WIDTH)
}

/// A plot that is looked at: it follows its data, and what turns the wheel over it scrolls the panel.
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

/// log₁₀, with a floor for what is nothing.
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
    // The names of what is outside would be drawn outside.
    marks.filter(|mark| (input.bounds.0..=input.bounds.1).contains(&mark.value)).collect()
}

/// The words of a whole decade; nothing for what lies between.
fn of_decade(mark: GridMark, words: impl Fn(f64) -> String) -> String {
    let is_whole = (mark.value - mark.value.round()).abs() < 1e-9;
    if is_whole { words(10f64.powi(mark.value.round() as i32)) } else { String::new() }
}

/// Bars of a histogram in a decade.
const IN_A_DECADE: f64 = 6.0;
/// From 100 ns to 100 ms, as log₁₀ of µs.
const FROM: f64 = -1.0;
const BARS: usize = 36;

/// How late ticks were, on a logarithmic scale; the height is log₁₀ of how often too, so that the one late tick is seen.
pub(super) fn lateness(ui: &mut egui::Ui, histogram: &TimeHistogram) {
    let counts = bars(histogram.recorded_us());
    let most = counts.iter().copied().max().unwrap_or(0).max(9) as f64;
    plain("palpate_lateness")
        .height(100.0)
        .include_x(FROM)
        .include_x(FROM + BARS as f64 / IN_A_DECADE)
        .include_y(0.0)
        .include_y((1.0 + most).log10())
        .x_grid_spacer(decades)
        .y_grid_spacer(decades)
        .custom_x_axes(vec![named(AxisHints::new_x(), |mark| of_decade(mark, microseconds))])
        .custom_y_axes(vec![y_axis(|mark| of_decade(mark, |count| format!("{count}×")))])
        .show(ui, |plot| {
            for (i, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
                let left = FROM + i as f64 / IN_A_DECADE;
                let right = left + 0.92 / IN_A_DECADE;
                let color = if right > 3.0 { theme::RED } else { theme::color(Scheme::KrylovLinear) };
                let height = (1.0 + count as f64).log10();
                let corners = vec![[left, 0.0], [left, height], [right, height], [right, 0.0]];
                let bar = egui_plot::Polygon::new("", corners).fill_color(color.gamma_multiply(0.8));
                plot.polygon(bar.stroke(egui::Stroke::new(0.5, color)));
            }
            plot.vline(VLine::new("deadline", 3.0).color(theme::RED).style(LineStyle::dashed_dense()));
        });
}

/// How often times (µs, count) fall into each bar; what is outside counts in the first or last.
fn bars(times: impl Iterator<Item = (f64, u64)>) -> [u64; BARS] {
    let mut counts = [0; BARS];
    for (us, count) in times {
        let bar = ((us.max(1e-3).log10() - FROM) * IN_A_DECADE).clamp(0.0, BARS as f64 - 1.0);
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

/// Gain and phase of full body and local model.
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
        .custom_x_axes(vec![named(AxisHints::new_x(), |mark| of_decade(mark, hertz))])
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
    fn every_time_falls_into_one_bar() {
        let times = [(0.01, 1), (0.1, 2), (0.99, 3), (1.0, 4), (999.0, 5), (1000.0, 6), (1e9, 7)];
        let counts = bars(times.into_iter());
        assert_eq!(counts.iter().sum::<u64>(), 28);
        assert_eq!((counts[0], counts[5], counts[6], counts[23], counts[24], counts[35]), (3, 3, 4, 5, 6, 7));
    }

    #[test]
    fn decades_are_named_and_what_lies_between_is_not() {
        let name = |value| of_decade(GridMark { value, step_size: 1.0 }, microseconds);
        assert_eq!((name(0.0), name(3.0), name(-1.0)), ("1 µs".into(), "1 ms".into(), "0.1 µs".into()));
        assert_eq!(name(2f64.log10()), "");
        let marks = decades(GridInput { bounds: (-0.5, 1.2), base_step_size: 0.1 });
        let whole: Vec<f64> = marks.iter().filter(|m| m.step_size == 1.0).map(|m| m.value).collect();
        assert_eq!(whole, [0.0, 1.0]);
    }

    #[test]
    fn the_running_scheme_is_drawn_on_top() {
        let of = [0, 1, 2, 3, 4, 5];
        let order: Vec<i32> = in_order(&of, Scheme::Tangent).map(|(_, i)| *i).collect();
        assert_eq!(order, [0, 1, 3, 4, 5, 2]);
    }
}
