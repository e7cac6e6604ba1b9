//! Buttons of a SpaceMouse as bits: those of report 3, and those with larger numbers in the reports 1C and 1D of the Enterprise.

/// Pressed buttons by report.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Buttons {
    /// Bits of report 3.
    pub(super) own: u32,
    /// Bits of the reports 1C and 1D.
    numbered: [u32; 2],
}

/// Keys of the Enterprise with numbers above 32, and their bits: Enter, Delete, 11, 12, V1, V2, V3, Tab, Space. Its other keys have the
/// bits 0 to 26 without 3, 6, 7, 9 and 11.
///
/// Source of the numbers: FreeSpacenav/spnavcfg, issue 69, whose codes are one less.
const ENTERPRISE_KEYS: [(u16, u8); 9] =
    [(36, 27), (37, 28), (77, 29), (78, 30), (103, 31), (104, 3), (105, 6), (175, 7), (176, 9)];

impl Buttons {
    /// Sets the buttons of report `id`, 1C or 1D, to those with the numbers `pressed`; 0 is none. Unknown numbers are ignored.
    pub(super) fn set_numbers(&mut self, id: u8, pressed: [u16; 6]) {
        let bits = pressed.into_iter().filter_map(bit_of).fold(0, |bits, bit| bits | 1 << bit);
        let [first, second] = &mut self.numbered;
        *(if id == super::report::NUMBERS[0] { first } else { second }) = bits;
    }

    /// Bit i for button i.
    pub(super) fn bits(self) -> u32 {
        self.own | self.numbered[0] | self.numbered[1]
    }
}

/// Bit of the button `number`, counted from 1.
fn bit_of(number: u16) -> Option<u8> {
    let key = ENTERPRISE_KEYS.iter().find(|(key, _)| *key == number).map(|&(_, bit)| bit);
    key.or_else(|| u8::try_from(number.checked_sub(1)?).ok().filter(|&bit| bit < 32))
}
