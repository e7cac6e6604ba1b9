//! Input reports of a joystick: position and buttons.

use super::usages::{BUTTONS, GAME_PAD, JOYSTICK, X, Y};
use crate::{Field, ReportDescriptor, ReportKind, Usage};

/// Layout of the input report with the joystick's axes. Buttons in other reports are ignored.
#[derive(Clone, Debug)]
pub(super) struct InputLayout {
    id: u8,
    bytes: usize,
    x: Field,
    y: Option<Field>,
    /// Field of each button, with its bit in [`ParsedInput::Position`].
    buttons: Vec<(Field, u8)>,
    /// Array fields that contain the numbers of the pressed buttons.
    pressed: Vec<Field>,
    /// IDs and lengths of all input reports of the device.
    all_reports: Vec<(u8, usize)>,
    max_length: usize,
}

/// Content of an input report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ParsedInput {
    /// Position of x and y as a fraction of the travel, -1 to 1; pressed buttons, bit i for button i + 1.
    Position([f64; 2], u32),
    /// Another report of the device.
    Other,
    /// No report of the device, or one with a wrong length.
    Malformed,
}

impl InputLayout {
    /// Finds the report in `descriptor`; `None` without an x axis.
    pub(super) fn of(descriptor: &ReportDescriptor, use_y: bool) -> Option<Self> {
        let find = |within: Usage| descriptor.find(ReportKind::Input, within, X.usage);
        let (report, x) = find(JOYSTICK.usage).or_else(|| find(GAME_PAD.usage))?;
        let y = report.field(Y.usage).filter(|_| use_y);
        let is_axis = |field: &Field| {
            !field.is_array && (1..=32).contains(&field.bits) && field.logical[0] < field.logical[1]
        };
        let mut buttons = Vec::new();
        let mut pressed = Vec::new();
        for field in report.fields.iter().filter(|field| !field.is_constant) {
            let first = field.usages.first().map(|range| range.first);
            match first.filter(|usage| usage.page == BUTTONS) {
                Some(_) if field.is_array => pressed.push(field.clone()),
                Some(usage) => {
                    buttons.extend(bit_of(usage).map(|bit| (field.clone(), bit)));
                }
                None => {}
            }
        }
        let reports = descriptor.reports().iter().filter(|report| report.kind == ReportKind::Input);
        let all_reports: Vec<(u8, usize)> = reports.map(|report| (report.id, 1 + report.bytes())).collect();
        let max_length = all_reports.iter().map(|report| report.1).max().unwrap_or(0);
        is_axis(x).then(|| Self {
            id: report.id,
            bytes: 1 + report.bytes(),
            x: x.clone(),
            y: y.filter(|y| is_axis(y)).cloned(),
            buttons,
            pressed,
            all_reports,
            max_length,
        })
    }

    /// Whether the y axis is used.
    pub(super) fn has_y(&self) -> bool {
        self.y.is_some()
    }

    /// Parses an input report with its ID. Its length must match the descriptor; Windows pads all reports to the length of the longest.
    pub(super) fn parse(&self, report: &[u8]) -> ParsedInput {
        let Some((&id, data)) = report.split_first() else { return ParsedInput::Malformed };
        let fits = |bytes| report.len() == bytes || (cfg!(windows) && report.len() == self.max_length);
        if id != self.id {
            let is_other = self.all_reports.iter().any(|&(other, bytes)| other == id && fits(bytes));
            return if is_other { ParsedInput::Other } else { ParsedInput::Malformed };
        }
        let x = self.x.get(data).map(|value| part(&self.x, value));
        let y = match &self.y {
            Some(y) => y.get(data).map(|value| part(y, value)),
            None => Some(0.0),
        };
        match (x, y) {
            (Some(x), Some(y)) if fits(self.bytes) => ParsedInput::Position([x, y], self.buttons(data)),
            _ => ParsedInput::Malformed,
        }
    }

    fn buttons(&self, data: &[u8]) -> u32 {
        let is_pressed = |field: &Field| field.get(data).is_some_and(|value| value != 0);
        let own = self.buttons.iter().filter(|(field, _)| is_pressed(field)).map(|&(_, bit)| bit);
        let named = self.pressed.iter().filter_map(|field| bit_of(field.usage_of(field.get(data)?)?));
        own.chain(named).fold(0, |all, bit| all | (1 << bit))
    }
}

/// Bit of a button; `None` beyond the first 32.
fn bit_of(usage: Usage) -> Option<u8> {
    let bit = usage.id.checked_sub(1)?;
    (usage.page == BUTTONS && bit < 32).then_some(bit as u8)
}

/// Position of `value` between the centre of the field's range and its ends, clamped to -1 to 1.
fn part(field: &Field, value: i64) -> f64 {
    let [low, high] = field.logical.map(|limit| limit as f64);
    ((value as f64 - 0.5 * (low + high)) / (0.5 * (high - low))).clamp(-1.0, 1.0)
}
