//! This example demonstrates the full pipeline: a recorded motion probes a soft organ that lies on a table, and finds a lump in it. The
//! organ is stepped at 20 Hz in a Bevy app, the local model at 1 kHz on a thread. Afterwards every scheme is compared with the full body on
//! the same samples.
//!
//! `cargo run --release --example probing` runs headless; `--features panel,gizmos` opens a window.

mod comparable;
mod options;
mod plot;
mod report;
mod scene;
mod touches;

use bevy::prelude::*;
use bevy_palpate::LoopMode;
use clap::Parser;
pub use options::Options;
use palpate_stage::Stage;

fn main() -> AppExit {
    app(stage(), Options::parse()).run()
}

/// The description of the scene.
pub fn stage() -> Stage {
    Stage {
        name: "probing",
        title: "A hand probes an organ for a lump: force at 1,000 Hz, body at 20 Hz",
        floor_m: 0.0,
        focus_m: Vec3::new(0.013, 0.032, 0.0),
        eye_m: Vec3::new(0.078, 0.117, 0.13),
        // The example demonstrates the loop on a thread.
        mode: LoopMode::Threaded,
        settles: true,
        ..Stage::default()
    }
}

/// The scene on `stage`.
pub fn app(stage: Stage, options: Options) -> App {
    let mut app = stage.app(&options.stage);
    app.add_plugins((scene::ScenePlugin { hand: options.trajectory.clone() }, report::ReportPlugin))
        .insert_resource(options);
    app
}
