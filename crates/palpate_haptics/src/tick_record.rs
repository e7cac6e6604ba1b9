//! Output of a tick, and its record.

use crate::{DeviceError, LoopSettings, Reading, SafetyReport, TickTiming};
use glam::DVec3;
use palpate_local::{ModelId, RenderedForce, Sample};

/// Output of [`crate::HapticLoop::tick`]: the force to be written, and the inputs and intermediate results that led to it.
/// After the write, [`crate::HapticLoop::finish_tick`] completes it to a [`TickRecord`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickOutput {
    /// Force to be written to the device, N, device frame.
    pub device_force_n: DVec3,
    /// Periods since the loop's start.
    pub sequence: u64,
    /// Periods since the previous tick.
    pub elapsed: u64,
    /// Validated reading of the device, device frame.
    pub reading: Result<Reading, DeviceError>,
    /// Newest sample; `None` before the first reading.
    pub sample: Option<Sample>,
    /// Settings adopted at this tick, with their number.
    pub settings: Option<(u64, LoopSettings)>,
    /// Local model that arrived at this tick.
    pub new_model: Option<ModelId>,
    /// Force before the safety chain, and the local model that rendered it.
    pub rendered: RenderedForce,
    /// Actions of the safety chain.
    pub safety: SafetyReport,
    /// Force after the safety chain, N, scene frame.
    pub force_n: DVec3,
}

impl TickOutput {
    /// Adds the result of the write and the times of the tick.
    #[must_use]
    pub fn complete(self, written: Result<(), DeviceError>, timing: TickTiming) -> TickRecord {
        let Self {
            device_force_n: _,
            sequence,
            elapsed,
            reading,
            sample,
            settings,
            new_model,
            rendered,
            safety,
            force_n,
        } = self;
        TickRecord {
            sequence,
            elapsed,
            reading,
            sample,
            settings,
            new_model,
            rendered,
            safety,
            force_n,
            written,
            timing,
        }
    }
}

/// Record of one complete tick.
///
/// Another loop reproduces the forces bit for bit when it receives the same `elapsed` and `reading`, the local models named by
/// `new_model`, and the `settings` where they changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickRecord {
    /// Periods since the loop's start.
    pub sequence: u64,
    /// Periods since the previous tick.
    pub elapsed: u64,
    /// Validated reading of the device, device frame.
    pub reading: Result<Reading, DeviceError>,
    /// Newest sample; `None` before the first reading.
    pub sample: Option<Sample>,
    /// Settings adopted at this tick, with their number.
    pub settings: Option<(u64, LoopSettings)>,
    /// Local model that arrived at this tick.
    pub new_model: Option<ModelId>,
    /// Force before the safety chain, and the local model that rendered it.
    pub rendered: RenderedForce,
    /// Actions of the safety chain.
    pub safety: SafetyReport,
    /// Written force, N, scene frame.
    pub force_n: DVec3,
    /// Result of writing the force.
    pub written: Result<(), DeviceError>,
    /// Times of the tick; zero in lock step.
    pub timing: TickTiming,
}
