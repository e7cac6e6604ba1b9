//! Colours of the gizmos.

use bevy::prelude::*;
use glam::DVec3;

pub(super) const FIXED: Color = Color::srgb(0.55, 0.58, 0.62);
pub(super) const DEVICE: Color = Color::srgba(0.7, 0.75, 0.85, 0.5);
pub(super) const TOOL: Color = Color::srgb(0.85, 0.9, 1.0);
pub(super) const FORCE: Color = Color::srgb(1.0, 0.75, 0.25);
pub(super) const CONTACT: Color = Color::srgb(1.0, 0.35, 0.35);
pub(super) const SUPPORT: Color = Color::srgb(0.2, 0.95, 0.6);
pub(super) const RING: Color = Color::srgba(0.2, 0.7, 0.85, 0.8);

/// Colour of a relative strain: blue for compression, faint grey for zero, red for tension; full at −1 and 1.
pub(super) fn strained(strain: f32) -> Color {
    let rest = LinearRgba::new(0.35, 0.37, 0.40, 0.12);
    let full = if strain < 0.0 { LinearRgba::rgb(0.05, 0.25, 1.0) } else { LinearRgba::rgb(1.0, 0.08, 0.05) };
    // A strain that is not finite has the full colour.
    let share = if strain.is_finite() { strain.abs().min(1.0) } else { 1.0 };
    rest.mix(&full, share).into()
}

/// Colour of a share, 0 to 1: dark violet, green, yellow.
pub(super) fn bright(share: f32) -> Color {
    Color::srgb_from_array(crate::color_map::bright(share))
}

/// Displacements of the nodes relative to the largest, 0 to 1.
pub(super) fn shares(moves: &[DVec3]) -> Vec<f32> {
    let max = moves.iter().map(|v| v.length()).fold(0.0, f64::max);
    moves.iter().map(|v| if max > 0.0 { (v.length() / max) as f32 } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_displacement_is_brightest_and_zero_stays_zero() {
        let moves = [DVec3::ZERO, DVec3::X * 0.5, DVec3::new(0.0, -2.0, 0.0)];
        assert_eq!(shares(&moves), [0.0, 0.25, 1.0]);
        assert_eq!(shares(&[DVec3::ZERO; 2]), [0.0; 2]);
        assert_eq!(bright(1.0), Color::srgb(0.99, 0.91, 0.14));
        assert_eq!(bright(0.0), Color::srgb(0.27, 0.0, 0.33));
    }

    #[test]
    fn tension_is_red_compression_blue_and_colours_saturate() {
        let [red, blue, rest] = [1.0, -1.0, 0.0].map(|strain| strained(strain).to_linear());
        assert!(red.red > rest.red && red.blue < rest.blue && blue.blue > rest.blue && blue.red < rest.red);
        assert_eq!((strained(7.0), strained(f32::NAN).to_linear().red), (strained(1.0), red.red));
    }
}
