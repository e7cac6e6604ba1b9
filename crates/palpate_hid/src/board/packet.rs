//! What is sent to a board and what comes from it, in three forms.
//!
//! All numbers are little-endian and of 16 bits; no report has a number.
//!
//! | form | from the board | to the board |
//! | --- | --- | --- |
//! | 8 bytes (WoodenHaptics, circuit board 0.4) | encoders a, b, c, a running number | currents a, b, c, unused |
//! | 14 bytes (mbed) | encoders a to f, info | currents a, b, c, command, three attributes |
//! | 64 bytes (Teensy) | the 14 bytes, the rest unused | the 14 bytes, the rest zero |
//!
//! Info 1: the board asks to be calibrated. Command 0: currents, mA. Command 1: the counters of a, b, c become the attributes, those
//! of d, e, f what stands in the places of the currents. A pressed button adds 10,000 to encoder d.
//!
//! Sources: forsslund/haptikfabrikenapi at b8d6c94, `src/fsusbhapticdevicethread.h` and `.cpp`, `firmware/main.cpp`;
//! WoodenHaptics/woody-experimental at 04fc932, `mbed-code/WoodenHapticsHID/main.cpp` (8 bytes).

use crate::{ReportDescriptor, ReportKind};
use thiserror::Error;

/// The longest report of a board, bytes, with the zero that leads it where reports have no number.
pub(super) const LONGEST: usize = 65;
/// Encoder d beyond this says that the button is pressed.
const PRESSED_ABOVE: i16 = 5_000;
/// What a pressed button adds to encoder d.
const PRESSED: i16 = 10_000;
/// Info: the board asks to be calibrated.
const CALIBRATION_REQUEST: i16 = 1;
/// Command: show currents.
const SHOW: i16 = 0;
/// Command: set the counters.
const SET_COUNTERS: i16 = 1;

/// Which reports a board has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BoardForm {
    /// Three encoders, no commands.
    Bytes8,
    /// Six encoders and commands.
    Bytes14,
    /// The same, in longer reports.
    Bytes64,
}

impl BoardForm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Bytes8, Self::Bytes14, Self::Bytes64];

    /// The form whose sizes are those of the input and the output report; `None` where there is none, or where reports have numbers.
    #[must_use]
    pub fn of(descriptor: &ReportDescriptor) -> Option<Self> {
        let bytes = |kind| descriptor.report(kind, 0).map(crate::Report::bytes);
        let of = |form: &Self| {
            let bytes_here = Some(form.bytes());
            bytes(ReportKind::Input) == bytes_here && bytes(ReportKind::Output) == bytes_here
        };
        Self::ALL.into_iter().find(of).filter(|_| !descriptor.is_numbered())
    }

    /// Length of its reports, bytes, both ways; the zero before an output report does not count.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Bytes8 => 8,
            Self::Bytes14 => 14,
            Self::Bytes64 => 64,
        }
    }

    /// Whether its counters can be set, and whether the board can ask for it.
    #[must_use]
    pub fn has_commands(self) -> bool {
        self != Self::Bytes8
    }
}

/// Why bytes are no report of a board, or a report has no bytes.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoardPacketError {
    /// It is longer or shorter than its form has it.
    #[error("a report of a board has {found} bytes; its form has {expected}")]
    Length {
        /// What it has, bytes.
        found: usize,
        /// What it has to have, bytes.
        expected: usize,
    },
    /// An output report begins with the number that boards do not have: there a zero is due.
    #[error(
        "an output report of a board begins with {0}; boards have no report numbers, so that it must be 0"
    )]
    Number(u8),
    /// The command is neither of the two.
    #[error("a board is sent command {0}; 0 and 1 are known")]
    Command(i16),
    /// The form of 8 bytes has no room for commands.
    #[error("a board with reports of 8 bytes has no commands; its counters are set aside by its driver")]
    NoCommands,
}

/// What comes from a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoardInput {
    /// Counters of encoders a to f as the board has them; they wrap around. Those of d to f are zero in the form of 8 bytes.
    pub encoders: [i16; 6],
    /// Whether the button is pressed.
    pub is_pressed: bool,
    /// Whether it asks to be calibrated: the arm is at home and its button was pushed.
    pub requests_calibration: bool,
    /// Its running number in the form of 8 bytes; zero in the others.
    pub running: u16,
}

/// What is sent to a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoardOutput {
    /// Currents of motors a, b, c, mA.
    Currents([i16; 3]),
    /// What the counters of encoders a to f are from now on. No currents meanwhile.
    Counters([i16; 6]),
}

/// A report with its length, without a heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardBytes {
    bytes: [u8; LONGEST],
    length: usize,
}

impl BoardBytes {
    /// `length` zeros.
    fn zeros(length: usize) -> Self {
        Self { bytes: [0; LONGEST], length: length.min(LONGEST) }
    }

    /// Its bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Puts `words` from byte `first` on; what has no room is left out.
    fn put(&mut self, first: usize, words: impl IntoIterator<Item = i16>) {
        let room = self.bytes.get_mut(first..self.length).unwrap_or_default();
        for (place, word) in room.chunks_exact_mut(2).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
    }
}

/// The first seven words, or as many as there are, the rest zero.
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
    /// Reads an input report.
    ///
    /// # Errors
    /// [`BoardPacketError::Length`].
    pub fn parse(form: BoardForm, report: &[u8]) -> Result<Self, BoardPacketError> {
        check_length(report.len(), form.bytes())?;
        let [a, b, c, d, e, f, info] = words(report);
        if form == BoardForm::Bytes8 {
            let encoders = [a, b, c, 0, 0, 0];
            return Ok(Self { encoders, running: d.cast_unsigned(), ..Self::default() });
        }
        let is_pressed = d > PRESSED_ABOVE;
        let d = if is_pressed { d.wrapping_sub(PRESSED) } else { d };
        Ok(Self {
            encoders: [a, b, c, d, e, f],
            is_pressed,
            requests_calibration: info == CALIBRATION_REQUEST,
            running: 0,
        })
    }

    /// The report as a board sends it. What the form has no room for is left out.
    #[must_use]
    pub fn encode(&self, form: BoardForm) -> BoardBytes {
        let [a, b, c, d, e, f] = self.encoders;
        let mut report = BoardBytes::zeros(form.bytes());
        if form == BoardForm::Bytes8 {
            report.put(0, [a, b, c, self.running.cast_signed()]);
        } else {
            let d = if self.is_pressed { d.wrapping_add(PRESSED) } else { d };
            report
                .put(0, [a, b, c, d, e, f, if self.requests_calibration { CALIBRATION_REQUEST } else { 0 }]);
        }
        report
    }
}

impl BoardOutput {
    /// No force.
    pub const ZERO: Self = Self::Currents([0; 3]);

    /// The report as it is sent, led by a zero.
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

    /// Reads an output report, as a board does, with the zero that leads it.
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
            SHOW => Ok(Self::Currents([x, y, z])),
            SET_COUNTERS => Ok(Self::Counters([a, b, c, x, y, z])),
            other => Err(BoardPacketError::Command(other)),
        }
    }
}
