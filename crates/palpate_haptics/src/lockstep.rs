//! The loop in lock step with the model side: deterministic, without thread and clock.

use crate::{DeviceError, HapticDevice, HapticLoop};
use std::time::Duration;

/// A loop and its device, advanced by calls: exactly the requested number of ticks, without missed deadlines.
#[derive(Debug)]
pub struct Lockstep<D: HapticDevice + ?Sized> {
    haptic_loop: HapticLoop,
    device: Box<D>,
}

impl<D: HapticDevice + ?Sized> Lockstep<D> {
    /// Opens `device` and connects it to `haptic_loop`.
    ///
    /// # Errors
    /// Errors of [`HapticDevice::open`].
    pub fn new(mut haptic_loop: HapticLoop, mut device: Box<D>) -> Result<Self, DeviceError> {
        device.open()?;
        haptic_loop.start(device.notice());
        Ok(Self { haptic_loop, device })
    }

    /// Runs `ticks` ticks.
    pub fn run(&mut self, ticks: usize) {
        let period = Duration::from_secs_f64(self.haptic_loop.config().hand_over.tick_s);
        for _ in 0..ticks {
            let reading = self.device.read(period);
            let output = self.haptic_loop.tick(1, reading);
            let written = self.device.write(output.device_force_n);
            self.haptic_loop.finish_tick(output, None, written);
        }
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &D {
        &self.device
    }
}

impl<D: HapticDevice + ?Sized> Drop for Lockstep<D> {
    fn drop(&mut self) {
        let zeroed = self.device.write(glam::DVec3::ZERO);
        let closed = self.device.close().and(zeroed);
        self.haptic_loop.end(closed);
    }
}
