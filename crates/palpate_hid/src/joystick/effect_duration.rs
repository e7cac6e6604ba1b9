//! Duration of effects, which bounds the force after the program was killed.

use super::report_encoding::max_value;
use crate::Field;
use std::time::Duration;

/// Target duration of an effect, s.
const DURATION_S: f64 = 0.5;
/// Minimum and maximum duration, s, of a finite effect.
const ALLOWED_S: [f64; 2] = [0.25, 1.0];
/// Period at which an effect with a force is started again.
pub(super) const RESTART_PERIOD: Duration = Duration::from_millis(100);

/// Value of the duration field for 0.5 s, or the nearest that the field holds; `None` if that is below 0.25 s or above 1 s. The value
/// with all bits set means endless and is never used.
pub(super) fn duration_counts(field: &Field) -> Option<i64> {
    let count_s = count_s(field);
    let [low, high] = field.logical;
    let (min, max) = (low.max(1), high.min(max_value(field) - 1));
    if count_s <= 0.0 || min > max {
        return None;
    }
    let counts = ((DURATION_S / count_s).round() as i64).clamp(min, max);
    let [min_s, max_s] = ALLOWED_S;
    (min_s..=max_s).contains(&(counts as f64 * count_s)).then_some(counts)
}

/// Duration of one count, s: milliseconds, by the class definition, where the field declares no unit of time.
fn count_s(field: &Field) -> f64 {
    // Lowest four bits: system of units; then the exponents of length, mass, time and so on.
    const TIME: u32 = 0x1000;
    if field.unit & !0xF != TIME {
        return 1e-3;
    }
    let span = |[low, high]: [i64; 2]| high as f64 - low as f64;
    let (logical, physical) = (span(field.logical), span(field.physical));
    let units = if logical > 0.0 && physical > 0.0 { physical / logical } else { 1.0 };
    units * 10_f64.powi(i32::from(field.unit_exponent))
}

#[cfg(test)]
mod test {
    use super::*;
    use crate::{ReportDescriptor, ReportKind};

    fn counts_of(logical: [i32; 2], more: &[u8], bits: u8) -> Option<i64> {
        let [[a, b, c, d], [e, f, g, h]] = logical.map(i32::to_le_bytes);
        let limits = [0x05, 0x0F, 0x09, 0x50, 0x17, a, b, c, d, 0x27, e, f, g, h];
        let items = [&limits[..], more, &[0x75, bits, 0x95, 1, 0x91, 2]].concat();
        let descriptor = ReportDescriptor::parse(&items).unwrap();
        duration_counts(&descriptor.report(ReportKind::Output, 0).unwrap().fields[0])
    }

    #[test]
    fn half_a_second_in_various_units() {
        // Seconds as a unit: 0x1001 in SI, 0x1003 in the English system.
        let unit = |exponent: u8| [0x66, 0x01, 0x10, 0x55, exponent];
        assert_eq!(counts_of([0, 32767], &[], 16), Some(500), "without a unit");
        assert_eq!(counts_of([0, 32767], &[0x66, 0x03, 0x10, 0x55, 0xFD], 16), Some(500));
        assert_eq!(counts_of([0, 32767], &unit(0x0D), 16), Some(500), "an exponent of four bits");
        assert_eq!(counts_of([0, 65534], &unit(0x0C), 16), Some(5000), "tenths of a millisecond");
        assert_eq!(counts_of([0, 32767], &unit(0x0E), 16), Some(50), "hundredths of a second");
        assert_eq!(counts_of([0, 100], &unit(0), 16), Some(1), "seconds: minimum of one count");
        // 0 to 2000 stands for 0 to 1000 ms.
        let physical = [&[0x35, 0, 0x46, 0xE8, 0x03][..], &unit(0x0D)].concat();
        assert_eq!(counts_of([0, 2000], &physical, 16), Some(1000));
        // A unit of length is left over from another field.
        assert_eq!(counts_of([0, 32767], &[0x65, 0x11], 16), Some(500));
    }

    #[test]
    fn unrepresentable_durations_are_none() {
        assert_eq!(counts_of([0, 255], &[], 8), Some(254), "255 means endless");
        assert_eq!(counts_of([0, 200], &[], 8), None, "too short to be started again in time");
        assert_eq!(counts_of([1500, 32767], &[], 16), None, "too long");
        assert_eq!(counts_of([0, 32767], &[0x66, 0x01, 0x10, 0x55, 1], 16), None, "tens of seconds");
        assert_eq!(counts_of([0, 0], &[], 16), None);
    }
}
