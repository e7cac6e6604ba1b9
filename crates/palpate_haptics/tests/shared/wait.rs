//! Waiting for a thread.

use std::time::Duration;

/// Waits until `done`, for ten seconds at most.
#[expect(clippy::disallowed_methods, reason = "a test of a thread has to wait for it")]
pub fn wait_for(mut done: impl FnMut() -> bool) {
    for _ in 0..10_000 {
        if done() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("it did not happen within ten seconds");
}
