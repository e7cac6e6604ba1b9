//! Layout of a contact patch in rows: one row for a contact that is small compared with a cell, else nine.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::smooth_step::smooth_step;
use crate::{
    Indentation, PATCH_ROWS, Patch, PatchScale, PatchStart, Pressure, PressurePoint, SeriesCompliance,
    ToolShape,
};
use glam::DVec3;

/// Maximum number of patches of a tool.
pub const MAX_PATCHES: usize = 4;
/// Contact radius in cells up to which a patch is one row, and from which its nine rows are fully separated.
const ONE_ROW_CELLS: f64 = 0.8;
const ALL_ROWS_CELLS: f64 = 2.0;
/// Distance in cells by which the pressure of a punch ends inside its rim when rows are separated; measured against
/// the closed form.
const RIM_CELLS: f64 = 0.3;
/// Minimum portion of the force of a row.
const MIN_PORTION: f64 = 1e-9;

impl Patch {
    /// Start of the next step's search. The step takes `span_s`, and a tool of `shape` presses with `force_n` along
    /// the normal. `elastic` holds Young's modulus, Pa, and Poisson's ratio. A ball on a body without a modulus
    /// touches at a point.
    #[must_use]
    pub fn start(
        &self,
        shape: &ToolShape,
        elastic: (Option<f64>, f64),
        (force_n, span_s): (f64, f64),
    ) -> PatchStart {
        let averaged_n = self.eased(force_n, span_s);
        let (_, law, contact_m) = contact(shape, self.normal, elastic, force_n);
        let depth_ratio = law.map_or(0.0, |law| law.approach_m(averaged_n) / law.radius_m);
        self.after(contact_m, averaged_n, depth_ratio)
    }
}

fn contact(
    shape: &ToolShape,
    normal: DVec3,
    (modulus_pa, poissons_ratio): (Option<f64>, f64),
    force_n: f64,
) -> (Pressure, Option<Indentation>, f64) {
    let (pressure, radius_m) = shape.pressure(normal);
    let law = modulus_pa.map(|modulus_pa| Indentation {
        pressure,
        radius_m,
        modulus_pa: modulus_pa / (1.0 - poissons_ratio * poissons_ratio),
        poissons_ratio,
    });
    let contact_m = match (law, pressure) {
        (Some(law), _) => law.radius_of_contact_m(force_n),
        (None, Pressure::Punch) => radius_m,
        (None, Pressure::Ball) => 0.0,
    };
    (pressure, law, contact_m)
}

/// Layout of a contact patch in rows. Each row is the mean of the surface under its part of the tool's pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchLayout {
    /// Pressure distribution and contact radius, m.
    pub pressure: (Pressure, f64),
    /// Law of indentation of a smooth surface, if the body has a Young's modulus.
    pub law: Option<Indentation>,
    /// Force on all rows in the previous step, N.
    pub force_n: f64,
    /// Separation of the rows, from 0 (one row, the mean under the whole pressure) to 1.
    pub apart: f64,
    sums: [Sums; PATCH_ROWS],
    row_n: [f64; PATCH_ROWS],
    pub(crate) patch: Patch,
    axes: [DVec3; 2],
    /// Radius of a ball, m; `None` for a punch.
    ball_m: Option<f64>,
}

/// Sums over the points of a row, weighted with their shares of the pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    /// Sum of the shares.
    portion: f64,
    /// Distance of the tool's surface behind its tip, m.
    behind: f64,
    /// Position in the contact in units of its radius.
    place: [f64; 2],
}

/// A row of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowLayout {
    /// Index of the row in its patch: 0 for the middle or for a single row, 1 to 8 for the sides.
    pub index: usize,
    /// Outward unit normal of the surface, against which the tool pushes there.
    pub normal: DVec3,
    /// Offset from the tool's position to the plane of contact, m. The gap to the row's point x is n·(tool + tip −
    /// x).
    pub tip_m: DVec3,
    /// Portion of the force under the pressure distribution on a smooth surface.
    pub portion: f64,
    /// Normal force in the previous step, N.
    pub force_n: f64,
    /// Whether the patch was one row in the previous step.
    was_one: bool,
}

impl RowLayout {
    /// Total force in the previous step, N; `row_n` holds the forces of the patch's rows then.
    #[must_use]
    pub fn whole_n(&self, row_n: &[DVec3; PATCH_ROWS]) -> DVec3 {
        let of = |row: usize| row_n.get(row).copied().unwrap_or_default();
        if self.was_one { of(0) * self.portion } else { of(self.index) }
    }
}

