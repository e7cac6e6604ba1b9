//! This example demonstrates a device driver: the trait `HapticDevice` for a simulated hand, a mass on a spring that follows a sinusoidal
//! target and is pushed back by the force.

use bevy::prelude::*;
use bevy_palpate::TickRecording;
use bevy_palpate::prelude::*;
use clap::Parser;
use palpate_haptics::{DeviceDescription, DeviceError, HapticDevice, Reading};
use palpate_stage::{SetUpHands, SetUpScene, Stage, StageOptions};
use std::f64::consts::TAU;
use std::io::Write;
use std::time::Duration;

/// The hand: x'' = (k (target − x) − b x' + F)/m.
#[derive(Debug, Default)]
struct SpringHand {
    tick: u64,
    open: bool,
    position_m: f64,
    velocity_m_per_s: f64,
    force_n: f64,
}

const STIFFNESS_N_PER_M: f64 = 300.0;
const DAMPING_NS_PER_M: f64 = 8.0;
const MASS_KG: f64 = 0.1;
const TICK_S: f64 = 1e-3;

impl HapticDevice for SpringHand {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "spring hand".into(),
            workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
            max_force_n: 10.0,
            rate_hz: 1.0 / TICK_S,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        *self = Self { open: true, position_m: target_m(0), ..Self::default() };
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        self.tick += 1;
        let pull = STIFFNESS_N_PER_M * (target_m(self.tick) - self.position_m) + self.force_n;
        self.velocity_m_per_s += TICK_S * (pull - DAMPING_NS_PER_M * self.velocity_m_per_s) / MASS_KG;
        self.position_m += TICK_S * self.velocity_m_per_s;
        Ok(Reading::at(DVec3::new(0.012, self.position_m, 0.009)))
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        self.force_n = force_n.y;
        Ok(())
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        *self = Self::default();
        Ok(())
    }
}

/// Target of the hand, m: from 15 mm above the body's top to 10 mm below it, twice in three seconds.
fn target_m(tick: u64) -> f64 {
    0.05 + 0.005 + 0.0025 + 0.0125 * (TAU * tick as f64 * TICK_S / 1.5).cos()
}

/// A simulated, spring-driven device touches a soft block.
#[derive(Clone, Debug, Parser)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
}

fn main() -> AppExit {
    let Options { stage: options } = Options::parse();
    let stage = Stage {
        name: "custom_device",
        title: "A device driver: a hand driven by a spring, pushed back by the body",
        seconds: 3.0,
        ..default()
    };
    let mut app = stage.app(&options);
    app.add_systems(SetUpScene, set_up)
        .add_systems(SetUpHands, set_up_hands)
        .add_systems(Last, report.run_if(on_message::<AppExit>));
    app.world_mut().resource_mut::<HapticDevices>().register("spring hand", || Ok(SpringHand::default()));
    app.run()
}

fn set_up(mut commands: Commands) {
    commands.spawn((
        DeformableBody::block([6, 6, 6], 0.1),
        Tissue { youngs_modulus_pa: 20e3, ..default() },
        FixedRegion::Face(BoxFace::Bottom),
    ));
}

fn set_up_hands(mut commands: Commands, options: Res<StageOptions>) {
    let tool = HapticTool::new("spring hand").with_scheme(options.scheme);
    commands.spawn((tool, TickRecording { keep: 60_000, ..default() }));
}

/// Reports the maximum force, and the tracking error at that time.
fn report(tools: Query<&TickRecording>, mut done: Local<bool>) -> Result {
    let Ok(recording) = tools.single() else { return Ok(()) };
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let strongest = recording.records.iter().max_by(|a, b| a.force_n.y.total_cmp(&b.force_n.y));
    let Some((record, sample)) = strongest.and_then(|record| Some((record, record.sample?))) else {
        return Ok(());
    };
    let (force_n, error_m) = (record.force_n.y, sample.position_m.y - target_m(sample.sequence));
    let ticks = recording.records.iter().filter(|record| record.force_n.y > 0.0).count();
    let mut out = std::io::stdout().lock();
    writeln!(out, "maximum force, N         {force_n:.3}   at {:.3} s", sample.time_s)?;
    writeln!(
        out,
        "tracking error, mm       {:.2}   force / stiffness {:.2}",
        1e3 * error_m,
        1e3 * force_n / STIFFNESS_N_PER_M
    )?;
    writeln!(out, "ticks in contact         {ticks} of {}", recording.records.len())?;
    writeln!(out, r#"{{"force_n":{force_n:.4},"error_m":{error_m:.6},"contact_ticks":{ticks}}}"#)?;
    Ok(())
}
