//! The first lines of a VTK file.

use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scanner, shorten};

pub(super) const NAME: &str = "VTK";

/// Reads the lines of the version, the title, the encoding and the data set.
pub(super) fn read(scanner: &mut Scanner) -> Result<Encoding, MeshFileError> {
    let Some(version) = scanner.line()?.trim_start().strip_prefix("# vtk DataFile Version") else {
        return Err(scanner.not_valid("the first line must begin with `# vtk DataFile Version`".into()));
    };
    let major = version.trim().split('.').next().and_then(|major| major.parse::<u32>().ok());
    if !major.is_some_and(|major| (1..=5).contains(&major)) {
        let version = shorten(version.trim());
        return Err(MeshFileError::VersionNotRead { format: NAME, version, allowed: "1 to 5" });
    }
    // The title may be in any encoding of characters.
    let title = scanner.rest().iter().position(|byte| *byte == b'\n').unwrap_or(scanner.rest().len());
    scanner.advance(title + 1);
    let encoding = match scanner.word()?.to_ascii_uppercase().as_str() {
        "ASCII" => Encoding::Text,
        "BINARY" => Encoding::BigEndian,
        other => {
            let problem = format!("the third line is `{}`; it must be ASCII or BINARY", shorten(other));
            return Err(scanner.not_valid(problem));
        }
    };
    if !scanner.word()?.eq_ignore_ascii_case("DATASET") {
        return Err(scanner.not_valid("the fourth line must begin with DATASET".into()));
    }
    let data_set = scanner.word()?;
    if !data_set.eq_ignore_ascii_case("UNSTRUCTURED_GRID") {
        return Err(MeshFileError::OtherDataSet { format: NAME, content: shorten(data_set) });
    }
    Ok(encoding)
}
