//! The driver: what is sent, and when.

use super::calibration::Calibrator;
use super::limits::{Limits, is_much_less};
use super::{
    BoardBytes, BoardCalibration, BoardForm, BoardInput, BoardKinematics, BoardOptions, BoardOutput,
};
use crate::driver::Driver;
use crate::link::{Link, Understood};
use glam::{DQuat, DVec3};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;

/// Silence after which a board is woken up, and counts as silent.
const SILENCE: Duration = Duration::from_millis(10);
/// So often a board that has just been opened is waited for, `SILENCE` each time: it may be slow, but not for ever.
const FIRST_WAITS: usize = 20;
/// The first reports of a board that has just been opened may be as old as the last time that it was read: what its bus keeps, and
/// one more. As many show, when it is closed, that the board has taken a zero: only what is fetched lets it go on.
const OLD_REPORTS: usize = 3;

#[derive(Debug)]
pub(super) struct Board {
    name: String,
    options: BoardOptions,
    form: BoardForm,
    /// The report that ends all force.
    zero: BoardBytes,
    calibrator: Calibrator,
    limits: Limits,
    turns: Turns,
    /// Reports that have come since it was opened.
    number: u64,
    newest: Option<Pose>,
}

/// Where the arm is.
#[derive(Clone, Copy, Debug)]
struct Pose {
    angles_rad: DVec3,
    is_pressed: bool,
}

/// Whose turn it is.
#[derive(Clone, Copy, Debug, Default)]
struct Turns {
    /// A report has been read that is not answered yet.
    is_owed: bool,
    /// A force has been sent that was not asked for, since the last report.
    is_ahead: bool,
    /// The currents that the board shows, mA.
    shown_ma: [i16; 3],
    /// When a report was last read.
    heard_at: Duration,
    /// When one last went either way.
    exchanged_at: Duration,
    is_silent: bool,
}

impl Board {
    /// A closed one; `zero` is its report that ends all force.
    pub(super) fn new(name: String, options: BoardOptions, form: BoardForm, zero: BoardBytes) -> Self {
        Self {
            name,
            options,
            form,
            zero,
            calibrator: Calibrator::new(form),
            limits: Limits::default(),
            turns: Turns::default(),
            number: 0,
            newest: None,
        }
    }

    /// Takes what has come. Whether there was a report.
    fn drain(&mut self, link: &mut Link, within: Duration) -> Result<bool, DeviceError> {
        let (form, mut newest, mut reports) = (self.form, None, 0_u64);
        link.drain(within, |bytes| match BoardInput::parse(form, bytes) {
            Ok(input) => {
                newest = Some(input);
                reports += 1;
                Understood::As(0)
            }
            Err(_) => Understood::Malformed,
        })?;
        let Some(input) = newest else { return Ok(false) };
        let kinematics = &self.options.kinematics;
        let counters = self.calibrator.take(kinematics, &input);
        if self.calibrator.begins_anew() {
            self.limits.begin_anew();
        }
        let angles_rad = kinematics.angles_rad(kinematics.counts(counters));
        self.newest = Some(Pose { angles_rad, is_pressed: input.is_pressed });
        self.number = self.number.saturating_add(reports);
        let now = link.clock.now();
        (self.turns.heard_at, self.turns.exchanged_at) = (now, now);
        (self.turns.is_owed, self.turns.is_ahead, self.turns.is_silent) = (true, false, false);
        Ok(true)
    }

