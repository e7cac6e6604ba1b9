//! A gentle test of one device with the loop and safety chain of an app.

use super::arm::Arm;
use super::response::{AXES, Motion, Response, Responses, board_advice, joystick_advice};
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

/// Time between two forces of the test, s.
const STEP_S: f64 = 0.01;
/// Duration of the force along an axis, s: one period of a sine.
const AXIS_S: f64 = 2.0;
/// Time before the first force, s: the device is read and the safety chain starts.
const WAIT_S: f64 = 0.5;

/// Set by an interruption.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Test of a device.
pub(super) struct DeviceTest {
    pub(super) selector: HidSelector,
    /// Maximum force, N.
    pub(super) force_n: f64,
    /// Options of a joystick; the maximum force is that of the test.
    pub(super) joystick: JoystickOptions,
    /// Arm of a board; a board without an arm exerts no force.
    pub(super) arm: Option<Arm>,
    pub(super) seconds: f64,
    /// Whether a person must confirm the test.
    pub(super) needs_confirmation: bool,
}

/// Report of a test.
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
    /// Rate of the forces, Hz; `None` where the device accepted none.
    pub(super) force_rate_hz: Option<f64>,
    /// Maximum force written, N.
    pub(super) max_force_n: f64,
    pub(super) lowest_m: [f64; 3],
    pub(super) highest_m: [f64; 3],
    /// Buttons that were pressed at any time.
    pub(super) buttons: u32,
    /// Motion under a force along each axis with a motor.
    pub(super) responses: Vec<Response>,
    /// Settings that the motions show to be wrong.
    pub(super) advice: Vec<String>,
    /// Settings that should be checked for this device.
    pub(super) notes: Vec<String>,
    /// Errors of the device, each once.
    pub(super) faults: Vec<String>,
}

