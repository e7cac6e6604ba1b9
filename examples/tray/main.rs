//! This example demonstrates rigid bodies of avian3d with a soft one: an organ rests on a tray, which stands on a table, a lump rolls off
//! the organ, and a hand presses on it. The tray bears the organ and the hand.
//!
//! `cargo run --release --features avian --example tray` prints the forces; `--features avian,panel,gizmos` opens a window.

mod hand;
#[cfg(feature = "window")]
mod looks;
mod outcome;
mod scene;

use bevy::prelude::*;
use clap::Parser;
use palpate_stage::{Stage, StageOptions};

/// An organ on a tray, a lump that rolls off it, and a hand that presses.
#[derive(Clone, Debug, Parser)]
#[command(after_help = "Examples:\n  tray --seconds 3\n  tray --pictures . --at 0.5,2.4")]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
}

fn main() -> AppExit {
    let Options { stage: options } = Options::parse();
    let stage = Stage {
        name: "tray",
        title: "An organ on a tray: rigid and soft bodies push each other; a lump rolls off",
        eye_m: Vec3::new(0.10, 0.17, 0.24),
        focus_m: Vec3::new(0.0, 0.03, 0.0),
        floor_m: 0.0,
        seconds: hand::SECONDS,
        ..default()
    };
    let mut app = stage.app(&options);
    app.add_plugins((scene::ScenePlugin, outcome::OutcomePlugin));
    #[cfg(feature = "window")]
    app.add_plugins(looks::LooksPlugin);
    app.run()
}
