//! This example demonstrates two hands on one body: what one presses the other feels. Each tool is an entity with a device and a loop of
//! its own; the body is stepped along both.

use bevy::prelude::*;
use bevy_palpate::TickRecording;
use bevy_palpate::prelude::*;
use clap::Parser;
use palpate_stage::{SetUpHands, SetUpScene, Stage, StageOptions, ToolPaint, register_hand};
use std::io::Write;

/// Where the two hands are, m, across the body.
const LEFT_M: f64 = -0.013;
const RIGHT_M: f64 = 0.013;
const TOP_M: f64 = 0.03;
const RADIUS_M: f64 = 0.008;

/// The left hand rests on a soft slab; the right one presses beside it and leaves again.
#[derive(Clone, Debug, Parser)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
}

/// Which hand a tool is.
#[derive(Component, Clone, Copy, PartialEq)]
enum Hand {
    Left,
    Right,
}

fn main() -> AppExit {
    let Options { stage: options } = Options::parse();
    let stage = Stage {
        name: "two_tools",
        title: "Two hands on one body: what the orange one presses the blue one feels",
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

/// A hand that presses at `x_m`, `depth_m` deep.
fn press(x_m: f64, depth_m: f64) -> Reading {
    Reading::at(DVec3::new(x_m, TOP_M + RADIUS_M - depth_m, 0.0))
}

/// Down to 4 mm within half a second, and there it stays.
fn left_depth_m(t: f64) -> f64 {
    0.014 * (t / 0.5).min(1.0) - 0.010
}

/// From 15 mm above to 12 mm deep and back, between 1 s and 2.4 s.
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
        let tool = HapticTool {
            device: DeviceSelector::named(name),
            scheme: options.scheme,
            shape: ToolShape::Sphere { radius_m: RADIUS_M },
            ..default()
        };
        commands.spawn((tool, hand, paint, TickRecording { keep: 60_000, ..default() }));
    }
}

/// What the left hand felt alone and with the right one beside it.
fn report(tools: Query<(&Hand, &TickRecording)>, mut done: Local<bool>) -> Result {
    let of = |wanted| tools.iter().find(|(hand, _)| **hand == wanted).map(|(_, recording)| recording);
    let (Some(left), Some(right)) = (of(Hand::Left), of(Hand::Right)) else { return Ok(()) };
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let peak = right.records.iter().max_by(|a, b| a.force_n.length().total_cmp(&b.force_n.length()));
    let felt =
        |at: u64| left.records.iter().find(|record| record.sequence == at).map(|record| record.force_n);
    let (Some(pressed), Some(alone_n)) = (peak, felt(950)) else {
        writeln!(std::io::stdout(), "it takes 2 s for the right hand to press")?;
        return Ok(());
    };
    let (right_n, beside_n) = (pressed.force_n, felt(pressed.sequence).unwrap_or_default());
    let change_n = beside_n - alone_n;
    let mut out = std::io::stdout().lock();
    writeln!(out, "force, N            across    out   along")?;
    for (what, f) in [
        ("left hand alone", alone_n),
        ("right hand", right_n),
        ("left hand beside it", beside_n),
        ("so it felt", change_n),
    ] {
        writeln!(out, "{what:19} {:6.3} {:6.3} {:7.3}", f.x, f.y, f.z)?;
    }
    writeln!(
        out,
        r#"{{"alone_n":{:.4},"right_n":{:.4},"beside_n":{:.4}}}"#,
        alone_n.length(),
        right_n.length(),
        beside_n.length()
    )?;
    Ok(())
}
