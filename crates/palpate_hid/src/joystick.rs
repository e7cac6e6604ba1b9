//! Force-feedback joysticks with USB's physical interface device class (PID), driven by what their report descriptors say.
//!
//! The driver has the device make one constant force for each axis that has a motor, and writes its magnitude at every tick:
//!
//! 1. start: reset, an end to the pause in which a game may have left it, actuators on, gain to its greatest, the effects made one by one and asked for, told what they are, set to zero,
//!    started;
//! 2. write: the magnitude of each, first that which gets smaller; if one is not taken, zero for all; every 100 ms a start, as long as
//!    there is force;
//! 3. stop: the magnitudes zero, the effects stopped and freed, actuators off. What the device does then (some have a spring of their
//!    own) is its own business.
//!
//! **What a killed program leaves.** A program that ends without a stop, because it is killed, would leave the
//! last force on. So effects last half a second, in the unit that the duration's field states, milliseconds where it states none;
//! and as long as there is force each is started again every 100 ms. When nobody does that any more the firmware ends the force by
//! itself, 0.4 to 0.5 s later. To start an effect that is playing restarts it, by the class definition's effect operation: its time
//! begins anew, and a constant force without an envelope, which does not depend on the time, goes on with its magnitude. OpenFFBoard
//! (HidFFB.cpp at 3a4cc0e, `set_effect_operation`) and ArduinoJoystickWithFFBLibrary (PIDReportHandler.cpp at 04fdc39, `StartEffect`)
//! set the time of its start and leave the rest; OpenFFBoard of 2020 (04dcaf4) counts on instead, so that the force pauses for up to
//! 100 ms after each of its durations. A device on whose duration field nothing from 0.25 to 1 s can be written is given
//! effects without end: there the last force stays until the device is opened again, reset or without power.
//!
//! The operating system's driver of such devices (`hid-pidff` on Linux) may also make effects in it: let no game and no force
//! feedback through evdev run beside.
//!
//! Sources: *Device Class Definition for Physical Interface Devices (PID)*, version 1.0, USB Implementers' Forum; and of firmware
//! Ultrawipf/OpenFFBoard, YukMingLaw/ArduinoJoystickWithFFBLibrary, and walmis/VPforce-TelemFFB for the VPforce Rhino.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod effect;
mod effect_duration;
mod force_scale;
mod input;
mod layout;
mod options;
mod report_encoding;
pub(crate) mod usages;

pub use options::JoystickOptions;

use crate::driver::Driver;
use crate::link::{Handled, Link};
use crate::{HidError, HidInfo, ReportDescriptor, ReportKind};
use effect::{Effect, check_capacity};
use glam::{DQuat, DVec3};
use input::Said;
use layout::{Axes, Layout};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;
use usages::{GAME_PAD, JOYSTICK, MAGNITUDE, SET_CONSTANT_FORCE};

/// After a silence as long as this the effects are started anew: the watchdog, which stops them after 50 ms, may have done so.
const RESTART: Duration = Duration::from_millis(40);
/// After the device was set to zero the whole force comes back within this time.
const RECOVERY: Duration = Duration::from_millis(20);
/// The most that one tick counts of it.
const MAX_TICK: Duration = Duration::from_millis(2);

/// Whether its applications allow it: a joystick, or a game pad.
pub(crate) fn may_be_one(info: &HidInfo) -> bool {
    info.applications.iter().any(|usage| *usage == JOYSTICK.usage || *usage == GAME_PAD.usage)
}

/// Whether it has a report that sets a constant force.
pub(crate) fn is_one(descriptor: &ReportDescriptor) -> bool {
    descriptor.find(ReportKind::Output, SET_CONSTANT_FORCE.usage, MAGNITUDE.usage).is_some()
}

