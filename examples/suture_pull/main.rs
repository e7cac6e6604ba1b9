//! This example demonstrates grasp and suture: a tool grasps a wound's edge and pulls it across, three threads are sewn and tightened, and
//! the tool finally tears the middle one; the others hold.
//!
//! `cargo run --release --example suture_pull` prints the forces; `--features panel,gizmos` opens a window, in which key M selects the
//! mouse, whose left button grasps.

mod hand;
mod scene;
#[cfg(feature = "panel")]
mod tension;
mod wound;

use bevy::prelude::*;
use clap::Parser;
use palpate_stage::{Stage, StageOptions};

/// A tool grasps a wound's edge and pulls it across; threads hold it, with equal forces on both sides, until one tears.
#[derive(Clone, Debug, Parser)]
#[command(after_help = "Examples:\n  suture_pull --seconds 3\n  suture_pull --pictures . --at 1.2,2.8")]
pub struct Options {
    #[command(flatten)]
    stage: StageOptions,
    /// Tension at which a thread tears, N
    #[arg(long, default_value_t = 0.3)]
    tear_limit: f64,
}

fn main() -> AppExit {
    app(&Options::parse()).run()
}

/// The scene.
pub fn app(options: &Options) -> App {
    let stage = Stage {
        name: "suture_pull",
        title: "A wound's edge is grasped, pulled across and sewn; threads pull and never push",
        eye_m: Vec3::new(-0.032, 0.095, 0.088),
        focus_m: Vec3::new(0.014, 0.0, 0.012),
        floor_m: -0.0152,
        seconds: hand::SECONDS,
        ..Stage::default()
    };
    let mut app = stage.app(&options.stage);
    app.add_plugins(scene::ScenePlugin { tear_limit_n: options.tear_limit });
    #[cfg(feature = "panel")]
    app.add_plugins(tension::TensionPlugin);
    app
}
