//! Force-feedback joysticks with the USB physical interface device class (PID), driven by their report descriptors.
//!
//! The driver creates one constant force for each axis with a motor and writes its magnitude at every tick:
//!
//! 1. start: reset the device, end a pause that a game may have left, enable the actuators, set the gain to its maximum, create the
//!    effects one by one, set their parameters, set their magnitudes to zero, start them;
//! 2. write: the magnitude of each effect, the decreasing one first. If the device rejects one, all are set to zero. While there is
//!    force, each effect is started again every 100 ms;
//! 3. stop: magnitudes zero, effects stopped and freed, actuators disabled. The force after that depends on the device; some have a
//!    spring of their own.
//!
//! # After the program was killed
//!
//! A killed program sends no stop and would leave the last force on. Effects therefore last 0.5 s, in the unit of the duration field
//! (milliseconds without one), and each effect with a force is started again every 100 ms. Without the driver the firmware ends the
//! force 0.4 to 0.5 s later.
//!
//! By the class definition, the start operation restarts an effect that is already playing: its time begins at zero, and a constant
//! force without an envelope keeps its magnitude. OpenFFBoard (HidFFB.cpp at 3a4cc0e, `set_effect_operation`) and
//! ArduinoJoystickWithFFBLibrary (PIDReportHandler.cpp at 04fdc39, `StartEffect`) reset the start time only. OpenFFBoard of 2020
//! (04dcaf4) lets the time run on, so the force pauses for up to 100 ms after each duration.
//!
//! If the duration field holds no value from 0.25 to 1 s, the effects are endless: the last force stays until the device is opened
//! again, reset or switched off.
//!
//! # Other programs
//!
//! The operating system's driver (`hid-pidff` on Linux) can create effects in the same device. Do not run a game or force feedback
//! through evdev at the same time.
//!
//! Sources: *Device Class Definition for Physical Interface Devices (PID)*, version 1.0, USB Implementers' Forum; and of firmware
//! Ultrawipf/OpenFFBoard, YukMingLaw/ArduinoJoystickWithFFBLibrary, and walmis/VPforce-TelemFFB for the VPforce Rhino.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub(crate) mod array_base;
mod direction_check;
mod effect;
mod effect_duration;
mod force_scale;
mod input;
mod layout;
mod off_reports;
mod options;
mod report_encoding;
pub(crate) mod usages;

pub use array_base::{PidArrayBase, PidArrayBases};
pub use options::JoystickOptions;

use crate::driver::{Driver, StopReport};
use crate::link::{Handled, Link};
use crate::{HidError, HidInfo, ReportDescriptor, ReportKind};
use direction_check::{DirectionCheck, DirectionFault};
use effect::{Effect, check_capacity};
use glam::{DQuat, DVec3};
use input::ParsedInput;
use layout::{Axes, Layout};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;
use usages::{GAME_PAD, JOYSTICK, MAGNITUDE, SET_CONSTANT_FORCE};

/// Time without a force after which the effects are started again: the watchdog, with a timeout of 50 ms, may have stopped them.
const RESTART: Duration = Duration::from_millis(40);
/// Time in which the full force returns after the device was set to zero.
const RECOVERY: Duration = Duration::from_millis(20);
/// Maximum part of the recovery time that one tick counts.
const MAX_TICK: Duration = Duration::from_millis(2);

/// Whether a top-level usage is that of a joystick or a game pad.
pub(crate) fn may_be_joystick(info: &HidInfo) -> bool {
    info.applications.iter().any(|usage| *usage == JOYSTICK.usage || *usage == GAME_PAD.usage)
}

/// Whether the device has a report that sets a constant force.
pub(crate) fn has_constant_force(descriptor: &ReportDescriptor) -> bool {
    descriptor.find(ReportKind::Output, SET_CONSTANT_FORCE.usage, MAGNITUDE.usage).is_some()
}

#[derive(Debug)]
struct Joystick {
    name: String,
    options: JoystickOptions,
    layout: Layout,
    /// Effects of x and, if it has a motor, of y; empty before the start.
    effects: Vec<Effect>,
    /// Time of the last accepted force.
    accepted_at: Duration,
    /// Scale of the forces, 0 to 1; below 1 for a while after the device was set to zero without the loop's involvement.
    scale: f64,
    /// Whether the effects have to be started again.
    is_stopped: bool,
    /// Whether the actuators were switched off after an effect rejected zero.
    is_off: bool,
    /// Check of the direction of the force; `None` if it is disabled.
    check: Option<DirectionCheck>,
    /// Fault of the direction for which the force was removed.
    fault: Option<DirectionFault>,
    /// Latest position as a fraction of the travel, pressed buttons, and the time of their report.
    latest: Option<([f64; 2], u32, Duration)>,
}

pub(crate) fn driver(
    info: &HidInfo,
    descriptor: &ReportDescriptor,
    options: JoystickOptions,
) -> Result<Box<dyn Driver>, HidError> {
    options.validate()?;
    let name = info.label();
    let layout = Layout::of(&name, descriptor, &options)?;
    let (effects, accepted_at, scale, latest) = (Vec::new(), Duration::ZERO, 1.0, None);
    let (is_stopped, is_off) = (false, false);
    Ok(Box::new(Joystick {
        name,
        options,
        layout,
        effects,
        accepted_at,
        scale,
        is_stopped,
        is_off,
        check: None,
        fault: None,
        latest,
    }))
}

