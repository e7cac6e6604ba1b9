//! Progress of a scene without a window.

use crate::scene::Shown;
use crate::{SceneTime, Stage, StageOptions};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;

pub(crate) struct ProgressPlugin;

impl Plugin for ProgressPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Progress(ProgressBar::no_length()))
            .add_systems(Update, show_progress)
            .add_systems(Last, finish.run_if(on_message::<AppExit>));
    }
}

/// A bar on a terminal, otherwise a line per second.
#[derive(Resource)]
struct Progress(ProgressBar);

/// Clears the bar before the scene's report.
fn finish(progress: Res<Progress>) {
    progress.0.finish_and_clear();
}

fn show_progress(
    tools: Query<&ToolForce>,
    time: Res<SceneTime>,
    (stage, options): (Res<Stage>, Res<StageOptions>),
    progress: Res<Progress>,
    mut printed_s: Local<u64>,
) {
    let bar = &progress.0;
    if bar.length().is_none() {
        let end_s = stage.end_s(&options, Shown::Headless).unwrap_or_default();
        bar.set_length((end_s * 1000.0).round() as u64);
        let line = "{elapsed} [{bar:30}] {msg}";
        bar.set_style(ProgressStyle::with_template(line).unwrap_or_else(|_| ProgressStyle::default_bar()));
    }
    bar.set_position((time.0 * 1000.0).round() as u64);
    let forces: Vec<String> = tools.iter().map(|force| format!("{:5.2} N", force.force_n.length())).collect();
    let line = forces.join(", ");
    let second = bar.position() / 1000;
    if bar.is_hidden() && std::mem::replace(&mut *printed_s, second) != second {
        let _ = writeln!(std::io::stderr(), "{second} s: {line}");
    }
    bar.set_message(line);
}
