//! The panel: force, error, timing and settings of a tool.

mod devices;
mod fault_log;
mod history;
mod plots;
mod recording;
mod safety_lamps;
mod scheme_comparison;
mod settings;
mod state;
mod stress;
mod theme;
mod tool_history;
mod widgets;

pub use state::HapticPanel;
pub use widgets::HapticWidgets;

use crate::cost::FrameCost;
use crate::schedule::{HapticSystems, HapticUpdateSystems, ModelSchedule};
use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;
use bevy_egui::input::EguiWantsInput;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use std::path::PathBuf;

/// Adds a panel at the right edge of the window: forces of all schemes, error against the full body, lateness, Bode plot, safety chain,
/// settings, recording. Adds bevy_egui's [`EguiPlugin`] if the app does not have it.
///
/// ```no_run
/// use bevy::prelude::*;
/// use bevy_palpate::{HapticPanelPlugin, prelude::*};
///
/// # let mut app = App::new();
/// app.add_plugins((DefaultPlugins, PalpatePlugins, HapticPanelPlugin::default()));
/// ```
///
/// A closed panel or section collects and computes nothing.
#[derive(Clone, Debug)]
pub struct HapticPanelPlugin {
    /// Whether to draw the side panel. Without it, the app draws the parts of [`HapticWidgets`] in its own windows.
    pub side: bool,
    /// Whether the side panel is open at the start.
    pub open: bool,
    /// Key that opens and closes the side panel.
    pub key: Option<KeyCode>,
    /// Folder of recordings, created with the first one.
    pub folder: PathBuf,
}

impl Default for HapticPanelPlugin {
    /// Open, F1, `recordings` in the working directory.
    fn default() -> Self {
        Self { side: true, open: true, key: Some(KeyCode::F1), folder: "recordings".into() }
    }
}

impl HapticPanelPlugin {
    /// Time of the panel in a frame, on the main thread, ms; zero while it is closed.
    pub const COST: DiagnosticPath = DiagnosticPath::const_new("palpate/panel_cost");
}

/// Time of the panel in this frame.
#[derive(Resource, Default)]
struct PanelCost(FrameCost);

impl Plugin for HapticPanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        let cost = FrameCost::default();
        app.insert_resource(HapticPanel::new(self.open, self.key, self.folder.clone()))
            .register_type::<HapticPanel>()
            .insert_resource(PanelCost(cost.clone()))
            .init_resource::<tool_history::ToolHistory>()
            .init_resource::<fault_log::FaultLog>()
            .register_diagnostic(Diagnostic::new(Self::COST).with_suffix(" ms"))
            .add_systems(First, cost.timed(tool_history::start_frame))
            .add_systems(
                PreUpdate,
                (toggle, cost.timed(fault_log::collect_faults)).chain().after(HapticUpdateSystems::Tools),
            )
            .add_systems(
                ModelSchedule,
                cost.timed(tool_history::update_history)
                    .after(HapticSystems::Writeback)
                    .before(HapticSystems::Last),
            )
            .add_systems(Last, record_cost);
        if self.side {
            app.add_systems(EguiPrimaryContextPass, cost.timed(draw_side));
        }
    }
}

/// Opens and closes the side panel, unless a text field has the keyboard.
fn toggle(
    mut panel: ResMut<HapticPanel>,
    wants: Res<EguiWantsInput>,
    keys: Option<Res<ButtonInput<KeyCode>>>,
) {
    let keys = keys.filter(|_| !wants.wants_any_keyboard_input());
    if keys.zip(panel.key).is_some_and(|(keys, key)| keys.just_pressed(key)) {
        panel.open = !panel.open;
    }
}

/// Width of the side panel, points.
const WIDTH: f32 = 370.0;

fn draw_side(mut contexts: EguiContexts, mut widgets: HapticWidgets) {
    if !widgets.is_open() {
        return;
    }
    // Without a camera there is no context.
    let Ok(context) = contexts.ctx_mut() else { return };
    let screen =
        egui::UiBuilder::new().layer_id(egui::LayerId::background()).max_rect(context.viewport_rect());
    let mut ui = egui::Ui::new(context.clone(), "palpate".into(), screen);
    egui::Panel::right("palpate_panel").default_size(WIDTH).min_size(280.0).resizable(true).show(
        &mut ui,
        |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| widgets.all(ui));
        },
    );
}

fn record_cost(cost: Res<PanelCost>, mut diagnostics: Diagnostics) {
    diagnostics.add_measurement(&HapticPanelPlugin::COST, || cost.0.take_ms());
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_egui::EguiContext;
    use bevy_egui::input::write_egui_wants_input_system;

    #[test]
    fn typing_into_a_field_does_not_close_the_panel() {
        let mut app = App::new();
        app.init_resource::<EguiWantsInput>()
            .init_resource::<ButtonInput<KeyCode>>()
            .insert_resource(HapticPanel::new(true, Some(KeyCode::F1), "recordings".into()))
            .add_systems(PreUpdate, toggle)
            .add_systems(PostUpdate, write_egui_wants_input_system);
        let context = EguiContext::default();
        let egui = context.clone().get_mut().clone();
        app.world_mut().spawn(context);
        let mut press = |is_typing: bool| {
            let field = egui::Id::new("field");
            egui.memory_mut(|memory| {
                if is_typing { memory.request_focus(field) } else { memory.surrender_focus(field) }
            });
            app.update();
            app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::F1);
            app.update();
            app.world_mut().resource_mut::<ButtonInput<KeyCode>>().reset_all();
            app.world().resource::<HapticPanel>().open
        };
        assert_eq!([press(true), press(false), press(true)], [true, false, false]);
        assert!(press(false));
    }
}
