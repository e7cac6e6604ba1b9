//! Results of scenarios, and waiting for conditions.

use std::error::Error;
use std::fmt::{self, Display, Formatter};
use std::time::Duration;

/// Result of a scenario: figures, or the reason of the failure.
pub type Outcome = Result<String, Box<dyn Error>>;

/// A scenario that cannot run here.
#[derive(Debug)]
pub struct Unavailable(pub &'static str);

impl Display for Unavailable {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

impl Error for Unavailable {}

/// Returns an error with `why` unless `holds`.
pub fn ensure(holds: bool, why: impl FnOnce() -> String) -> Result<(), Box<dyn Error>> {
    if holds { Ok(()) } else { Err(why().into()) }
}

/// Formats an error with its causes on one line.
pub fn report(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text.replace('\n', " ")
}

/// Sleeps.
#[expect(clippy::disallowed_methods, reason = "no haptic loop waits here")]
pub fn pause(time: Duration) {
    std::thread::sleep(time);
}

/// Timeout. A busy host may leave a guest without a processor for seconds.
const TIMEOUT: Duration = Duration::from_secs(15);

/// Waits until `holds`, polled a hundred times at once and then every few milliseconds. A timeout returns an error with `what`.
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) -> Result<(), Box<dyn Error>> {
    const STEP: Duration = Duration::from_millis(5);
    // A condition that another thread sets at once needs no sleep.
    for _ in 0..100 {
        if holds() {
            return Ok(());
        }
        std::thread::yield_now();
    }
    for _ in 0..TIMEOUT.as_millis() / STEP.as_millis() {
        if holds() {
            return Ok(());
        }
        pause(STEP);
    }
    Err(format!("not within {} s: {what}", TIMEOUT.as_secs()).into())
}
