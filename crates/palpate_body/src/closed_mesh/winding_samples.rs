//! Samples of the winding number on a grid.

use super::MeshError;
use super::geometry::double_area;
use super::inside::{UNITS, row_crossing};
use super::winding_tree::WindingTree;
use crate::parallel;
use glam::DVec3;

/// Winding numbers of triangles at the points of a grid, with at least one layer of points outside their bounds.
///
/// The number at a point is the integer of the triangles with their holes capped, counted along rows of the grid, less the winding number of
/// the caps. This is the generalised winding number of the open triangles without an error near them.
pub(super) struct WindingSamples {
    pub counts: [usize; 3],
    pub spacing_m: f64,
    /// Position of the first point, relative to the centre of the mesh, m.
    pub first_m: DVec3,
    /// Winding number at each point, x fastest.
    pub winding: Vec<f32>,
}

/// Winding numbers between these, in magnitude, are uncertain.
const UNCERTAIN: std::ops::Range<f32> = 0.1..0.9;
/// Side of the blocks of points in which the winding number of distant caps is interpolated, in points.
const BLOCK: usize = 4;
/// Difference of the winding number of the caps from one integer, at the corners of a block, above which its points are computed one by one
/// if caps are near. In the middle of separate triangles the number is 1.
const NEAR_CAPS: f64 = 0.15;
/// Distance from a cap, in blocks, up to which it is near. Beyond it the interpolated number errs by less than a hundredth, as that of a half
/// plane: h²/(8 · 2π r²) for each of two directions, with h = 1 and r = 1.5 blocks.
const NEAR_BLOCKS: f64 = 1.5;
/// Maximum number of terms of the winding numbers of caps, beyond which the samples are further apart, about a second of one processor; and
/// beyond which the mesh is rejected. Ratio of successive spacings, maximum ratio to the given one, and number of blocks at which the terms are
/// counted.
const MAX_CAP_TERMS: f64 = 5e7;
const TOO_MANY_CAP_TERMS: f64 = 2e9;
const COARSER: f64 = 1.25;
const MAX_COARSER: f64 = 4.0;
const EXAMINED_BLOCKS: usize = 256;
/// Area of the caps per block, in sides of a block, beyond which all blocks count as near a cap.
const MAX_COVER: f64 = 16.0;

impl WindingSamples {
    /// Samples `triangles`, whose corners lie within ±`half_size_m`, at points about `spacing_m` apart, or up to four times as far if the caps
    /// would take too long.
    ///
    /// # Errors
    /// [`MeshError::Tangled`] if they would even so.
    pub(super) fn new(
        triangles: impl Iterator<Item = [DVec3; 3]>,
        caps: &[[DVec3; 3]],
        half_size_m: DVec3,
        spacing_m: f64,
    ) -> Result<Self, MeshError> {
        if caps.is_empty() {
            return Ok(Self::of_closed(triangles, half_size_m, spacing_m));
        }
        let tree = WindingTree::new(caps.to_vec());
        let mut samples = Self::empty(half_size_m, spacing_m);
        let (mut near, mut terms) = samples.near_caps(caps, &tree);
        while terms > MAX_CAP_TERMS && COARSER * samples.spacing_m <= MAX_COARSER * spacing_m {
            samples = Self::empty(half_size_m, COARSER * samples.spacing_m);
            (near, terms) = samples.near_caps(caps, &tree);
        }
        if terms > TOO_MANY_CAP_TERMS {
            return Err(MeshError::Tangled { pairs: TOO_MANY_CAP_TERMS as usize });
        }
        samples.count_crossings(triangles.chain(caps.iter().copied()), half_size_m);
        samples.subtract_caps(&tree, &near);
        samples.clear_outermost();
        Ok(samples)
    }

    /// Samples closed `triangles`, as [`WindingSamples::new`].
    pub(super) fn of_closed(
        triangles: impl Iterator<Item = [DVec3; 3]>,
        half_size_m: DVec3,
        spacing_m: f64,
    ) -> Self {
        let mut samples = Self::empty(half_size_m, spacing_m);
        samples.count_crossings(triangles, half_size_m);
        samples.clear_outermost();
        samples
    }

    /// The grid, without winding numbers.
    fn empty(half_size_m: DVec3, spacing_m: f64) -> Self {
        let counts = (2.0 * half_size_m / spacing_m).to_array().map(|along| along.ceil() as usize + 3);
        let extent_m = spacing_m * DVec3::from_array(counts.map(|n| (n - 1) as f64));
        Self { counts, spacing_m, first_m: -0.5 * extent_m, winding: Vec::new() }
    }