#[derive(Debug)]
struct Joystick {
    name: String,
    options: JoystickOptions,
    layout: Layout,
    /// Those of x and, if it has a motor, of y, once it is started.
    effects: Vec<Effect>,
    /// When the device last took a force, and the part of what is asked for that it is given: less than 1 for a while after it was
    /// set to zero, when the loop does not know of it.
    taken_at: Duration,
    part: f64,
    /// Whether its effects have to be started anew.
    is_stopped: bool,
    /// Where it is in parts of its travel, which buttons are pressed, and when it said so.
    place: Option<([f64; 2], u32, Duration)>,
}

pub(crate) fn driver(
    info: &HidInfo,
    descriptor: &ReportDescriptor,
    options: JoystickOptions,
) -> Result<Box<dyn Driver>, HidError> {
    options.validate()?;
    let name = info.label();
    let layout = Layout::of(&name, descriptor, &options)?;
    let (effects, taken_at, part, place) = (Vec::new(), Duration::ZERO, 1.0, None);
    let is_stopped = false;
    Ok(Box::new(Joystick { name, options, layout, effects, taken_at, part, is_stopped, place }))
}

impl Joystick {
    fn axes(&self) -> usize {
        match self.layout.axes {
            Axes::X => 1,
            Axes::Xy => 2,
        }
    }

    /// The magnitudes for a force, of x and of y: it is projected on the plane, or on the line of x, and shortened to what is
    /// allowed.
    fn magnitudes(&self, force_n: DVec3) -> [i64; 2] {
        let [x, y] = self.options.plane;
        let along_y = if self.axes() == 2 { force_n.dot(y) } else { 0.0 };
        let in_plane = [force_n.dot(x), along_y];
        let length = in_plane[0].hypot(in_plane[1]);
        // What is not a number is no force.
        let shorter = if length > self.options.max_force_n { self.options.max_force_n / length } else { 1.0 };
        let [is_x_reversed, is_y_reversed] = self.options.reverse;
        let magnitude = |force_n: f64, is_reversed: bool| {
            let sign = if is_reversed { -1.0 } else { 1.0 };
            self.layout.scale.counts(sign * self.part * shorter * force_n)
        };
        let [x, y] = in_plane;
        [magnitude(x, is_x_reversed), magnitude(y, is_y_reversed)]
    }

    /// Has the device make its effects and lets them act, at zero.
    fn make(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        for axis in 0..self.axes() {
            self.effects.push(Effect::create(link, &self.layout, axis)?);
        }
        self.effects.iter().try_for_each(|effect| effect.set(link))?;
        self.effects.iter_mut().try_for_each(|effect| effect.zero(link))?;
        self.effects.iter_mut().try_for_each(|effect| effect.start(link))
    }

    /// Zero, and from there on anew: one axis must not go on with an old force while the other has a new one. Where an axis does not
    /// even take zero the actuators are switched off.
    fn zero_all(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.part = 0.0;
        let mut zeroed = Ok(());
        for effect in &mut self.effects {
            // Each of them, even if one fails.
            zeroed = zeroed.and(effect.zero(link));
        }
        if zeroed.is_err() {
            self.is_stopped = true;
            let _ = link.write(&self.layout.control.disable);
        }
        zeroed
    }

    /// Lets the effects act again, which may have been stopped beside.
    fn restart(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.zero_all(link)?;
        link.write(&self.layout.control.enable)?;
        self.effects.iter_mut().try_for_each(|effect| effect.start(link))?;
        self.is_stopped = false;
        Ok(())
    }

