//! A 3-DOF board that is only there in memory, with its arm and a hand that holds it.

mod arm;

use super::Firmware;
use crate::{BoardForm, BoardInput, BoardKinematics, BoardOutput, HidInfo, Usage};
use arm::Arm;
use glam::DVec3;
use std::collections::VecDeque;
use std::fmt;

/// Silence after which the motors are switched off, s.
const WATCHDOG_S: f64 = 0.5;
/// The most that its amplifiers give, mA.
const SATURATES_MA: i16 = 3_000;

/// What a hand does: where it is, m, in the device's frame, when so many reports have been exchanged.
type Hand = dyn FnMut(u64) -> DVec3 + Send;

/// The firmware of a board with an arm, of a WoodenHaptics or of a Polhem, and a hand that holds the arm's tip by a spring.
///
/// It sends one report and then waits for one, as the firmware for 14 bytes does; that for 8 bytes sends whenever it is asked, which
/// here, where nothing has a clock, is once for each report as well. How the firmware of a Teensy takes turns has not been published;
/// it does the same here. Each report that it takes advances its time by one step. Where no reports go, [`BoardFirmware::advance`] does.
///
/// The hand holds the tip, which has 0.2 kg, with 400 N/m and 10 N s/m. The arm's kinematics are its own: turned links for the place
/// of the tip, half angles where bars close, finite differences for its motion, Newton's method for the angles. Places and forces are
/// in the device's frame, SI.
pub struct BoardFirmware {
    form: BoardForm,
    arm: Arm,
    hand: Box<Hand>,
    step_s: f64,
    /// What the counters were when their bodies were at zero, with the sign with which the board counts.
    base: [i32; 6],
    is_pressed: bool,
    requests_calibration: bool,
    running: u16,
    currents_ma: [i16; 3],
    are_motors_on: bool,
    silent_s: f64,
    phase: Phase,
    /// Reports that came before its own was fetched, oldest first.
    early: VecDeque<BoardOutput>,
    exchanged: u64,
    applied_force_n: DVec3,
    noise: u32,
    dice: u32,
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
    /// A board that has just got its power, its counters at zero, its arm held at home, with a step of 1 ms.
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
            running: 0,
            currents_ma: [0; 3],
            are_motors_on: false,
            silent_s: 0.0,
            phase: Phase::Sending,
            // Room, so that nothing is allocated while it runs.
            early: VecDeque::with_capacity(64),
            exchanged: 0,
            applied_force_n: DVec3::ZERO,
            noise: 0,
            dice: 1,
        };
        board.cut_power();
        board
    }

    /// The same, advancing by `step_s` with each report that it takes.
    #[must_use]
    pub fn with_step_s(mut self, step_s: f64) -> Self {
        self.step_s = step_s;
        self
    }

    /// The same, its counters set before.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        self.base = [0; 6];
        self
    }

    /// The same with a hand that goes where `hand` says.
    #[must_use]
    pub fn with_hand(mut self, hand: impl FnMut(u64) -> DVec3 + Send + 'static) -> Self {
        self.hand = Box::new(hand);
        self
    }

    /// The same with encoders that are off by up to `counts`, at random and the same in each run.
    #[must_use]
    pub fn with_noise(mut self, counts: u16) -> Self {
        self.noise = u32::from(counts);
        self
    }

    /// What the operating system would know of it.
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

    /// Its report descriptor: that of `USBHID::reportDesc` of mbed, which is also that of a Teensy's raw HID.
    #[must_use]
    pub fn descriptor(&self) -> Vec<u8> {
        // Every form is shorter than 256 bytes.
        let bytes = self.form.bytes() as u8;
        let mut descriptor = vec![0x06, 0xAB, 0xFF, 0x0A, 0x00, 0x02, 0xA1, 0x01];
        descriptor.extend([0x75, 0x08, 0x15, 0x00, 0x26, 0xFF, 0x00]);
        descriptor.extend([0x95, bytes, 0x09, 0x01, 0x81, 0x02]);
        descriptor.extend([0x95, bytes, 0x09, 0x02, 0x91, 0x02, 0xC0]);
        descriptor
    }

    /// From now on the hand is at `at_m`.
    pub fn hold_at(&mut self, at_m: DVec3) {
        self.hand = Box::new(move |_| at_m);
    }

    /// The button on the grip.
    pub fn press(&mut self, is_pressed: bool) {
        self.is_pressed = is_pressed;
    }

    /// Somebody pushes the button on the board: the arm is at home.
    pub fn request_calibration(&mut self) {
        self.requests_calibration = self.form.has_commands();
    }

    /// The power was gone for a moment: the counters begin with zero where the arm is.
    pub fn cut_power(&mut self) {
        let here = self.signed_counts();
        self.base = [here[0], here[1], here[2], 0, 0, 0];
        (self.currents_ma, self.are_motors_on, self.requests_calibration) = ([0; 3], false, false);
        (self.phase, self.silent_s) = (Phase::Sending, 0.0);
        self.early.clear();
    }

    /// Time goes by, s, and nobody sends a report.
    pub fn advance(&mut self, time_s: f64) {
        let steps = (time_s / self.step_s).round() as u64;
        for _ in 0..steps {
            self.silent_s += self.step_s;
            self.are_motors_on &= self.silent_s < WATCHDOG_S;
            self.step();
        }
    }

    /// Reports that it has taken.
    #[must_use]
    pub fn exchanged(&self) -> u64 {
        self.exchanged
    }

    /// Reports that have come and that it has not taken yet.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.early.len()
    }

    /// Force of the motors on the hand when the last report was taken, N.
    #[must_use]
    pub fn applied_force_n(&self) -> DVec3 {
        self.applied_force_n
    }

    /// Currents of the motors, mA; what was sent last.
    #[must_use]
    pub fn currents_ma(&self) -> [i16; 3] {
        if self.are_motors_on { self.currents_ma } else { [0; 3] }
    }

    /// Whether the amplifiers are switched on.
    #[must_use]
    pub fn are_motors_on(&self) -> bool {
        self.are_motors_on
    }

    /// Place of the tip, m.
    #[must_use]
    pub fn tip_m(&self) -> DVec3 {
        self.arm.tip_m()
    }

    /// Counts of the bodies, with the sign with which this board counts.
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
                // Marsaglia's generator.
                self.dice ^= self.dice << 13;
                self.dice ^= self.dice >> 17;
                self.dice ^= self.dice << 5;
                *counter += (self.dice % (2 * self.noise + 1)) as i32 - self.noise as i32;
            }
        }
        // The firmware counts in 32 bits and sends 16.
        counters.map(|counter| counter as i16)
    }

    fn take(&mut self, output: BoardOutput) {
        (self.silent_s, self.are_motors_on) = (0.0, true);
        match output {
            BoardOutput::Currents(currents) => {
                self.currents_ma = currents.map(|ma| ma.clamp(-SATURATES_MA, SATURATES_MA));
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
        self.running = self.running.wrapping_add(1);
        let encoders = self.counters();
        let (is_pressed, requests_calibration, running) =
            (self.is_pressed, self.requests_calibration, self.running);
        let input = BoardInput { encoders, is_pressed, requests_calibration, running }.encode(self.form);
        let Some(room) = report.get_mut(..input.as_slice().len()) else { return 0 };
        room.copy_from_slice(input.as_slice());
        let length = room.len();
        self.phase = Phase::Receiving;
        if let Some(early) = self.early.pop_front() {
            self.take(early);
        }
        length
    }

    fn output(&mut self, report: &[u8]) -> bool {
        let Ok(output) = BoardOutput::parse(self.form, report) else { return false };
        match self.phase {
            Phase::Receiving => self.take(output),
            // It takes one for each that it sends; the rest waits.
            Phase::Sending => self.early.push_back(output),
        }
        true
    }
}
