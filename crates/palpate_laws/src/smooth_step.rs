//! A smooth passage from 0 to 1.

/// 0 up to `from`, 1 from `to` on, and between them a cubic without a bend at its ends; `from` < `to`.
pub(crate) fn smooth_step(value: f64, from: f64, to: f64) -> f64 {
    let share = ((value - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
