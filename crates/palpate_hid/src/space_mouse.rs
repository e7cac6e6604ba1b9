//! The 3Dconnexion SpaceMouse: a spring-centred cap that reports its deflection along and about three axes. The driver integrates the
//! deflection as a velocity, which moves a point in a box.
//!
//! Sources: JakubAndrysek/PySpaceMouse at 284caf6, `pyspacemouse/devices.toml` and `device.py`; FreeSpacenav/spacenavd at bac572a,
//! `src/dev.c`.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod buttons;
mod models;
mod report;

pub(crate) use models::is_space_mouse;
pub use report::{ParseReportError, SpaceMouseReport};

use crate::driver::{Driver, StopReport};
use crate::link::{Handled, Link};
use crate::{HidError, HidInfo};
use buttons::Buttons;
use glam::{DQuat, DVec3};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;

/// Full deflection, counts.
const FULL_DEFLECTION: f64 = 350.0;
/// Shortest period of a cap's reports of one kind, s: 8 ms by cable, 16 ms by radio.
const REPORT_PERIOD_S: f64 = 0.008;
/// Maximum time between two readings over which the deflection is integrated, s.
const MAX_STEP_S: f64 = 0.02;

/// Options of a SpaceMouse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpaceMouseOptions {
    /// Speed of the point at full deflection along one axis, m/s, above 0 and at most 10.
    pub full_speed_m_per_s: f64,
    /// Angular speed at full deflection about one axis, rad/s, 0 to 100; 0 keeps the orientation.
    pub full_turn_rad_per_s: f64,
    /// Half the sides of the box, m. The box is centred on the initial position of the point.
    pub half_size_m: DVec3,
    /// Fraction of the full deflection that is treated as none, at least 0 and below 1, because caps seldom rest at zero.
    pub dead_zone: f64,
    /// Time after the last report after which the cap is treated as released, s. Some models do not report their return to rest, and
    /// the operating system drops reports of a queue that is full.
    pub stale_after_s: f64,
}

impl Default for SpaceMouseOptions {
    /// 0.1 m/s and 1.5 rad/s in a cube of 0.2 m; dead zone 0.02; released after 0.1 s.
    fn default() -> Self {
        Self {
            full_speed_m_per_s: 0.1,
            full_turn_rad_per_s: 1.5,
            half_size_m: DVec3::splat(0.1),
            dead_zone: 0.02,
            stale_after_s: 0.1,
        }
    }
}

impl SpaceMouseOptions {
    /// Validates the options.
    ///
    /// # Errors
    /// [`HidError::Option`].
    pub fn validate(&self) -> Result<(), HidError> {
        let check = |what, value: f64, ok: bool, allowed| {
            if value.is_finite() && ok {
                return Ok(());
            }
            Err(HidError::Option { what, found: value.to_string(), allowed })
        };
        let Self { full_speed_m_per_s, full_turn_rad_per_s, half_size_m, dead_zone, stale_after_s } = *self;
        let ok = full_speed_m_per_s > 0.0 && full_speed_m_per_s <= 10.0;
        check("full speed of the cap, m/s", full_speed_m_per_s, ok, "above 0 and at most 10")?;
        let ok = (0.0..=100.0).contains(&full_turn_rad_per_s);
        check("full turn of the cap, rad/s", full_turn_rad_per_s, ok, "0 to 100")?;
        for side in half_size_m.to_array() {
            let ok = side > 0.0 && side <= 100.0;
            check("half a side of the cap's box, m", side, ok, "above 0 and at most 100")?;
        }
        check("dead zone of the cap", dead_zone, (0.0..1.0).contains(&dead_zone), "at least 0 and below 1")?;
        let ok = stale_after_s > 0.0 && stale_after_s <= 10.0;
        check(
            "time after which the cap is treated as released, s",
            stale_after_s,
            ok,
            "above 0 and at most 10",
        )
    }
}

/// State of the cap: deflections in device counts, and buttons.
#[derive(Clone, Copy, Debug, Default)]
struct Cap {
    push: [i16; 3],
    turn: [i16; 3],
    buttons: Buttons,
}

#[derive(Debug)]
struct SpaceMouse {
    name: String,
    options: SpaceMouseOptions,
    /// Whether the cap has the axes of the oldest models.
    has_y_up: bool,
    cap: Cap,
    /// Times at which the last reports of push and of turn arrived.
    pushed_at: Option<Duration>,
    turned_at: Option<Duration>,
    read_at: Option<Duration>,
    /// Time at which the queue of reports was last emptied.
    emptied_at: Duration,
    position_m: DVec3,
    orientation: DQuat,
}

pub(crate) fn driver(info: &HidInfo, options: SpaceMouseOptions) -> Result<Box<dyn Driver>, HidError> {
    options.validate()?;
    Ok(Box::new(SpaceMouse {
        name: info.label(),
        options,
        has_y_up: models::has_y_up(info),
        cap: Cap::default(),
        pushed_at: None,
        turned_at: None,
        read_at: None,
        emptied_at: Duration::ZERO,
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
    }))
}

/// Converts from the axes of the cap to the device frame (x to the right, y up, z towards the user), for a push and for a turn alike. The
/// axes of a cap are x to the right, y towards the user, z down; those of the oldest models are x to the right, y up, z away from the user.
fn to_frame([x, y, z]: [f64; 3], has_y_up: bool) -> DVec3 {
    if has_y_up { DVec3::new(x, y, -z) } else { DVec3::new(x, -z, y) }
}

