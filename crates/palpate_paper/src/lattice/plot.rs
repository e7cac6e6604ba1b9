//! Figures of a mesh: responses, states and the mesh itself.

use super::analysis::{Analysis, Response};
use super::options::Method;
use palpate_lab::error::LabError;
use palpate_lab::figure::{Area, Curve, Panel, Scale, canvas, failed, svg};
use plotters::prelude::*;
use std::collections::HashSet;

/// Figs. 5, 9 and 11: magnitude and phase along the normal and along a tangent.
pub(crate) fn response_panels(analysis: &Analysis) -> Vec<Panel> {
    let report = &analysis.report;
    let hz = &report.response.frequency_hz;
    let reduced = method_name(report.method);
    let responses = [
        ("full", Some(&report.response)),
        (reduced.as_str(), (report.method != Method::Full).then_some(&report.reduced_response)),
        ("balanced, as many states", analysis.balanced.as_ref()),
    ];
    let panel = |title: &str, y, scale, pick: &dyn Fn(&Response) -> Option<Vec<f64>>| {
        let curves = responses.iter().filter_map(|(name, response)| {
            let values = pick((*response)?)?;
            let curve = Curve::new(*name, hz.iter().copied().zip(values));
            Some(if *name == "full" { curve.broad() } else { curve })
        });
        Panel { title: title.into(), x: "frequency, Hz", y, scale, curves: curves.collect() }
    };
    let (force, phase) = ("force over displacement, N/m", "phase, rad");
    let mut panels = vec![panel("normal", force, Scale::Log, &|r| Some(r.normal_abs_n_per_m.clone()))];
    if report.response.tangential_abs_n_per_m.is_some() {
        panels.push(panel("tangential", force, Scale::Log, &|r| r.tangential_abs_n_per_m.clone()));
    }
    panels.push(panel("normal", phase, Scale::LogX, &|r| Some(r.normal_phase_rad.clone())));
    if report.response.tangential_phase_rad.is_some() {
        panels.push(panel("tangential", phase, Scale::LogX, &|r| r.tangential_phase_rad.clone()));
    }
    panels
}

/// Hankel singular values above rounding.
pub(super) fn hankel_panel(analysis: &Analysis) -> Panel {
    let values = analysis.report.hankel_singular_values.as_deref().unwrap_or_default();
    let largest = values.first().copied().unwrap_or(0.0);
    let points = values.iter().enumerate().map(|(i, &value)| (i as f64 + 1.0, value));
    let points = points.take_while(|(_, value)| *value > 1e-15 * largest);
    Panel {
        title: "Hankel singular values".into(),
        x: "index",
        y: "N/m",
        scale: Scale::Log,
        curves: vec![Curve::new("full", points)],
    }
}

fn method_name(method: Method) -> String {
    use clap::ValueEnum;
    method.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// Maximum number of states in the figure.
const MAX_STATES: usize = 12;

/// Fig. 6: displacement of each node in each reduced state. In three dimensions, in the plane through the tool.
pub(crate) fn states(analysis: &Analysis) -> Result<String, LabError> {
    let magnitudes = analysis.state_magnitudes().unwrap_or_default();
    let shown = &magnitudes[..magnitudes.len().min(MAX_STATES)];
    let lattice = analysis.specimen.lattice()?;
    if analysis.specimen.dimension == 1 {
        let curves = shown.iter().enumerate().map(|(i, state)| {
            let points = state.iter().enumerate().map(|(node, &value)| (node as f64, value));
            Curve::new(format!("state {}", i + 1), points)
        });
        let title = "Displacement of each state".into();
        let (x, y, scale) = ("node; the tool is at the last", "relative to the largest", Scale::Linear);
        return svg(&[Panel { title, x, y, scale, curves: curves.collect() }], 1);
    }
    let (columns, side) = (4, 190);
    let rows = shown.len().div_ceil(columns);
    let (width, height) = ((columns * side) as u32, (rows * (side + 20)) as u32);
    let driven = analysis.specimen.driven()?;
    canvas((width, height + LEGEND), |area| {
        let (maps, below) = area.split_vertically(height);
        for i in 0..=10 {
            let x = 20 + 12 * i;
            let box_at = [(x, 8), (x + 12, 20)];
            below.draw(&Rectangle::new(box_at, shade(0.1 * f64::from(i)).filled())).map_err(failed)?;
        }
        let scale = "displacement, 0 to the largest of the state";
        write_text(&below, (160, 8), scale)?;
        below.draw(&Rectangle::new([(440, 8), (452, 20)], TOOL.filled())).map_err(failed)?;
        write_text(&below, (458, 8), "tool; x to the right, depth downward")?;
        for ((i, state), place) in shown.iter().enumerate().zip(maps.split_evenly((rows, columns))) {
            let inner = titled(&place, &format!("state {}", i + 1))?;
            let n = analysis.specimen.cells + 1;
            let (width, height) = inner.dim_in_pixel();
            for (column, depth) in (0..n).flat_map(|column| (0..n).map(move |depth| (column, depth))) {
                let mut ijk = driven;
                ijk[0] = column;
                ijk[analysis.specimen.dimension - 1] = analysis.specimen.cells - depth;
                let edge = |i: usize, length: u32| (i * length as usize / n) as i32;
                let corners = [
                    (edge(column, width), edge(depth, height)),
                    (edge(column + 1, width), edge(depth + 1, height)),
                ];
                // The node of the tool is an input and no state.
                let tool = (ijk == driven).then_some(TOOL);
                let color = tool.unwrap_or_else(|| shade(state[lattice.node(ijk)]));
                inner.draw(&Rectangle::new(corners, color.filled())).map_err(failed)?;
            }
        }
        Ok(())
    })
}

/// Height of a legend, pixels.
const LEGEND: u32 = 30;
/// Colour of the tool.
const TOOL: RGBColor = RGBColor(213, 94, 0);

fn write_text(area: &Area<'_>, at: (i32, i32), text: &str) -> Result<(), LabError> {
    area.draw(&Text::new(text.to_owned(), at, ("sans-serif", 12))).map_err(failed)
}

/// Part of `area` below its title.
fn titled<'a>(area: &Area<'a>, title: &str) -> Result<Area<'a>, LabError> {
    let inner = area.margin(6, 6, 6, 6);
    inner.titled(title, ("sans-serif", 12)).map_err(failed)
}

