//! This example demonstrates a test of a haptic scene: no renderer, no threads, no sleeping. In lock step every update of the app is
//! one model step, and the same scene gives the same bits.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::TickRecording;
use bevy_palpate::prelude::*;
use clap::Parser;
use std::io::Write;
use std::time::Duration;

/// What a run has come to.
#[derive(Debug, PartialEq)]
struct Outcome {
    touched: usize,
    let_go: usize,
    peak_n: f64,
    largest_error: f64,
    /// Bits of every force that was written to the device, folded.
    bits: u64,
}

/// A hand presses a block, in lock step; what comes of it is checked.
#[derive(Clone, Copy, Debug, Parser)]
struct Options {
    /// How long it runs, s: the hand is away again after 1.2 s
    #[arg(long, default_value_t = 1.3, value_parser = seconds)]
    seconds: f64,
    /// It never has a window, and takes this as the other scenes do
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
    assert_eq!((near.touched, near.let_go), (1, 1), "one touch, told at both its ends");
    assert!((0.5..5.0).contains(&near.peak_n), "6 mm into tissue of 20 kPa: {} N", near.peak_n);
    assert!(near.largest_error < 0.07, "nobody notices an error of {}", near.largest_error);
    assert!(hold.largest_error > 3.0 * near.largest_error, "the held force is farther off");
    let mut out = std::io::stdout().lock();
    writeln!(out, "peak force, N                      {:.3}", near.peak_n)?;
    writeln!(out, "largest error of a model step      {:.2} %", 100.0 * near.largest_error)?;
    writeln!(out, "the same with the force held       {:.2} %", 100.0 * hold.largest_error)?;
    writeln!(out, "bits of all forces, twice the same {:016x}", near.bits)?;
    Ok(())
}

/// A hand presses a block for 1.2 s and leaves.
fn run(scheme: Scheme, seconds: f64) -> Outcome {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins)
        .add_plugins(PalpatePlugins.set(HapticSchedulePlugin { mode: LoopMode::Lockstep, ..default() }))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || Ok(pressing_hand()));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom)));
    let tool = HapticTool { device: DeviceSelector::named("hand"), scheme, ..default() };
    let tool = app.world_mut().spawn((tool, TickRecording::default())).id();

    let mut outcome = Outcome { touched: 0, let_go: 0, peak_n: 0.0, largest_error: 0.0, bits: 0 };
    // The first update only starts the clock.
    for _ in 0..=(20.0 * seconds).round() as usize {
        app.update();
        let world = app.world_mut();
        outcome.touched += world.resource_mut::<Messages<ContactStart>>().drain().count();
        outcome.let_go += world.resource_mut::<Messages<ContactEnd>>().drain().count();
        if let Some(error) = world.get::<ForceError>(tool).and_then(|error| error.relative) {
            outcome.largest_error = outcome.largest_error.max(error);
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

/// Down from 2 mm above the top to 6 mm below it, and up again.
fn pressing_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = (n as f64 * 1e-3).min(1.2);
        let depth = 0.002 - 0.008 * (std::f64::consts::PI * t / 1.2).sin();
        Ok(Reading::at(DVec3::new(0.012, 0.055 + depth, 0.009)))
    })
}
