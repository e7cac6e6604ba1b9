//! A smooth step from 0 to 1.

/// 0 up to `from`, 1 from `to` on, and a cubic with zero slope at both ends between them; `from` < `to`.
pub(crate) fn smooth_step(value: f64, from: f64, to: f64) -> f64 {
    let share = ((value - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