impl Joystick {
    fn axes(&self) -> usize {
        match self.layout.axes {
            Axes::X => 1,
            Axes::Xy => 2,
        }
    }

    /// Components of a force along x and y, N: projected on the plane, or on the line of x, and limited to the maximum force.
    fn in_plane(&self, force_n: DVec3) -> [f64; 2] {
        let [x, y] = self.options.plane;
        let along_y = if self.axes() == 2 { force_n.dot(y) } else { 0.0 };
        let in_plane = [force_n.dot(x), along_y];
        let length = in_plane[0].hypot(in_plane[1]);
        let max_n = self.options.max_force_n;
        // The comparison is false for NaN, which becomes zero.
        let shorter = if length <= max_n { 1.0 } else { max_n / length };
        in_plane.map(|force_n| if force_n.is_finite() { shorter * force_n } else { 0.0 })
    }

    /// Magnitudes of x and y for the components `in_plane` of a force, N.
    fn magnitudes(&self, [x, y]: [f64; 2]) -> [i64; 2] {
        let [is_x_reversed, is_y_reversed] = self.options.reverse;
        let magnitude = |force_n: f64, is_reversed: bool| {
            let sign = if is_reversed { -1.0 } else { 1.0 };
            self.layout.scale.counts(sign * self.scale * force_n)
        };
        [magnitude(x, is_x_reversed), magnitude(y, is_y_reversed)]
    }

    /// Gain by the check of the direction. After a fault the effects are at zero, and the actuators are off unless it may pass.
    fn check_direction(
        &mut self,
        link: &mut Link,
        now: Duration,
        in_plane: [f64; 2],
    ) -> Result<f64, DeviceError> {
        let Some(check) = &mut self.check else { return Ok(1.0) };
        match check.gain(now, in_plane) {
            Ok(gain) => {
                self.fault = None;
                Ok(gain)
            }
            Err(fault) => {
                if self.fault.replace(fault) != Some(fault) {
                    let _ = self.zero_all(link);
                    self.is_stopped = true;
                    if fault != DirectionFault::AtEnd {
                        self.is_off = self.layout.control.off.send(link).is_ok();
                    }
                }
                Err(fault.error())
            }
        }
    }

    /// Creates the effects and starts them at zero.
    fn create_effects(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        for axis in 0..self.axes() {
            let effect = Effect::create(link, &self.layout, axis, &self.effects)?;
            self.effects.push(effect);
        }
        self.effects.iter().try_for_each(|effect| effect.set(link))?;
        self.effects.iter_mut().try_for_each(|effect| effect.zero(link))?;
        self.effects.iter_mut().try_for_each(|effect| effect.start(link))
    }

    /// Sets all effects to zero and restarts the recovery: no axis may keep an old force while another has a new one. If an axis rejects
    /// zero, disables the actuators.
    fn zero_all(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.scale = 0.0;
        let mut zeroed = Ok(());
        for effect in &mut self.effects {
            // Zero each effect, even if one fails.
            zeroed = zeroed.and(effect.zero(link));
        }
        if zeroed.is_err() {
            self.is_stopped = true;
            let off = &self.layout.control.off;
            // In one of two readings the reports enable the actuators for a moment, so they are not repeated.
            if !(self.is_off && off.is_ambiguous()) {
                self.is_off = off.send(link).is_ok();
            }
        }
        zeroed
    }

    /// Starts the effects again after another thread may have stopped them.
    fn restart(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.zero_all(link)?;
        self.is_off = false;
        link.write(&self.layout.control.enable)?;
        self.effects.iter_mut().try_for_each(|effect| effect.start(link))?;
        self.is_stopped = false;
        Ok(())
    }

    /// Writes all magnitudes, the decreasing one first: in between, the total force is smaller, not larger. Returns whether one was
    /// written.
    fn send(&mut self, link: &mut Link, now: Duration) -> Result<bool, DeviceError> {
        let layout = &self.layout;
        let is_second_first = matches!(&*self.effects, [x, y] if y.growth() < x.growth());
        let mut has_written = false;
        let mut send =
            |effect: &mut Effect| effect.send(link, layout, now).map(|is_written| has_written |= is_written);
        if is_second_first {
            self.effects.iter_mut().rev().try_for_each(&mut send)?;
        } else {
            self.effects.iter_mut().try_for_each(&mut send)?;
        }
        Ok(has_written)
    }
}

impl Driver for Joystick {
    fn describe(&self) -> DeviceDescription {
        let [x, y] = self.options.plane;
        let [along_x, along_y] = self.options.travel_m;
        let along_y = if self.layout.input.has_y() { along_y } else { 0.0 };
        let half = x.abs() * along_x + y.abs() * along_y;
        DeviceDescription {
            name: self.name.clone(),
            workspace_m: [-half, half],
            max_force_n: self.options.max_force_n,
            // Estimated: full-speed USB transfers one output report per millisecond, and each axis needs one. `HidCounters` has the
            // measured rate.
            rate_hz: 1000.0 / self.axes() as f64,
        }
    }

