//! Results of `palpate-lab probe`: JSON, table and CSV.

use super::arguments::Probe;
use super::hertz;
use super::options::{CouplingKind, Tool};
use super::press::PressAt;
use crate::app_tool::{COUPLING, limit_reached};
use crate::multirate::TICK_S;
use crate::output::csv;
use glam::DVec3;
use palpate_body::ImplausibleSize;
use serde::Serialize;
use std::io::Write;

#[derive(Serialize)]
pub(super) struct Report {
    pub(super) presses: Vec<PressReport>,
    /// (max − min) / mean of the normal force over the scan, of the full body; `None` without a scan or a force.
    ripple: Option<f64>,
    /// (max − min) / mean of the normal force over the scan, of the loop.
    loop_ripple: Option<f64>,
    /// Closed form of the half-space: Hertz's for a sphere, the flat punch's for a punch, N.
    hertz_n: f64,
    /// Sentences about an implausible size and a force at its limit, with the flag to change.
    warnings: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct PressReport {
    pub(super) x_mm: f64,
    pub(super) z_mm: f64,
    depth_mm: f64,
    /// Forces at the end of the press.
    pub(super) body_force_n: [f64; 3],
    pub(super) loop_force_n: [f64; 3],
    /// First tick with a force in the loop.
    first_force_tick: Option<usize>,
    /// First tick with a force of the body.
    body_first_force_tick: Option<usize>,
    /// First tick in which the tool overlaps the undeformed surface.
    crossing_tick: Option<usize>,
    unconverged_steps: usize,
    unconverged_ticks: usize,
    /// Maximum number of inverted cells after a model step.
    inverted_cells: usize,
    /// Maximum time of a model step of the body without its local model, ms.
    step_ms_max: f64,
    /// Median time of a model step of the body without its local model, ms.
    step_ms_p50: f64,
    /// Maximum time of building a local model, ms.
    build_ms_max: f64,
    /// Last tick.
    last_tick: usize,
    /// Whether the body had settled by the last tick.
    settled: bool,
}

impl Report {
    /// The report on `presses`, of which the first `at_count` are not part of the scan.
    pub(super) fn of(probe: &Probe, size_m: f64, presses: &[PressAt], at_count: usize) -> Self {
        let flag = if probe.mesh.is_some() { "--scale" } else { "--edge-m" };
        let size = ImplausibleSize::of(size_m).map(|size| format!("{size}; change {flag}"));
        let forces = presses.iter().flat_map(|at| &at.press.loop_n);
        let peak_n = forces.map(|force_n| force_n.length()).fold(0.0, f64::max);
        let limit = match probe.coupling {
            CouplingKind::Rigid => None,
            CouplingKind::Virtual => limit_reached(COUPLING, peak_n),
        };
        let limit = limit.map(|limit| format!("{limit}; change --coupling: rigid has no limit"));
        let presses: Vec<PressReport> = presses.iter().map(|press| PressReport::of(probe, press)).collect();
        let scan = &presses[at_count..];
        Self {
            ripple: ripple(scan.iter().map(|press| press.body_force_n[1])),
            loop_ripple: ripple(scan.iter().map(|press| press.loop_force_n[1])),
            hertz_n: hertz::force_n(
                probe.tool,
                (probe.youngs_pa, probe.elements.poissons_ratio()),
                1e-3 * probe.depth_mm,
            ),
            presses,
            warnings: size.into_iter().chain(limit).collect(),
        }
    }

    pub(super) fn table(&self, probe: &Probe, out: &mut dyn Write) -> std::io::Result<()> {
        let (shape, closed_form) = match probe.tool {
            Tool::Sphere { .. } => ("sphere", "Hertz, elastic half-space"),
            Tool::Punch { .. } => ("flat punch", "flat punch, elastic half-space"),
        };
        let coupling = match probe.coupling {
            CouplingKind::Rigid => "rigid",
            CouplingKind::Virtual => "virtual",
        };
        let radius_mm = 1e3 * probe.tool.radius_m();
        writeln!(out, "{shape} of radius {radius_mm} mm, friction {}, {coupling} coupling", probe.friction)?;
        writeln!(out, "depth {} mm at {} m/s; forces at the end, N", probe.depth_mm, probe.speed_m_per_s)?;
        writeln!(out)?;
        writeln!(
            out,
            "{:>8}{:>8}{:>27}{:>27}{:>9}{:>8}{:>20}{:>10}{:>10}",
            "", "", "full body", "loop", "crossed", "force", "unconverged", "inverted", "maximum"
        )?;
        writeln!(
            out,
            "{:>8}{:>8}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>8}{:>10}{:>10}{:>10}{:>10}",
            "x, mm",
            "z, mm",
            "x",
            "y",
            "z",
            "x",
            "y",
            "z",
            "tick",
            "tick",
            "steps",
            "ticks",
            "cells",
            "step, ms"
        )?;
        for press in &self.presses {
            write!(out, "{:>8.2}{:>8.2}", press.x_mm, press.z_mm)?;
            for force in press.body_force_n.iter().chain(&press.loop_force_n) {
                write!(out, "{force:>9.4}")?;
            }
            let tick = |tick: Option<usize>| tick.map_or_else(|| "-".to_owned(), |tick| tick.to_string());
            writeln!(
                out,
                "{:>9}{:>8}{:>10}{:>10}{:>10}{:>10.2}{}",
                tick(press.crossing_tick),
                tick(press.first_force_tick),
                press.unconverged_steps,
                press.unconverged_ticks,
                press.inverted_cells,
                press.step_ms_max,
                if press.settled { "" } else { "  not settled" }
            )?;
        }
        writeln!(out)?;
        if let (Some(body), Some(in_loop)) = (self.ripple, self.loop_ripple) {
            let (body, in_loop) = (100.0 * body, 100.0 * in_loop);
            writeln!(
                out,
                "ripple of the scan, (max - min) / mean: {body:.2} % full body, {in_loop:.2} % loop"
            )?;
        }
        writeln!(out, "{closed_form}: {:.4} N", self.hertz_n)?;
        self.warnings.iter().try_for_each(|warning| writeln!(out, "warning: {warning}"))
    }

