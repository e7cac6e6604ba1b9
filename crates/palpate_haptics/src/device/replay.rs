//! A device that replays a trajectory.

use super::open_state::OpenState;
use super::{DeviceDescription, DeviceError, HapticDevice, Reading};
use crate::Trajectory;
use glam::DVec3;
use std::time::Duration;

/// Behaviour of a [`ReplayDevice`] after the last row of its trajectory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReplayEnd {
    /// Stay at the last position.
    #[default]
    Stay,
    /// Start again at the first row. The trajectory should end where it begins, or the tool jumps.
    Repeat,
}

/// Replays a [`Trajectory`] with its buttons and orientations, one row per reading. It accepts forces and ignores them.
#[derive(Clone, Debug)]
pub struct ReplayDevice {
    trajectory: Trajectory,
    at_end: ReplayEnd,
    open: OpenState,
    next: usize,
}

impl ReplayDevice {
    /// A closed device that replays `trajectory`.
    #[must_use]
    pub fn new(trajectory: Trajectory, at_end: ReplayEnd) -> Self {
        Self { trajectory, at_end, open: OpenState::default(), next: 0 }
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
        self.open.open()?;
        self.next = 0;
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        self.open.check()?;
        let rows = self.trajectory.positions_m().len();
        let row = self.next.min(rows.saturating_sub(1));
        self.next += 1;
        if self.next >= rows && self.at_end == ReplayEnd::Repeat {
            self.next = 0;
        }
        self.trajectory.reading(row).ok_or(DeviceError::Protocol("no rows"))
    }

    fn write(&mut self, _force_n: DVec3) -> Result<(), DeviceError> {
        self.open.check()
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        self.open.close();
        Ok(())
    }
}
