//! A device whose hand is a function.

use super::{DeviceDescription, DeviceError, HapticDevice, Reading};
use glam::DVec3;
use std::time::Duration;

/// What a script is told at each reading.
type Script = dyn FnMut(u64, DVec3) -> Result<Reading, DeviceError> + Send;

/// A complete stand-in whose readings are made by a function of the number of the reading (from 0) and of the
/// force written last (N, zero at first). The function can answer with an error, to rehearse faults.
pub struct ScriptedDevice {
    script: Box<Script>,
    description: DeviceDescription,
    open: bool,
    reads: u64,
    force_n: DVec3,
}

impl ScriptedDevice {
    /// A device that reads what `script` says.
    pub fn new(script: impl FnMut(u64, DVec3) -> Result<Reading, DeviceError> + Send + 'static) -> Self {
        let description = DeviceDescription {
            name: "scripted hand".into(),
            workspace_m: [DVec3::splat(-0.2), DVec3::splat(0.2)],
            max_force_n: 20.0,
            rate_hz: 1000.0,
        };
        Self { script: Box::new(script), description, open: false, reads: 0, force_n: DVec3::ZERO }
    }

    /// The same device with another description.
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
        if self.open {
            return Err(DeviceError::AlreadyOpen);
        }
        (self.open, self.reads, self.force_n) = (true, 0, DVec3::ZERO);
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        let reading = (self.script)(self.reads, self.force_n);
        self.reads += 1;
        reading
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        self.force_n = force_n;
        Ok(())
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        (self.open, self.force_n) = (false, DVec3::ZERO);
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
