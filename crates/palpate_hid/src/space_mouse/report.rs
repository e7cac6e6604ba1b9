//! What a cap says.

use thiserror::Error;

/// Output report that turns its light on.
pub(super) const LIGHT_ON: [u8; 2] = [4, 1];
/// Output report that turns its light off.
pub(super) const LIGHT_OFF: [u8; 2] = [4, 0];

/// One input report of a cap. Numbers are counts, about ±350 at the stop, in its own axes: x to the right, y towards the hand's
/// owner, z down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpaceMouseReport {
    /// How far it is pushed. Report 1, 7 bytes: x, y, z.
    Push([i16; 3]),
    /// How far it is turned. Report 2, 7 bytes: about x, y, z.
    Turn([i16; 3]),
    /// Both. Report 1, 13 bytes, of wireless models.
    PushAndTurn([i16; 3], [i16; 3]),
    /// Which buttons are pressed, bit i for button i. Report 3.
    Buttons(u32),
    /// Another report, such as that of a battery: its number.
    Other(u8),
}

/// A report that is too short for what its number says.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("report {id} of a cap has {found} bytes; it must have at least {required}")]
pub struct ParseReportError {
    /// Its number; 0 where there is not even that.
    pub id: u8,
    /// Its length, bytes.
    pub found: usize,
    /// The least, bytes.
    pub required: usize,
}

impl SpaceMouseReport {
    /// Reads an input report, its number first. Reports 1 to 3 have a number and two bytes for each axis, little-endian; whether
    /// report 1 has three axes or six its length says.
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
            &[id, ..] => Ok(Self::Other(id)),
            [] => Err(short(0, 1)),
        }
    }
}

/// Three numbers from byte `at`.
fn axes(report: &[u8], at: usize) -> Option<[i16; 3]> {
    let &[a, b, c, d, e, f] = report.get(at..at + 6)?.first_chunk::<6>()?;
    Some([i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d]), i16::from_le_bytes([e, f])])
}
