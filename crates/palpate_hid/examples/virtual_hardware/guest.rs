//! All scenarios, in sequence.

mod board;
mod check;
mod enumeration;
mod joystick;
mod lab;
mod late_effects;
mod queue;
mod space_mouse;
mod touch;
mod uhid;
mod unplugged;
mod virtual_device;

use check::{Outcome, Unavailable};
use std::process::ExitCode;

/// Scenarios in this order; each creates its own devices.
const SCENARIOS: [(&str, fn() -> Outcome); 17] = [
    ("enumeration", enumeration::run),
    ("palpate_lab", lab::run),
    ("wired_space_mouse", space_mouse::wired),
    ("wireless_space_mouse", space_mouse::wireless),
    ("queue", queue::run),
    ("unplugged_space_mouse", unplugged::space_mouse),
    ("joystick_openffboard", joystick::openffboard),
    ("joystick_rhino", joystick::rhino),
    ("joystick_arduino", joystick::arduino),
    ("joystick_arrays", joystick::arrays),
    ("joystick_reversed", joystick::reversed),
    ("joystick_late_effects", late_effects::run),
    ("unplugged_joystick", unplugged::joystick),
    ("board_8", board::bytes_8),
    ("board_14", board::bytes_14),
    ("board_64", board::bytes_64),
    ("unplugged_board", unplugged::board),
];

/// Runs all scenarios and prints their results; `word` ends the last line.
pub fn run_all(word: &str) -> ExitCode {
    let mut failed = 0;
    for (name, scenario) in SCENARIOS {
        match scenario() {
            Ok(figures) => println!("ok {name}: {figures}"),
            Err(why) if why.is::<Unavailable>() => println!("skipped {name}: {why}"),
            Err(why) => {
                failed += 1;
                println!("FAILED {name}: {}", check::report(&*why));
            }
        }
    }
    let of = SCENARIOS.len();
    if failed > 0 {
        println!("virtual hardware: {failed} of {of} scenarios failed; {word}");
        return ExitCode::FAILURE;
    }
    println!("virtual hardware: none of {of} scenarios failed; {word}");
    ExitCode::SUCCESS
}
