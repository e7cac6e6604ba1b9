//! Beginnings and ends of sections, and the section of names.

use super::header::NAME;
use crate::error::MeshFileError;
use crate::scanner::Scanner;
use std::collections::HashMap;

/// Goes to the next section, and returns its name. Lines between sections are skipped. `None` at the end.
pub(super) fn next<'a>(scanner: &mut Scanner<'a>) -> Result<Option<&'a str>, MeshFileError> {
    loop {
        scanner.skip_space();
        if scanner.rest().is_empty() {
            return Ok(None);
        }
        if let Some(name) = scanner.line()?.strip_prefix('$') {
            return Ok(Some(name.trim_end()));
        }
    }
}

/// Reads the end of the section `name`.
pub(super) fn end(scanner: &mut Scanner, name: &str) -> Result<(), MeshFileError> {
    scanner.skip_space();
    let end = format!("$End{name}");
    if !scanner.rest().starts_with(end.as_bytes()) {
        return Err(
            scanner.not_valid(format!("${name} must end with {end} after the elements that it states"))
        );
    }
    scanner.advance(end.len());
    Ok(())
}

/// Goes to the end of the section `name`.
pub(super) fn skip(scanner: &mut Scanner, name: &str) -> Result<(), MeshFileError> {
    let end = format!("$End{name}");
    loop {
        let rest = scanner.rest();
        let Some(place) = rest.iter().position(|byte| *byte == b'$') else {
            let problem = format!("${} has no end", crate::scanner::shorten(name));
            return Err(MeshFileError::VolumeNotValid { format: NAME, problem });
        };
        scanner.advance(place);
        if scanner.rest().starts_with(end.as_bytes()) {
            scanner.advance(end.len());
            return Ok(());
        }
        scanner.advance(1);
    }
}

/// Reads the names of physical groups of volumes, by number. The section is text in each encoding.
pub(super) fn read_names(
    scanner: &mut Scanner,
    names: &mut HashMap<i64, String>,
) -> Result<(), MeshFileError> {
    let line = scanner.line()?;
    let count: u64 =
        line.trim().parse().map_err(|_| scanner.not_valid("$PhysicalNames must have a count".into()))?;
    for _ in 0..count {
        scanner.skip_space();
        let line = scanner.line()?;
        let mut words = line.split_whitespace();
        let dimension = words.next().and_then(|word| word.parse::<u8>().ok());
        let number = words.next().and_then(|word| word.parse::<i64>().ok());
        let name = line.split_once('"').and_then(|(_, rest)| Some(rest.rsplit_once('"')?.0));
        let (Some(dimension), Some(number), Some(name)) = (dimension, number, name) else {
            let problem = "a physical name must have a dimension, a number and a name in quotation marks";
            return Err(scanner.not_valid(problem.into()));
        };
        if dimension == 3 {
            names.insert(number, name.to_owned());
        }
    }
    Ok(())
}
