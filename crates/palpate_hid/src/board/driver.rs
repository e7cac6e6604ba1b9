//! The driver: what is sent, and when.

use super::calibration::Calibrator;
use super::force_limits::{Limits, is_less_than_half};
use super::report_credits::{ReportCredits, SILENCE_TIMEOUT};
use super::{
    BoardBytes, BoardCalibration, BoardForm, BoardInput, BoardKinematics, BoardOptions, BoardOutput,
};
use crate::driver::{Driver, StopCounter};
use crate::link::{Handled, Link};
use glam::{DQuat, DVec3};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;

/// So often a board that has just been opened is waited for, `SILENCE_TIMEOUT` each time: it may be slow, but not for ever.
const FIRST_WAITS: usize = 20;
/// The first reports of a board that has just been opened may be as old as the last time that it was read: what its bus keeps, and
/// one more. As many show, when it is closed, that the board has taken a zero: only what is fetched lets it go on.
const OLD_REPORTS: usize = 3;
/// So often a board that is closed is sent zero until it takes it.
const ZERO_TRIES: usize = 5;

#[derive(Debug)]
pub(super) struct Board {
    name: String,
    options: BoardOptions,
    form: BoardForm,
    /// The report that ends all force.
    zero: BoardBytes,
    calibrator: Calibrator,
    limits: Limits,
    turns: ReportCredits,
    stop_counter: StopCounter,
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
            turns: ReportCredits::default(),
            stop_counter: StopCounter::default(),
            number: 0,
            newest: None,
        }
    }

    /// Takes into account what another thread has sent to end all force.
    fn account_for_stops(&mut self) {
        let zeros = self.stop_counter.take();
        if zeros > 0 {
            self.turns.stopped(zeros);
            self.limits.reset();
        }
    }

    /// Takes what has come. Whether there was a report.
    fn drain(&mut self, link: &mut Link, within: Duration) -> Result<bool, DeviceError> {
        let (form, mut newest, mut reports) = (self.form, None, 0_u64);
        link.drain(within, |bytes| match BoardInput::parse(form, bytes) {
            Ok(input) => {
                newest = Some(input);
                reports += 1;
                Handled::Used(0)
            }
            Err(_) => Handled::Malformed,
        })?;
        let Some(input) = newest else { return Ok(false) };
        let kinematics = &self.options.kinematics;
        let counters = self.calibrator.take(kinematics, &input);
        if self.calibrator.take_force_reset() {
            self.limits.reset();
        }
        let angles_rad = kinematics.angles_rad(kinematics.counts(counters));
        self.newest = Some(Pose { angles_rad, is_pressed: input.is_pressed });
        self.number = self.number.saturating_add(reports);
        self.turns.heard(reports, link.clock.now());
        Ok(true)
    }

    /// Takes no notice of what has come, but that it has. Whether there was a report within [`SILENCE_TIMEOUT`].
    fn skip(&mut self, link: &mut Link) -> Result<bool, DeviceError> {
        let mut reports = 0;
        link.drain(SILENCE_TIMEOUT, |_| {
            reports += 1;
            Handled::Ignored
        })?;
        if reports > 0 {
            self.turns.heard(reports, link.clock.now());
        } else {
            self.turns.note_silence();
        }
        Ok(reports > 0)
    }

    fn send_zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.turns.sending(link.clock.now());
        link.write(self.zero.as_slice())?;
        self.turns.sent([0; 3]);
        self.limits.reset();
        Ok(())
    }

    fn send(&mut self, link: &mut Link, output: BoardOutput) -> Result<(), DeviceError> {
        let Ok(report) = output.encode(self.form) else {
            // Only a calibration has no form of 8 bytes, and such a board is never asked for one.
            return Ok(());
        };
        self.turns.sending(link.clock.now());
        link.write(report.as_slice())?;
        self.turns.sent(match output {
            BoardOutput::Currents(currents_ma) => currents_ma,
            BoardOutput::Counters(_) => [0; 3],
        });
        Ok(())
    }

    /// Zero force, and where home is if the board is to be told.
    fn reply_with_zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        if !self.calibrator.is_asked() {
            return self.send_zero(link);
        }
        self.limits.reset();
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
    fn track_link_errors<T>(&mut self, done: Result<T, DeviceError>) -> Result<T, DeviceError> {
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
        self.turns = ReportCredits::begin(link.clock.now());
        self.stop_counter.take();
        (self.limits, self.number, self.newest) = (Limits::default(), 0, None);
        // Firmware that takes turns falls silent once it has nothing to take.
        for _ in 0..FIRST_WAITS {
            if !self.skip(link)? {
                break;
            }
        }
        self.send_zero(link)?;
        let mut old = 0;
        for _ in 0..FIRST_WAITS {
            old += usize::from(self.skip(link)?);
            if self.turns.has_credit() {
                self.send_zero(link)?;
            }
            if old == OLD_REPORTS {
                break;
            }
        }
        self.calibrator.opened(self.options.homing);
        for _ in 0..FIRST_WAITS {
            if !self.drain(link, SILENCE_TIMEOUT)? || !self.calibrator.is_in_progress() {
                break;
            }
            // So that an arm that is at home now is not seen to jump there.
            if self.turns.has_credit() {
                self.reply_with_zero(link)?;
            }
        }
        Ok(())
    }

    fn newest(&mut self, link: &mut Link) -> Result<Reading, DeviceError> {
        self.account_for_stops();
        let drained = self.drain(link, Duration::ZERO);
        if drained.is_err() {
            self.turns.failed();
        }
        if !drained? && self.turns.needs_wake_up(link.clock.now()) {
            self.send_zero(link)?;
        }
        let pose = self.newest.filter(|_| !self.turns.is_silent()).ok_or(DeviceError::TimedOut)?;
        Ok(Reading {
            position_m: self.options.kinematics.position_m(pose.angles_rad),
            velocity_m_per_s: None,
            orientation: DQuat::IDENTITY,
            buttons: u32::from(pose.is_pressed),
            sequence: Some(self.number),
        })
    }

    fn show(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        self.account_for_stops();
        if self.turns.has_credit() && self.calibrator.is_asked() {
            return self.reply_with_zero(link);
        }
        if !force_n.is_finite() {
            self.limits.reset();
        }
        let currents_ma = self.currents_ma(force_n);
        if self.turns.has_credit() {
            self.send(link, BoardOutput::Currents(currents_ma))?;
            if let Some(pose) = self.newest.filter(|_| self.calibrator.is_done()) {
                self.limits.taken(&self.options, pose.angles_rad);
            }
            link.note_force();
        } else if self.turns.may_send_early() && is_less_than_half(currents_ma, self.turns.shown_ma) {
            self.send(link, BoardOutput::Currents(currents_ma))?;
        } else if self.turns.is_silent() && force_n != DVec3::ZERO {
            return Err(DeviceError::TimedOut);
        }
        Ok(())
    }

    /// Zero force, sent again where it was not taken: nothing comes after it.
    fn send_zero_with_retries(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let mut sent = self.send_zero(link);
        for _ in 1..ZERO_TRIES {
            if sent.is_ok() {
                break;
            }
            sent = self.send_zero(link);
        }
        sent
    }

    fn end(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.account_for_stops();
        self.send_zero_with_retries(link)?;
        for _ in 0..OLD_REPORTS {
            if !self.drain(link, SILENCE_TIMEOUT)? {
                break;
            }
            if self.turns.has_credit() {
                self.send_zero_with_retries(link)?;
            }
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
        self.track_link_errors(begun)
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let newest = self.newest(link);
        self.track_link_errors(newest)
    }

    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        let shown = self.show(link, force_n);
        self.track_link_errors(shown)
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let ended = self.end(link);
        self.track_link_errors(ended)
    }

    fn mark_disconnected(&mut self) {
        self.calibrator.lost();
    }

    fn ends_by_itself(&self) -> bool {
        // What boards with reports of 64 bytes do has not been published.
        self.form != BoardForm::Bytes64
    }

    fn stop_reports(&self) -> Vec<Vec<u8>> {
        vec![self.zero.as_slice().to_vec()]
    }

    fn stop_counter(&self) -> Option<StopCounter> {
        Some(self.stop_counter.clone())
    }

    fn calibration(&self) -> Option<BoardCalibration> {
        Some(self.calibrator.handle())
    }
}
