//! Simulated 3-DOF board, with its arm and a hand that holds it.

mod arm;

use super::Firmware;
use crate::{BoardForm, BoardInput, BoardKinematics, BoardOutput, HidInfo, Usage};
use arm::Arm;
use glam::DVec3;
use std::collections::VecDeque;
use std::fmt;

/// Timeout of the watchdog, s: the motors are switched off after this time without a report.
const WATCHDOG_S: f64 = 0.5;
/// Maximum current of the amplifiers, mA.
const MAX_CURRENT_MA: i16 = 3_000;

/// Position of the hand, m, in the device frame, as a function of the number of exchanged reports.
type Hand = dyn FnMut(u64) -> DVec3 + Send;

/// Simulated firmware of a board, with the arm of a WoodenHaptics or a Polhem, and a hand that holds the tip by a spring.
///
/// It sends one report and then waits for one, as the firmware for 14 bytes. The firmware for 8 bytes sends whenever it is polled, which
/// is once for each report here, as nothing has a clock. The exchange of the Teensy firmware is unpublished; this one uses the same. Each
/// received report advances the time by one step. [`BoardFirmware::advance`] advances it without reports.
///
/// The hand holds the tip, with a mass of 0.2 kg, with 400 N/m and 10 N s/m. The kinematics are independent of the driver's: rotated links
/// for the position of the tip, half-angle formulas where bars close, finite differences for the Jacobian, Newton's method for the
/// angles. Positions and forces are in the device frame, SI.
pub struct BoardFirmware {
    form: BoardForm,
    arm: Arm,
    hand: Box<Hand>,
    step_s: f64,
    /// Counts of the bodies where the counters are zero, with the sign with which the board counts.
    base: [i32; 6],
    is_pressed: bool,
    requests_calibration: bool,
    sequence: u16,
    currents_ma: [i16; 3],
    are_motors_on: bool,
    silent_s: f64,
    phase: Phase,
    /// Reports received before the board's own report was fetched, oldest first.
    early: VecDeque<BoardOutput>,
    exchanged: u64,
    applied_force_n: DVec3,
    noise: u32,
    random_state: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Sending,
    Receiving,
}

impl fmt::Debug for BoardFirmware {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BoardFirmware")
            .field("form", &self.form)
            .field("phase", &self.phase)
            .field("exchanged", &self.exchanged)
            .finish_non_exhaustive()
    }
}

impl BoardFirmware {
    /// Board after power-on: counters zero, arm held at home, steps of 1 ms.
    #[must_use]
    pub fn at_home(form: BoardForm, kinematics: &BoardKinematics) -> Self {
        let arm = Arm::at_home(kinematics);
        let held_m = arm.tip_m();
        let mut board = Self {
            form,
            arm,
            hand: Box::new(move |_| held_m),
            step_s: 1e-3,
            base: [0; 6],
            is_pressed: false,
            requests_calibration: false,
            sequence: 0,
            currents_ma: [0; 3],
            are_motors_on: false,
            silent_s: 0.0,
            phase: Phase::Sending,
            // Capacity that avoids allocations later.
            early: VecDeque::with_capacity(64),
            exchanged: 0,
            applied_force_n: DVec3::ZERO,
            noise: 0,
            random_state: 1,
        };
        board.cut_power();
        board
    }

    /// Sets the time step for each received report, s.
    #[must_use]
    pub fn with_step_s(mut self, step_s: f64) -> Self {
        self.step_s = step_s;
        self
    }