    fn send_zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.turns.exchanged_at = link.clock.now();
        link.write(self.zero.as_slice())?;
        (self.turns.is_owed, self.turns.shown_ma) = (false, [0; 3]);
        self.limits.begin_anew();
        Ok(())
    }

    fn send(&mut self, link: &mut Link, output: BoardOutput) -> Result<(), DeviceError> {
        let Ok(report) = output.encode(self.form) else {
            // Only a calibration has no form of 8 bytes, and such a board is never asked for one.
            return Ok(());
        };
        self.turns.exchanged_at = link.clock.now();
        link.write(report.as_slice())?;
        self.turns.is_owed = false;
        self.turns.shown_ma = match output {
            BoardOutput::Currents(currents_ma) => currents_ma,
            BoardOutput::Counters(_) => [0; 3],
        };
        Ok(())
    }

    /// Zero force, and where home is if the board is to be told.
    fn answer_with_zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        if !self.calibrator.is_asked() {
            return self.send_zero(link);
        }
        self.limits.begin_anew();
        self.send(link, BoardOutput::Counters(self.options.kinematics.home_counts))?;
        self.calibrator.told();
        Ok(())
    }

    /// The currents for `force_n` where the arm is; zero while nobody knows where.
    fn currents_ma(&self, force_n: DVec3) -> [i16; 3] {
        match self.newest {
            Some(pose) if self.calibrator.is_done() => {
                self.limits.currents(&self.options, pose.angles_rad, force_n)
            }
            _ => [0; 3],
        }
    }

    /// Hands `done` on. After an error of the link the board's counters may mean nothing.
    fn noting<T>(&mut self, done: Result<T, DeviceError>) -> Result<T, DeviceError> {
        match done {
            Err(DeviceError::Disconnected) => self.calibrator.lost(),
            // That is told of a silence; nothing has failed.
            Ok(_) | Err(DeviceError::TimedOut) => {}
            Err(_) => self.calibrator.doubt(),
        }
        done
    }

    /// Synchronises with a board that has just been opened, at zero force.
    fn begin(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.calibrator.opening();
        let now = link.clock.now();
        self.turns = Turns { heard_at: now, exchanged_at: now, ..Turns::default() };
        (self.limits, self.number, self.newest) = (Limits::default(), 0, None);
        link.drain(Duration::ZERO, |_| Understood::Nothing)?;
        self.send_zero(link)?;
        let mut old = 0;
        for _ in 0..FIRST_WAITS {
            let mut has_come = false;
            link.drain(SILENCE, |_| {
                has_come = true;
                Understood::Nothing
            })?;
            if has_come {
                old += 1;
                self.send_zero(link)?;
            }
            if old == OLD_REPORTS {
                break;
            }
        }
        self.calibrator.opened(self.options.homing);
        for _ in 0..FIRST_WAITS {
            if !self.drain(link, SILENCE)? || !self.calibrator.is_under_way() {
                break;
            }
            // So that an arm that is at home now is not seen to jump there.
            self.answer_with_zero(link)?;
        }
        Ok(())
    }

    fn newest(&mut self, link: &mut Link) -> Result<Reading, DeviceError> {
        let drained = self.drain(link, Duration::ZERO);
        self.turns.is_silent |= drained.is_err();
        if !drained? {
            let now = link.clock.now();
            self.turns.is_silent = now.saturating_sub(self.turns.heard_at) >= SILENCE;
            if now.saturating_sub(self.turns.exchanged_at) >= SILENCE {
                self.send_zero(link)?;
            }
        }
        let pose = self.newest.filter(|_| !self.turns.is_silent).ok_or(DeviceError::TimedOut)?;
        Ok(Reading {
            position_m: self.options.kinematics.position_m(pose.angles_rad),
            velocity_m_per_s: None,
            orientation: DQuat::IDENTITY,
            buttons: u32::from(pose.is_pressed),
            number: Some(self.number),
        })
    }

    fn show(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        if self.turns.is_owed && self.calibrator.is_asked() {
            return self.answer_with_zero(link);
        }
        if !force_n.is_finite() {
            self.limits.begin_anew();
        }
        let currents_ma = self.currents_ma(force_n);
        if self.turns.is_owed {
            self.send(link, BoardOutput::Currents(currents_ma))?;
            if let Some(pose) = self.newest.filter(|_| self.calibrator.is_done()) {
                self.limits.taken(&self.options, pose.angles_rad);
            }
            link.note_force();
        } else if !self.turns.is_ahead && is_much_less(currents_ma, self.turns.shown_ma) {
            self.send(link, BoardOutput::Currents(currents_ma))?;
            self.turns.is_ahead = true;
        } else if self.turns.is_silent && force_n != DVec3::ZERO {
            return Err(DeviceError::TimedOut);
        }
        Ok(())
    }

    fn end(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.send_zero(link)?;
        for _ in 0..OLD_REPORTS {
            if !self.drain(link, SILENCE)? {
                break;
            }
            self.send_zero(link)?;
        }
        Ok(())
    }
}

impl Driver for Board {
    fn describe(&self) -> DeviceDescription {
        let BoardKinematics { workspace_radius_m, max_force_n, .. } = self.options.kinematics;
        DeviceDescription {
            name: self.name.clone(),
            workspace_m: [DVec3::splat(-workspace_radius_m), DVec3::splat(workspace_radius_m)],
            max_force_n,
            // A report in each frame of the bus.
            rate_hz: 1000.0,
        }
    }

    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let begun = self.begin(link);
        self.noting(begun)
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let newest = self.newest(link);
        self.noting(newest)
    }

    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        let shown = self.show(link, force_n);
        self.noting(shown)
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let ended = self.end(link);
        self.noting(ended)
    }

    fn was_gone(&mut self) {
        self.calibrator.lost();
    }

    fn stop_reports(&self) -> Vec<Vec<u8>> {
        vec![self.zero.as_slice().to_vec()]
    }

    fn calibration(&self) -> Option<BoardCalibration> {
        Some(self.calibrator.handle())
    }
}
