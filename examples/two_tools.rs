//! This example demonstrates two tools on one body, which influence each other. Each tool is an entity with its own device and loop; the
//! body is stepped along both.

use bevy::prelude::*;
use bevy_palpate::TickRecording;
use bevy_palpate::prelude::*;
use clap::Parser;
use palpate_haptics::Reading;
use palpate_stage::{SetUpHands, SetUpScene, Stage, StageOptions, ToolPaint, register_hand};
use std::io::Write;

/// Positions of the two tools across the body, m.
const LEFT_M: f64 = -0.013;
const RIGHT_M: f64 = 0.013;
const TOP_M: f64 = 0.03;
const RADIUS_M: f64 = 0.008;

/// The left tool rests on a soft slab; the right one presses next to it and leaves.
#[derive(Clone, Debug, Parser)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
}

/// Side of a tool.
#[derive(Component, Clone, Copy, PartialEq)]
enum Hand {
    Left,
    Right,
}

fn main() -> AppExit {
    let Options { stage: options } = Options::parse();
    let stage = Stage {
        name: "two_tools",
        title: "Two tools on one body: the orange one changes the force on the blue one",
        eye_m: Vec3::new(0.0, 0.095, 0.165),
        focus_m: Vec3::new(0.0, 0.012, 0.0),
        floor_m: -0.0302,
        seconds: 3.0,
        ..default()
    };
    let mut app = stage.app(&options);
    app.add_systems(SetUpScene, set_up)
        .add_systems(SetUpHands, set_up_hands)
        .add_systems(Last, report.run_if(on_message::<AppExit>));
    register_hand(app.world_mut(), "left", |t| press(LEFT_M, left_depth_m(t)));
    register_hand(app.world_mut(), "right", |t| press(RIGHT_M, right_depth_m(t)));
    app.run()
}

/// The reading of a device at `x_m` and a depth of `depth_m`.
fn press(x_m: f64, depth_m: f64) -> Reading {
    Reading::at(DVec3::new(x_m, TOP_M + RADIUS_M - depth_m, 0.0))
}

/// Depth of the left tool: 4 mm from half a second on.
fn left_depth_m(t: f64) -> f64 {
    0.014 * (t / 0.5).min(1.0) - 0.010
}

/// Depth of the right tool: from 15 mm above the surface to a depth of 12 mm and back, between 1 s and 2.4 s.
fn right_depth_m(t: f64) -> f64 {
    let way = ((t - 1.0) / 1.4).clamp(0.0, 1.0);
    0.027 * (std::f64::consts::PI * way).sin().powi(2) - 0.015
}

fn set_up(mut commands: Commands) {
    commands.spawn((
        DeformableBody::block_of_size([13, 7, 9], DVec3::new(0.12, 2.0 * TOP_M, 0.08)),
        Tissue { youngs_modulus_pa: 10e3, ..default() },
        FixedRegion::Face(BoxFace::Bottom),
    ));
}

fn set_up_hands(mut commands: Commands, options: Res<StageOptions>) {
    for (hand, name, paint) in
        [(Hand::Left, "left", ToolPaint::Blue), (Hand::Right, "right", ToolPaint::Orange)]
    {
        let shape = ToolShape::Sphere { radius_m: RADIUS_M };
        let tool = HapticTool::new(name).with_scheme(options.scheme).with_shape(shape);
        commands.spawn((tool, hand, paint, TickRecording { keep: 60_000, ..default() }));
    }
}

/// Reports the force on the left tool, alone and with the right one.
fn report(tools: Query<(&Hand, &TickRecording)>, mut done: Local<bool>) -> Result {
    let of = |side| tools.iter().find(|(hand, _)| **hand == side).map(|(_, recording)| recording);
    let (Some(left), Some(right)) = (of(Hand::Left), of(Hand::Right)) else { return Ok(()) };
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let peak = right.records.iter().max_by(|a, b| a.force_n.length().total_cmp(&b.force_n.length()));
    let left_n =
        |at: u64| left.records.iter().find(|record| record.sequence == at).map(|record| record.force_n);
    let (Some(peak), Some(alone_n)) = (peak, left_n(950)) else {
        writeln!(std::io::stdout(), "no report: the right tool presses after 2 s")?;
        return Ok(());
    };
    let (right_n, both_n) = (peak.force_n, left_n(peak.sequence).unwrap_or_default());
    let change_n = both_n - alone_n;
    let mut out = std::io::stdout().lock();
    writeln!(out, "force, N             across    out   along")?;
    for (what, f) in [
        ("left tool alone", alone_n),
        ("right tool", right_n),
        ("left tool with right", both_n),
        ("change", change_n),
    ] {
        writeln!(out, "{what:20} {:6.3} {:6.3} {:7.3}", f.x, f.y, f.z)?;
    }
    writeln!(
        out,
        r#"{{"alone_n":{:.4},"right_n":{:.4},"both_n":{:.4}}}"#,
        alone_n.length(),
        right_n.length(),
        both_n.length()
    )?;
    Ok(())
}