    fn displayed_force_n(&self, force_n: DVec3) -> DVec3 {
        let axes = self.options.plane.iter().take(self.axes());
        axes.map(|axis| force_n.dot(*axis) * *axis).sum()
    }

    fn notice(&self) -> Option<&'static str> {
        // Descriptors do not state which axes have a motor.
        self.layout.input.has_y().then_some(
            "it declares the axes x and y; if it is a wheel with one motor, whose y is a pedal, force along y is lost or acts along x:              set `JoystickOptions::use_y` to false (palpate-lab devices --test: --no-y)",
        )
    }

    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.effects.clear();
        self.latest = None;
        let JoystickOptions { travel_m, max_force_n, check_direction, .. } = self.options;
        (self.check, self.fault) =
            (check_direction.then(|| DirectionCheck::new(travel_m, max_force_n)), None);
        // Discard reports from before the opening.
        link.drain(Duration::ZERO, |_| Handled::Ignored)?;
        link.write(&self.layout.control.reset)?;
        if let Some(resume) = &self.layout.control.resume {
            // A reset may leave the device paused. The command is optional, so ignore its rejection.
            let _ = link.write(resume);
        }
        link.write(&self.layout.control.enable)?;
        if let Some(gain) = &self.layout.gain {
            link.write(gain)?;
        }
        if let Some(pool) = &self.layout.pool {
            check_capacity(link, pool, self.axes() as i64)?;
        }
        if let Err(error) = self.create_effects(link) {
            // An effect with an unknown index may exist.
            let _ = link.write(&self.layout.control.reset);
            return Err(error);
        }
        (self.accepted_at, self.scale) = (link.clock.now(), 1.0);
        (self.is_stopped, self.is_off) = (false, false);
        Ok(())
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let (input, mut newest) = (&self.layout.input, None);
        // Do not wait: between two reports the position is unchanged.
        link.drain(Duration::ZERO, |bytes| match input.parse(bytes) {
            ParsedInput::Position(position, buttons) => {
                newest = Some((position, buttons));
                Handled::Used(0)
            }
            ParsedInput::Other => Handled::Ignored,
            ParsedInput::Malformed => Handled::Malformed,
        })?;
        let now = link.clock.now();
        if let Some((position, buttons)) = newest {
            self.latest = Some((position, buttons, now));
            let [along_x, along_y] = self.options.travel_m;
            if let Some(check) = &mut self.check {
                check.note_position(now, [position[0] * along_x, position[1] * along_y]);
            }
        }
        let (position, buttons, reported_at) = self.latest.ok_or(DeviceError::TimedOut)?;
        let silence_s = now.saturating_sub(reported_at).as_secs_f64();
        if self.options.silent_after_s.is_some_and(|limit_s| silence_s > limit_s) {
            return Err(DeviceError::TimedOut);
        }
        let ([x, y], [along_x, along_y]) = (self.options.plane, self.options.travel_m);
        Ok(Reading {
            position_m: position[0] * along_x * x + position[1] * along_y * y,
            velocity_m_per_s: None,
            orientation: DQuat::IDENTITY,
            buttons,
            sequence: None,
        })
    }

    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        let now = link.clock.now();
        let in_plane = self.in_plane(force_n);
        let gain = self.check_direction(link, now, in_plane)?;
        if self.is_stopped || now.saturating_sub(self.accepted_at) > RESTART {
            self.restart(link)?;
        }
        let magnitudes = self.magnitudes(in_plane.map(|force_n| gain * force_n));
        for (effect, magnitude) in self.effects.iter_mut().zip(magnitudes) {
            effect.target = magnitude;
        }
        let is_written = match self.send(link, now) {
            Ok(is_written) => is_written,
            Err(error) => {
                let _ = self.zero_all(link);
                return Err(error);
            }
        };
        let tick = now.saturating_sub(self.accepted_at).min(MAX_TICK);
        self.scale = (self.scale + tick.as_secs_f64() / RECOVERY.as_secs_f64()).min(1.0);
        self.accepted_at = now;
        if is_written {
            link.note_force();
        }
        Ok(())
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        // Send each report, even if one fails.
        let mut stopped = self.zero_all(link);
        for effect in &self.effects {
            stopped = stopped.and(effect.stop(link));
        }
        for effect in &self.effects {
            stopped = stopped.and(effect.free(link));
        }
        stopped = stopped.and(self.layout.control.off.send(link));
        self.effects.clear();
        stopped
    }

    fn has_force_timeout(&self) -> bool {
        self.layout.has_finite_effects
    }

    fn stop_reports(&self) -> Vec<StopReport> {
        let zero = self.effects.iter().map(Effect::zero_report);
        let control = &self.layout.control;
        // The last ones work without effect indices.
        let first = zero.chain([control.stop_all.clone()]).map(StopReport::required);
        first.chain(control.off.stop_reports()).collect()
    }
}
