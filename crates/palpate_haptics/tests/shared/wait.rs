//! Waits for a condition set by another thread.

use std::time::Duration;

/// Waits until `done`, at most ten seconds.
#[expect(clippy::disallowed_methods, reason = "a test of a thread has to wait for it")]
pub fn wait_for(mut done: impl FnMut() -> bool) {
    for _ in 0..10_000 {
        if done() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("the condition did not become true within ten seconds");
}