    /// Writes all magnitudes: first the one that gets smaller, so that in between there is less force and not more. Whether one
    /// was written.
    fn send(&mut self, link: &mut Link, now: Duration) -> Result<bool, DeviceError> {
        let layout = &self.layout;
        let is_second_first = matches!(&*self.effects, [x, y] if y.growth() < x.growth());
        let mut is_any = false;
        let mut send =
            |effect: &mut Effect| effect.send(link, layout, now).map(|is_written| is_any |= is_written);
        if is_second_first {
            self.effects.iter_mut().rev().try_for_each(&mut send)?;
        } else {
            self.effects.iter_mut().try_for_each(&mut send)?;
        }
        Ok(is_any)
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
            // An inference: USB at full speed takes one output report a millisecond, and each axis needs one. What was achieved
            // the counters tell.
            rate_hz: 1000.0 / self.axes() as f64,
        }
    }

    fn displayed_force_n(&self, force_n: DVec3) -> DVec3 {
        let axes = self.options.plane.iter().take(self.axes());
        axes.map(|axis| force_n.dot(*axis) * *axis).sum()
    }

    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        self.effects.clear();
        self.place = None;
        // What came before it was opened is old.
        link.drain(Duration::ZERO, |_| Handled::Ignored)?;
        link.write(&self.layout.control.reset)?;
        if let Some(resume) = &self.layout.control.resume {
            // A reset need not end a pause. One that does not take this may do without.
            let _ = link.write(resume);
        }
        link.write(&self.layout.control.enable)?;
        if let Some(gain) = &self.layout.gain {
            link.write(gain)?;
        }
        if let Some(pool) = &self.layout.pool {
            check_capacity(link, pool, self.axes() as i64)?;
        }
        if let Err(error) = self.make(link) {
            // There may be an effect whose index is not known.
            let _ = link.write(&self.layout.control.reset);
            return Err(error);
        }
        (self.taken_at, self.part, self.is_stopped) = (link.clock.now(), 1.0, false);
        Ok(())
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let (input, mut said) = (&self.layout.input, None);
        // Nothing is waited for: between two reports the stick is where it was.
        link.drain(Duration::ZERO, |bytes| match input.parse(bytes) {
            Said::Place(place, buttons) => {
                said = Some((place, buttons));
                Handled::Used(0)
            }
            Said::Other => Handled::Ignored,
            Said::Malformed => Handled::Malformed,
        })?;
        let now = link.clock.now();
        if let Some((place, buttons)) = said {
            self.place = Some((place, buttons, now));
        }
        let (place, buttons, said_at) = self.place.ok_or(DeviceError::TimedOut)?;
        let silence_s = now.saturating_sub(said_at).as_secs_f64();
        if self.options.silent_after_s.is_some_and(|limit_s| silence_s > limit_s) {
            return Err(DeviceError::TimedOut);
        }
        let ([x, y], [along_x, along_y]) = (self.options.plane, self.options.travel_m);
        Ok(Reading {
            position_m: place[0] * along_x * x + place[1] * along_y * y,
            velocity_m_per_s: None,
            orientation: DQuat::IDENTITY,
            buttons,
            sequence: None,
        })
    }

    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError> {
        let now = link.clock.now();
        if self.is_stopped || now.saturating_sub(self.taken_at) > RESTART {
            self.restart(link)?;
        }
        let magnitudes = self.magnitudes(force_n);
        for (effect, magnitude) in self.effects.iter_mut().zip(magnitudes) {
            effect.wanted = magnitude;
        }
        let is_written = match self.send(link, now) {
            Ok(is_written) => is_written,
            Err(error) => {
                let _ = self.zero_all(link);
                return Err(error);
            }
        };
        let tick = now.saturating_sub(self.taken_at).min(MAX_TICK);
        self.part = (self.part + tick.as_secs_f64() / RECOVERY.as_secs_f64()).min(1.0);
        self.taken_at = now;
        if is_written {
            link.note_force();
        }
        Ok(())
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        // Each of these, even if one fails.
        let mut stopped = self.zero_all(link);
        for effect in &self.effects {
            stopped = stopped.and(effect.stop(link));
        }
        for effect in &self.effects {
            stopped = stopped.and(effect.free(link));
        }
        stopped = stopped.and(link.write(&self.layout.control.disable));
        self.effects.clear();
        stopped
    }

    fn ends_by_itself(&self) -> bool {
        self.layout.ends
    }

    fn stop_reports(&self) -> Vec<Vec<u8>> {
        let zero = self.effects.iter().map(Effect::zero_report);
        let control = &self.layout.control;
        // The last two need no effect's index.
        zero.chain([control.stop_all.clone(), control.disable.clone()]).collect()
    }
}
