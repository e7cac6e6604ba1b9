//! This example demonstrates indentation: a ball and a flat punch are pressed slowly into a soft layer. It compares force over depth with
//! the theory of elasticity.
//!
//! `cargo run --release --example indentation` prints the ratios of measured and predicted force; `--features panel,gizmos` plots the curve
//! in a window.

mod curve;
mod hand;
pub mod scene;
mod theory;

use bevy::prelude::*;
use clap::Parser;
use palpate_stage::{Stage, StageOptions};

/// A ball and a flat punch are pressed into a soft layer; force over depth is compared with Hertz and the flat punch.
#[derive(Clone, Debug, Parser)]
#[command(
    after_help = "The layer is 180 by 60 by 180 mm, of 20 kPa and Poisson's ratio 0.45, with a fixed bottom; the ball has a radius of \
    40 mm, the punch of 20 mm. In a window the mouse can press instead (key M).\n\nExamples:\n  indentation --tip ball\n  indentation --pictures . --at 2.4"
)]
pub struct Options {
    #[command(flatten)]
    stage: StageOptions,
    /// Tip of the tool [default: both, one after the other]
    #[arg(long)]
    tip: Option<scene::Tip>,
}

fn main() -> AppExit {
    app(&Options::parse()).run()
}

/// The scene.
pub fn app(options: &Options) -> App {
    let tips = options.tip.map_or(vec![scene::Tip::Ball, scene::Tip::Punch], |tip| vec![tip]);
    let stage = Stage {
        name: "indentation",
        title: "A ball and a flat punch pressed into a soft layer: force over depth, compared with Hertz",
        eye_m: Vec3::new(0.05, 0.14, 0.24),
        focus_m: Vec3::new(0.035, 0.005, 0.0),
        floor_m: -0.0302,
        seconds: hand::SECONDS * tips.len() as f64,
        ..Stage::default()
    };
    let mut app = stage.app(&options.stage);
    app.add_plugins(scene::ScenePlugin { tips });
    #[cfg(feature = "panel")]
    app.add_systems(bevy_egui::EguiPrimaryContextPass, curve::show);
    app
}
