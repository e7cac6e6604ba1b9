//! Driver of force-feedback joysticks: reports byte by byte on three published layouts, input reports, and the haptic loop.

mod haptic_loop;
mod input;
mod killed_program;
mod reconnection;
mod reports;
