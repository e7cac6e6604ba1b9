//! The program `palpate-lab`; its commands are in the library.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    palpate_lab::run()
}