    /// Sets the counters as after a calibration.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        self.base = [0; 6];
        self
    }

    /// Sets the path of the hand: its position, m, as a function of the number of exchanged reports.
    #[must_use]
    pub fn with_hand(mut self, hand: impl FnMut(u64) -> DVec3 + Send + 'static) -> Self {
        self.hand = Box::new(hand);
        self
    }

    /// Adds reproducible pseudo-random noise of up to ±`counts` to the encoders.
    #[must_use]
    pub fn with_noise(mut self, counts: u16) -> Self {
        self.noise = u32::from(counts);
        self
    }

    /// Device description for the path `path`.
    #[must_use]
    pub fn info(&self, path: &str) -> HidInfo {
        let (vendor, product) =
            if self.form == BoardForm::Bytes64 { (0x16C0, 0x0486) } else { (0x1234, 0x0006) };
        HidInfo {
            path: path.into(),
            vendor,
            product,
            name: "3-DOF board".into(),
            interface: Some(0),
            applications: vec![Usage::new(0xFFAB, 0x0200)],
            ..HidInfo::default()
        }
    }

    /// Report descriptor: that of `USBHID::reportDesc` of mbed, which is also that of a Teensy's raw HID.
    #[must_use]
    pub fn descriptor(&self) -> Vec<u8> {
        // All forms are shorter than 256 bytes.
        let bytes = self.form.bytes() as u8;
        let mut descriptor = vec![0x06, 0xAB, 0xFF, 0x0A, 0x00, 0x02, 0xA1, 0x01];
        descriptor.extend([0x75, 0x08, 0x15, 0x00, 0x26, 0xFF, 0x00]);
        descriptor.extend([0x95, bytes, 0x09, 0x01, 0x81, 0x02]);
        descriptor.extend([0x95, bytes, 0x09, 0x02, 0x91, 0x02, 0xC0]);
        descriptor
    }

    /// Holds the hand at `at_m` from now on, m.
    pub fn hold_at(&mut self, at_m: DVec3) {
        self.hand = Box::new(move |_| at_m);
    }

    /// Presses or releases the button on the grip.
    pub fn press(&mut self, is_pressed: bool) {
        self.is_pressed = is_pressed;
    }

    /// Presses the calibration button on the board: the arm is at home.
    pub fn request_calibration(&mut self) {
        self.requests_calibration = self.form.has_commands();
    }

    /// Interrupts the power: the counters restart from zero in the current pose.
    pub fn cut_power(&mut self) {
        let here = self.signed_counts();
        self.base = [here[0], here[1], here[2], 0, 0, 0];
        (self.currents_ma, self.are_motors_on, self.requests_calibration) = ([0; 3], false, false);
        (self.phase, self.silent_s) = (Phase::Sending, 0.0);
        self.early.clear();
    }

    /// Advances the time by `time_s`, s, without reports.
    pub fn advance(&mut self, time_s: f64) {
        let steps = (time_s / self.step_s).round() as u64;
        for _ in 0..steps {
            self.silent_s += self.step_s;
            self.are_motors_on &= self.silent_s < WATCHDOG_S;
            self.step();
        }
    }

    /// Number of processed output reports.
    #[must_use]
    pub fn exchanged(&self) -> u64 {
        self.exchanged
    }

    /// Number of received output reports that are not processed yet.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.early.len()
    }

    /// Force of the motors on the hand at the last processed report, N.
    #[must_use]
    pub fn applied_force_n(&self) -> DVec3 {
        self.applied_force_n
    }

    /// Currents of the motors, mA.
    #[must_use]
    pub fn currents_ma(&self) -> [i16; 3] {
        if self.are_motors_on { self.currents_ma } else { [0; 3] }
    }

    /// Whether the amplifiers are on.
    #[must_use]
    pub fn are_motors_on(&self) -> bool {
        self.are_motors_on
    }

    /// Position of the tip, m.
    #[must_use]
    pub fn tip_m(&self) -> DVec3 {
        self.arm.tip_m()
    }

    /// Counts of the bodies, with the sign with which the board counts.
    fn signed_counts(&self) -> [i32; 3] {
        let counts = self.arm.counts();
        if self.form.has_commands() { counts } else { counts.map(|count| -count) }
    }

    fn counters(&mut self) -> [i16; 6] {
        let [a, b, c] = self.signed_counts();
        let mut counters = [a, b, c, 0, 0, 0];
        for (i, counter) in counters.iter_mut().enumerate() {
            *counter -= self.base[i];
            if i < 3 && self.noise > 0 {
                // Marsaglia's xorshift generator.
                self.random_state ^= self.random_state << 13;
                self.random_state ^= self.random_state >> 17;
                self.random_state ^= self.random_state << 5;
                *counter += (self.random_state % (2 * self.noise + 1)) as i32 - self.noise as i32;
            }
        }
        // The firmware counts in 32 bits and sends 16.
        counters.map(|counter| counter as i16)
    }

    fn process(&mut self, output: BoardOutput) {
        (self.silent_s, self.are_motors_on) = (0.0, true);
        match output {
            BoardOutput::Currents(currents) => {
                self.currents_ma = currents.map(|ma| ma.clamp(-MAX_CURRENT_MA, MAX_CURRENT_MA));
            }
            BoardOutput::Counters(values) => {
                let here = self.signed_counts();
                for (i, value) in values.into_iter().enumerate() {
                    self.base[i] = here.get(i).copied().unwrap_or(0) - i32::from(value);
                }
                (self.requests_calibration, self.currents_ma) = (false, [0; 3]);
            }
        }
        self.applied_force_n = self.arm.force_n(self.currents_ma);
        self.exchanged += 1;
        self.step();
        self.phase = Phase::Sending;
    }

    fn step(&mut self) {
        let hand_m = (self.hand)(self.exchanged);
        let force_n = self.arm.force_n(self.currents_ma());
        self.arm.advance(hand_m, force_n, self.step_s);
    }
}

impl Firmware for BoardFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        if self.phase == Phase::Receiving {
            return 0;
        }
        self.sequence = self.sequence.wrapping_add(1);
        let encoders = self.counters();
        let (is_pressed, requests_calibration, sequence) =
            (self.is_pressed, self.requests_calibration, self.sequence);
        let input = BoardInput { encoders, is_pressed, requests_calibration, sequence }.encode(self.form);
        let Some(space) = report.get_mut(..input.as_slice().len()) else { return 0 };
        space.copy_from_slice(input.as_slice());
        let length = space.len();
        self.phase = Phase::Receiving;
        if let Some(early) = self.early.pop_front() {
            self.process(early);
        }
        length
    }

    fn output(&mut self, report: &[u8]) -> bool {
        let Ok(output) = BoardOutput::parse(self.form, report) else { return false };
        match self.phase {
            Phase::Receiving => self.process(output),
            // It processes one report for each that it sends and queues the rest.
            Phase::Sending => self.early.push_back(output),
        }
        true
    }
}