/// Time at which the last of `reports` reports of one kind arrived. All were read at the time `now`, after the queue had been empty at
/// the time `last`. A report can be almost as old as that: after a stall the cap may have been released since. A full queue holds the
/// oldest reports, and how long the last of them has been there is unknown.
fn arrival([last, now]: [Duration; 2], reports: u32, was_full: bool) -> Duration {
    let newest = last + Duration::from_secs_f64(REPORT_PERIOD_S * f64::from(reports));
    if was_full { last } else { newest.min(now) }
}

impl SpaceMouse {
    /// Deflection as a fraction of the full one, -1 to 1, in the device frame.
    fn deflection(&self, counts: [i16; 3]) -> DVec3 {
        let zone = self.options.dead_zone;
        let parts = counts.map(|count| {
            let part = (f64::from(count) / FULL_DEFLECTION).clamp(-1.0, 1.0);
            // Continuous at the edge of the dead zone.
            part.signum() * ((part.abs() - zone) / (1.0 - zone)).max(0.0)
        });
        to_frame(parts, self.has_y_up)
    }

    fn update(cap: &mut Cap, report: SpaceMouseReport) -> (bool, bool, Handled) {
        match report {
            SpaceMouseReport::Push(push) => {
                cap.push = push;
                (true, false, Handled::Used(1))
            }
            SpaceMouseReport::Turn(turn) => {
                cap.turn = turn;
                (false, true, Handled::Used(2))
            }
            SpaceMouseReport::PushAndTurn(push, turn) => {
                (cap.push, cap.turn) = (push, turn);
                (true, true, Handled::Used(1))
            }
            SpaceMouseReport::Buttons(buttons) => {
                cap.buttons.own = buttons;
                // A press is never superseded by a later report.
                (false, false, Handled::Ignored)
            }
            SpaceMouseReport::ButtonNumbers(id, pressed) => {
                cap.buttons.set_numbers(id, pressed);
                (false, false, Handled::Ignored)
            }
            SpaceMouseReport::Other(_) => (false, false, Handled::Ignored),
        }
    }
}

impl Driver for SpaceMouse {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: self.name.clone(),
            workspace_m: [-self.options.half_size_m, self.options.half_size_m],
            max_force_n: 0.0,
            // The position is available at any time and moves between the reports, of which there are about 100 per second.
            rate_hz: 1000.0,
        }
    }

    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        (self.cap, self.pushed_at, self.turned_at, self.read_at) = (Cap::default(), None, None, None);
        (self.position_m, self.orientation) = (DVec3::ZERO, DQuat::IDENTITY);
        // Discard reports from before the opening.
        link.drain(Duration::ZERO, |_| Handled::Ignored)?;
        self.emptied_at = link.clock.now();
        // Some models have no light.
        let _ = link.write(&report::LIGHT_ON);
        Ok(())
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let (mut cap, mut pushes, mut turns) = (self.cap, 0, 0);
        let drained = link.drain(Duration::ZERO, |bytes| match SpaceMouseReport::parse(bytes) {
            Ok(report) => {
                let (push, turn, understood) = Self::update(&mut cap, report);
                (pushes, turns) = (pushes + u32::from(push), turns + u32::from(turn));
                understood
            }
            Err(ParseReportError { .. }) => Handled::Malformed,
        })?;
        let now = link.clock.now();
        let last = std::mem::replace(&mut self.emptied_at, now);
        let arrival = |reports: u32| arrival([last, now], reports, drained.was_full);
        if pushes > 0 {
            self.pushed_at = Some(arrival(pushes));
        }
        if turns > 0 {
            self.turned_at = Some(arrival(turns));
        }
        let is_old = |at: Option<Duration>| {
            at.is_none_or(|at| now.saturating_sub(at).as_secs_f64() > self.options.stale_after_s)
        };
        if is_old(self.pushed_at) {
            cap.push = [0; 3];
        }
        if is_old(self.turned_at) {
            cap.turn = [0; 3];
        }
        self.cap = cap;
        let step_s = self.read_at.map_or(0.0, |last| now.saturating_sub(last).as_secs_f64());
        let step_s = step_s.min(MAX_STEP_S);
        self.read_at = Some(now);

        let half = self.options.half_size_m;
        let target_velocity = self.options.full_speed_m_per_s * self.deflection(cap.push);
        let moved = (self.position_m + step_s * target_velocity).clamp(-half, half);
        // Zero at a wall of the box.
        let velocity = if step_s > 0.0 { (moved - self.position_m) / step_s } else { DVec3::ZERO };
        self.position_m = moved;
        let turn = step_s * self.options.full_turn_rad_per_s * self.deflection(cap.turn);
        self.orientation = (DQuat::from_scaled_axis(turn) * self.orientation).normalize();
        Ok(Reading {
            position_m: self.position_m,
            velocity_m_per_s: Some(velocity),
            orientation: self.orientation,
            buttons: cap.buttons.bits(),
            sequence: None,
        })
    }

    fn write(&mut self, _: &mut Link, _: DVec3) -> Result<(), DeviceError> {
        // A device without motors. The safety chain has limited the force to zero.
        Ok(())
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let _ = link.write(&report::LIGHT_OFF);
        Ok(())
    }

    fn has_force_timeout(&self) -> bool {
        // A device without motors has no force to end.
        true
    }

    fn stop_reports(&self) -> Vec<StopReport> {
        Vec::new()
    }
}
