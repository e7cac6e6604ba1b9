//! A soft block and a tool moved by a recorded hand.

use crate::options::Options;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ModelStepCount, TickRecording};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;

/// Time probed when nothing else is said and there is no window, s.
const HEADLESS_SECONDS: f64 = 5.0;

/// Spawns the scene and ends it in time.
pub struct ScenePlugin;

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(PalpatePlugins).add_systems(Startup, setup).add_systems(Update, end_in_time);
    }
}

/// Shows how far the probing is, where there is no window to see it.
pub struct ProgressPlugin;

impl Plugin for ProgressPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Progress(ProgressBar::no_length())).add_systems(Update, show_progress);
    }
}

/// A bar on a terminal; elsewhere a line each second.
#[derive(Resource)]
pub struct Progress(ProgressBar);

impl Progress {
    /// Clears the bar, so that the table stands alone.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

/// Periods of 1 ms to be probed, if there is an end.
pub fn periods(options: &Options, headless: bool) -> Option<u64> {
    let seconds = options.seconds.or(headless.then_some(HEADLESS_SECONDS));
    seconds.map(|seconds| (seconds * 1000.0).round() as u64)
}

fn setup(mut commands: Commands, options: Res<Options>) {
    commands.spawn((
        DeformableBody::block([6, 6, 6], 0.1),
        Tissue { youngs_modulus_pa: 20e3, density_kg_per_m3: 1000.0, damping_ratio: 0.5 },
        FixedRegion::Face(Face::Bottom),
    ));
    commands.spawn((
        HapticTool {
            device: DeviceSelector::replay(options.trajectory.display().to_string()),
            scheme: options.scheme,
            ..default()
        },
        TickRecording::default(),
    ));
}

fn end_in_time(
    tools: Query<&TickRecording>,
    options: Res<Options>,
    progress: Option<Res<Progress>>,
    mut exit: MessageWriter<AppExit>,
) {
    let done = tools.iter().filter_map(|t| t.samples.last()).map(|s| s.sequence).max().unwrap_or(0);
    if periods(&options, progress.is_some()).is_some_and(|periods| done >= periods) {
        exit.write(AppExit::Success);
    }
}

fn show_progress(
    tools: Query<(&ToolForce, &LoopTiming)>,
    steps: Res<ModelStepCount>,
    options: Res<Options>,
    progress: Res<Progress>,
    mut said: Local<u64>,
) {
    let Ok((force, timing)) = tools.single() else { return };
    let bar = &progress.0;
    if bar.length().is_none() {
        bar.set_length(periods(&options, true).unwrap_or_default());
        let line = "{elapsed} [{bar:30}] {msg}";
        bar.set_style(ProgressStyle::with_template(line).unwrap_or_else(|_| ProgressStyle::default_bar()));
    }
    bar.set_position(timing.ticks + timing.missed_deadlines);
    let line = format!("{} model steps, {:5.2} N", steps.0, force.force_n.length());
    let second = bar.position() / 1000;
    if bar.is_hidden() && std::mem::replace(&mut *said, second) != second {
        let _ = writeln!(std::io::stderr(), "{second} s: {line}");
    }
    bar.set_message(line);
}
