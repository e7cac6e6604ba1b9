//! Surface points that carry the load of a contact.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{PATCH_ROWS, PRESSURE_POINTS, PatchLayout, PatchScale, PatchSurface};

/// A vertex of a triangulated surface that carries part of a contact's load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadedPoint {
    /// Index of the vertex.
    pub point: usize,
    /// Share of the contact's force on this vertex. The shares of all vertices sum to 1.
    pub share: f64,
    /// Share of each row in `share`, when the patch has several rows.
    pub of_rows: [f64; PATCH_ROWS],
}

/// Maximum number of surface points that carry a contact.
pub const MAX_LOADED_POINTS: usize = 3 * PRESSURE_POINTS;

impl PatchLayout {
    /// Distributes the patch's force over the vertices of the surface and accumulates the sums of the rows in the
    /// same pass.
    ///
    /// `corners` returns the vertices of a triangle. The result replaces the contents of `carried`, which needs a
    /// capacity of [`MAX_LOADED_POINTS`]; vertices beyond its capacity are merged into the last one.
    pub fn carry(
        &mut self,
        surface: &impl PatchSurface,
        corners: impl Fn(usize) -> Option<[usize; 3]>,
        scale: &PatchScale,
        carried: &mut Vec<LoadedPoint>,
    ) {
        carried.clear();
        // The vertices of the last triangle in the list: the next place is often on the same triangle.
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
                                carried.push(LoadedPoint { point, ..LoadedPoint::default() });
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
