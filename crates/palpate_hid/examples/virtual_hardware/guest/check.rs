//! What a scenario comes to, and waiting for what it expects.

use std::error::Error;
use std::fmt::{self, Display, Formatter};
use std::time::Duration;

/// Figures of a scenario that went as it should, or why it did not.
pub type Outcome = Result<String, Box<dyn Error>>;

/// A scenario that cannot be tried here.
#[derive(Debug)]
pub struct NotHere(pub &'static str);

impl Display for NotHere {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

impl Error for NotHere {}

/// An error with `why` unless `holds`.
pub fn ensure(holds: bool, why: impl FnOnce() -> String) -> Result<(), Box<dyn Error>> {
    if holds { Ok(()) } else { Err(why().into()) }
}

/// An error with its causes, on one line.
pub fn chain(error: &(dyn Error + 'static)) -> String {
    let mut told = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        told += &format!(": {error}");
        cause = error.source();
    }
    told.replace('\n', " ")
}

/// Waits.
#[expect(clippy::disallowed_methods, reason = "it is no haptic loop that waits here")]
pub fn pause(time: Duration) {
    std::thread::sleep(time);
}

/// So long anything may take: a busy host may leave a guest without a processor for seconds.
const LONGEST: Duration = Duration::from_secs(15);

/// Waits until `holds`, which is asked a hundred times at once and then every few milliseconds. An error with `what` if that takes too long.
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) -> Result<(), Box<dyn Error>> {
    const STEP: Duration = Duration::from_millis(5);
    // What is only a thread's turn away takes no time.
    for _ in 0..100 {
        if holds() {
            return Ok(());
        }
        std::thread::yield_now();
    }
    for _ in 0..LONGEST.as_millis() / STEP.as_millis() {
        if holds() {
            return Ok(());
        }
        pause(STEP);
    }
    Err(format!("not within {} s: {what}", LONGEST.as_secs()).into())
}