impl DeviceTest {
    pub(super) fn run(&self, bus: Arc<dyn HidBus>, output: &Output) -> Result<(), LabError> {
        // With a confirmation the arm is at its home position when the device opens.
        let homing = if self.needs_confirmation { BoardHoming::AtOpen } else { BoardHoming::Awaited };
        let kinematics = self.arm.map_or_else(BoardKinematics::default, Arm::kinematics);
        let board = BoardOptions { homing, kinematics, ..BoardOptions::default() };
        let joystick =
            JoystickOptions { max_force_n: self.force_n.min(self.joystick.full_scale_n), ..self.joystick };
        let options = HidOptions { board, joystick, ..HidOptions::default() };
        let device = HidDevice::find(bus, &self.selector, &options)?;
        let kind = device.found().kind;
        if self.needs_confirmation {
            let is_terminal = std::io::stdin().is_terminal();
            let (mut question, mut reply) = (std::io::stderr().lock(), std::io::stdin().lock());
            let described = (&device.describe(), kind, device.has_force_timeout());
            self.confirm(described, &mut question, &mut reply, is_terminal)?;
        }
        // An interruption ends the test with zero force.
        ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)).map_err(LabError::Interrupt)?;
        let report = self.test(device)?;
        output.print(&report, |out| print(&report, out))?;
        match report.faults.first() {
            Some(fault) => Err(LabError::Broken(fault.clone())),
            None => Ok(()),
        }
    }

    /// Maximum force on a device of this kind, N.
    fn max_force_n(&self, device: &DeviceDescription, kind: HidKind) -> f64 {
        let is_known = kind != HidKind::Board || self.arm.is_some();
        if is_known { self.force_n.min(device.max_force_n) } else { 0.0 }
    }

    /// Requests a confirmation; every reply except yes declines. The device is given by its description, its kind, and whether it ends
    /// its force by itself.
    pub(super) fn confirm(
        &self,
        (device, kind, has_force_timeout): (&DeviceDescription, HidKind, bool),
        question: &mut dyn Write,
        reply: &mut dyn BufRead,
        is_terminal: bool,
    ) -> Result<(), LabError> {
        if !is_terminal {
            return Err(LabError::NoTerminal);
        }
        let max_force_n = self.max_force_n(device, kind);
        let name = &device.name;
        match (kind, self.arm) {
            (HidKind::Board, Some(arm)) => {
                writeln!(question, "Move its arm to its home position and hold it there: {}.", arm.home())?;
            }
            (HidKind::Board, None) => writeln!(
                question,
                "It will exert no force: name its arm (--board) to enable forces. With the dimensions of another arm a force may be several times as large."
            )?,
            (HidKind::Joystick, _) => writeln!(
                question,
                "Its maximum force is assumed to be {} N; if it is larger, the test is stronger in proportion (--full-scale-n).",
                self.joystick.full_scale_n
            )?,
            (HidKind::SpaceMouse, _) => {}
        }
        if max_force_n > 0.0 {
            writeln!(
                question,
                "{name} will push and pull along each of its axes with up to {max_force_n:.2} N for {} s.",
                self.seconds
            )?;
            if !has_force_timeout {
                let why = match kind {
                    HidKind::Board => "It is not published whether its firmware has a watchdog",
                    _ => "Its protocol has no time limit for forces",
                };
                writeln!(
                    question,
                    "{why}: if this program is killed its last force may stay until its power is cut."
                )?;
            }
            writeln!(question, "Hold it loosely, and keep a hand at its switch or plug.")?;
        } else {
            let why = if device.max_force_n > 0.0 { "exerts no force" } else { "has no motors" };
            writeln!(question, "{name} {why}; it will be read for {} s. Move it.", self.seconds)?;
        }
        write!(question, "Begin? [y/N] ")?;
        question.flush()?;
        let mut line = String::new();
        reply.read_line(&mut line)?;
        match line.trim() {
            "y" | "Y" | "yes" => Ok(()),
            _ => Err(LabError::Declined),
        }
    }

    /// Runs the loop on a thread with a force that a hand resists easily.
    #[expect(clippy::disallowed_methods, reason = "the force follows wall-clock time")]
    pub(super) fn test(&self, device: HidDevice) -> Result<TestReport, LabError> {
        let (found, counters) = (device.found().clone(), device.counters());
        let description = device.describe();
        let has_motor = |axis: &DVec3| device.displayable_force_n(*axis).length() > 0.5;
        let axes: Vec<DVec3> = DVec3::AXES.into_iter().filter(has_motor).collect();
        let config = LoopConfig { device: description.limits(), ..LoopConfig::default() };
        let safety = SafetySettings {
            max_force_n: self.force_n,
            // Unlike a body, the test moves a hand at rest.
            passivity_tolerance_j: 0.1,
            ..description.safety(config.hand_over.tick_s)
        };
        let settings =
            LoopSettings { safety, record: true, model_period_s: STEP_S, ..LoopSettings::default() };
        let (mut handle, haptic_loop) = haptic_loop(config, settings)?;
        let mut thread = haptic_loop.spawn(Box::new(device))?;
        let max_force_n = self.max_force_n(&description, found.kind);
        let mut log = LoopLog::default();
        let start = std::time::Instant::now();
        // A device that was unplugged gets no force without a new confirmation.
        while start.elapsed().as_secs_f64() < self.seconds
            && thread.is_running()
            && !log.is_disconnected
            && !INTERRUPTED.load(Ordering::Relaxed)
        {
            let force_n = force(start.elapsed().as_secs_f64(), max_force_n, &axes);
            if let Some(sample) = handle.samples().newest().copied() {
                let model = handle.model_slot();
                model.id.sequence = sample.sequence;
                model.contact = Contact::Held;
                model.force_n = force_n;
                handle.publish_model();
            }
            std::thread::sleep(Duration::from_secs_f64(STEP_S));
            log.read(&mut handle);
        }
        let seconds = start.elapsed().as_secs_f64();
        if matches!(thread.stop(), StopOutcome::Detached) {
            let text = "the device hangs and may still exert a force: cut its power";
            return Err(LabError::Broken(text.into()));
        }
        log.read(&mut handle);
        let report = handle.report();
        if report.ticks == 0 {
            return Err(LabError::Broken(
                log.first_error.unwrap_or_else(|| "the device delivered no reading".into()),
            ));
        }
        let responses = log.responses.all();
        let advice = match found.kind {
            HidKind::Joystick => joystick_advice(&responses, self.joystick.reverse),
            HidKind::Board => board_advice(&responses),
            HidKind::SpaceMouse => Vec::new(),
        };
        let rounded = |v: DVec3| v.to_array().map(|m| (1e6 * m).round() / 1e6);
        let [lowest_m, highest_m] = log.bounds_m.unwrap_or_default().map(rounded);
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
            max_force_n: log.max_force_n,
            lowest_m,
            highest_m,
            buttons: log.buttons,
            responses,
            advice,
            notes: log.notes,
            faults: log.faults,
        })
    }
}