    /// The blocks near a cap, and the number of terms of the winding numbers of the caps.
    fn near_caps(&self, caps: &[[DVec3; 3]], tree: &WindingTree) -> (Vec<bool>, f64) {
        let near = self.blocks_near(caps);
        let terms = self.cap_terms(tree, &near);
        (near, terms)
    }

    /// Number of blocks along each axis.
    fn blocks(&self) -> [usize; 3] {
        self.counts.map(|n| (n - 1).div_ceil(BLOCK))
    }

    /// Estimate of the number of terms of the winding numbers of the caps: at the corners of all blocks, and at the points of those near a cap.
    fn cap_terms(&self, tree: &WindingTree, is_near: &[bool]) -> f64 {
        let places: Vec<DVec3> = crate::lattice::grid(self.blocks())
            .zip(is_near)
            .filter(|(_, is_near)| **is_near)
            .map(|(block, _)| self.at_m(block.map(|n| n * BLOCK + BLOCK / 2)))
            .collect();
        let examined = || places.iter().step_by(places.len().div_ceil(EXAMINED_BLOCKS).max(1));
        let terms: usize = examined().map(|place_m| tree.term_count(*place_m)).sum();
        let mean = terms as f64 / examined().count().max(1) as f64;
        mean * (is_near.len() + places.len() * BLOCK.pow(3)) as f64
    }

