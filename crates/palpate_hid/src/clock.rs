//! Clock of the drivers. A SpaceMouse reports a velocity, which its driver integrates over time.

use std::time::Duration;

/// A monotonic clock.
pub trait Clock: Send {
    /// Time since an arbitrary fixed instant.
    fn now(&mut self) -> Duration;
}

impl<F: FnMut() -> Duration + Send> Clock for F {
    fn now(&mut self) -> Duration {
        self()
    }
}

/// The standard library's monotonic clock.
#[expect(clippy::disallowed_methods, reason = "a driver measures its device, not the loop")]
pub(crate) fn monotonic() -> Box<dyn Clock> {
    let start = std::time::Instant::now();
    Box::new(move || start.elapsed())
}

/// Waits while a device is opened.
#[expect(clippy::disallowed_methods, reason = "no tick runs while a device is opened")]
pub(crate) fn wait(time: Duration) {
    std::thread::sleep(time);
}
