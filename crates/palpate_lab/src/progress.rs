//! Progress bars on standard error, only where that is a terminal.

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use std::time::Duration;

/// Progress bar of `steps` steps that disappears when it is dropped.
///
/// # Panics
/// Never: its template is valid.
pub fn bar(steps: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} {msg} ({elapsed})")
        .expect("the template is valid");
    let bar = ProgressBar::new(steps as u64).with_style(style).with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
