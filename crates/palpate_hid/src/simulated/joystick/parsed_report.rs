//! Reports received by the simulated joystick, parsed by the descriptor independently of the driver's code, so that each checks the
//! other.

use crate::joystick::array_base::{PidArrayBases, offset};
use crate::joystick::usages::*;
use crate::{Field, Report, ReportDescriptor, ReportKind, Usage};

/// A constant force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Effect {
    /// Components of the unit force along x and y.
    pub(super) along: [f64; 2],
    pub(super) gain: f64,
    /// Magnitude as a fraction of the maximum, -1 to 1.
    pub(super) magnitude: f64,
    pub(super) duration_s: f64,
    /// Remaining time, s.
    pub(super) left_s: f64,
}

/// Unit of a duration, s: powers of ten of a second for a unit of time, else milliseconds.
fn unit_s(duration: &Field) -> f64 {
    let is_time = (duration.unit >> 4) == 0x100;
    if is_time { 10_f64.powi(i32::from(duration.unit_exponent)) } else { 1e-3 }
}

/// A received report.
pub(super) struct ParsedReport<'a> {
    descriptor: &'a ReportDescriptor,
    report: &'a Report,
    data: &'a [u8],
    bases: PidArrayBases,
}

impl<'a> ParsedReport<'a> {
    /// Parses `bytes`, with arrays numbered as `bases` states; `None` without a report of that ID and length.
    pub(super) fn of(
        descriptor: &'a ReportDescriptor,
        kind: ReportKind,
        bytes: &'a [u8],
        bases: PidArrayBases,
    ) -> Option<Self> {
        let (&id, data) = bytes.split_first()?;
        let report = descriptor.report(kind, id).filter(|report| report.bytes() == data.len())?;
        Some(Self { descriptor, report, data, bases })
    }

    fn around(&self, field: &Field, usage: Usage) -> bool {
        self.descriptor.around(field).any(|around| around == usage)
    }

    pub(super) fn belongs_to(&self, named: Named) -> bool {
        self.report.fields.iter().any(|field| self.around(field, named.usage))
    }

    pub(super) fn field(&self, named: Named) -> Option<&Field> {
        self.report.field(named.usage)
    }

    /// Value of a field; `None` outside its declared range.
    pub(super) fn value(&self, named: Named) -> Option<i64> {
        let field = self.field(named)?;
        let value = field.get(self.data)?;
        (field.logical[0]..=field.logical[1]).contains(&value).then_some(value)
    }

    pub(super) fn is_set(&self, named: Named) -> bool {
        self.field(named).is_some_and(|field| match field.get(self.data) {
            Some(value) if field.is_array => {
                field.usage_of(value - self.array_offset(field)) == Some(named.usage)
            }
            Some(value) => value != 0,
            None => false,
        })
    }

    /// Difference of the firmware's numbers from those that the Logical Minimum of an array gives.
    fn array_offset(&self, field: &Field) -> i64 {
        let base = if self.belongs_to(CONTROL) {
            self.bases.control
        } else if self.belongs_to(OPERATION_REPORT) {
            self.bases.operation
        } else {
            self.bases.effect_type
        };
        offset(field, base)
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

    /// Parameters of an effect.
    pub(super) fn effect(&self) -> Option<Effect> {
        if !self.is_set(ET_CONSTANT) {
            return None;
        }
        let duration = self.field(DURATION)?;
        let duration_s = if self.is_full(duration) {
            f64::INFINITY
        } else {
            self.value(DURATION)? as f64 * unit_s(duration)
        };
        let gain = self.value(GAIN)? as f64 / self.field(GAIN)?.logical[1] as f64;
        let direction = self.first_in(DIRECTION, |_| true)?;
        let [low, high] = direction.logical;
        let turned = direction.get(self.data).filter(|at| (low..=high).contains(at))?;
        let angle = std::f64::consts::TAU * (turned - low) as f64 / (high - low) as f64;
        // Direction from which the force comes, clockwise from the far end of y.
        let mut along = [-angle.sin(), angle.cos()];
        let is_directed = self.is_set(DIRECTION_ENABLE);
        if !is_directed {
            for (part, axis) in along.iter_mut().zip([X, Y]) {
                let enabled = self.first_in(AXES_ENABLE, |field| field.has(axis.usage));
                if enabled.and_then(|field| field.get(self.data)) != Some(1) {
                    *part = 0.0;
                }
            }
        }
        Some(Effect { along, gain, duration_s, left_s: f64::INFINITY, magnitude: 0.0 })
    }
}
