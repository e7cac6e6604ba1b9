//! The parts of the panel, for any window.

mod running;

use super::devices;
use super::fault_log::FaultLog;
use super::history::{ForceComponent, index_of};
use super::plots::CurvePoints;
use super::recording::{name_of, next_free};
use super::settings::{View, grid};
use super::state::HapticPanel;
use super::theme;
use super::tool_history::ToolHistory;
use crate::body::{SimulatedBody, Tissue};
use crate::device::{HapticDevices, TrajectoryAsset};
use crate::model_time::{ModelRate, ModelStepCount};
use crate::tool::{ForceError, HapticTool, LocalModelStats, LoopTiming, ToolForce, ToolLoop, ToolSettings};
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy_egui::egui;
use palpate_haptics::SafetySettings;
use palpate_local::Scheme;

/// System parameter that draws the parts of the panel, for a system in `EguiPrimaryContextPass` or another pass of bevy_egui.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_egui::{EguiContexts, egui};
/// use bevy_palpate::HapticWidgets;
///
/// fn my_window(mut contexts: EguiContexts, mut palpate: HapticWidgets) -> Result {
///     egui::Window::new("Force").show(contexts.ctx_mut()?, |ui| {
///         palpate.header(ui);
///         palpate.force(ui);
///     });
///     Ok(())
/// }
/// # bevy::ecs::system::assert_is_system::<(), (), _>(my_window);
/// ```
///
/// All parts show the tool [`HapticPanel::tool`]. A part that is not drawn computes nothing.
#[derive(SystemParam)]
pub struct HapticWidgets<'w, 's> {
    panel: ResMut<'w, HapticPanel>,
    history: ResMut<'w, ToolHistory>,
    log: Res<'w, FaultLog>,
    tools: Query<'w, 's, Shown>,
    bodies: Query<'w, 's, (&'static SimulatedBody, &'static mut Tissue, Option<&'static Name>)>,
    devices: Res<'w, HapticDevices>,
    trajectories: Option<ResMut<'w, Assets<TrajectoryAsset>>>,
    rate: ResMut<'w, ModelRate>,
    steps: Res<'w, ModelStepCount>,
    time: Res<'w, Time<Real>>,
    points: Local<'s, CurvePoints>,
}

#[derive(QueryData)]
#[query_data(mutable)]
struct Shown {
    entity: Entity,
    name: Option<&'static Name>,
    tool: &'static mut HapticTool,
    settings: &'static mut ToolSettings,
    running: Option<&'static mut ToolLoop>,
    force: &'static ToolForce,
    build: &'static LocalModelStats,
    error: &'static ForceError,
    timing: &'static LoopTiming,
}

impl HapticWidgets<'_, '_> {
    /// Returns whether the side panel is open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.panel.open
    }