    /// A row for each press.
    pub(super) fn presses_csv(&self) -> String {
        let column = |name: &str, of: &dyn Fn(&PressReport) -> f64| -> (String, Vec<f64>) {
            (name.to_owned(), self.presses.iter().map(of).collect())
        };
        let tick = |tick: Option<usize>| tick.map_or(f64::NAN, |tick| tick as f64);
        let mut columns = vec![
            column("x_mm", &|press| press.x_mm),
            column("z_mm", &|press| press.z_mm),
            column("depth_mm", &|press| press.depth_mm),
        ];
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            columns.push(column(&format!("body_force_{letter}_n"), &|press| press.body_force_n[axis]));
        }
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            columns.push(column(&format!("loop_force_{letter}_n"), &|press| press.loop_force_n[axis]));
        }
        columns.extend([
            column("first_force_tick", &|press| tick(press.first_force_tick)),
            column("crossing_tick", &|press| tick(press.crossing_tick)),
            column("unconverged_steps", &|press| press.unconverged_steps as f64),
            column("unconverged_ticks", &|press| press.unconverged_ticks as f64),
            column("inverted_cells", &|press| press.inverted_cells as f64),
            column("step_ms_max", &|press| press.step_ms_max),
        ]);
        csv(&columns)
    }
}

impl PressReport {
    fn of(probe: &Probe, PressAt { place, press }: &PressAt) -> Self {
        let [body_n, loop_n] = press.end_n();
        let [body_first, loop_first] = press.first_force_ticks();
        let mut step_ms = press.step_ms.clone();
        step_ms.sort_by(f64::total_cmp);
        Self {
            x_mm: place.x_mm,
            z_mm: place.z_mm,
            depth_mm: probe.depth_mm,
            body_force_n: body_n.to_array(),
            loop_force_n: loop_n.to_array(),
            first_force_tick: loop_first,
            body_first_force_tick: body_first,
            crossing_tick: press.crossing_tick(),
            unconverged_steps: press.unconverged_steps,
            unconverged_ticks: press.unconverged_ticks,
            inverted_cells: press.inverted_cells,
            step_ms_max: step_ms.last().copied().unwrap_or_default(),
            step_ms_p50: step_ms.get(step_ms.len() / 2).copied().unwrap_or_default(),
            build_ms_max: press.build_ms_max,
            last_tick: press.body_n.len() - 1,
            settled: press.is_settled,
        }
    }
}

/// A row for each tick of each press.
pub(super) fn ticks_csv(presses: &[PressAt]) -> String {
    let names = ["press", "x_mm", "z_mm", "t_s", "depth_mm"].map(str::to_owned);
    let forces = ["body", "loop"].map(|of| ["x", "y", "z"].map(|axis| format!("{of}_force_{axis}_n")));
    let names: Vec<String> = names.into_iter().chain(forces.into_iter().flatten()).collect();
    let mut columns: Vec<(String, Vec<f64>)> = names.into_iter().map(|name| (name, Vec::new())).collect();
    for (index, PressAt { place, press }) in presses.iter().enumerate() {
        for tick in 0..press.body_n.len() {
            let DVec3 { x, y, z } = press.body_n[tick];
            let DVec3 { x: loop_x, y: loop_y, z: loop_z } = press.loop_n[tick];
            let depth_mm = 1e3 * press.depth_m[tick];
            let t_s = TICK_S * tick as f64;
            let row = [index as f64, place.x_mm, place.z_mm, t_s, depth_mm, x, y, z, loop_x, loop_y, loop_z];
            columns.iter_mut().zip(row).for_each(|((_, column), value)| column.push(value));
        }
    }
    csv(&columns)
}

/// (max − min) / mean.
fn ripple(forces_n: impl Iterator<Item = f64> + Clone) -> Option<f64> {
    let (low, high) =
        forces_n.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(f), h.max(f)));
    let mean = forces_n.clone().sum::<f64>() / forces_n.count() as f64;
    let ripple = (high - low) / mean;
    ripple.is_finite().then_some(ripple)
}

#[cfg(test)]
mod tests {
    use super::ripple;

    #[test]
    fn ripple_is_the_range_over_the_mean() {
        assert_eq!(ripple([1.0, 3.0, 2.0].into_iter()), Some(1.0));
        assert_eq!(ripple([0.0, 0.0].into_iter()), None);
        assert_eq!(ripple([].into_iter()), None);
    }
}
