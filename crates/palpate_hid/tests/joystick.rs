//! Force-feedback joysticks: to the byte on three published layouts, what they say and might say, and in the haptic loop.

#[path = "joystick/found_again.rs"]
mod found_again;
#[path = "common/hex.rs"]
mod hex;
#[path = "joystick/in_loop.rs"]
mod in_loop;
#[path = "joystick/input.rs"]
mod input;
#[path = "joystick/killed.rs"]
mod killed;
#[path = "common/recorded.rs"]
mod recorded;
#[path = "joystick/reports.rs"]
mod reports;
#[path = "common/stick.rs"]
mod stick;
