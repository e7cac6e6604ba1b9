//! Tests of the drivers with simulated devices and recorded bytes.

#[path = "shared/bytes.rs"]
mod bytes;
#[path = "shared/arm.rs"]
mod every_arm;
#[path = "common/hex.rs"]
mod hex;
#[path = "common/joystick_bench.rs"]
mod joystick_bench;
#[path = "common/report_log.rs"]
mod report_log;

mod board;
mod board_kinematics;
mod board_packets;
mod board_polhem;
mod board_selection;
mod descriptor;
mod direction_check;
mod effect_creation;
mod joystick;
mod pid_arrays;
mod space_mouse;
mod space_mouse_models;
mod space_mouse_stall;
mod wheel;
