//! What a report that came to a stand-in joystick says, by its descriptor. It is read here anew, and not by what the driver finds, so
//! that the two check each other.

use crate::joystick::usages::*;
use crate::{Field, Report, ReportDescriptor, ReportKind, Usage};

/// A constant force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Effect {
    /// What of it goes along x and along y.
    pub(super) along: [f64; 2],
    pub(super) gain: f64,
    /// A part of the greatest, -1 to 1.
    pub(super) magnitude: f64,
    pub(super) lasts_s: f64,
    /// The rest of its time.
    pub(super) left_s: f64,
}

/// The unit of a duration, s: powers of ten of a second where it is of time, else milliseconds.
fn unit_s(duration: &Field) -> f64 {
    let is_time = (duration.unit >> 4) == 0x100;
    if is_time { 10_f64.powi(i32::from(duration.unit_exponent)) } else { 1e-3 }
}

/// A report that came, and what it says.
pub(super) struct ParsedReport<'a> {
    descriptor: &'a ReportDescriptor,
    report: &'a Report,
    data: &'a [u8],
}

impl<'a> ParsedReport<'a> {
    /// The report in `bytes`, if there is one of that number and length.
    pub(super) fn of(descriptor: &'a ReportDescriptor, kind: ReportKind, bytes: &'a [u8]) -> Option<Self> {
        let (&id, data) = bytes.split_first()?;
        let report = descriptor.report(kind, id).filter(|report| report.bytes() == data.len())?;
        Some(Self { descriptor, report, data })
    }

    fn around(&self, field: &Field, usage: Usage) -> bool {
        self.descriptor.around(field).any(|around| around == usage)
    }

    pub(super) fn is(&self, named: Named) -> bool {
        self.report.fields.iter().any(|field| self.around(field, named.usage))
    }

    pub(super) fn field(&self, named: Named) -> Option<&Field> {
        self.report.field(named.usage)
    }

    /// The value of a field, if its descriptor allows it.
    pub(super) fn value(&self, named: Named) -> Option<i64> {
        let field = self.field(named)?;
        let value = field.get(self.data)?;
        (field.logical[0]..=field.logical[1]).contains(&value).then_some(value)
    }

    pub(super) fn says(&self, named: Named) -> bool {
        self.field(named).is_some_and(|field| match field.get(self.data) {
            Some(value) if field.is_array => field.usage_of(value) == Some(named.usage),
            Some(value) => value != 0,
            None => false,
        })
    }

    /// Whether all bits of a field are set.
    pub(super) fn is_full(&self, field: &Field) -> bool {
        field.bits < 64
            && field
                .get(self.data)
                .is_some_and(|value| value & ((1 << field.bits) - 1) == (1 << field.bits) - 1)
    }

    fn first_in(&self, collection: Named, wanted: impl Fn(&Field) -> bool) -> Option<&Field> {
        let mut fields = self.report.fields.iter();
        fields.find(|field| self.around(field, collection.usage) && wanted(field))
    }

    /// What a report says that an effect is.
    pub(super) fn effect(&self) -> Option<Effect> {
        if !self.says(ET_CONSTANT) {
            return None;
        }
        let duration = self.field(DURATION)?;
        let lasts_s = if self.is_full(duration) {
            f64::INFINITY
        } else {
            self.value(DURATION)? as f64 * unit_s(duration)
        };
        let gain = self.value(GAIN)? as f64 / self.field(GAIN)?.logical[1] as f64;
        let direction = self.first_in(DIRECTION, |_| true)?;
        let [low, high] = direction.logical;
        let turned = direction.get(self.data).filter(|at| (low..=high).contains(at))?;
        let angle = std::f64::consts::TAU * (turned - low) as f64 / (high - low) as f64;
        // Where the force comes from, clockwise from the far end of y.
        let mut along = [-angle.sin(), angle.cos()];
        let is_directed = self.says(DIRECTION_ENABLE);
        if !is_directed {
            for (part, axis) in along.iter_mut().zip([X, Y]) {
                let enabled = self.first_in(AXES_ENABLE, |field| field.has(axis.usage));
                if enabled.and_then(|field| field.get(self.data)) != Some(1) {
                    *part = 0.0;
                }
            }
        }
        Some(Effect { along, gain, lasts_s, left_s: f64::INFINITY, magnitude: 0.0 })
    }
}
