//! Captions of a scene: title, state, keys, and curves.

use crate::keys::keys_are_elsewhere;
use crate::scene::Shown;
use crate::{Stage, time};
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_palpate::prelude::*;
use egui::{Align2, Color32, RichText};
use egui_plot::{AxisHints, Line, PlotPoints, Points};

pub(crate) struct CaptionPlugin;

impl Plugin for CaptionPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<Help>()
            .add_systems(
                Update,
                toggle_help.run_if(resource_exists::<ButtonInput<KeyCode>>.and_then(not(keys_are_elsewhere))),
            )
            .add_systems(EguiPrimaryContextPass, write);
    }
}

/// Whether the list of keys is visible.
#[derive(Resource, Default)]
struct Help(bool);

const KEYS: [(&str, &str); 8] = [
    ("R", "restart"),
    ("Space", "pause"),
    ("S", "slow motion, 1/10"),
    ("1 … 6", "scheme: hold to near field exact"),
    ("M", "mouse or the scene's own device"),
    ("P  G  H", "panel, gizmos, this list"),
    ("left button, wheel", "grasp, depth of the mouse"),
    ("right, middle, Ctrl + wheel", "camera"),
];

fn toggle_help(keys: Res<ButtonInput<KeyCode>>, mut help: ResMut<Help>) {
    help.0 ^= keys.just_pressed(KeyCode::KeyH);
}

fn write(
    mut contexts: EguiContexts,
    stage: Res<Stage>,
    help: Res<Help>,
    (time, shown): (Res<Time<Virtual>>, Res<Shown>),
    tools: Query<(&HapticTool, &ToolForce)>,
) -> Result {
    let context = contexts.ctx_mut()?;
    egui::Area::new("title".into()).anchor(Align2::LEFT_TOP, [12.0, 10.0]).interactable(false).show(
        context,
        |ui| {
            let shade = egui::Frame::NONE.fill(Color32::from_black_alpha(110)).corner_radius(4.0);
            shade.inner_margin(egui::Margin::symmetric(6, 2)).show(ui, |ui| {
                ui.label(RichText::new(stage.title).size(15.0).strong().color(Color32::WHITE));
            });
        },
    );
    egui::Area::new("state".into()).anchor(Align2::LEFT_BOTTOM, [12.0, -8.0]).interactable(false).show(
        context,
        |ui| {
            for (tool, force) in &tools {
                let line = format!("{}   {:4.2} N", tool.scheme.name(), force.force_n.length());
                let line = RichText::new(line).size(13.0).monospace().color(Color32::from_gray(215));
                // The area is narrow before the first tool.
                ui.add(egui::Label::new(line).extend());
            }
            // Pictures show no keys.
            if *shown == Shown::InPictures {
                return;
            }
            let state = match (time.is_paused(), time::is_slow(&time)) {
                (true, _) => "paused   ",
                (false, true) => "1/10 speed, in lock step, model steps every 5 ms   ",
                (false, false) => "",
            };
            let line = format!("{state}H: keys");
            ui.label(RichText::new(line).size(11.0).color(Color32::from_gray(150)));
        },
    );
    if help.0 {
        egui::Window::new("keys").anchor(Align2::LEFT_CENTER, [12.0, 0.0]).resizable(false).show(
            context,
            |ui| {
                egui::Grid::new("keys").show(ui, |ui| {
                    for (key, action) in KEYS {
                        ui.label(RichText::new(key).monospace().strong());
                        ui.label(action);
                        ui.end_row();
                    }
                });
            },
        );
    }
    Ok(())
}

/// Curves of a scene.
pub struct Plot<'a> {
    /// Title of the plot.
    pub title: &'a str,
    /// Labels of the axes, with units.
    pub axes: [&'a str; 2],
    /// Name, colour (red, green, blue) and points of each line.
    pub lines: &'a [(&'a str, [u8; 3], Vec<[f64; 2]>)],
    /// Name, colour and positions of each set of separate points.
    pub points: &'a [(&'a str, [u8; 3], Vec<[f64; 2]>)],
}

/// Draws `plot` in the lower right corner.
///
/// # Errors
/// Without a context of bevy_egui.
pub fn plot_window(contexts: &mut EguiContexts, plot: &Plot<'_>) -> Result {
    let color = |[r, g, b]: [u8; 3]| Color32::from_rgb(r, g, b);
    let frame = egui::Frame::NONE.fill(Color32::from_black_alpha(175)).corner_radius(6.0).inner_margin(8.0);
    let area = egui::Area::new(egui::Id::new(plot.title)).anchor(Align2::RIGHT_BOTTOM, [-10.0, -10.0]);
    area.show(contexts.ctx_mut()?, |ui| {
        frame.show(ui, |ui| {
            ui.set_width(226.0);
            ui.label(RichText::new(plot.title).size(12.0).strong().color(Color32::WHITE));
            ui.horizontal_wrapped(|ui| {
                for (name, of, _) in plot.lines.iter().chain(plot.points) {
                    ui.label(RichText::new(*name).size(11.0).color(color(*of)));
                }
            });
            egui_plot::Plot::new(plot.title)
                .width(222.0)
                .height(132.0)
                .custom_x_axes(vec![AxisHints::new_x().label(plot.axes[0]).label_spacing(18.0..=40.0)])
                .custom_y_axes(vec![AxisHints::new_y().label(plot.axes[1]).label_spacing(12.0..=26.0)])
                .include_x(0.0)
                .include_y(0.0)
                .show_background(false)
                .allow_drag(false)
                .allow_zoom(false)
                .allow_scroll(false)
                .show(ui, |shown| {
                    for (name, line, points) in plot.lines {
                        let points = PlotPoints::from(points.clone());
                        shown.line(Line::new(*name, points).color(color(*line)).width(1.8));
                    }
                    for (name, dot, points) in plot.points {
                        let points = PlotPoints::from(points.clone());
                        shown.points(Points::new(*name, points).color(color(*dot)).radius(2.6));
                    }
                });
        });
    });
    Ok(())
}