/// Force at `at_s`, N: zero at first, then a sine along each of `axes` in turn.
fn force(at_s: f64, max_force_n: f64, axes: &[DVec3]) -> DVec3 {
    let since_s = at_s - WAIT_S;
    if since_s < 0.0 || axes.is_empty() {
        return DVec3::ZERO;
    }
    let axis = axes[(since_s / AXIS_S) as usize % axes.len()];
    max_force_n * (TAU * since_s / AXIS_S).sin() * axis
}

/// Records and events of the loop.
#[derive(Default)]
struct LoopLog {
    /// Minimum and maximum position in the device's frame, m.
    bounds_m: Option<[DVec3; 2]>,
    max_force_n: f64,
    buttons: u32,
    responses: Responses,
    first_error: Option<String>,
    notes: Vec<String>,
    faults: Vec<String>,
    is_disconnected: bool,
}

impl LoopLog {
    fn read(&mut self, handle: &mut HapticHandle) {
        while let Some(record) = handle.next_record() {
            self.max_force_n = self.max_force_n.max(record.force_n.length());
            if let Ok(reading) = record.reading {
                let at = reading.position_m;
                let [low, high] = self.bounds_m.unwrap_or([at; 2]);
                self.bounds_m = Some([low.min(at), high.max(at)]);
                self.buttons |= reading.buttons;
                self.responses.take(record.force_n, at);
            }
        }
        while let Some(event) = handle.next_event() {
            if let LoopEventKind::DeviceNotice(notice) = event.kind {
                self.notes.push(notice.into());
            }
            if let LoopEventKind::DeviceFailed(error) = event.kind {
                let text = error.to_string();
                self.is_disconnected |= error == DeviceError::Disconnected;
                self.first_error.get_or_insert_with(|| text.clone());
                // Each error once.
                if !self.faults.contains(&text) {
                    self.faults.push(text);
                }
            }
        }
    }
}

fn print(report: &TestReport, out: &mut dyn Write) -> std::io::Result<()> {
    let TestReport { device, kind, seconds, ticks, reports, skipped, malformed, .. } = report;
    writeln!(out, "{device}, a {kind}")?;
    let rate = *reports as f64 / seconds;
    writeln!(out, "ticks          {ticks} in {seconds:.1} s")?;
    writeln!(out, "reports        {reports}, {rate:.0} a second; {skipped} skipped, {malformed} malformed")?;
    match report.force_rate_hz {
        Some(hz) => writeln!(
            out,
            "forces         {}, {hz:.0} a second, up to {:.2} N",
            report.forces, report.max_force_n
        )?,
        None => writeln!(out, "forces         none accepted")?,
    }
    let mm = |m: [f64; 3]| m.map(|m| format!("{:.1}", 1e3 * m)).join(" ");
    writeln!(out, "moved, mm      {} to {}", mm(report.lowest_m), mm(report.highest_m))?;
    writeln!(out, "buttons        {:b}", report.buttons)?;
    for Response { axis, moved_m, motion } in &report.responses {
        let axis = AXES[*axis];
        let how = match motion {
            Motion::Along => "along the force".to_owned(),
            Motion::Reversed => "against the force".to_owned(),
            Motion::Across(other) => format!("along {}", AXES[*other]),
            Motion::None => "not moved".to_owned(),
        };
        writeln!(out, "force along {axis}  {how}: {} mm", mm(*moved_m))?;
    }
    for advice in &report.advice {
        writeln!(out, "setting        {advice}")?;
    }
    for note in &report.notes {
        writeln!(out, "note           {note}")?;
    }
    for fault in &report.faults {
        writeln!(out, "fault          {fault}")?;
    }
    Ok(())
}
