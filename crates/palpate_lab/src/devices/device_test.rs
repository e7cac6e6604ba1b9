//! A gentle test of one device, by the loop and the safety chain that an app has.

use super::arm::Arm;
use crate::error::LabError;
use crate::output::Output;
use glam::DVec3;
use palpate_haptics::{
    DeviceDescription, DeviceError, HapticDevice, HapticHandle, LoopConfig, LoopEventKind, LoopSettings,
    SafetySettings, StopOutcome, haptic_loop,
};
use palpate_hid::{
    BoardHoming, BoardKinematics, BoardOptions, HidBus, HidDevice, HidKind, HidOptions, HidSelector,
    JoystickOptions,
};
use palpate_local::Contact;
use serde::Serialize;
use std::f64::consts::TAU;
use std::io::{BufRead, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Between two forces of the test.
const STEP_S: f64 = 0.01;
/// How long the force goes along one axis, s: a sine, there and back.
const AXIS_S: f64 = 2.0;
/// Before the first force, for the device to be read and the chain to begin, s.
const WAIT_S: f64 = 0.5;

/// Somebody wants it to end.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// What is tested, and how.
pub(super) struct DeviceTest {
    pub(super) selector: HidSelector,
    /// N.
    pub(super) force_n: f64,
    /// What a joystick's greatest force is taken for, N.
    pub(super) full_scale_n: f64,
    /// What a board's arm is; a board without is not pushed.
    pub(super) arm: Option<Arm>,
    pub(super) seconds: f64,
    /// Whether a person is asked first.
    pub(super) asks: bool,
}

/// What came of it.
#[derive(Debug, Serialize)]
pub(super) struct TestReport {
    pub(super) device: String,
    pub(super) kind: String,
    pub(super) seconds: f64,
    pub(super) ticks: u64,
    pub(super) reports: u64,
    pub(super) skipped: u64,
    pub(super) malformed: u64,
    pub(super) device_errors: u64,
    pub(super) forces: u64,
    /// `None` where the device took none.
    pub(super) force_rate_hz: Option<f64>,
    /// The largest force that was written, N.
    pub(super) max_force_n: f64,
    pub(super) lowest_m: [f64; 3],
    pub(super) highest_m: [f64; 3],
    /// Buttons that were pressed at any time.
    pub(super) buttons: u32,
    /// What the device failed with, each once.
    pub(super) faults: Vec<String>,
}

impl DeviceTest {
    pub(super) fn run(&self, bus: Arc<dyn HidBus>, output: &Output) -> Result<(), LabError> {
        // Whoever is asked puts the arm to its home.
        let homing = if self.asks { BoardHoming::AtOpen } else { BoardHoming::Awaited };
        let kinematics = self.arm.map_or_else(BoardKinematics::default, Arm::kinematics);
        let board = BoardOptions { homing, kinematics, ..BoardOptions::default() };
        let joystick = JoystickOptions {
            full_scale_n: self.full_scale_n,
            max_force_n: self.force_n.min(self.full_scale_n),
            ..JoystickOptions::default()
        };
        let options = HidOptions { board, joystick, ..HidOptions::default() };
        let device = HidDevice::find(bus, &self.selector, &options)?;
        let kind = device.found().kind;
        if self.asks {
            let is_terminal = std::io::stdin().is_terminal();
            let (mut question, mut answer) = (std::io::stderr().lock(), std::io::stdin().lock());
            let asked = (&device.describe(), kind, device.ends_by_itself());
            self.ask(asked, &mut question, &mut answer, is_terminal)?;
        }
        // Whoever interrupts it leaves a device without force.
        ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)).map_err(LabError::Interrupt)?;
        let tested = self.test(device)?;
        output.print(&tested, |out| print(&tested, out))?;
        match tested.faults.first() {
            Some(fault) => Err(LabError::Broken(fault.clone())),
            None => Ok(()),
        }
    }

    /// The largest force on such a device, N.
    fn most_n(&self, device: &DeviceDescription, kind: HidKind) -> f64 {
        let is_known = kind != HidKind::Board || self.arm.is_some();
        if is_known { self.force_n.min(device.max_force_n) } else { 0.0 }
    }

    /// Asks whoever sits there; anything but a yes is a no. Of the device there is what it is and whether it is known to end its force
    /// by itself.
    pub(super) fn ask(
        &self,
        (device, kind, ends_by_itself): (&DeviceDescription, HidKind, bool),
        question: &mut dyn Write,
        answer: &mut dyn BufRead,
        is_terminal: bool,
    ) -> Result<(), LabError> {
        if !is_terminal {
            return Err(LabError::NoTerminal);
        }
        let most_n = self.most_n(device, kind);
        let name = &device.name;
        match (kind, self.arm) {
            (HidKind::Board, Some(arm)) => writeln!(
                question,
                "Put its arm to its home and hold it there, where it is taken to be: {}.",
                arm.home()
            )?,
            (HidKind::Board, None) => writeln!(
                question,
                "It will not push: name its arm (--board) for that. With the sizes of another one a force may be several times as large."
            )?,
            (HidKind::Joystick, _) => writeln!(
                question,
                "Its greatest force is taken for {} N; if it is more the test is as much stronger (--full-scale-n).",
                self.full_scale_n
            )?,
            (HidKind::SpaceMouse, _) => {}
        }
        if most_n > 0.0 {
            writeln!(
                question,
                "{name} will push and pull along each of its axes with up to {most_n:.2} N for {} s.",
                self.seconds
            )?;
            if !ends_by_itself {
                let why = match kind {
                    HidKind::Board => "Whether its firmware has a watchdog has not been published",
                    _ => "No end of its forces can be written to it",
                };
                writeln!(
                    question,
                    "{why}: if this program is killed its last force may stay until its power is cut."
                )?;
            }
            writeln!(question, "Hold it loosely, and keep a hand at its switch or plug.")?;
        } else {
            let why = if device.max_force_n > 0.0 { "is not pushed" } else { "has no motors" };
            writeln!(question, "{name} {why}; it will be read for {} s. Move it.", self.seconds)?;
        }
        write!(question, "Begin? [y/N] ")?;
        question.flush()?;
        let mut line = String::new();
        answer.read_line(&mut line)?;
        match line.trim() {
            "y" | "Y" | "yes" => Ok(()),
            _ => Err(LabError::Declined),
        }
    }

    /// Runs the loop on a thread, with a force that a person hardly needs to hold against.
    #[expect(clippy::disallowed_methods, reason = "forces are given in the time of the hand")]
    pub(super) fn test(&self, device: HidDevice) -> Result<TestReport, LabError> {
        let (found, counters) = (device.found().clone(), device.counters());
        let description = device.describe();
        let config = LoopConfig { device: description.limits(), ..LoopConfig::default() };
        let safety = SafetySettings {
            max_force_n: self.force_n,
            // The test does what the body does not: it moves a hand that stands still.
            passivity_tolerance_j: 0.1,
            ..description.safety(config.hand_over.tick_s)
        };
        let settings =
            LoopSettings { safety, record: true, model_period_s: STEP_S, ..LoopSettings::default() };
        let (mut handle, haptic_loop) = haptic_loop(config, settings)?;
        let mut thread = haptic_loop.spawn(Box::new(device))?;
        let most_n = self.most_n(&description, found.kind);
        let mut seen = Seen::default();
        let began = std::time::Instant::now();
        // A device that was unplugged is not pushed again without being asked.
        while began.elapsed().as_secs_f64() < self.seconds
            && thread.is_running()
            && !seen.is_gone
            && !INTERRUPTED.load(Ordering::Relaxed)
        {
            let force_n = force(began.elapsed().as_secs_f64(), most_n);
            if let Some(sample) = handle.samples().newest().copied() {
                let model = handle.model_slot();
                model.id.sequence = sample.sequence;
                model.contact = Contact::Held;
                model.force_n = force_n;
                handle.publish_model();
            }
            std::thread::sleep(Duration::from_secs_f64(STEP_S));
            seen.take(&mut handle);
        }
        let seconds = began.elapsed().as_secs_f64();
        if matches!(thread.stop(), StopOutcome::Detached) {
            let text = "the device hangs and may still push: cut its power";
            return Err(LabError::Broken(text.into()));
        }
        seen.take(&mut handle);
        let report = handle.report();
        if report.ticks == 0 {
            return Err(LabError::Broken(seen.told.unwrap_or_else(|| "the device gave nothing".into())));
        }
        let rounded = |v: DVec3| v.to_array().map(|m| (1e6 * m).round() / 1e6);
        let [lowest_m, highest_m] = seen.bounds_m.unwrap_or_default().map(rounded);
        Ok(TestReport {
            device: found.info.label(),
            kind: found.kind.to_string(),
            seconds,
            ticks: report.ticks,
            reports: counters.read(),
            skipped: counters.skipped(),
            malformed: counters.malformed(),
            device_errors: report.device_errors,
            forces: counters.forces(),
            force_rate_hz: counters.force_rate_hz(),
            max_force_n: seen.max_force_n,
            lowest_m,
            highest_m,
            buttons: seen.buttons,
            faults: seen.faults,
        })
    }
}

