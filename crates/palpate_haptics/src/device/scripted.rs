//! A device whose readings come from a function.

use super::open_state::OpenState;
use super::{DeviceDescription, DeviceError, HapticDevice, Reading};
use glam::DVec3;
use std::time::Duration;

/// Function of the reading's index and of the last force, N.
type Script = dyn FnMut(u64, DVec3) -> Result<Reading, DeviceError> + Send;

/// A simulated device whose readings come from a function. Arguments of the function are the index of the reading, from 0, and
/// the last written force, N, zero at first. The function may return an error to simulate a fault.
pub struct ScriptedDevice {
    script: Box<Script>,
    description: DeviceDescription,
    open: OpenState,
    reads: u64,
    force_n: DVec3,
}

impl ScriptedDevice {
    /// A closed device whose readings come from `script`.
    pub fn new(script: impl FnMut(u64, DVec3) -> Result<Reading, DeviceError> + Send + 'static) -> Self {
        let description = DeviceDescription {
            name: "scripted hand".into(),
            workspace_m: [DVec3::splat(-0.2), DVec3::splat(0.2)],
            max_force_n: 20.0,
            rate_hz: 1000.0,
        };
        let open = OpenState::default();
        Self { script: Box::new(script), description, open, reads: 0, force_n: DVec3::ZERO }
    }

    /// Replaces the description.
    #[must_use]
    pub fn with_description(mut self, description: DeviceDescription) -> Self {
        self.description = description;
        self
    }
}

impl HapticDevice for ScriptedDevice {
    fn describe(&self) -> DeviceDescription {
        self.description.clone()
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        self.open.open()?;
        (self.reads, self.force_n) = (0, DVec3::ZERO);
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        self.open.check()?;
        let reading = (self.script)(self.reads, self.force_n);
        self.reads += 1;
        reading
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.open.check()?;
        self.force_n = force_n;
        Ok(())
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        self.open.close();
        self.force_n = DVec3::ZERO;
        Ok(())
    }
}

impl std::fmt::Debug for ScriptedDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ScriptedDevice")
            .field("open", &self.open)
            .field("reads", &self.reads)
            .finish_non_exhaustive()
    }
}
