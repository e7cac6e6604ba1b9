//! This example demonstrates the whole ring: a recorded hand probes a soft block. The block steps at 20 Hz in a
//! Bevy app, the local model ticks at 1 kHz on a thread of its own; afterwards every scheme is judged against
//! the full body on the samples that were felt.
//!
//! `cargo run --release --example probing` runs anywhere; `--features window` shows it.

mod options;
mod plot;
mod report;
mod scene;
#[cfg(feature = "window")]
mod window;

use bevy::app::ScheduleRunnerPlugin;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use clap::Parser;
use options::Options;
use std::time::Duration;

fn main() -> AppExit {
    let options = Options::parse();
    let mut app = App::new();
    #[cfg(feature = "window")]
    let windowed = window::add_plugins(&mut app, &options);
    #[cfg(not(feature = "window"))]
    let windowed = false;
    if !windowed {
        let frame = ScheduleRunnerPlugin::run_loop(Duration::from_millis(5));
        app.add_plugins((MinimalPlugins.set(frame), LogPlugin::default(), scene::ProgressPlugin));
    }
    app.add_plugins((scene::ScenePlugin, report::ReportPlugin)).insert_resource(options).run()
}
