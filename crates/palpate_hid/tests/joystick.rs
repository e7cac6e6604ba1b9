//! Driver of force-feedback joysticks: reports byte by byte on three published layouts, input reports, and the haptic loop.

#[path = "joystick/haptic_loop.rs"]
mod haptic_loop;
#[path = "common/hex.rs"]
mod hex;
#[path = "joystick/input.rs"]
mod input;
#[path = "common/joystick_bench.rs"]
mod joystick_bench;
#[path = "joystick/killed_program.rs"]
mod killed_program;
#[path = "joystick/reconnection.rs"]
mod reconnection;
#[path = "common/report_log.rs"]
mod report_log;
#[path = "joystick/reports.rs"]
mod reports;
