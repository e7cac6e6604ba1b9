//! Colours of shares, for gizmos and the panel.

/// Red, green and blue of a share, 0 to 1: dark violet, green, yellow (the stops of viridis: S. van der Walt and N. Smith, 2015).
pub(crate) fn bright(share: f32) -> [f32; 3] {
    const STOPS: [[f32; 3]; 5] =
        [[0.27, 0.0, 0.33], [0.23, 0.32, 0.55], [0.13, 0.57, 0.55], [0.37, 0.79, 0.38], [0.99, 0.91, 0.14]];
    // A share that is not finite has the last colour.
    let share = if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) };
    let place = share * (STOPS.len() - 1) as f32;
    let below = (place as usize).min(STOPS.len() - 2);
    let between = place - below as f32;
    std::array::from_fn(|channel| {
        STOPS[below][channel] + between * (STOPS[below + 1][channel] - STOPS[below][channel])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_have_their_stops_and_shares_are_clamped() {
        assert_eq!(
            (bright(0.0), bright(0.5), bright(1.0)),
            ([0.27, 0.0, 0.33], [0.13, 0.57, 0.55], [0.99, 0.91, 0.14])
        );
        assert_eq!((bright(-3.0), bright(7.0), bright(f32::NAN)), (bright(0.0), bright(1.0), bright(1.0)));
    }
}
