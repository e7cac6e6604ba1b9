//! A device that repeats a recorded hand.

use super::{DeviceDescription, DeviceError, HapticDevice, Reading};
use crate::Trajectory;
use glam::DVec3;
use std::time::Duration;

/// What a replay does after its last row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReplayEnd {
    /// Stays at the last position.
    #[default]
    Stay,
    /// Begins anew. The trajectory should end where it begins, or the tool jumps.
    Repeat,
}

/// Replays a [`Trajectory`], one row a reading, with its buttons and orientations. It takes forces and feels none of them.
#[derive(Clone, Debug)]
pub struct ReplayDevice {
    trajectory: Trajectory,
    at_end: ReplayEnd,
    open: bool,
    next: usize,
}

impl ReplayDevice {
    /// A device that replays `trajectory`.
    #[must_use]
    pub fn new(trajectory: Trajectory, at_end: ReplayEnd) -> Self {
        Self { trajectory, at_end, open: false, next: 0 }
    }
}

impl HapticDevice for ReplayDevice {
    fn describe(&self) -> DeviceDescription {
        let positions = self.trajectory.positions_m();
        let corner =
            |pick: fn(DVec3, DVec3) -> DVec3| positions.iter().copied().reduce(pick).unwrap_or_default();
        DeviceDescription {
            name: "replayed hand".into(),
            workspace_m: [corner(DVec3::min), corner(DVec3::max)],
            max_force_n: 20.0,
            rate_hz: 1000.0,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        if self.open {
            return Err(DeviceError::AlreadyOpen);
        }
        (self.open, self.next) = (true, 0);
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        let rows = self.trajectory.positions_m().len();
        let row = self.next.min(rows.saturating_sub(1));
        self.next += 1;
        if self.next >= rows && self.at_end == ReplayEnd::Repeat {
            self.next = 0;
        }
        self.trajectory.reading(row).ok_or(DeviceError::Protocol("no rows"))
    }

    fn write(&mut self, _force_n: DVec3) -> Result<(), DeviceError> {
        if self.open { Ok(()) } else { Err(DeviceError::NotOpen) }
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        self.open = false;
        Ok(())
    }
}