    /// Draws all parts under collapsible headings.
    pub fn all(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            ui.heading(egui::RichText::new("palpate").strong());
            if let Some(key) = self.panel.key {
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    theme::small(ui, format!("{key:?} closes"));
                });
            }
        });
        self.header(ui);
        if self.entity().is_none() {
            return;
        }
        let parts: [(&str, bool, fn(&mut Self, &mut egui::Ui)); 10] = [
            ("Force", true, Self::force),
            ("Error against the full body", true, Self::error),
            ("Safety", true, Self::safety),
            ("Loop", true, Self::timing),
            ("Frequency response", false, Self::bode),
            ("Stress", false, Self::stress),
            ("Model and material", false, Self::material),
            ("Limits", false, Self::limits),
            ("Device frame", false, Self::frame),
            ("Record and replay", false, Self::recording),
        ];
        for (title, open, part) in parts {
            let header = egui::RichText::new(title).strong();
            egui::CollapsingHeader::new(header).default_open(open).show_unindented(ui, |ui| part(self, ui));
        }
        self.faults(ui);
    }

    fn entity(&self) -> Option<Entity> {
        self.panel.shown(self.tools.iter().map(|shown| shown.entity))
    }

    /// Draws device, force and local model of the tool, with a selection if there are several tools.
    pub fn header(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(entity) = self.entity() else {
            theme::small(ui, "There is no tool; spawn an entity with HapticTool.");
            return;
        };
        let label = |entity: Entity, name: Option<&Name>| {
            name.map_or_else(|| format!("tool {entity}"), |name| name.to_string())
        };
        if self.tools.iter().count() > 1 {
            let mut selected = entity;
            let shown = self.tools.get(entity).map(|shown| label(entity, shown.name)).unwrap_or_default();
            egui::ComboBox::from_id_salt("palpate_tool").selected_text(shown).show_ui(ui, |ui| {
                for other in &self.tools {
                    ui.selectable_value(&mut selected, other.entity, label(other.entity, other.name));
                }
            });
            if selected != entity {
                self.panel.tool = Some(selected);
            }
        }
        let Ok(mut shown) = self.tools.get_mut(entity) else { return };
        grid(ui, "palpate_header", |ui| {
            ui.label("device");
            ui.vertical(|ui| {
                let list = &mut self.panel.bypass_change_detection().devices;
                let mut device = shown.tool.device.clone();
                if list.select(ui, &mut device, &self.devices) {
                    shown.tool.device = device;
                }
                devices::calibrate(ui, &self.devices, &shown.tool.device);
            });
            ui.end_row();
            ui.label("force on the hand");
            ui.horizontal(|ui| {
                ui.monospace(format!("{:.2} N", shown.force.force_n.length()));
                if shown.running.is_none() {
                    ui.colored_label(theme::RED, "no loop runs");
                }
            });
            ui.end_row();
            ui.label("local model");
            let LocalModelStats { states, time_s, .. } = *shown.build;
            let age_ms = 1e3 * shown.force.model_age_s;
            ui.label(format!("{states} states, built in {:.1} ms, {age_ms:.0} ms old", 1e3 * time_s));
            ui.end_row();
            let beyond_s = self.log.beyond_support_s(entity, self.time.elapsed_secs_f64());
            if let Some((text, is_amber)) = note_on_model(shown.build, beyond_s) {
                ui.label("");
                if is_amber {
                    ui.colored_label(theme::AMBER, text);
                } else {
                    theme::small(ui, text);
                }
                ui.end_row();
            }
        });
    }

    /// Draws the force of the last seconds: that of the full body, and that of every scheme on the same samples.
    pub fn force(&mut self, ui: &mut egui::Ui) {
        let Some(running) = self.prepare(ui) else { return };
        self.chips(ui, running);
        let Self { panel, points, .. } = self;
        points.force(ui, panel.seconds, running, |scheme| panel.draws(scheme));
        let panel = panel.bypass_change_detection();
        ui.horizontal(|ui| {
            for (along, name) in ForceComponent::ALL {
                ui.selectable_value(&mut panel.view.along, along, name);
            }
            ui.separator();
            let seconds = egui::DragValue::new(&mut panel.seconds).range(1.0..=15.0).speed(0.1).suffix(" s");
            ui.add(seconds.max_decimals(1));
            ui.checkbox(&mut panel.compare, "all schemes")
                .on_hover_text("computes the other schemes on the same samples, in the background");
        });
        let (cost_ms, skipped) = self.history.comparison_cost();
        if self.panel.compare {
            let mut text = format!("the schemes take {cost_ms:.1} ms per model step on another thread");
            if skipped > 0 {
                text += &format!("; {skipped} steps were skipped because of that time");
            }
            theme::small(ui, text);
        }
    }

    /// Draws the error of every scheme against the full body over the last second, with the just noticeable difference.
    pub fn error(&mut self, ui: &mut egui::Ui) {
        let Some(running) = self.prepare(ui) else { return };
        let newest = self.history.errors[index_of(running)].points.back().copied();
        let now = newest.filter(|(at, _)| self.history.newest.is_some_and(|newest| newest - at < 1000));
        ui.horizontal(|ui| match now {
            Some((_, share)) => {
                let jnd = ForceError::FORCE_JND;
                let color = match share / jnd {
                    part if part < 1.0 => theme::GREEN,
                    part if part < 2.0 => theme::AMBER,
                    _ => theme::RED,
                };
                let text =
                    egui::RichText::new(format!("{:.2} %", 100.0 * share)).color(color).strong().size(15.0);
                ui.label(text);
                let verdict = if share < jnd { "not noticeable" } else { "noticeable" };
                ui.label(format!("{}: {verdict} (7 % is just noticeable)", theme::name(running)));
            }
            None => {
                theme::small(ui, "Touch the body: there is no force to compare.");
            }
        });
        let Self { panel, points, .. } = self;
        points.error(ui, panel.seconds, running, |scheme| panel.draws(scheme));
    }

    /// Requests and updates the curves; returns the running scheme.
    fn prepare(&mut self, ui: &mut egui::Ui) -> Option<Scheme> {
        theme::apply(ui);
        let scheme = self.tools.get(self.entity()?).ok()?.tool.scheme;
        let history = self.history.bypass_change_detection();
        history.drawn.forces = true;
        self.points.refresh(history, self.panel.seconds, self.panel.view.along);
        Some(scheme)
    }

    /// Draws the names of the curves in their colours; a click shows or hides a curve.
    fn chips(&mut self, ui: &mut egui::Ui, running: Scheme) {
        let curves = &mut self.panel.bypass_change_detection().curves;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = egui::vec2(12.0, 1.0);
            theme::chip(ui, "full body", theme::FULL, true);
            for (i, scheme) in Scheme::ALL.into_iter().enumerate() {
                let color = if curves[i] { theme::color(scheme) } else { theme::RIM };
                let chip = theme::chip(ui, theme::name(scheme), color, scheme == running);
                let note = self.history.notes[i].as_deref();
                let hint = match note {
                    Some(reason) => format!("has no curve: {reason}"),
                    None if scheme == running => "runs in the loop".into(),
                    None => "computed in the background on the same samples".into(),
                };
                if chip.on_hover_text(hint).clicked() {
                    curves[i] = !curves[i];
                }
            }
        });
    }

    /// Draws scheme, model rate, and the body's nodes, inverted cells and material.
    pub fn material(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let view = &mut self.panel.bypass_change_detection().view;
        let mut rate = None;
        egui::Grid::new("palpate_model").num_columns(3).min_col_width(100.0).spacing([8.0, 3.0]).show(
            ui,
            |ui| {
                ui.label("scheme");
                if let Some(scheme) = View::scheme(ui, shown.tool.scheme) {
                    shown.tool.scheme = scheme;
                }
                ui.end_row();
                rate = view.rate(ui, *self.rate);
            },
        );
        if let Some(rate) = rate {
            *self.rate = rate;
        }
        view.show_rate_rejection(ui);
        let body = shown.running.as_ref().and_then(|running| running.body());
        match body.and_then(|body| Some((body, self.bodies.get_mut(body).ok()?))) {
            Some((body, (simulated, mut tissue, name))) => {
                let nodes = simulated.body().network().node_count();
                let label = name.map_or_else(|| format!("body {body}"), |name| name.to_string());
                theme::small(ui, format!("{label}: {nodes} nodes"));
                let cells = simulated.body().network().cells().len();
                if let Some((text, is_warning)) = note_on_cells(cells, simulated.last_step().inverted_cells) {
                    if is_warning {
                        ui.colored_label(theme::AMBER, text);
                    } else {
                        theme::small(ui, text);
                    }
                }
                view.tissue(ui, body, &mut tissue);
            }
            None => {
                theme::small(ui, "The tool has no body.");
            }
        }
    }

    /// Draws stress and strain below the tool's contact, as numbers and as a section through the body.
    pub fn stress(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(shown) = self.entity().and_then(|tool| self.tools.get(tool).ok()) else { return };
        let HapticPanel { folder, stress, .. } = self.panel.bypass_change_detection();
        let body = shown.running.and_then(ToolLoop::body);
        let found = body.and_then(|body| Some((body, self.bodies.get(body).ok()?.0)));
        let (Some((body, simulated)), Some(contact)) = (found, shown.force.contact) else {
            theme::small(ui, "Touch a body: there is no contact.");
            return;
        };
        stress.refresh((body, self.steps.0), simulated, (contact.point_m, contact.normal));
        stress.draw(ui, simulated, folder);
    }

    /// Draws the limits of the safety chain.
    pub fn limits(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let of_device =
            shown.running.as_ref().map_or(SafetySettings::default(), |running| running.device_safety);
        self.panel.bypass_change_detection().view.limits(ui, &mut shown.settings, of_device);
    }

    /// Draws rotation, scale and offset of the device frame.
    pub fn frame(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        self.panel.bypass_change_detection().view.frame(ui, &mut shown.settings);
    }

    /// Draws the controls to record the device's motion to a file, and to replay a file.
    pub fn recording(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let HapticPanel { folder, view, .. } = self.panel.bypass_change_detection();
        let recorder = &mut self.history.bypass_change_detection().recorder;
        if let Some(written) = recorder.written.take() {
            view.file = written.display().to_string();
        } else if view.file.is_empty() {
            view.file = next_free(folder).display().to_string();
        }
        ui.horizontal(|ui| {
            ui.label("file");
            ui.add(egui::TextEdit::singleline(&mut view.file).desired_width(f32::INFINITY));
        });
        ui.horizontal(|ui| {
            let recorded = recorder.tool();
            if recorded.is_some() {
                let stop = ui.button(egui::RichText::new("■ stop").color(theme::RED)).clicked();
                ui.monospace(format!("{:.1} s", recorder.duration_s()));
                if stop || recorder.is_full() {
                    recorder.stop(view.file.clone().into());
                }
            } else if let Some(seconds) = recorder.unwritten_s() {
                let retry = ui.button(format!("retry to write {seconds:.1} s")).clicked();
                let hint = "discards the recording that could not be written";
                let discard = ui.button("discard").on_hover_text(hint).clicked();
                if retry {
                    recorder.write_again(view.file.clone().into());
                } else if discard {
                    recorder.discard();
                }
            } else {
                let idle = shown.running.is_some() && !recorder.is_writing();
                if ui.add_enabled(idle, egui::Button::new("⏺ record")).clicked() {
                    // An existing file is never overwritten.
                    if std::path::Path::new(&view.file).exists() {
                        view.file = next_free(folder).display().to_string();
                    }
                    recorder.start(shown.entity);
                }
            }
            let still = recorded.is_none() && !recorder.is_writing();
            let tool = (shown.entity, &mut *shown.tool.bypass_change_detection());
            let before = recorder.device_before(shown.entity).map(name_of);
            let (mut replay, mut back) = (false, false);
            replay |= ui.add_enabled(still, egui::Button::new("▶ replay")).clicked();
            if let Some(before) = before {
                back = ui.button(format!("back to {before}")).clicked();
            }
            let device = tool.1.device.clone();
            if replay {
                recorder.replay(tool, &view.file, self.trajectories.as_deref_mut());
            } else if back {
                recorder.restore_device(tool);
            }
            if shown.tool.device != device {
                shown.tool.set_changed();
            }
        });
        match &recorder.message {
            Some(Ok(text)) => {
                theme::small(ui, text.as_str());
            }
            Some(Err(reason)) => {
                theme::error(ui, reason);
            }
            None => {}
        }
    }

    /// Draws the last faults, if any.
    pub fn faults(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        if self.log.faults.is_empty() {
            return;
        }
        ui.separator();
        let now_s = self.time.elapsed_secs_f64();
        for (text, times, at_s) in self.log.faults.iter().rev() {
            let count = if *times > 1 { format!(" (×{times})") } else { String::new() };
            let ago = now_s - at_s;
            let color = if ago < 5.0 { theme::AMBER } else { theme::FAINT };
            let text = egui::RichText::new(format!("{ago:.0} s ago{count}: {text}")).small().color(color);
            ui.add(egui::Label::new(text).wrap());
        }
    }
}

