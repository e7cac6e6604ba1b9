//! The points of a surface that carry a contact.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{PATCH_ROWS, PRESSURE_POINTS, PatchLayout, PatchScale, PatchSurface};

/// A point of a surface, a corner of triangles, under a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CarriedPoint {
    /// Which it is.
    pub point: usize,
    /// The share of the force that it carries: the shares of all points sum to 1.
    pub share: f64,
    /// The share of each row in that, where rows are apart.
    pub of_rows: [f64; PATCH_ROWS],
}

/// Most points that carry a contact.
pub const MAX_CARRIED: usize = 3 * PRESSURE_POINTS;

impl PatchLayout {
    /// Spreads the force of the patch over the surface: makes `carried`, which needs room for [`MOST_CARRIED`], the points that carry it, where
    /// `corners` are the points of a triangle. The sums of the rows are taken in the same pass.
    pub fn carry(
        &mut self,
        surface: &impl PatchSurface,
        corners: impl Fn(usize) -> Option<[usize; 3]>,
        scale: &PatchScale,
        carried: &mut Vec<CarriedPoint>,
    ) {
        carried.clear();
        // The corners of the last triangle in the list: the next place is often on the same.
        let mut last: Option<(usize, [usize; 3])> = None;
        let (patch, pressure) = (self.patch, self.pressure);
        patch.spread(surface, pressure, scale, |place, share, at| {
            let of_rows = self.add(at, share);
            let listed = match last {
                Some((triangle, listed)) if triangle == place.triangle => listed,
                _ => {
                    let Some(points) = corners(place.triangle) else { return };
                    points.map(|point| {
                        carried.iter().position(|known| known.point == point).unwrap_or_else(|| {
                            if carried.len() < carried.capacity() {
                                carried.push(CarriedPoint { point, ..CarriedPoint::default() });
                            }
                            carried.len().saturating_sub(1)
                        })
                    })
                }
            };
            last = Some((place.triangle, listed));
            for (index, w) in listed.into_iter().zip(place.weights).filter(|(_, w)| *w != 0.0) {
                let Some(to) = carried.get_mut(index) else { continue };
                to.share += share * w;
                if let Some(of_rows) = &of_rows {
                    to.of_rows.iter_mut().zip(of_rows).for_each(|(to, share)| *to += share * w);
                }
            }
        });
    }
}
