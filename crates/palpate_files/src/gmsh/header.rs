//! The first section of a Gmsh file: its version and its encoding.

use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scalar, Scanner};

pub(super) const NAME: &str = "Gmsh";

/// A layout of sections.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Version {
    /// 2.0 to 2.2.
    V2,
    V40,
    V41,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub version: Version,
    /// The type of counts, and of the numbers of nodes and elements in version 4.1.
    pub size: Scalar,
}

/// Reads the section `$MeshFormat`, and sets the encoding of `scanner`.
pub(super) fn read(scanner: &mut Scanner) -> Result<Layout, MeshFileError> {
    let line = scanner.line()?;
    let mut words = line.split_whitespace();
    let (Some(version), Some(is_binary), Some(size)) = (words.next(), words.next(), words.next()) else {
        return Err(scanner.not_valid("$MeshFormat must have a version, a type and a size".into()));
    };
    let layout = match version {
        "2" | "2.0" | "2.1" | "2.2" => Version::V2,
        "4" | "4.0" => Version::V40,
        "4.1" => Version::V41,
        _ => return Err(version_not_read(version)),
    };
    let size = match size {
        "4" if layout == Version::V41 => Scalar::U32,
        "8" => Scalar::U64,
        _ => return Err(scanner.not_valid(format!("the size of a number is {size}; it must be 8"))),
    };
    match is_binary {
        "0" => {}
        "1" => {
            let one: Result<[u8; 4], _> = scanner.take(4)?.try_into();
            scanner.encoding = match one {
                Ok([1, 0, 0, 0]) => Encoding::LittleEndian,
                Ok([0, 0, 0, 1]) => Encoding::BigEndian,
                _ => return Err(scanner.not_valid("the order of bytes must be given by the number 1".into())),
            };
        }
        _ => return Err(scanner.not_valid(format!("the type of the file is {is_binary}; it must be 0 or 1"))),
    }
    Ok(Layout { version: layout, size })
}

pub(super) fn version_not_read(version: &str) -> MeshFileError {
    let version = crate::scanner::shorten(version);
    MeshFileError::VersionNotRead { format: NAME, version, allowed: "2.0 to 2.2, 4.0 or 4.1" }
}
