//! Driver of a board.

use super::calibration::Calibrator;
use super::force_limits::{ForceLimits, is_less_than_half};
use super::report_credits::{ReportCredits, SILENCE_TIMEOUT};
use super::{
    BoardBytes, BoardCalibration, BoardForm, BoardInput, BoardKinematics, BoardOptions, BoardOutput,
};
use crate::driver::{Driver, StopCounter, StopReport};
use crate::link::{Handled, Link};
use glam::{DQuat, DVec3};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;

/// Maximum number of waits of [`SILENCE_TIMEOUT`] for a board that has just been opened.
const FIRST_WAITS: usize = 20;
/// Number of reports that may be stale after opening: those queued by the bus since the last read, and one more. Closing waits for as
/// many, which show that the board has received the zero report: it continues only after its reports are fetched.
const STALE_REPORTS: usize = 3;
/// Maximum number of attempts to send zero on closing.
const ZERO_TRIES: usize = 5;

#[derive(Debug)]
pub(super) struct BoardDriver {
    name: String,
    options: BoardOptions,
    form: BoardForm,
    /// Report that ends all force.
    zero: BoardBytes,
    calibrator: Calibrator,
    limits: ForceLimits,
    credits: ReportCredits,
    stop_counter: StopCounter,
    /// Number of reports received since the board was opened.
    report_count: u64,
    newest: Option<Pose>,
}

/// Pose of the arm and state of the button.
#[derive(Clone, Copy, Debug)]
struct Pose {
    angles_rad: DVec3,
    is_pressed: bool,
}

impl BoardDriver {
    /// Creates the driver of a closed board; `zero` is the report that ends all force.
    pub(super) fn new(name: String, options: BoardOptions, form: BoardForm, zero: BoardBytes) -> Self {
        Self {
            name,
            options,
            form,
            zero,
            calibrator: Calibrator::new(form),
            limits: ForceLimits::default(),
            credits: ReportCredits::default(),
            stop_counter: StopCounter::default(),
            report_count: 0,
            newest: None,
        }
    }

    /// Accounts for stop reports sent by another thread.
    fn account_for_stops(&mut self) {
        let zeros = self.stop_counter.take();
        if zeros > 0 {
            self.credits.stops_sent(zeros);
            self.limits.reset();
        }
    }