    /// Share of the samples whose winding number is between 0.1 and 0.9 in magnitude, so that the inside is uncertain.
    pub(super) fn uncertain_share(&self) -> f64 {
        let uncertain = self.winding.iter().filter(|w| UNCERTAIN.contains(&w.abs())).count();
        uncertain as f64 / self.winding.len() as f64
    }

    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.counts[0] * (j + self.counts[1] * k)
    }

    pub(super) fn at_m(&self, [i, j, k]: [usize; 3]) -> DVec3 {
        self.first_m + self.spacing_m * DVec3::new(i as f64, j as f64, k as f64)
    }

    /// Sets the winding numbers to the signed number of triangles that a ray from each point along +x crosses.
    fn count_crossings(&mut self, triangles: impl Iterator<Item = [DVec3; 3]>, half_size_m: DVec3) {
        // Crossings between a point and the next one, at the point.
        let total = self.counts.iter().product();
        let mut after = vec![0_i32; total];
        let unit_m = half_size_m.max_element() / UNITS;
        let whole = |x: f64| (x / unit_m).round() as i64;
        let in_points = |x_m: f64, axis: usize| (x_m - self.first_m[axis]) / self.spacing_m;
        for t in triangles {
            let (low, high) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
            let range = |axis: usize| {
                let begin = in_points(low[axis], axis).floor().max(0.0) as usize;
                let end = in_points(high[axis], axis).ceil().max(0.0) as usize + 1;
                begin..end.min(self.counts[axis])
            };
            let t = t.map(|x| x.to_array().map(whole));
            for k in range(2) {
                for j in range(1) {
                    let at_m = self.at_m([0, j, k]);
                    let Some((sign, x)) = row_crossing(&t, [whole(at_m.y), whole(at_m.z)]) else { continue };
                    let points = in_points(x * unit_m, 0).ceil().clamp(0.0, self.counts[0] as f64) as usize;
                    if points > 0 {
                        after[self.index([points - 1, j, k])] += sign as i32;
                    }
                }
            }
        }
        self.winding = vec![0.0; total];
        for row in 0..self.counts[1] * self.counts[2] {
            let mut sum = 0;
            for point in (row * self.counts[0]..(row + 1) * self.counts[0]).rev() {
                sum += after[point];
                self.winding[point] = sum as f32;
            }
        }
    }

    /// Whether each block, x fastest, has a cap within [`NEAR_BLOCKS`]. Caps are halved until they are as small as a block. If their area is many
    /// times that of the blocks, all count as near.
    fn blocks_near(&self, caps: &[[DVec3; 3]]) -> Vec<bool> {
        let blocks = self.blocks();
        let mut is_near = vec![false; blocks.iter().product()];
        let block_m = BLOCK as f64 * self.spacing_m;
        let area_m2 = 0.5 * caps.iter().copied().map(double_area).sum::<f64>();
        if area_m2 > MAX_COVER * block_m * block_m * is_near.len() as f64 {
            is_near.fill(true);
            return is_near;
        }
        let mut left: Vec<[DVec3; 3]> = Vec::new();
        for cap in caps {
            left.push(cap.map(|x| (x - self.first_m) / block_m));
            while let Some(t) = left.pop() {
                let (length2, opposite) = longest_side(t);
                if length2 > 1.0 {
                    let [a, b, c] = [t[opposite], t[(opposite + 1) % 3], t[(opposite + 2) % 3]];
                    let middle = 0.5 * (b + c);
                    left.extend([[a, b, middle], [a, middle, c]]);
                    continue;
                }
                let low = t[0].min(t[1]).min(t[2]) - NEAR_BLOCKS;
                let high = t[0].max(t[1]).max(t[2]) + NEAR_BLOCKS;
                let range = |axis: usize| {
                    let end = (high[axis].floor().max(-1.0) + 1.0) as usize;
                    low[axis].floor().max(0.0) as usize..end.min(blocks[axis])
                };
                for k in range(2) {
                    for j in range(1) {
                        let row = blocks[0] * (j + blocks[1] * k);
                        let along = range(0);
                        if along.start < along.end {
                            is_near[row + along.start..row + along.end].fill(true);
                        }
                    }
                }
            }
        }
        is_near
    }

    /// Sets the outermost samples to zero: they lie outside the mesh.
    fn clear_outermost(&mut self) {
        for place in crate::lattice::grid(self.counts) {
            if (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == self.counts[axis]) {
                let point = self.index(place);
                self.winding[point] = 0.0;
            }
        }
    }

    /// Subtracts the winding number of the caps, in blocks: interpolated between the corners where caps are far, or where it is near the same
    /// integer on all of them.
    fn subtract_caps(&mut self, caps: &WindingTree, has_caps_near: &[bool]) {
        let blocks = self.blocks();
        let corners = blocks.map(|n| n + 1);
        let corner_index = |[i, j, k]: [usize; 3]| i + corners[0] * (j + corners[1] * k);
        let at_corner: Vec<f64> = {
            let places: Vec<DVec3> =
                crate::lattice::grid(corners).map(|place| self.at_m(place.map(|n| n * BLOCK))).collect();
            parallel::map(&places, |place_m| caps.winding(*place_m))
        };
        let mut near = Vec::new();
        for block in crate::lattice::grid(blocks) {
            let of: [f64; 8] = std::array::from_fn(|c| {
                at_corner[corner_index([block[0] + (c & 1), block[1] + (c >> 1 & 1), block[2] + (c >> 2)])]
            });
            let is_near = has_caps_near[block[0] + blocks[0] * (block[1] + blocks[1] * block[2])]
                && of.iter().any(|w| (w - of[0].round()).abs() > NEAR_CAPS);
            let range = |axis: usize| {
                let begin = block[axis] * BLOCK;
                // The last block has its upper layer too.
                let end = if block[axis] + 1 == blocks[axis] { self.counts[axis] } else { begin + BLOCK };
                begin..end
            };
            for k in range(2) {
                for j in range(1) {
                    for i in range(0) {
                        let point = self.index([i, j, k]);
                        if is_near {
                            near.push((point, self.at_m([i, j, k])));
                            continue;
                        }
                        let t = [i - block[0] * BLOCK, j - block[1] * BLOCK, k - block[2] * BLOCK]
                            .map(|n| n as f64 / BLOCK as f64);
                        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
                        let low = mix(mix(of[0], of[1], t[0]), mix(of[2], of[3], t[0]), t[1]);
                        let high = mix(mix(of[4], of[5], t[0]), mix(of[6], of[7], t[0]), t[1]);
                        self.winding[point] -= mix(low, high, t[2]) as f32;
                    }
                }
            }
        }
        let exact = parallel::map(&near, |(_, place_m)| caps.winding(*place_m));
        for ((point, _), w) in near.into_iter().zip(exact) {
            self.winding[point] -= w as f32;
        }
    }
}

/// Square of the longest side of a triangle, and the index of the corner opposite to it.
fn longest_side([a, b, c]: [DVec3; 3]) -> (f64, usize) {
    let sides = [b.distance_squared(c), c.distance_squared(a), a.distance_squared(b)];
    let opposite = (1..3).fold(0, |longest, side| if sides[side] > sides[longest] { side } else { longest });
    (sides[opposite], opposite)
}
