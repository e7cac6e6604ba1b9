//! Reports of a board in three forms.
//!
//! All numbers are little-endian with 16 bits; reports have no IDs.
//!
//! | form | from the board | to the board |
//! | --- | --- | --- |
//! | 8 bytes (WoodenHaptics, circuit board 0.4) | encoders a, b, c, sequence number | currents a, b, c, unused |
//! | 14 bytes (mbed) | encoders a to f, info | currents a, b, c, command, three attributes |
//! | 64 bytes (Teensy) | the 14 bytes, the rest unused | the 14 bytes, the rest zero |
//!
//! Info 1: the board requests calibration. Command 0: currents, mA. Command 1: the attributes become the counters of a, b, c, and the
//! values in place of the currents those of d, e, f. A pressed button adds 10,000 to encoder d.
//!
//! Sources: forsslund/haptikfabrikenapi at b8d6c94, `src/fsusbhapticdevicethread.h` and `.cpp`, `firmware/main.cpp`;
//! WoodenHaptics/woody-experimental at 04fc932, `mbed-code/WoodenHapticsHID/main.cpp` (8 bytes).

use crate::{ReportDescriptor, ReportKind};
use thiserror::Error;

/// Maximum length of a board's report, bytes, with the leading zero of a report without ID.
pub(super) const MAX_REPORT_BYTES: usize = 65;
/// Value of encoder d above which the button is pressed.
const PRESSED_ABOVE: i16 = 5_000;
/// Offset of encoder d while the button is pressed.
const PRESSED: i16 = 10_000;
/// Info: the board requests calibration.
const CALIBRATION_REQUEST: i16 = 1;
/// Command: display currents.
const SET_CURRENTS: i16 = 0;
/// Command: set the counters.
const SET_COUNTERS: i16 = 1;

/// Form of a board's reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BoardForm {
    /// Three encoders, no commands.
    Bytes8,
    /// Six encoders and commands.
    Bytes14,
    /// Six encoders and commands, in longer reports.
    Bytes64,
}

impl BoardForm {
    /// All forms.
    pub const ALL: [Self; 3] = [Self::Bytes8, Self::Bytes14, Self::Bytes64];

    /// Form with the sizes of the input and output reports; `None` without a match, or for a device with report IDs.
    #[must_use]
    pub fn of(descriptor: &ReportDescriptor) -> Option<Self> {
        let bytes = |kind| descriptor.report(kind, 0).map(crate::Report::bytes);
        let of = |form: &Self| {
            let bytes_here = Some(form.bytes());
            bytes(ReportKind::Input) == bytes_here && bytes(ReportKind::Output) == bytes_here
        };
        Self::ALL.into_iter().find(of).filter(|_| !descriptor.is_numbered())
    }

    /// Length of the reports in both directions, bytes, without the leading zero of an output report.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Bytes8 => 8,
            Self::Bytes14 => 14,
            Self::Bytes64 => 64,
        }
    }

    /// Whether the counters can be set, and whether the board can request it.
    #[must_use]
    pub fn has_commands(self) -> bool {
        self != Self::Bytes8
    }
}

/// Error while parsing or encoding a board's report.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoardPacketError {
    /// The report has the wrong length.
    #[error("a report of a board has {found} bytes; it must have {expected}")]
    Length {
        /// Actual length, bytes.
        found: usize,
        /// Expected length, bytes.
        expected: usize,
    },
    /// An output report does not begin with zero.
    #[error(
        "the first byte of a board's output report is {0}; it must be 0, because boards have no report IDs"
    )]
    Number(u8),
    /// The command is unknown.
    #[error("the command of a board's output report is {0}; it must be 0 or 1")]
    Command(i16),
    /// Reports of 8 bytes cannot set counters.
    #[error("the counters of a board with reports of 8 bytes cannot be set; its driver stores an offset")]
    NoCommands,
}

/// Input report of a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoardInput {
    /// Counters of encoders a to f, which wrap around; zero for d to f in the form of 8 bytes.
    pub encoders: [i16; 6],
    /// Whether the button is pressed.
    pub is_pressed: bool,
    /// Whether the board requests calibration: the arm is at home and its button was pressed.
    pub requests_calibration: bool,
    /// Sequence number in the form of 8 bytes; zero in the others.
    pub sequence: u16,
}

/// Output report of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoardOutput {
    /// Currents of motors a, b, c, mA.
    Currents([i16; 3]),
    /// New counters of encoders a to f; the currents become zero.
    Counters([i16; 6]),
}

