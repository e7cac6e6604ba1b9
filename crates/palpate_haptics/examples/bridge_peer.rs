//! This example demonstrates the vendor's end of a bridge: a process that serves a device to palpate in another process. The device is
//! a simulated hand: a mass on a spring with a moving end, pushed back by the force.
//!
//! `cargo run -p palpate_haptics --example bridge_peer [ADDRESS:PORT [--beyond-loopback]]`; Enter ends it.

use glam::DVec3;
use palpate_haptics::bridge::{BridgePeer, PeerSettings};
use palpate_haptics::{DeviceDescription, DeviceError, HapticDevice, Reading};
use std::f64::consts::TAU;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const STIFFNESS_N_PER_M: f64 = 300.0;
const DAMPING_NS_PER_M: f64 = 8.0;
const MASS_KG: f64 = 0.1;
const TICK_S: f64 = 1e-3;

/// The hand: x'' = (k (target − x) − b x' + F)/m.
#[derive(Clone, Copy, Debug, Default)]
struct SpringHand {
    tick: u64,
    position_m: DVec3,
    velocity_m_per_s: DVec3,
    force_n: DVec3,
}

impl SpringHand {
    /// Position of the spring's end: up and down by 30 mm, once in three seconds.
    fn target_m(&self) -> DVec3 {
        DVec3::Y * 0.03 * (TAU * self.tick as f64 * TICK_S / 3.0).cos()
    }

    fn step(&mut self) {
        self.tick += 1;
        let spring_n = STIFFNESS_N_PER_M * (self.target_m() - self.position_m) + self.force_n;
        self.velocity_m_per_s += TICK_S * (spring_n - DAMPING_NS_PER_M * self.velocity_m_per_s) / MASS_KG;
        self.position_m += TICK_S * self.velocity_m_per_s;
    }
}

/// The hand as a device, with access for the main thread.
struct Device(Arc<Mutex<SpringHand>>);

impl Device {
    fn with<T>(&mut self, operation: impl FnOnce(&mut SpringHand) -> T) -> Result<T, DeviceError> {
        self.0.lock().map(|mut hand| operation(&mut hand)).map_err(|_| DeviceError::Disconnected)
    }
}

impl HapticDevice for Device {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "hand on a spring".into(),
            workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
            max_force_n: 10.0,
            rate_hz: 1.0 / TICK_S,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        self.with(|hand| *hand = SpringHand { position_m: hand.target_m(), ..SpringHand::default() })
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        self.with(|hand| {
            hand.step();
            let velocity_m_per_s = Some(hand.velocity_m_per_s);
            Reading { velocity_m_per_s, ..Reading::at(hand.position_m) }
        })
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.with(|hand| hand.force_n = force_n)
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        self.write(DVec3::ZERO)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut settings = PeerSettings::default();
    for word in std::env::args().skip(1) {
        match word.as_str() {
            "--beyond-loopback" => settings.beyond_loopback = true,
            address => settings.address = address.parse()?,
        }
    }
    let hand = Arc::new(Mutex::new(SpringHand::default()));
    let mut peer = BridgePeer::bind(settings, Box::new(Device(Arc::clone(&hand))))?;
    let (monitor, mut out) = (peer.monitor(), std::io::stdout());
    writeln!(out, "serving a hand on a spring on {}; Enter ends it", peer.address())?;
    let (enter, entered) = channel();
    std::thread::spawn(move || {
        // Without input there is no Enter: the process runs until it is killed.
        while std::io::stdin().read_line(&mut String::new()).is_ok_and(|length| length == 0) {
            std::thread::park();
        }
        let _ = enter.send(());
    });
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| peer.run(&stop));
        while entered.recv_timeout(Duration::from_secs(1)) == Err(RecvTimeoutError::Timeout) {
            let (counts, state) =
                (monitor.counts(), hand.lock().map_or_else(|e| *e.into_inner(), |hand| *hand));
            let (y_mm, force_n) = (1e3 * state.position_m.y, state.force_n.length());
            let _ = writeln!(
                out,
                "hand at {y_mm:6.1} mm, {force_n:5.2} N; {} forces, {} lost, {} late, {} rejected; {} sessions, {} silences",
                counts.accepted, counts.lost, counts.late, counts.rejected, counts.sessions, counts.silences
            );
        }
        stop.store(true, Ordering::Release);
    });
    Ok(())
}
