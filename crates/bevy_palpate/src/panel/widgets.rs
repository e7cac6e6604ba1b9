//! The panel's parts, to be put into any window.

mod running;

use super::devices;
use super::fault_log::FaultLog;
use super::history::{ForceComponent, index_of};
use super::plots::PlotPoints;
use super::recording::{name_of, next_free};
use super::settings::{View, grid};
use super::state::HapticPanel;
use super::theme;
use super::tool_history::ToolHistory;
use crate::body::{SimulatedBody, Tissue};
use crate::device::HapticDevices;
use crate::schedule::ModelRate;
use crate::tool::{ForceError, HapticTool, LocalModelStats, LoopTiming, ToolForce, ToolLoop, ToolSettings};
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy_egui::egui;
use palpate_haptics::SafetySettings;
use palpate_local::Scheme;

/// The parts of the panel, for a system in `EguiPrimaryContextPass` (or any other pass of bevy_egui):
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
/// All parts are of the tool that [`HapticPanel::tool`] names. What is not drawn is not computed.
#[derive(SystemParam)]
pub struct HapticWidgets<'w, 's> {
    panel: ResMut<'w, HapticPanel>,
    watched: ResMut<'w, ToolHistory>,
    heard: Res<'w, FaultLog>,
    tools: Query<'w, 's, Shown>,
    bodies: Query<'w, 's, (&'static SimulatedBody, &'static mut Tissue, Option<&'static Name>)>,
    devices: Res<'w, HapticDevices>,
    rate: ResMut<'w, ModelRate>,
    time: Res<'w, Time<Real>>,
    drawn: Local<'s, PlotPoints>,
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
    /// Whether the side panel is open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.panel.open
    }

