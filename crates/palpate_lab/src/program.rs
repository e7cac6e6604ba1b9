//! The frame of a program: arguments are parsed, errors printed in one line, exit codes chosen.

use crate::error::LabError;
use clap::error::ErrorKind;
use clap::{Args, Parser};
use std::io::Write;
use std::process::ExitCode;

/// Parses the arguments of the process.
///
/// # Errors
/// Exit code 2 for invalid arguments, after the message has been printed in one line. Help and version end the process.
pub fn parse<T: Parser>() -> Result<T, ExitCode> {
    match T::try_parse() {
        Ok(arguments) => Ok(arguments),
        Err(error)
            if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand =>
        {
            // Up to the first empty line: the message and the allowed values. The usage follows.
            let text = error.to_string();
            let lines = text.lines().take_while(|line| !line.is_empty()).map(str::trim);
            Err(reject(&(lines.collect::<Vec<_>>().join(" ") + "; see --help")))
        }
        // Help and version.
        Err(error) => error.exit(),
    }
}

/// Exit code for the result of a command, after an error has been printed in one line: 1 where the command ran and found that a
/// guarantee does not hold, 2 where it could not run.
pub fn exit_code(result: Result<(), LabError>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = reject(&format!("error: {}", palpate_haptics::report(&error)));
            if matches!(error, LabError::NotSurvived { .. } | LabError::Broken(_)) {
                ExitCode::FAILURE
            } else {
                code
            }
        }
    }
}

/// Options of a command with their default values.
///
/// # Panics
/// When an argument of `T` has no default value.
pub fn defaults<T: Args>() -> T {
    let matches = T::augment_args(clap::Command::new("defaults")).get_matches_from(["defaults"]);
    T::from_arg_matches(&matches).expect("every argument has a default")
}

fn reject(line: &str) -> ExitCode {
    // A closed standard error leaves no other way to report.
    let _ = writeln!(std::io::stderr(), "{line}");
    ExitCode::from(2)
}