/// Text about the inverted ones of a body's `cells` cells, and whether it is a warning; `None` for a body without cells.
fn note_on_cells(cells: usize, inverted: usize) -> Option<(String, bool)> {
    (cells > 0).then(|| (format!("{inverted} of {cells} cells inverted"), inverted > 0))
}

/// Time after a contact beyond the support set for which a warning is shown, s.
const RECENT_S: f64 = 5.0;

/// Text about a local model, and whether it is a warning: that the body buckles, or that the tool touched beyond the support set `beyond_s`
/// ago. A truncated support set alone is no warning.
fn note_on_model(build: &LocalModelStats, beyond_s: Option<f64>) -> Option<(String, bool)> {
    if build.tangent_clamped {
        Some(("the body buckles: clamped tangent".into(), true))
    } else if beyond_s.is_some_and(|ago_s| ago_s < RECENT_S) {
        Some(("the tool touched beyond the support set".into(), true))
    } else {
        let nodes = build.support_nodes;
        build
            .support_truncated
            .then(|| (format!("support set truncated to its {nodes} most likely nodes"), false))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncated_support_set_is_a_warning_only_after_contact_beyond_it() {
        let whole = LocalModelStats { support_nodes: 18, ..default() };
        let truncated = LocalModelStats { support_truncated: true, ..whole };
        assert_eq!(note_on_model(&whole, None), None);
        let text = "support set truncated to its 18 most likely nodes";
        assert_eq!(note_on_model(&truncated, None), Some((text.into(), false)));
        for build in [&whole, &truncated] {
            assert!(note_on_model(build, Some(1.0)).unwrap().1);
        }
        assert!(!note_on_model(&truncated, Some(60.0)).unwrap().1);
        let clamped = LocalModelStats { tangent_clamped: true, ..truncated };
        assert!(note_on_model(&clamped, None).unwrap().1);
    }

    #[test]
    fn inverted_cells_are_a_warning() {
        assert_eq!(note_on_cells(0, 0), None);
        assert_eq!(note_on_cells(125, 0), Some(("0 of 125 cells inverted".into(), false)));
        assert_eq!(note_on_cells(125, 2), Some(("2 of 125 cells inverted".into(), true)));
    }
}