    /// All parts under headings that open and close.
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
        let parts: [(&str, bool, fn(&mut Self, &mut egui::Ui)); 9] = [
            ("Force", true, Self::force),
            ("Error against the full body", true, Self::error),
            ("Safety", true, Self::safety),
            ("Loop", true, Self::timing),
            ("Frequency response", false, Self::bode),
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

    /// Which tool is shown, with a chooser if there are several, and what it does now.
    pub fn header(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(entity) = self.entity() else {
            theme::small(ui, "There is no tool. Spawn a HapticTool.");
            return;
        };
        let label = |entity: Entity, name: Option<&Name>| {
            name.map_or_else(|| format!("tool {entity}"), |name| name.to_string())
        };
        if self.tools.iter().count() > 1 {
            let mut chosen = entity;
            let shown = self.tools.get(entity).map(|shown| label(entity, shown.name)).unwrap_or_default();
            egui::ComboBox::from_id_salt("palpate_tool").selected_text(shown).show_ui(ui, |ui| {
                for other in &self.tools {
                    ui.selectable_value(&mut chosen, other.entity, label(other.entity, other.name));
                }
            });
            if chosen != entity {
                self.panel.tool = Some(chosen);
            }
        }
        let Ok(mut shown) = self.tools.get_mut(entity) else { return };
        grid(ui, "palpate_header", |ui| {
            ui.label("device");
            ui.vertical(|ui| {
                let present = &mut self.panel.bypass_change_detection().present;
                let mut device = shown.tool.device.clone();
                if present.choose(ui, &mut device, &self.devices) {
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
            let beyond_s = self.heard.beyond_support_s(entity, self.time.elapsed_secs_f64());
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

    /// Force over the last seconds: the full body's, and every scheme's on the same samples.
    pub fn force(&mut self, ui: &mut egui::Ui) {
        let Some(running) = self.prepare(ui) else { return };
        self.chips(ui, running);
        let Self { panel, drawn, .. } = self;
        drawn.force(ui, panel.seconds, running, |scheme| panel.draws(scheme));
        let panel = panel.bypass_change_detection();
        ui.horizontal(|ui| {
            for (along, name) in ForceComponent::ALL {
                ui.selectable_value(&mut panel.view.along, along, name);
            }
            ui.separator();
            let seconds = egui::DragValue::new(&mut panel.seconds).range(1.0..=15.0).speed(0.1).suffix(" s");
            ui.add(seconds.max_decimals(1));
            ui.checkbox(&mut panel.compare, "all schemes")
                .on_hover_text("computes the schemes that do not run on the same samples, beside the app");
        });
        let (cost_ms, skipped) = self.watched.comparing_cost();
        if self.panel.compare {
            let mut text = format!("the schemes beside take {cost_ms:.1} ms a model step on another thread");
            if skipped > 0 {
                text += &format!("; {skipped} steps left out, for it was too much");
            }
            theme::small(ui, text);
        }
    }

    /// Error of every scheme against the full body over the last second, and what a person just notices.
    pub fn error(&mut self, ui: &mut egui::Ui) {
        let Some(running) = self.prepare(ui) else { return };
        let newest = self.watched.errors[index_of(running)].points.back().copied();
        let now = newest.filter(|(at, _)| self.watched.newest.is_some_and(|newest| newest - at < 1000));
        ui.horizontal(|ui| match now {
            Some((_, share)) => {
                let noticeable = ForceError::FORCE_JND;
                let color = match share / noticeable {
                    part if part < 1.0 => theme::GREEN,
                    part if part < 2.0 => theme::AMBER,
                    _ => theme::RED,
                };
                let text =
                    egui::RichText::new(format!("{:.2} %", 100.0 * share)).color(color).strong().size(15.0);
                ui.label(text);
                let words = if share < noticeable { "not to be felt" } else { "to be felt" };
                ui.label(format!("{}: {words} (7 % is just noticeable)", theme::name(running)));
            }
            None => {
                theme::small(ui, "Touch the body: there is no force to speak of.");
            }
        });
        let Self { panel, drawn, .. } = self;
        drawn.error(ui, panel.seconds, running, |scheme| panel.draws(scheme));
    }

    /// What every curve needs; the running scheme.
    fn prepare(&mut self, ui: &mut egui::Ui) -> Option<Scheme> {
        theme::apply(ui);
        let scheme = self.tools.get(self.entity()?).ok()?.tool.scheme;
        let watched = self.watched.bypass_change_detection();
        watched.drawn.forces = true;
        self.drawn.refresh(watched, self.panel.seconds, self.panel.view.along);
        Some(scheme)
    }

    /// The names of the curves in their colours; a click draws one or not.
    fn chips(&mut self, ui: &mut egui::Ui, running: Scheme) {
        let curves = &mut self.panel.bypass_change_detection().curves;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = egui::vec2(12.0, 1.0);
            theme::chip(ui, "full body", theme::FULL, true);
            for (i, scheme) in Scheme::ALL.into_iter().enumerate() {
                let color = if curves[i] { theme::color(scheme) } else { theme::RIM };
                let chip = theme::chip(ui, theme::name(scheme), color, scheme == running);
                let note = self.watched.notes[i].as_deref();
                let hint = match note {
                    Some(why) => format!("has no curve: {why}"),
                    None if scheme == running => "runs in the loop".into(),
                    None => "beside, on the same samples".into(),
                };
                if chip.on_hover_text(hint).clicked() {
                    curves[i] = !curves[i];
                }
            }
        });
    }

    /// Scheme, model rate, the body's nodes and inverted cells, and its material.
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
        view.rate_refusal(ui);
        let body = shown.running.as_ref().and_then(|running| running.body());
        match body.and_then(|body| Some((body, self.bodies.get_mut(body).ok()?))) {
            Some((body, (simulated, mut tissue, name))) => {
                let nodes = simulated.body().network().node_count();
                let what = name.map_or_else(|| format!("body {body}"), |name| name.to_string());
                theme::small(ui, format!("{what}: {nodes} nodes"));
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

    /// Limits of the safety chain.
    pub fn limits(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let of_device =
            shown.running.as_ref().map_or(SafetySettings::default(), |running| running.device_safety);
        self.panel.bypass_change_detection().view.limits(ui, &mut shown.settings, of_device);
    }

    /// How the device lies in the scene.
    pub fn frame(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        self.panel.bypass_change_detection().view.frame(ui, &mut shown.settings);
    }

    /// Records the hand to a file, and replays one.
    pub fn recording(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        let Some(mut shown) = self.entity().and_then(|tool| self.tools.get_mut(tool).ok()) else { return };
        let HapticPanel { folder, view, .. } = self.panel.bypass_change_detection();
        let recorder = &mut self.watched.bypass_change_detection().recorder;
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
                let again = ui.button(format!("write {seconds:.1} s again")).clicked();
                let hint = "gives up what could not be written";
                let away = ui.button("throw away").on_hover_text(hint).clicked();
                if again {
                    recorder.write_again(view.file.clone().into());
                } else if away {
                    recorder.discard();
                }
            } else {
                let idle = shown.running.is_some() && !recorder.is_writing();
                if ui.add_enabled(idle, egui::Button::new("⏺ record")).clicked() {
                    // What is there is never written over.
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
                recorder.replay(tool, view.file.clone(), &self.devices);
            } else if back {
                recorder.restore_device(tool);
            }
            if shown.tool.device != device {
                shown.tool.set_changed();
            }
        });
        match &recorder.told {
            Some(Ok(text)) => {
                theme::small(ui, text.as_str());
            }
            Some(Err(why)) => {
                theme::refusal(ui, why);
            }
            None => {}
        }
    }

    /// The faults that were told last; nothing where there were none.
    pub fn faults(&mut self, ui: &mut egui::Ui) {
        theme::apply(ui);
        if self.heard.faults.is_empty() {
            return;
        }
        ui.separator();
        let now_s = self.time.elapsed_secs_f64();
        for (text, times, at_s) in self.heard.faults.iter().rev() {
            let often = if *times > 1 { format!(" (×{times})") } else { String::new() };
            let ago = now_s - at_s;
            let color = if ago < 5.0 { theme::AMBER } else { theme::FAINT };
            let text = egui::RichText::new(format!("{ago:.0} s ago{often}: {text}")).small().color(color);
            ui.add(egui::Label::new(text).wrap());
        }
    }
}

/// How many of a body's `cells` cells are inverted, and whether that is a warning; `None` for a body without cells.
fn note_on_cells(cells: usize, inverted: usize) -> Option<(String, bool)> {
    (cells > 0).then(|| (format!("{inverted} of {cells} cells inverted"), inverted > 0))
}

/// Time for which a touch beyond the support set is worth a warning, s.
const RECENT_S: f64 = 5.0;

/// What is to be said of a local model, and whether it is a warning: that the body buckles, or that the tool touched beyond the
/// support set `beyond_s` ago. A support set that is cut, as most are, does no harm by itself.
fn note_on_model(build: &LocalModelStats, beyond_s: Option<f64>) -> Option<(String, bool)> {
    if build.tangent_clamped {
        Some(("the body buckles: clamped tangent".into(), true))
    } else if beyond_s.is_some_and(|ago_s| ago_s < RECENT_S) {
        Some(("the tool touched beyond the nodes of S".into(), true))
    } else {
        let nodes = build.support_nodes;
        build.support_truncated.then(|| (format!("S is cut to its {nodes} most likely nodes"), false))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_support_set_that_is_cut_is_a_warning_only_where_the_tool_touched_beyond_it() {
        let whole = LocalModelStats { support_nodes: 18, ..default() };
        let cut = LocalModelStats { support_truncated: true, ..whole };
        assert_eq!(note_on_model(&whole, None), None);
        assert_eq!(note_on_model(&cut, None), Some(("S is cut to its 18 most likely nodes".into(), false)));
        for build in [&whole, &cut] {
            assert!(note_on_model(build, Some(1.0)).unwrap().1);
        }
        assert!(!note_on_model(&cut, Some(60.0)).unwrap().1);
        let clamped = LocalModelStats { tangent_clamped: true, ..cut };
        assert!(note_on_model(&clamped, None).unwrap().1);
    }

    #[test]
    fn inverted_cells_are_a_warning() {
        assert_eq!(note_on_cells(0, 0), None);
        assert_eq!(note_on_cells(125, 0), Some(("0 of 125 cells inverted".into(), false)));
        assert_eq!(note_on_cells(125, 2), Some(("2 of 125 cells inverted".into(), true)));
    }
}
