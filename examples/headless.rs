//! This example demonstrates a test of a haptic scene without a renderer, threads or sleeps. In lock step the same scene gives the same
//! bits.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::*;
use bevy_palpate::{ForceError, HapticSchedulePlugin, LoopMode, TickRecording};
use clap::Parser;
use palpate_haptics::{Reading, ScriptedDevice};
use std::io::Write;
use std::time::Duration;

/// Result of a run.
#[derive(Debug, PartialEq)]
struct Outcome {
    contact_starts: usize,
    contact_ends: usize,
    peak_n: f64,
    max_error: f64,
    /// Hash of the bits of all forces that were written to the device.
    bits: u64,
}

/// A tool presses a block, in lock step; the example checks the result.
#[derive(Clone, Copy, Debug, Parser)]
struct Options {
    /// Duration, s: the tool has left the body after 1.2 s
    #[arg(long, default_value_t = 1.3, value_parser = seconds)]
    seconds: f64,
    /// No effect: accepted like in the other scenes
    #[arg(long)]
    headless: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (1.3..=3600.0).contains(seconds));
    seconds.ok_or("it must be a number from 1.3 to 3600".into())
}

fn main() -> Result {
    let Options { seconds, .. } = Options::parse();
    let run = |scheme| run(scheme, seconds);
    let near = run(Scheme::NearFieldExact);
    let hold = run(Scheme::Hold);
    assert_eq!(near, run(Scheme::NearFieldExact), "the same scene gives the same bits");
    assert_eq!((near.contact_starts, near.contact_ends), (1, 1), "one contact");
    assert!((0.5..5.0).contains(&near.peak_n), "6 mm into tissue of 20 kPa: {} N", near.peak_n);
    assert!(near.max_error < 0.07, "an error of {} is noticeable", near.max_error);
    assert!(hold.max_error > 3.0 * near.max_error, "the error of Scheme::Hold is larger");
    let mut out = std::io::stdout().lock();
    writeln!(out, "peak force, N                      {:.3}", near.peak_n)?;
    writeln!(out, "maximum error of a model step      {:.2} %", 100.0 * near.max_error)?;
    writeln!(out, "the same with Scheme::Hold         {:.2} %", 100.0 * hold.max_error)?;
    writeln!(out, "bits of all forces, in both runs   {:016x}", near.bits)?;
    Ok(())
}

/// Runs the scene: a tool presses a block for 1.2 s and leaves.
fn run(scheme: Scheme, seconds: f64) -> Outcome {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins)
        .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || Ok(pressing_hand()));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom)));
    let tool = HapticTool::new("hand").with_scheme(scheme);
    let tool = app.world_mut().spawn((tool, TickRecording::default())).id();

    let mut outcome = Outcome { contact_starts: 0, contact_ends: 0, peak_n: 0.0, max_error: 0.0, bits: 0 };
    // The first update only starts the clock.
    for _ in 0..=(20.0 * seconds).round() as usize {
        app.update();
        let world = app.world_mut();
        outcome.contact_starts += world.resource_mut::<Messages<ContactStart>>().drain().count();
        outcome.contact_ends += world.resource_mut::<Messages<ContactEnd>>().drain().count();
        if let Some(error) = world.get::<ForceError>(tool).and_then(|error| error.relative) {
            outcome.max_error = outcome.max_error.max(error);
        }
    }
    if let Some(recording) = app.world().get::<TickRecording>(tool) {
        for record in &recording.records {
            outcome.peak_n = outcome.peak_n.max(record.force_n.length());
            let bits = record.force_n.to_array().map(f64::to_bits);
            outcome.bits = bits.iter().fold(outcome.bits, |all, bits| all.rotate_left(7) ^ bits);
        }
    }
    outcome
}

/// A device that moves from 2 mm above the top to a depth of 6 mm and back.
fn pressing_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = (n as f64 * 1e-3).min(1.2);
        let depth = 0.002 - 0.008 * (std::f64::consts::PI * t / 1.2).sin();
        Ok(Reading::at(DVec3::new(0.012, 0.055 + depth, 0.009)))
    })
}
