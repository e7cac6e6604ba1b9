//! Where the stick is, as an input report says it.

use super::usages::{BUTTONS, GAME_PAD, JOYSTICK, X, Y};
use crate::{Field, ReportDescriptor, ReportKind, Usage};

/// The input report with the joystick's axes. Buttons that are in another report are not seen.
#[derive(Clone, Debug)]
pub(super) struct Input {
    id: u8,
    bytes: usize,
    x: Field,
    y: Option<Field>,
    /// Each with the bit that it becomes.
    buttons: Vec<(Field, u8)>,
    /// Fields that name the buttons that are pressed.
    pressed: Vec<Field>,
    /// Numbers and lengths of all of its input reports.
    known: Vec<(u8, usize)>,
    longest: usize,
}

/// What an input report says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Said {
    /// Parts of the way from the middle to the ends, -1 to 1, of x and of y; bit i for button i + 1.
    Place([f64; 2], u32),
    /// It is another report of the device.
    Other,
    /// It is none, or too short, or too long.
    Malformed,
}

impl Input {
    /// That of `descriptor`; `None` without an x.
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
        let known: Vec<(u8, usize)> = reports.map(|report| (report.id, 1 + report.bytes())).collect();
        let longest = known.iter().map(|known| known.1).max().unwrap_or(0);
        is_axis(x).then(|| Self {
            id: report.id,
            bytes: 1 + report.bytes(),
            x: x.clone(),
            y: y.filter(|y| is_axis(y)).cloned(),
            buttons,
            pressed,
            known,
            longest,
        })
    }

    /// Whether it has a y that is used.
    pub(super) fn has_y(&self) -> bool {
        self.y.is_some()
    }

    /// Reads an input report, its number first. It has exactly the length that its descriptor gives it; Windows gives all of a
    /// device's reports the length of the longest.
    pub(super) fn parse(&self, report: &[u8]) -> Said {
        let Some((&id, data)) = report.split_first() else { return Said::Malformed };
        let fits = |bytes| report.len() == bytes || (cfg!(windows) && report.len() == self.longest);
        if id != self.id {
            let is_known = self.known.iter().any(|&(known, bytes)| known == id && fits(bytes));
            return if is_known { Said::Other } else { Said::Malformed };
        }
        let x = self.x.get(data).map(|value| part(&self.x, value));
        let y = match &self.y {
            Some(y) => y.get(data).map(|value| part(y, value)),
            None => Some(0.0),
        };
        match (x, y) {
            (Some(x), Some(y)) if fits(self.bytes) => Said::Place([x, y], self.buttons(data)),
            _ => Said::Malformed,
        }
    }

    fn buttons(&self, data: &[u8]) -> u32 {
        let is_down = |field: &Field| field.get(data).is_some_and(|value| value != 0);
        let own = self.buttons.iter().filter(|(field, _)| is_down(field)).map(|&(_, bit)| bit);
        let named = self.pressed.iter().filter_map(|field| bit_of(field.usage_of(field.get(data)?)?));
        own.chain(named).fold(0, |all, bit| all | (1 << bit))
    }
}

/// The bit of a button, of the first 32.
fn bit_of(usage: Usage) -> Option<u8> {
    let bit = usage.id.checked_sub(1)?;
    (usage.page == BUTTONS && bit < 32).then_some(bit as u8)
}

/// Where `value` is between the middle of the field's range and its ends; beyond them, at them.
fn part(field: &Field, value: i64) -> f64 {
    let [low, high] = field.logical.map(|limit| limit as f64);
    ((value as f64 - 0.5 * (low + high)) / (0.5 * (high - low))).clamp(-1.0, 1.0)
}