    /// Processes all pending reports. Returns whether there was one.
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
        let counters = self.calibrator.process(kinematics, &input);
        if self.calibrator.take_force_reset() {
            self.limits.reset();
        }
        let angles_rad = kinematics.angles_rad(kinematics.counts(counters));
        self.newest = Some(Pose { angles_rad, is_pressed: input.is_pressed });
        self.report_count = self.report_count.saturating_add(reports);
        self.credits.received(reports, link.clock.now());
        Ok(true)
    }

    /// Discards all pending reports and only counts them. Returns whether one arrived within [`SILENCE_TIMEOUT`].
    fn discard_reports(&mut self, link: &mut Link) -> Result<bool, DeviceError> {
        let mut reports = 0;
        link.drain(SILENCE_TIMEOUT, |_| {
            reports += 1;
            Handled::Ignored
        })?;
        if reports > 0 {
            self.credits.received(reports, link.clock.now());
        } else {
            self.credits.note_silence();
        }
        Ok(reports > 0)
    }

    fn send_zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.credits.sending(link.clock.now());
        link.write(self.zero.as_slice())?;
        self.credits.sent([0; 3]);
        self.limits.reset();
        Ok(())
    }

    fn send(&mut self, link: &mut Link, output: BoardOutput) -> Result<(), DeviceError> {
        let Ok(report) = output.encode(self.form) else {
            // Only counters cannot be encoded in 8 bytes, and they are never sent to a board with such reports.
            return Ok(());
        };
        self.credits.sending(link.clock.now());
        link.write(report.as_slice())?;
        self.credits.sent(match output {
            BoardOutput::Currents(currents_ma) => currents_ma,
            BoardOutput::Counters(_) => [0; 3],
        });
        Ok(())
    }

    /// Replies with zero force, or with the counters of the home pose if they have to be sent.
    fn reply_with_zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        if !self.calibrator.must_send_counters() {
            return self.send_zero(link);
        }
        self.limits.reset();
        self.send(link, BoardOutput::Counters(self.options.kinematics.home_counts))?;
        self.calibrator.counters_sent();
        Ok(())
    }

    /// Currents for `force_n` in the current pose, mA; zero before calibration.
    fn currents_ma(&self, force_n: DVec3) -> [i16; 3] {
        match self.newest {
            Some(pose) if self.calibrator.is_done() => {
                self.limits.currents(&self.options, pose.angles_rad, force_n)
            }
            _ => [0; 3],
        }
    }

    /// Returns `result` unchanged and notes its error: the counters may be invalid after an error of the link.
    fn track_link_errors<T>(&mut self, result: Result<T, DeviceError>) -> Result<T, DeviceError> {
        match result {
            Err(DeviceError::Disconnected) => self.calibrator.connection_lost(),
            // A timeout reports silence, which is no failure of the link.
            Ok(_) | Err(DeviceError::TimedOut) => {}
            Err(_) => self.calibrator.link_failed(),
        }
        result
    }

    /// Synchronises with a newly opened board, at zero force.
    fn synchronise(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.calibrator.before_open();
        self.credits = ReportCredits::begin(link.clock.now());
        self.stop_counter.take();
        (self.limits, self.report_count, self.newest) = (ForceLimits::default(), 0, None);
        // Firmware that waits for replies stops sending once it gets none.
        for _ in 0..FIRST_WAITS {
            if !self.discard_reports(link)? {
                break;
            }
        }
        self.send_zero(link)?;
        let mut stale = 0;
        for _ in 0..FIRST_WAITS {
            stale += usize::from(self.discard_reports(link)?);
            if self.credits.has_credit() {
                self.send_zero(link)?;
            }
            if stale == STALE_REPORTS {
                break;
            }
        }
        self.calibrator.after_open(self.options.homing);
        for _ in 0..FIRST_WAITS {
            if !self.drain(link, SILENCE_TIMEOUT)? || !self.calibrator.is_in_progress() {
                break;
            }
            // Calibrate before the first reading, which avoids a jump of the position.
            if self.credits.has_credit() {
                self.reply_with_zero(link)?;
            }
        }
        Ok(())
    }

    fn read_newest(&mut self, link: &mut Link) -> Result<Reading, DeviceError> {
        self.account_for_stops();
        let drained = self.drain(link, Duration::ZERO);
        if drained.is_err() {
            self.credits.link_failed();
        }
        if !drained? && self.credits.needs_wake_up(link.clock.now()) {
            self.send_zero(link)?;
        }
        let pose = self.newest.filter(|_| !self.credits.is_silent()).ok_or(DeviceError::TimedOut)?;
        Ok(Reading {
            position_m: self.options.kinematics.position_m(pose.angles_rad),
            velocity_m_per_s: None,
            orientation: DQuat::IDENTITY,
            buttons: u32::from(pose.is_pressed),
            sequence: Some(self.report_count),
        })
    }

    fn send_force(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        self.account_for_stops();
        if self.credits.has_credit() && self.calibrator.must_send_counters() {
            return self.reply_with_zero(link);
        }
        if !force_n.is_finite() {
            self.limits.reset();
        }
        let currents_ma = self.currents_ma(force_n);
        if self.credits.has_credit() {
            self.send(link, BoardOutput::Currents(currents_ma))?;
            if let Some(pose) = self.newest.filter(|_| self.calibrator.is_done()) {
                self.limits.force_accepted(&self.options, pose.angles_rad);
            }
            link.note_force();
        } else if self.credits.may_send_early() && is_less_than_half(currents_ma, self.credits.displayed_ma) {
            self.send(link, BoardOutput::Currents(currents_ma))?;
        } else if self.credits.is_silent() && force_n != DVec3::ZERO {
            return Err(DeviceError::TimedOut);
        }
        Ok(())
    }

    /// Sends zero force and retries after errors, as no later report corrects it.
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

    fn shut_down(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.account_for_stops();
        self.send_zero_with_retries(link)?;
        for _ in 0..STALE_REPORTS {
            if !self.drain(link, SILENCE_TIMEOUT)? {
                break;
            }
            if self.credits.has_credit() {
                self.send_zero_with_retries(link)?;
            }
        }
        Ok(())
    }
}

impl Driver for BoardDriver {
    fn describe(&self) -> DeviceDescription {
        let BoardKinematics { workspace_radius_m, max_force_n, .. } = self.options.kinematics;
        DeviceDescription {
            name: self.name.clone(),
            workspace_m: [DVec3::splat(-workspace_radius_m), DVec3::splat(workspace_radius_m)],
            max_force_n,
            // One report in each USB frame.
            rate_hz: 1000.0,
        }
    }

    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let result = self.synchronise(link);
        self.track_link_errors(result)
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let result = self.read_newest(link);
        self.track_link_errors(result)
    }

    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        let result = self.send_force(link, force_n);
        self.track_link_errors(result)
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let result = self.shut_down(link);
        self.track_link_errors(result)
    }

    fn mark_disconnected(&mut self) {
        self.calibrator.connection_lost();
    }

    fn has_force_timeout(&self) -> bool {
        // Firmware for reports of 64 bytes is unpublished.
        self.form != BoardForm::Bytes64
    }

    fn stop_reports(&self) -> Vec<StopReport> {
        vec![StopReport::required(self.zero.as_slice().to_vec())]
    }

    fn stop_counter(&self) -> Option<StopCounter> {
        Some(self.stop_counter.clone())
    }

    fn calibration(&self) -> Option<BoardCalibration> {
        Some(self.calibrator.handle())
    }
}