/// Colour from pale to dark blue for 0 to 1.
fn shade(value: f64) -> RGBColor {
    let between = |low: f64, high: f64| (low + value.clamp(0.0, 1.0) * (high - low)).round() as u8;
    RGBColor(between(238.0, 8.0), between(243.0, 48.0), between(248.0, 107.0))
}

/// Figs. 4, 8 and 10, and in one dimension 12 to 14: the mesh, or in three dimensions its plane through the tool. The driven node is
/// large, free nodes are dark. Springs of the reduced model are dark, scaled springs have the colour of the tool.
pub(crate) fn mesh(analysis: &Analysis) -> Result<String, LabError> {
    let specimen = analysis.specimen;
    let (network, lattice) = (specimen.network()?, specimen.lattice()?);
    let (driven, normal) = (specimen.driven()?, specimen.dimension - 1);
    let moving: HashSet<usize> = analysis.moving.iter().map(|(node, _)| *node).collect();
    let tool = lattice.node(driven);
    let grid: Vec<[usize; 3]> = lattice.grid().collect();
    let in_plane = |node: usize| (1..normal).all(|axis| grid[node][axis] == driven[axis]);
    let (side, margin) = (460, 24.0);
    let step = (f64::from(side) - 2.0 * margin) / specimen.cells as f64;
    let pixel = |node: usize| {
        let at = |cells: usize| (margin + step * cells as f64) as i32;
        let deep = at(specimen.cells - grid[node][normal]);
        // A chain is drawn horizontally.
        if normal == 0 { (deep, margin as i32) } else { (at(grid[node][0]), deep) }
    };
    let (tint, dark, faint) = (TOOL, RGBColor(0, 114, 178), RGBColor(190, 190, 190));
    let is_retained = |node: usize| node == tool || moving.contains(&node);
    let style = |ends: usize| match ends {
        0 => faint.stroke_width(1),
        1 if analysis.report.method == Method::Scaled => tint.stroke_width(2),
        _ => dark.stroke_width(2),
    };
    let height = if normal == 0 { 2 * margin as u32 } else { side };
    let is_scaled = analysis.report.method == Method::Scaled;
    let legend = [("tool", tint), ("free", dark), ("fixed", faint), ("scaled springs", tint)];
    let entries = if is_scaled { &legend[..] } else { &legend[..3] };
    canvas((side, height + LEGEND), |area| {
        for (i, &(name, color)) in entries.iter().enumerate() {
            let (x, y) = (40 + 100 * i as i32, height as i32 + 12);
            if i == 3 {
                let line = PathElement::new([(x - 10, y), (x + 6, y)], color.stroke_width(2));
                area.draw(&line).map_err(failed)?;
            } else {
                area.draw(&Circle::new((x, y), if i == 0 { 8 } else { 4 }, color.filled()))
                    .map_err(failed)?;
            }
            write_text(area, (x + 14, y - 6), name)?;
        }
        let links = || network.links().iter().filter(|link| in_plane(link.a) && in_plane(link.b));
        // Springs of the reduced model are drawn last, on top.
        for ends in 0..=2 {
            let retained_ends =
                |a: usize, b: usize| usize::from(is_retained(a)) + usize::from(is_retained(b));
            for link in links().filter(|link| retained_ends(link.a, link.b) == ends) {
                let line = PathElement::new([pixel(link.a), pixel(link.b)], style(ends));
                area.draw(&line).map_err(failed)?;
            }
        }
        for node in (0..network.node_count()).filter(|&node| in_plane(node)) {
            let (radius, color) = match (node == tool, moving.contains(&node)) {
                (true, _) => (8, tint),
                (_, true) => (4, dark),
                _ => (3, faint),
            };
            area.draw(&Circle::new(pixel(node), radius, color.filled())).map_err(failed)?;
        }
        Ok(())
    })
}