impl PatchLayout {
    /// Creates the layout of a patch whose rows bore the normal forces `row_n` (N) in the previous step, on a body
    /// with Young's modulus `modulus_pa` (Pa) and Poisson's ratio `poissons_ratio`.
    #[must_use]
    pub fn new(
        shape: &ToolShape,
        patch: &Patch,
        (modulus_pa, poissons_ratio): (Option<f64>, f64),
        row_n: &[f64; PATCH_ROWS],
        scale: &PatchScale,
    ) -> Self {
        let force_n: f64 = row_n.iter().sum();
        // With added compliance, law and grid follow the force together, and their ratio hardly changes. Without it
        // the contact would widen under a force that then falls, and oscillate.
        let widening_n = if scale.spread_m > 0.0 { force_n } else { patch.averaged_n };
        let (pressure, law, radius_m) =
            contact(shape, patch.normal, (modulus_pa, poissons_ratio), widening_n);
        let apart = rows_apart(radius_m, scale.cell_m);
        // Spread a small contact, so that its force depends little on the position within a cell.
        let spread_m = radius_m.hypot((1.0 - apart) * scale.spread_m);
        // A punch has its maximum pressure at the rim: nodes beyond the rim bear as much as those within.
        let radius_m = match pressure {
            Pressure::Ball => spread_m,
            Pressure::Punch => spread_m - RIM_CELLS * apart * scale.cell_m,
        };
        let ball_m = match *shape {
            ToolShape::Sphere { radius_m } => Some(radius_m),
            ToolShape::FlatPunch { .. } => None,
        };
        Self {
            pressure: (pressure, radius_m),
            law,
            force_n,
            apart,
            sums: [Sums::default(); PATCH_ROWS],
            row_n: *row_n,
            patch: *patch,
            axes: patch.tangents(scale),
            ball_m,
        }
    }

    /// Adds a point of the contact with its `share` of the pressure. Returns each row's share of the point, if rows
    /// are separated.
    pub(crate) fn add(&mut self, point: &PressurePoint, share: f64) -> Option<[f64; PATCH_ROWS]> {
        if self.apart <= 0.0 {
            return None;
        }
        let shares = point.portions.map(|portion| portion * share);
        let [x, y] = point.place;
        let behind_m = self.behind_m(point.distance);
        for (sums, share) in self.sums.iter_mut().zip(shares) {
            let [sum_x, sum_y] = sums.place;
            *sums = Sums {
                portion: sums.portion + share,
                behind: sums.behind + share * behind_m,
                place: [sum_x + share * x, sum_y + share * y],
            };
        }
        Some(shares)
    }

    /// The rows. All points must have been added.
    pub fn rows(&self) -> impl Iterator<Item = RowLayout> + use<> {
        let layout = *self;
        let Self { apart, force_n, row_n, sums, patch, .. } = layout;
        let mean_m: f64 = sums.iter().map(|sums| sums.behind).sum();
        let was_one = row_n.iter().skip(1).all(|n| *n == 0.0);
        let Patch { normal, tip_m, .. } = patch;
        let one = RowLayout { index: 0, normal, tip_m, portion: 1.0, force_n, was_one };
        let all = sums.into_iter().zip(row_n).enumerate().map(move |(index, (sums, n))| {
            let portion = sums.portion;
            let behind_m = apart * (sums.behind / portion - mean_m);
            let (normal, tip_m) = layout.tip(sums.place.map(|sum| apart * sum / portion), behind_m);
            let force_n = if was_one { force_n * portion } else { n };
            RowLayout { index, normal, tip_m, portion, force_n, was_one }
        });
        let (one, all) = if apart > 0.0 { (None, Some(all)) } else { (Some(one), None) };
        // A row beyond an edge bears nothing.
        one.into_iter().chain(all.into_iter().flatten().filter(|row| row.portion > MIN_PORTION))
    }

    /// Normal and tip at a point of the contact, at which the tool's surface is `behind_m` behind its tip.
    fn tip(&self, [x, y]: [f64; 2], behind_m: f64) -> (DVec3, DVec3) {
        let (normal, [u, v]) = (self.patch.normal, self.axes);
        let Some(ball_m) = self.ball_m else { return (normal, self.patch.tip_m + behind_m * normal) };
        // From the surface to the centre of the ball.
        let tilt = self.pressure.1 / ball_m;
        let there = (normal - tilt * (x * u + y * v)).try_normalize().unwrap_or(normal);
        (there, (behind_m - self.behind_m(x.hypot(y)) - ball_m) * there)
    }

    /// Distance of the tool's surface behind its tip, m, at a distance from the middle in units of the contact
    /// radius.
    fn behind_m(&self, distance: f64) -> f64 {
        let Some(ball_m) = self.ball_m else { return 0.0 };
        let off = (distance * self.pressure.1).min(ball_m);
        ball_m - (ball_m * ball_m - off * off).sqrt()
    }

    /// Compliance that a grid of cells lacks under this patch. `grid_m_per_n` is the deflection of the grid under the
    /// patch's pressure, per newton.
    #[must_use]
    pub fn missing_compliance(&self, grid_m_per_n: f64, scale: &PatchScale) -> Option<SeriesCompliance> {
        let forces = (self.force_n, self.patch.averaged_n);
        let softening_m = scale.softens.then_some(scale.cell_m);
        self.law.map(|law| SeriesCompliance::missing(law, (grid_m_per_n, softening_m), forces))
    }

    /// Compliance of rows on a body without added compliance: a twentieth of the smooth law. It distributes the load
    /// over nearly redundant rows and prevents oscillation.
    #[must_use]
    pub fn least_compliance(&self) -> Option<SeriesCompliance> {
        self.law.map(|law| SeriesCompliance::of_share(crate::series_compliance::MIN_SHARE, law))
    }
}

/// Separation of the rows of a contact of radius `radius_m`.
fn rows_apart(radius_m: f64, cell_m: f64) -> f64 {
    smooth_step(radius_m / cell_m, ONE_ROW_CELLS, ALL_ROWS_CELLS)
}
