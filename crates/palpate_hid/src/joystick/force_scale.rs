//! Conversion of forces to magnitudes of a constant-force effect.

use crate::Field;

/// Scale of a constant force, `F = F_full · n / n_full`, where `n_full` is the largest number that the field holds with either sign.
/// Zero maps to zero and opposite forces to opposite numbers, also for a field whose negative range is one larger.
#[derive(Clone, Copy, Debug)]
pub(super) struct ForceScale {
    full_scale_n: f64,
    full: i64,
}

impl ForceScale {
    /// Creates the scale of `magnitude`; `None` for a field without negative values or with an unsupported width.
    pub(super) fn of(magnitude: &Field, full_scale_n: f64) -> Option<Self> {
        let [low, high] = magnitude.logical;
        // The declared range may exceed the bits of the field.
        let max_of_bits = match magnitude.bits {
            bits @ 2..=32 => (1_i64 << (bits - 1)) - 1,
            _ => return None,
        };
        let full = high.min(low.saturating_neg()).min(max_of_bits);
        (full > 0).then_some(Self { full_scale_n, full })
    }

    /// Nearest magnitude to `force_n`, N; 0 for NaN.
    pub(super) fn counts(self, force_n: f64) -> i64 {
        let full = self.full as f64;
        (force_n / self.full_scale_n * full).round().clamp(-full, full) as i64
    }
}

#[cfg(test)]
mod test {
    use super::*;
    use crate::{ReportDescriptor, ReportKind};
    use proptest::prelude::*;

    fn scale(logical: [i32; 2], bits: u8) -> Option<ForceScale> {
        let [[a, b, c, d], [e, f, g, h]] = logical.map(i32::to_le_bytes);
        let items =
            [0x05, 0x0F, 0x09, 0x70, 0x17, a, b, c, d, 0x27, e, f, g, h, 0x75, bits, 0x95, 1, 0x91, 2];
        let descriptor = ReportDescriptor::parse(&items).unwrap();
        ForceScale::of(&descriptor.report(ReportKind::Output, 0).unwrap().fields[0], 40.0)
    }

    fn newtons(scale: ForceScale, counts: i64) -> f64 {
        scale.full_scale_n * counts as f64 / scale.full as f64
    }

    #[test]
    fn zero_and_full_scale_are_exact() {
        let scale = scale([-32768, 32767], 16).unwrap();
        for (force_n, counts) in [
            (0.0, 0),
            (-0.0, 0),
            (40.0, 32767),
            (-40.0, -32767),
            (1e9, 32767),
            (-1e9, -32767),
            (f64::INFINITY, 32767),
            (f64::NAN, 0),
            (20.0, 16384),
            (-20.0, -16384),
        ] {
            assert_eq!(scale.counts(force_n), counts, "{force_n} N");
        }
    }

    #[test]
    fn unsigned_or_oversized_field_has_no_scale() {
        assert!(scale([0, 255], 8).is_none());
        assert!(scale([-1, 1], 1).is_none());
        assert!(scale([-100, 100], 33).is_none());
        assert!(scale([5, -5], 8).is_none());
        // 8 bits with the declared range of 14.
        assert_eq!(scale([-4096, 4096], 8).unwrap().counts(40.0), 127);
    }

    proptest! {
        #[test]
        fn round_trip_error_is_at_most_half_a_count(force_n in -40.0..40.0, full in 1_i32..100_000) {
            let scale = scale([-full, full], 32).unwrap();
            let counts = scale.counts(force_n);
            prop_assert!((newtons(scale, counts) - force_n).abs() <= 0.5 * 40.0 / f64::from(full) * (1.0 + 1e-12));
            prop_assert_eq!(scale.counts(newtons(scale, counts)), counts);
            prop_assert_eq!(scale.counts(-force_n), -counts);
        }
    }
}
