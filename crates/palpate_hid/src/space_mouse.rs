//! The SpaceMouse of 3Dconnexion: a cap that springs back and tells how far it is pushed and turned. Its push is taken as a
//! velocity, which moves a point in a box.
//!
//! Sources: JakubAndrysek/PySpaceMouse at 284caf6, `pyspacemouse/devices.toml` and `device.py`; FreeSpacenav/spacenavd at bac572a,
//! `src/dev.c`.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod models;
mod report;

pub(crate) use models::is_one;
pub use report::{ParseReportError, SpaceMouseReport};

use crate::driver::Driver;
use crate::link::{Handled, Link};
use crate::{HidError, HidInfo};
use glam::{DQuat, DVec3};
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::time::Duration;

/// The push and the turn, in counts, that are taken as full.
const FULL: f64 = 350.0;
/// The longest time between two readings over which the cap's push is taken to have lasted, s.
const MAX_STEP_S: f64 = 0.02;

/// What can be set for a SpaceMouse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpaceMouseOptions {
    /// Speed of the point where the cap is pushed fully along one axis, m/s.
    pub full_speed_m_per_s: f64,
    /// Speed with which it turns where the cap is turned fully about one axis, rad/s; 0 keeps its orientation.
    pub full_turn_rad_per_s: f64,
    /// Half the sides of the box in which the point moves, about the place where it begins, m.
    pub half_size_m: DVec3,
    /// The part of the full push that counts as none: caps seldom rest at zero.
    pub dead_zone: f64,
    /// So long after its last word, s, the cap counts as let go: not every model says that it is back at rest.
    pub stale_after_s: f64,
}

impl Default for SpaceMouseOptions {
    /// 0.1 m/s and 1.5 rad/s in a cube of 0.2 m; a dead zone of 0.02; let go after 0.1 s.
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
    /// Refuses what makes no sense.
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
        check("time after which the cap counts as let go, s", stale_after_s, ok, "above 0 and at most 10")
    }
}

/// Push and turn, counts as the device has them.
#[derive(Clone, Copy, Debug, Default)]
struct Cap {
    push: [i16; 3],
    turn: [i16; 3],
    buttons: u32,
}

#[derive(Debug)]
struct SpaceMouse {
    name: String,
    options: SpaceMouseOptions,
    cap: Cap,
    /// When it last said where it is pushed; how it is turned.
    pushed_at: Option<Duration>,
    turned_at: Option<Duration>,
    read_at: Option<Duration>,
    position_m: DVec3,
    orientation: DQuat,
}

pub(crate) fn driver(info: &HidInfo, options: SpaceMouseOptions) -> Result<Box<dyn Driver>, HidError> {
    options.validate()?;
    Ok(Box::new(SpaceMouse {
        name: info.label(),
        options,
        cap: Cap::default(),
        pushed_at: None,
        turned_at: None,
        read_at: None,
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
    }))
}

/// Its axes are x to the right, y towards the hand's owner, z down, and its turns go about them by the right hand: here x is to the
/// right, y up, z towards the hand's owner.
fn to_frame([x, y, z]: [f64; 3]) -> DVec3 {
    DVec3::new(x, -z, y)
}

impl SpaceMouse {
    /// Parts of the full push or turn, between -1 and 1, in the device's frame.
    fn parts(&self, counts: [i16; 3]) -> DVec3 {
        let zone = self.options.dead_zone;
        to_frame(counts.map(|count| {
            let part = (f64::from(count) / FULL).clamp(-1.0, 1.0);
            // Without a step where the zone ends.
            part.signum() * ((part.abs() - zone) / (1.0 - zone)).max(0.0)
        }))
    }

    fn take(cap: &mut Cap, report: SpaceMouseReport) -> (bool, bool, Handled) {
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
                cap.buttons = buttons;
                // Each press counts: none is passed over.
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
            // It can be asked at any time: between its reports, about a hundred a second, the point moves on.
            rate_hz: 1000.0,
        }
    }

    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        (self.cap, self.pushed_at, self.turned_at, self.read_at) = (Cap::default(), None, None, None);
        (self.position_m, self.orientation) = (DVec3::ZERO, DQuat::IDENTITY);
        // What came before it was opened is old.
        link.drain(Duration::ZERO, |_| Handled::Ignored)?;
        // A model without a light is as good.
        let _ = link.write(&report::LIGHT_ON);
        Ok(())
    }

    fn read(&mut self, link: &mut Link, _: Duration) -> Result<Reading, DeviceError> {
        let (mut cap, mut pushed, mut turned) = (self.cap, false, false);
        link.drain(Duration::ZERO, |bytes| match SpaceMouseReport::parse(bytes) {
            Ok(report) => {
                let (push, turn, understood) = Self::take(&mut cap, report);
                (pushed, turned) = (pushed || push, turned || turn);
                understood
            }
            Err(ParseReportError { .. }) => Handled::Malformed,
        })?;
        let now = link.clock.now();
        if pushed {
            self.pushed_at = Some(now);
        }
        if turned {
            self.turned_at = Some(now);
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
        let wanted = self.options.full_speed_m_per_s * self.parts(cap.push);
        let moved = (self.position_m + step_s * wanted).clamp(-half, half);
        // At a wall of the box it stands still.
        let velocity = if step_s > 0.0 { (moved - self.position_m) / step_s } else { DVec3::ZERO };
        self.position_m = moved;
        let turn = step_s * self.options.full_turn_rad_per_s * self.parts(cap.turn);
        self.orientation = (DQuat::from_scaled_axis(turn) * self.orientation).normalize();
        Ok(Reading {
            position_m: self.position_m,
            velocity_m_per_s: Some(velocity),
            orientation: self.orientation,
            buttons: cap.buttons,
            sequence: None,
        })
    }

    fn write(&mut self, _: &mut Link, _: DVec3) -> Result<(), DeviceError> {
        // It has no motors; the safety chain has made it zero already.
        Ok(())
    }

    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let _ = link.write(&report::LIGHT_OFF);
        Ok(())
    }

    fn ends_by_itself(&self) -> bool {
        // It has no force.
        true
    }

    fn stop_reports(&self) -> Vec<Vec<u8>> {
        Vec::new()
    }
}