/// Bytes of a report, stored without heap allocation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardBytes {
    bytes: [u8; MAX_REPORT_BYTES],
    length: usize,
}

impl BoardBytes {
    /// `length` zeros.
    fn zeros(length: usize) -> Self {
        Self { bytes: [0; MAX_REPORT_BYTES], length: length.min(MAX_REPORT_BYTES) }
    }

    /// Bytes of the report.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Writes `words` from byte `first` on, up to the end of the report.
    fn put(&mut self, first: usize, words: impl IntoIterator<Item = i16>) {
        let space = self.bytes.get_mut(first..self.length).unwrap_or_default();
        for (place, word) in space.chunks_exact_mut(2).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
    }
}

/// First seven 16-bit words, zero beyond the end.
fn words(bytes: &[u8]) -> [i16; 7] {
    let mut words = [0; 7];
    for (word, place) in words.iter_mut().zip(bytes.chunks_exact(2)) {
        if let Some(&bytes) = place.first_chunk::<2>() {
            *word = i16::from_le_bytes(bytes);
        }
    }
    words
}

fn check_length(found: usize, expected: usize) -> Result<(), BoardPacketError> {
    if found == expected { Ok(()) } else { Err(BoardPacketError::Length { found, expected }) }
}

impl BoardInput {
    /// Parses an input report.
    ///
    /// # Errors
    /// [`BoardPacketError::Length`].
    pub fn parse(form: BoardForm, report: &[u8]) -> Result<Self, BoardPacketError> {
        check_length(report.len(), form.bytes())?;
        let [a, b, c, d, e, f, info] = words(report);
        if form == BoardForm::Bytes8 {
            let encoders = [a, b, c, 0, 0, 0];
            return Ok(Self { encoders, sequence: d.cast_unsigned(), ..Self::default() });
        }
        let is_pressed = d > PRESSED_ABOVE;
        let d = if is_pressed { d.wrapping_sub(PRESSED) } else { d };
        Ok(Self {
            encoders: [a, b, c, d, e, f],
            is_pressed,
            requests_calibration: info == CALIBRATION_REQUEST,
            sequence: 0,
        })
    }

    /// Encodes the report as a board sends it. Fields that the form lacks are omitted.
    #[must_use]
    pub fn encode(&self, form: BoardForm) -> BoardBytes {
        let [a, b, c, d, e, f] = self.encoders;
        let mut report = BoardBytes::zeros(form.bytes());
        if form == BoardForm::Bytes8 {
            report.put(0, [a, b, c, self.sequence.cast_signed()]);
        } else {
            let d = if self.is_pressed { d.wrapping_add(PRESSED) } else { d };
            report
                .put(0, [a, b, c, d, e, f, if self.requests_calibration { CALIBRATION_REQUEST } else { 0 }]);
        }
        report
    }
}

impl BoardOutput {
    /// Zero currents.
    pub const ZERO: Self = Self::Currents([0; 3]);

    /// Encodes the report for sending, with the leading zero.
    ///
    /// # Errors
    /// [`BoardPacketError::NoCommands`] for counters in the form of 8 bytes.
    pub fn encode(&self, form: BoardForm) -> Result<BoardBytes, BoardPacketError> {
        let mut report = BoardBytes::zeros(1 + form.bytes());
        match *self {
            Self::Currents(currents) => report.put(1, currents),
            Self::Counters(_) if !form.has_commands() => return Err(BoardPacketError::NoCommands),
            Self::Counters([a, b, c, d, e, f]) => report.put(1, [d, e, f, SET_COUNTERS, a, b, c]),
        }
        Ok(report)
    }

    /// Parses an output report with its leading zero, as a board does.
    ///
    /// # Errors
    /// [`BoardPacketError`].
    pub fn parse(form: BoardForm, report: &[u8]) -> Result<Self, BoardPacketError> {
        check_length(report.len(), 1 + form.bytes())?;
        let (number, data) = report.split_first().unwrap_or((&0, &[]));
        if *number != 0 {
            return Err(BoardPacketError::Number(*number));
        }
        let [x, y, z, command, a, b, c] = words(data);
        if !form.has_commands() {
            return Ok(Self::Currents([x, y, z]));
        }
        match command {
            SET_CURRENTS => Ok(Self::Currents([x, y, z])),
            SET_COUNTERS => Ok(Self::Counters([a, b, c, x, y, z])),
            other => Err(BoardPacketError::Command(other)),
        }
    }
}
