//! This example demonstrates the whole ring: a recorded hand probes a soft organ and finds a lump in it. The organ steps at
//! 20 Hz in a Bevy app, the local model ticks at 1 kHz on a thread of its own; afterwards every scheme is judged against
//! the full body on the samples that were felt.
//!
//! `cargo run --release --example probing` runs anywhere; `--features panel,gizmos` shows it.

mod comparable;
mod options;
mod plot;
mod report;
mod scene;
mod touches;

use bevy::prelude::*;
use bevy_palpate::LoopMode;
use clap::Parser;
use options::Options;
use palpate_stage::Stage;

fn main() -> AppExit {
    let options = Options::parse();
    let stage = Stage {
        name: "probing",
        title: "A hand probes an organ for a lump, felt at 1,000 Hz; the body steps at 20 Hz",
        floor_m: -0.0132,
        focus_m: Vec3::new(0.005, 0.03, 0.0),
        eye_m: Vec3::new(0.07, 0.115, 0.13),
        // What the loop's thread does is what it is about.
        mode: LoopMode::Threaded,
        ..Stage::default()
    };
    stage
        .app(&options.stage)
        .add_plugins((scene::ScenePlugin { hand: options.trajectory.clone() }, report::ReportPlugin))
        .insert_resource(options)
        .run()
}
