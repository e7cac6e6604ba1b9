//! The parts of the panel about the running loop: safety chain, timing, frequency response.

use super::HapticWidgets;
use crate::panel::settings::grid;
use crate::panel::{devices, plots, theme};
use crate::tool::LoopTiming;
use bevy::prelude::DetectChangesMut;
use bevy_egui::egui;
use palpate_body::StepReport;

impl HapticWidgets<'_, '_> {
    /// Draws the stages of the safety chain, lit when they act.
    pub fn safety(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let now_s = self.time.elapsed_secs_f64();
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let lamps = &mut self.panel.bypass_change_detection().view.lamps;
        if let Some(running) = &mut shown.running {
            lamps.update(running.handle.black_box(), now_s);
        }
        lamps.show(ui, now_s);
    }

    /// Draws lateness and cost of the loop's ticks, and the convergence of contact in its ticks and in the steps of the body.
    pub fn timing(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let LoopTiming { lateness_p50_us, lateness_p99_us, lateness_p999_us, lateness_max_us, .. } =
            *shown.timing;
        let LoopTiming {
            ticks,
            missed_deadlines,
            cost_p50_us,
            cost_p99_us,
            unconverged_ticks: unconverged,
            ..
        } = *shown.timing;
        let body = shown.running.as_ref().and_then(|running| running.body());
        let step = body.and_then(|body| self.bodies.get(body).ok()).map(|(body, ..)| body.last_step());
        grid(ui, "palpate_timing", |ui| {
            ui.label("missed deadlines");
            let share = 100.0 * missed_deadlines as f64 / (ticks + missed_deadlines).max(1) as f64;
            let color = if share < 0.1 { theme::GREEN } else { theme::AMBER };
            ui.colored_label(
                color,
                format!("{missed_deadlines} of {}  ({share:.2} %)", ticks + missed_deadlines),
            );
            ui.end_row();
            ui.label("lateness, µs");
            ui.label(format!(
                "{lateness_p50_us:.0} median · {lateness_p99_us:.0} p99 · {lateness_p999_us:.0} p99.9 · {lateness_max_us:.0} max"
            ));
            ui.end_row();
            ui.label("cost of a tick, µs");
            ui.label(format!("{cost_p50_us:.0} median · {cost_p99_us:.0} p99"));
            ui.end_row();
            ui.label("not converged");
            let share = 100.0 * unconverged as f64 / ticks.max(1) as f64;
            theme::healthy(ui, unconverged == 0, format!("{unconverged} of {ticks} ticks  ({share:.2} %)"));
            ui.end_row();
            if let Some((text, is_healthy)) = step.map(|step| unconverged_steps(&step)) {
                ui.label("");
                theme::healthy(ui, is_healthy, text);
                ui.end_row();
            }
            if let Some([forces, reports]) = devices::counters(&self.devices, &shown.tool.device) {
                ui.label("written forces");
                ui.label(forces);
                ui.end_row();
                ui.label("reports");
                ui.label(reports);
                ui.end_row();
            }
        });
        if let Some(running) = &mut shown.running {
            let report = running.report();
            if report.lateness.max_us() > 0.0 {
                plots::lateness(ui, &report.lateness);
            } else {
                theme::small(ui, "In lock step there is no lateness.");
            }
        }
    }

    /// Draws the Bode plots of the local model and of the full body.
    pub fn bode(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let history = self.history.bypass_change_detection();
        history.drawn.bode = true;
        match history.bode() {
            None => {
                theme::small(ui, "computing …");
            }
            Some(Err(reason)) => {
                theme::small(ui, reason.as_str());
            }
            Some(Ok(bode)) => {
                ui.horizontal_wrapped(|ui| {
                    ui.spacing_mut().item_spacing.x = 12.0;
                    theme::chip(ui, "full body", theme::FULL, true);
                    theme::chip(ui, theme::name(bode.scheme), theme::color(bode.scheme), false);
                });
                theme::small(
                    ui,
                    format!("force per displacement of node {} along the force, re 1 N/m", bode.node),
                );
                if bode.local.is_empty() {
                    theme::small(
                        ui,
                        format!("{} has no response between two model steps.", theme::name(bode.scheme)),
                    );
                }
                plots::bode(ui, bode);
            }
        }
    }
}

/// Text about the substeps of the body's last model step in which contact did not converge, and whether there are none.
fn unconverged_steps(report: &StepReport) -> (String, bool) {
    let StepReport { ticks, substeps, unconverged, .. } = *report;
    // A substep may be solved several times.
    let (of, unconverged) = (ticks * substeps, unconverged.min(ticks * substeps));
    (format!("{unconverged} of {of} substeps of the body in the last model step"), unconverged == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unconverged_substeps_count_once_each() {
        let report = StepReport { ticks: 50, substeps: 4, ..StepReport::default() };
        let text = "0 of 200 substeps of the body in the last model step";
        assert_eq!(unconverged_steps(&report), (text.into(), true));
        for (unconverged, shown) in [(3, "3 of 200"), (900, "200 of 200")] {
            let (text, is_healthy) = unconverged_steps(&StepReport { unconverged, ..report });
            assert!(text.starts_with(shown) && !is_healthy, "{text}");
        }
    }
}
