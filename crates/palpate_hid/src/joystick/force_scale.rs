//! Newtons to what a constant force's magnitude is written as, and back.

use crate::Field;

/// The magnitude of a constant force: `F = F_full · n / n_full`, where `n_full` is the greatest number that the field can have with
/// either sign. So zero is zero, and a force and its opposite are numbers and their opposites, also where the field goes one
/// further below than above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    full_scale_n: f64,
    full: i64,
}

impl Scale {
    /// That of `magnitude`; `None` where it has no negative values or none at all.
    pub(super) fn of(magnitude: &Field, full_scale_n: f64) -> Option<Self> {
        let [low, high] = magnitude.logical;
        // What is said of it may be more than it can hold.
        let held = match magnitude.bits {
            bits @ 2..=32 => (1_i64 << (bits - 1)) - 1,
            _ => return None,
        };
        let full = high.min(low.saturating_neg()).min(held);
        (full > 0).then_some(Self { full_scale_n, full })
    }

    /// The nearest number to `force_n`, N; 0 for what is not a number.
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

    fn scale(logical: [i32; 2], bits: u8) -> Option<Scale> {
        let [[a, b, c, d], [e, f, g, h]] = logical.map(i32::to_le_bytes);
        let items =
            [0x05, 0x0F, 0x09, 0x70, 0x17, a, b, c, d, 0x27, e, f, g, h, 0x75, bits, 0x95, 1, 0x91, 2];
        let descriptor = ReportDescriptor::parse(&items).unwrap();
        Scale::of(&descriptor.report(ReportKind::Output, 0).unwrap().fields[0], 40.0)
    }

    fn newtons(scale: Scale, counts: i64) -> f64 {
        scale.full_scale_n * counts as f64 / scale.full as f64
    }

    #[test]
    fn zero_is_zero_and_the_ends_are_the_ends() {
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
    fn a_magnitude_without_a_sign_or_room_has_no_scale() {
        assert!(scale([0, 255], 8).is_none());
        assert!(scale([-1, 1], 1).is_none());
        assert!(scale([-100, 100], 33).is_none());
        assert!(scale([5, -5], 8).is_none());
        // Eight bits of which sixteen are said.
        assert_eq!(scale([-4096, 4096], 8).unwrap().counts(40.0), 127);
    }

    proptest! {
        #[test]
        fn there_and_back_is_within_half_a_count(force_n in -40.0..40.0, full in 1_i32..100_000) {
            let scale = scale([-full, full], 32).unwrap();
            let counts = scale.counts(force_n);
            prop_assert!((newtons(scale, counts) - force_n).abs() <= 0.5 * 40.0 / f64::from(full) * (1.0 + 1e-12));
            prop_assert_eq!(scale.counts(newtons(scale, counts)), counts);
            prop_assert_eq!(scale.counts(-force_n), -counts);
        }
    }
}
