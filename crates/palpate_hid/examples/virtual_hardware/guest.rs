//! All scenarios, one after the other.

mod board;
mod check;
mod enumeration;
mod joystick;
mod lab;
mod queue;
mod space_mouse;
mod touch;
mod uhid;
mod unplugged;
mod virtual_device;

use check::{NotHere, Outcome};
use std::process::ExitCode;

/// What is tried, in this order; each brings its own devices.
const SCENARIOS: [(&str, fn() -> Outcome); 14] = [
    ("enumeration", enumeration::run),
    ("palpate_lab", lab::run),
    ("cap_with_a_cable", space_mouse::with_a_cable),
    ("cap_without", space_mouse::without),
    ("queue", queue::run),
    ("unplugged_cap", unplugged::cap),
    ("joystick_openffboard", joystick::openffboard),
    ("joystick_rhino", joystick::rhino),
    ("joystick_arduino", joystick::arduino),
    ("unplugged_joystick", unplugged::joystick),
    ("board_8", board::bytes_8),
    ("board_14", board::bytes_14),
    ("board_64", board::bytes_64),
    ("unplugged_board", unplugged::board),
];

/// Runs them and says what came of each; `word` ends the last line.
pub fn run_all(word: &str) -> ExitCode {
    let mut failed = 0;
    for (name, scenario) in SCENARIOS {
        match scenario() {
            Ok(figures) => println!("ok {name}: {figures}"),
            Err(why) if why.is::<NotHere>() => println!("skipped {name}: {why}"),
            Err(why) => {
                failed += 1;
                println!("FAILED {name}: {}", check::chain(&*why));
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