/// The force at `at_s`: a sine along each axis in turn, none at first.
fn force(at_s: f64, most_n: f64) -> DVec3 {
    let since_s = at_s - WAIT_S;
    if since_s < 0.0 {
        return DVec3::ZERO;
    }
    let axis = DVec3::AXES[(since_s / AXIS_S) as usize % 3];
    most_n * (TAU * since_s / AXIS_S).sin() * axis
}

/// What the loop told.
#[derive(Default)]
struct Seen {
    /// Of the device's frame.
    bounds_m: Option<[DVec3; 2]>,
    max_force_n: f64,
    buttons: u32,
    told: Option<String>,
    faults: Vec<String>,
    is_gone: bool,
}

impl Seen {
    fn take(&mut self, handle: &mut HapticHandle) {
        while let Some(record) = handle.next_record() {
            self.max_force_n = self.max_force_n.max(record.force_n.length());
            if let Ok(reading) = record.reading {
                let at = reading.position_m;
                let [low, high] = self.bounds_m.unwrap_or([at; 2]);
                self.bounds_m = Some([low.min(at), high.max(at)]);
                self.buttons |= reading.buttons;
            }
        }
        while let Some(event) = handle.next_event() {
            if let LoopEventKind::DeviceFailed(error) = event.kind {
                let text = error.to_string();
                self.is_gone |= error == DeviceError::Disconnected;
                self.told.get_or_insert_with(|| text.clone());
                // Each kind once.
                if !self.faults.contains(&text) {
                    self.faults.push(text);
                }
            }
        }
    }
}

fn print(tested: &TestReport, out: &mut dyn Write) -> std::io::Result<()> {
    let TestReport { device, kind, seconds, ticks, reports, skipped, malformed, .. } = tested;
    writeln!(out, "{device}, a {kind}")?;
    let rate = *reports as f64 / seconds;
    writeln!(out, "ticks          {ticks} in {seconds:.1} s")?;
    writeln!(out, "reports        {reports}, {rate:.0} a second; {skipped} skipped, {malformed} malformed")?;
    match tested.force_rate_hz {
        Some(hz) => writeln!(
            out,
            "forces         {}, {hz:.0} a second, up to {:.2} N",
            tested.forces, tested.max_force_n
        )?,
        None => writeln!(out, "forces         none taken")?,
    }
    let mm = |m: [f64; 3]| m.map(|m| format!("{:.1}", 1e3 * m)).join(" ");
    writeln!(out, "moved, mm      {} to {}", mm(tested.lowest_m), mm(tested.highest_m))?;
    writeln!(out, "buttons        {:b}", tested.buttons)?;
    for fault in &tested.faults {
        writeln!(out, "fault          {fault}")?;
    }
    Ok(())
}
