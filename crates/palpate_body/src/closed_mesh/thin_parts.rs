//! Parts of a mesh that are thin compared with its cells.

use super::ClosedMesh;
use super::distance_transform::squared_distances;
use super::surface_nets;
use super::winding_samples::WindingSamples;
use std::fmt;

/// Parts of a mesh that are thinner than two cells.
///
/// They keep their mass and axial stiffness, but bend like walls one cell thick: a wall of thickness t in cells of side h is about 3 (h/t)²
/// too stiff against bending. `Display` writes this as one sentence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinParts {
    /// Side of the cells, m.
    pub cell_m: f64,
    /// Share of the volume that is thinner than two cells, from 0 to 1: places further than √3 cells from the centre of every inscribed ball
    /// with a radius of a cell. Corners and edges of thick parts are nearer.
    pub share: f64,
    /// Largest tried side of cells with which this share is at most [`ThinParts::MAX_SHARE`], m. `None` if it is now, or if it would take more
    /// than [`ThinParts::MAX_TRIED_CELLS`] along the longest side.
    pub resolving_cell_m: Option<f64>,
}

/// Number of samples along a cell, and their maximum number along the mesh.
const SAMPLES_ALONG_CELL: f64 = 6.0;
const MAX_SAMPLES_ALONG: f64 = SAMPLES_ALONG_CELL * ThinParts::MAX_TRIED_CELLS as f64;
/// Ratio of successive sizes of cells that are tried.
const SIZE_RATIO: f64 = 0.8;

impl ThinParts {
    /// Share of the volume up to which cells resolve a mesh.
    pub const MAX_SHARE: f64 = 0.1;
    /// Maximum number of cells along the longest side that are tried.
    pub const MAX_TRIED_CELLS: usize = 32;
}

impl ClosedMesh {
    /// The parts that are thinner than two cells of side `cell_m`, m. The thickness is sampled at a sixth of a cell, and the calculation
    /// takes some milliseconds, or up to a second where it searches for the size of cells that resolves them.
    #[must_use]
    pub fn thin_parts(&self, cell_m: f64) -> ThinParts {
        self.thin_parts_of(cell_m, self.thin_share(cell_m))
    }

    /// [`ClosedMesh::thin_parts`] with the share that is known.
    pub(crate) fn thin_parts_of(&self, cell_m: f64, share: f64) -> ThinParts {
        let size_m = 2.0 * self.half_size_m().max_element();
        let least_m = size_m / ThinParts::MAX_TRIED_CELLS as f64;
        let smaller = std::iter::successors(Some(SIZE_RATIO * cell_m), |cell_m| Some(SIZE_RATIO * cell_m));
        let resolving_cell_m = (share > ThinParts::MAX_SHARE)
            .then(|| {
                let is_resolving = |cell_m: &f64| self.thin_share(*cell_m) <= ThinParts::MAX_SHARE;
                smaller.take_while(|cell_m| *cell_m >= least_m).find(is_resolving)
            })
            .flatten();
        ThinParts { cell_m, share, resolving_cell_m }
    }

    /// Share of the volume that is thinner than two cells of side `cell_m`, m.
    pub(crate) fn thin_share(&self, cell_m: f64) -> f64 {
        let finest_m = 2.0 * self.half_size_m().max_element() / MAX_SAMPLES_ALONG;
        let spacing_m = (cell_m / SAMPLES_ALONG_CELL).max(finest_m);
        let corners = self.closed_triangles().iter().map(|t| t.map(|point| self.enclosing_points_m()[point]));
        let samples = WindingSamples::of_closed(corners, self.half_size_m(), spacing_m);
        let is_inside = |sample: usize| surface_nets::is_inside(samples.winding[sample]);
        let cell = cell_m / spacing_m;
        let to_outside = squared_distances(samples.counts, |sample| !is_inside(sample));
        // The surface is about half a sample before the first sample outside, and the centre of a ball up to half a sample from a sample.
        let to_center = squared_distances(samples.counts, |sample| to_outside[sample] >= cell * cell);
        let (mut inside, mut at_surface, mut thick) = (0.0, 0.0, 0.0);
        for sample in (0..samples.winding.len()).filter(|&sample| is_inside(sample)) {
            inside += 1.0;
            at_surface += f64::from(u8::from(to_outside[sample] <= 1.0));
            thick += f64::from(u8::from(to_center[sample] <= 3.0 * cell * cell));
        }
        if inside == 0.0 {
            return 1.0;
        }
        // Parts between samples are thin. Samples beside the surface stand for up to twice their volume.
        let between = 1.0 - (inside + 0.5 * at_surface) * spacing_m.powi(3) / self.volume_m3();
        1.0 - thick / inside * (1.0 - between.max(0.0))
    }
}

impl fmt::Display for ThinParts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cell_m, share, resolving_cell_m } = *self;
        write!(
            f,
            "{:.0} % of the volume is thinner than two cells of {cell_m:.4} m; it keeps its mass and axial stiffness, but bends like a wall one \
             cell thick",
            100.0 * share
        )?;
        match resolving_cell_m {
            Some(cell_m) => write!(f, "; cells of {cell_m:.4} m resolve it"),
            None if share > Self::MAX_SHARE => {
                write!(f, "; {} cells along the longest side do not resolve it", Self::MAX_TRIED_CELLS)
            }
            None => Ok(()),
        }
    }
}
