//! Time for drivers: a cap that tells how fast it is pushed has to be timed.

use std::time::Duration;

/// Time since some moment, never going back.
pub trait Clock: Send {
    /// That time.
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
