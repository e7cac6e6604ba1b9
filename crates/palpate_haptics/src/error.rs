//! Errors of loops and settings, and the report of an error with its causes.

use palpate_local::LocalModelError;
use std::error::Error as StdError;
use thiserror::Error;

/// Why a loop could not be created or a setting was rejected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HapticsError {
    /// A setting is out of range. The previous settings stay in force.
    #[error("{what} is {value}; it must be {allowed}")]
    Setting {
        /// Setting, with its unit.
        what: &'static str,
        /// Rejected value.
        value: f64,
        /// Allowed range.
        allowed: &'static str,
    },
    /// A size or rate of the hand-over is out of range.
    #[error("the hand-over cannot be set up")]
    HandOver(#[from] LocalModelError),
    /// The operating system could not create a thread.
    #[error("the haptic thread could not be started")]
    Thread(#[source] std::io::Error),
}

/// Formats `error` and its chain of sources in one line, separated by colons.
///
/// ```
/// use palpate_haptics::{DeviceError, LoopEventKind, report};
///
/// let event = LoopEventKind::DeviceFailed(DeviceError::NotOpen);
/// assert_eq!(report(&event), "the device failed: the device is not open; open it first");
/// ```
#[must_use]
pub fn report(error: &dyn StdError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

/// Rejects `value` unless it is finite and above zero.
pub(crate) fn check_positive(what: &'static str, value: f64) -> Result<(), HapticsError> {
    check(what, value, value.is_finite() && value > 0.0, "finite and above 0")
}

/// Rejects `value` of the setting `what` unless `ok`.
pub(crate) fn check(
    what: &'static str,
    value: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<(), HapticsError> {
    if ok { Ok(()) } else { Err(HapticsError::Setting { what, value, allowed }) }
}
