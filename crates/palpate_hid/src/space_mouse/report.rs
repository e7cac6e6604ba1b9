//! Reports of a SpaceMouse.

use thiserror::Error;

/// Output report that switches the light on.
pub(super) const LIGHT_ON: [u8; 2] = [4, 1];
/// Output report that switches the light off.
pub(super) const LIGHT_OFF: [u8; 2] = [4, 0];

/// IDs of the reports with button numbers.
pub(super) const NUMBERS: [u8; 2] = [0x1C, 0x1D];

/// Input report of a SpaceMouse. Deflections are in counts, about ±350 at the stop, in the axes of the cap: x to the right, y towards
/// the user, z down; for SpaceMouse Plus XT and Classic y up and z away from the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpaceMouseReport {
    /// Linear deflection x, y, z. Report 1, 7 bytes.
    Push([i16; 3]),
    /// Angular deflection about x, y, z. Report 2, 7 bytes.
    Turn([i16; 3]),
    /// Linear and angular deflection. Report 1, 13 bytes, of wireless models.
    PushAndTurn([i16; 3], [i16; 3]),
    /// Pressed buttons, bit i for button i. Report 3.
    Buttons(u32),
    /// ID of the report, and numbers of the pressed buttons, from 1; 0 for none. Reports 1C and 1D of the Enterprise, 13 bytes, which has
    /// buttons above 31.
    ButtonNumbers(u8, [u16; 6]),
    /// Another report, such as the battery state, with its ID.
    Other(u8),
}

/// Error for a report that is too short for its ID.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("report {id} of a SpaceMouse has {found} bytes; it must have at least {required}")]
pub struct ParseReportError {
    /// ID of the report; 0 for an empty report.
    pub id: u8,
    /// Actual length, bytes.
    pub found: usize,
    /// Minimum length, bytes.
    pub required: usize,
}

impl SpaceMouseReport {
    /// Parses an input report with its ID. Reports 1 and 2 have two bytes for each axis, little-endian; the length of report 1
    /// distinguishes three axes from six. Reports 1C and 1D have two bytes for each button number.
    ///
    /// # Errors
    /// [`ParseReportError`].
    pub fn parse(report: &[u8]) -> Result<Self, ParseReportError> {
        let short = |id, required| ParseReportError { id, found: report.len(), required };
        match report {
            [1, ..] if report.len() >= 13 => match (axes(report, 1), axes(report, 7)) {
                (Some(push), Some(turn)) => Ok(Self::PushAndTurn(push, turn)),
                _ => Err(short(1, 13)),
            },
            [1, ..] => axes(report, 1).map(Self::Push).ok_or(short(1, 7)),
            [2, ..] => axes(report, 1).map(Self::Turn).ok_or(short(2, 7)),
            [3] => Err(short(3, 2)),
            [3, pressed @ ..] => {
                let bits = pressed.iter().take(4).enumerate().map(|(i, byte)| u32::from(*byte) << (8 * i));
                Ok(Self::Buttons(bits.sum()))
            }
            &[id, ..] if NUMBERS.contains(&id) => match (numbers(report, 1), numbers(report, 7)) {
                (Some([a, b, c]), Some([d, e, f])) => Ok(Self::ButtonNumbers(id, [a, b, c, d, e, f])),
                _ => Err(short(id, 13)),
            },
            &[id, ..] => Ok(Self::Other(id)),
            [] => Err(short(0, 1)),
        }
    }
}

/// Three 16-bit numbers from byte `at`.
fn numbers(report: &[u8], at: usize) -> Option<[u16; 3]> {
    let &[a, b, c, d, e, f] = report.get(at..at + 6)?.first_chunk::<6>()?;
    Some([u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]), u16::from_le_bytes([e, f])])
}

/// Three signed numbers from byte `at`.
fn axes(report: &[u8], at: usize) -> Option<[i16; 3]> {
    numbers(report, at).map(|axes| axes.map(u16::cast_signed))
}
