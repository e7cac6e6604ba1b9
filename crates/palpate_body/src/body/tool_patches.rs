//! Candidate contact patches of a tool for the next ticks.

use super::Body;
use crate::surface::PlacedSurface;
use crate::tool::Hold;
use crate::weights::{Weights, add_weight};
use crate::{SurfaceTree, ToolContact};
use glam::DVec3;
use palpate_laws::{
    ActivePatch, ActivePatches, LoadedPoint, MAX_LOADED_POINTS, MAX_PATCHES, PATCH_ROWS, Patch, PatchLayout,
    PatchScale, PatchStart, PatchSurface, RowLayout, Seed, SeriesCompliance, SurfacePlace, ToolShape,
    hexahedra_compliance, mobility, normal_compliance_at,
};

/// A tool that moves further than this in a millisecond, m, counts as having jumped and touches nothing on the way.
const JUMP_M_PER_MS: f64 = 0.025;
/// Penetration, as a fraction of its radius, with which a tool still counts as outside.
const CLEAR_SHARE: f64 = 1e-3;

/// A contact patch with its rows of nodes.
#[derive(Clone, Debug)]
pub(super) struct ToolPatch {
    pub(super) patch: Patch,
    /// Corners of the triangle under the tool as points of the contact surface, with their weights.
    pub(super) corners: [(usize, f64); 3],
    /// Rest normal of the triangle on which the patch started.
    pub(super) rest_normal: DVec3,
    /// Contact radius, m.
    pub(super) radius_m: f64,
    /// One row while the contact is small compared with a cell, then [`PATCH_ROWS`].
    pub(super) rows: Vec<PatchRow>,
}

/// A row of a patch.
#[derive(Clone, Debug)]
pub(super) struct PatchRow {
    /// Index of the row in its patch: 0 for the middle or for a single row.
    pub(super) index: usize,
    /// Nodes and weights: the mean of the surface under the row's part of the pressure is Σ w_i x_i.
    pub(super) nodes: Weights,
    /// Sum of the weights of the free nodes.
    pub(super) free_share: f64,
    /// Outward unit normal, and the offset from the tool's position to its tip, m.
    pub(super) normal: DVec3,
    pub(super) tip_m: DVec3,
    /// Compliance in series.
    pub(super) series: Option<SeriesCompliance>,
    /// Normal force in the previous step, and total force on the body, N.
    pub(super) force_n: f64,
    pub(super) whole_n: DVec3,
}

/// Candidate patches of a tool on a section of its path.
#[derive(Default)]
pub(super) struct ToolPatches {
    pub(super) patches: Vec<ToolPatch>,
    /// Number of patches beyond the maximum.
    pub(super) left_out: usize,
}

impl Body {
    /// Finds the candidate patches of a tool whose device moves straight from `from_m` to `to_m` in `span_s`. A tool
    /// that starts inside the body without a contact touches nothing until it has come out.
    pub(super) fn find_tool_patches(
        &mut self,
        contact: &mut ToolContact,
        (from_m, to_m): (DVec3, DVec3),
        span_s: f64,
    ) -> ToolPatches {
        let (proxy_m, coupling) = (contact.proxy_m(from_m), contact.coupling);
        let Hold::Nothing { shape, clear, .. } = &mut contact.hold else { return ToolPatches::default() };
        let (shape, radius, moved) = (*shape, shape.radius_m(), from_m.distance(to_m));
        let speed2 = |&node: &usize| self.v[node].length_squared();
        let fastest = self.network.free().iter().map(speed2).fold(0.0, f64::max).sqrt();
        let short = coupling.map_or(0.0, |c| c.remaining_m(from_m - proxy_m, Some(radius)).length());
        // Nodes are pushed by the tool or move by themselves. The next section finds patches from further away.
        let beside = 2.0 * fastest * span_s + short;
        let reach = 1.5 * radius + moved + beside;
        let way = (proxy_m, proxy_m + (to_m - from_m));
        let low = way.0.min(way.1).min(from_m).min(to_m) - reach;
        let high = way.0.max(way.1).max(from_m).max(to_m) + reach;
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for x in self.surface.points.iter().map(|point| point.of(&self.x)) {
            (least, most) = (least.min(x), most.max(x));
        }
        let mut before = std::mem::take(&mut contact.touched);
        let is_near = least.cmple(high).all() && most.cmpge(low).all();
        if !is_near && before.is_empty() {
            *clear = true;
            return ToolPatches::default();
        }
        let mut tree = self.tree.take().unwrap_or_else(|| Box::new(SurfaceTree::new(self)));
        tree.refit(self);
        let near = tree.near(low, high);
        if moved > JUMP_M_PER_MS * (1e3 * span_s).max(1.0) && !(near.is_empty() && before.is_empty()) {
            before.clear();
            *clear = false;
        } else if before.is_empty() {
            let closest = tree.closest(shape.core_m(proxy_m), reach + radius);
            *clear = closest.is_some_and(|closest| {
                let least = if *clear { 0.0 } else { radius * (1.0 - CLEAR_SHARE) };
                closest.distance_m > least
            });
        } else {
            *clear = true;
        }
        self.tree = Some(tree);
        if !*clear {
            return ToolPatches::default();
        }
        let x: Vec<DVec3> = self.contact_surface.points().iter().map(|point| point.of(&self.x)).collect();
        let surface = PlacedSurface { surface: &self.contact_surface, x: &x };
        let scale = self.patch_scale();
        let find = |start: &PatchStart| Patch::find(&surface, &shape, way.1, start, &scale);
        let known_patch = |row: &ToolPatch| ActivePatch {
            patch: row.patch,
            at_m: row.corners.iter().map(|&(point, w)| w * x[point]).sum(),
            rest_normal: row.rest_normal,
            radius_m: row.radius_m,
        };
        let (mut approach, mut all) = (ToolPatches::default(), ActivePatches::default());
        for touched in before.chunk_by(|a, b| a.patch == b.patch) {
            let Some(first) = touched.first() else { continue };
            let mut row_n = [0.0; PATCH_ROWS];
            let mut row_f = [DVec3::ZERO; PATCH_ROWS];
            for row in touched {
                (row_n[row.row], row_f[row.row]) = (row.pressing_n(), row.force_n());
            }
            let SurfacePlace { triangle, weights } = first.patch.foot;
            let modulus_pa = self.modulus_at_pa(triangle, weights);
            let elastic = (modulus_pa, self.poissons_ratio());
            let force_n = row_n.iter().sum();
            let Some(patch) = find(&first.patch.start(&shape, elastic, (force_n, span_s))) else { continue };
            if surface.place_m(patch.foot).is_none_or(|at_m| all.contains(&patch, at_m, scale.cell_m)) {
                continue;
            }
            let row = self.patch_rows(&surface, &shape, patch, (first.rest_normal, row_n, row_f));
            all.add(known_patch(&row));
            approach.patches.push(row);
        }
        contact.touched = before;
        let mut seeds: Vec<Seed> = self
            .contact_surface
            .parts_of(near)
            .into_iter()
            .filter_map(|triangle| {
                let corners = self.contact_surface.triangles()[triangle].map(|point| x[point]);
                let rest_normal = self.contact_surface.rest_normal(triangle);
                let [a, b, c] = corners;
                let ball = (a, a.distance(b).max(a.distance(c)));
                if all.covers(rest_normal, ball, scale.cell_m) {
                    return None;
                }
                Seed::of(&shape, way, (triangle, corners, rest_normal), beside)
            })
            .collect();
        all.begin(&mut seeds, scale.cell_m, find, |patch, seed| {
            if approach.patches.len() == MAX_PATCHES {
                approach.left_out += 1;
                return None;
            }
            let forces = (seed.rest_normal, [0.0; PATCH_ROWS], [DVec3::ZERO; PATCH_ROWS]);
            let row = self.patch_rows(&surface, &shape, patch, forces);
            let known = known_patch(&row);
            approach.patches.push(row);
            Some(known)
        });
        approach
    }

    /// Scale of the contact patches on the surface.
    #[must_use]
    pub fn patch_scale(&self) -> PatchScale {
        let grid = self.network.grid();
        let cell_m = grid.map_or(self.contact_surface.mean_edge_m(), crate::Grid::cell_m);
        PatchScale {
            cell_m,
            spread_m: if self.adds_compliance() { PatchScale::SPREAD_CELLS * cell_m } else { 0.0 },
            axes: grid.map_or(DVec3::AXES, crate::Grid::axes),
            softens: grid.is_none_or(|grid| grid.elements_ratio().is_none()),
        }
    }

    /// Young's modulus at a point of the contact surface, Pa, if the body has one.
    #[must_use]
    pub fn contact_modulus_pa(&self, point: usize) -> Option<f64> {
        let moduli = self.network.grid()?.youngs_modulus_pa();
        let point = self.contact_surface.points().get(point)?;
        Some(point.nodes().iter().map(|&(node, w)| w * moduli[node]).sum())
    }

    /// Young's modulus at a place on a triangle of the contact surface, Pa, if the body has one.
    fn modulus_at_pa(&self, triangle: usize, weights: [f64; 3]) -> Option<f64> {
        let corners = self.contact_surface.triangles()[triangle].into_iter().zip(weights);
        corners.map(|(point, w)| Some(w * self.contact_modulus_pa(point)?)).sum()
    }

    /// Poisson's ratio of the tissue; without a grid it is not used.
    fn poissons_ratio(&self) -> f64 {
        self.network.grid().map_or(0.0, crate::Grid::poissons_ratio)
    }

    /// Compliance of the grid below the surface between the nodes `i` and `j`, along the surface normal, times
    /// Young's modulus, 1/m. `None` if the body has no grid; 0 for a fixed node.
    #[must_use]
    pub fn grid_compliance_per_m(&self, i: usize, j: usize) -> Option<f64> {
        let grid = self.network.grid()?;
        let cell_m = grid.cell_m();
        if self.network.is_fixed(i) || self.network.is_fixed(j) {
            return Some(0.0);
        }
        let offset = (self.network.rest_m()[j] - self.network.rest_m()[i]) / cell_m;
        let near = self.partial_cells.as_ref().and_then(|cells| cells.between(i, j));
        let cells = match (grid.elements_ratio(), near) {
            (None, near) => normal_compliance_at(offset.length()) + near.unwrap_or(0.0),
            (Some(_), Some(near)) => near,
            (Some(ratio), None) => {
                let [x, y, z] = grid.axes().map(|axis| axis.dot(offset).round() as i32);
                // In the plane of a face one of the three is zero.
                let [_, j, i] = {
                    let mut sorted = [x, y, z].map(i32::abs);
                    sorted.sort_unstable();
                    sorted
                };
                hexahedra_compliance(ratio, i, j)
            }
        };
        Some(cells / cell_m)
    }

    /// Rows of a patch. `rest_normal` is that of the triangle on which it started; `row_n` and `row_f` are the normal
    /// and total forces on its rows in the previous step, N.
    fn patch_rows(
        &self,
        surface: &PlacedSurface<'_>,
        shape: &ToolShape,
        patch: Patch,
        (rest_normal, row_n, row_f): (DVec3, [f64; PATCH_ROWS], [DVec3; PATCH_ROWS]),
    ) -> ToolPatch {
        let SurfacePlace { triangle, weights } = patch.foot;
        let points = self.contact_surface.triangles()[triangle];
        let corners = [0, 1, 2].map(|i| (points[i], weights[i]));
        let modulus_pa = self.modulus_at_pa(triangle, weights);
        let scale = self.patch_scale();
        let elastic = (modulus_pa, self.poissons_ratio());
        let mut layout = PatchLayout::new(shape, &patch, elastic, &row_n, &scale);
        let mut carried = Vec::with_capacity(MAX_LOADED_POINTS);
        let corners_of = |triangle: usize| self.contact_surface.triangles().get(triangle).copied();
        layout.carry(surface, corners_of, &scale, &mut carried);
        let mut mean: Weights = Vec::new();
        let mut own: [Weights; PATCH_ROWS] = Default::default();
        for LoadedPoint { point, share, of_rows } in carried {
            for &(node, w) in self.contact_surface.points()[point].nodes() {
                add_weight(&mut mean, node, share * w);
                let parts = own.iter_mut().zip(of_rows).filter(|(_, part)| *part > 0.0);
                parts.for_each(|(nodes, part)| add_weight(nodes, node, part * w));
            }
        }
        let series = if self.adds_compliance() {
            modulus_pa.and_then(|modulus_pa| self.missing_compliance(&mean, &layout, modulus_pa))
        } else {
            layout.least_compliance()
        };
        let row = |row: RowLayout| -> Option<PatchRow> {
            let mut nodes: Weights = mean.iter().map(|&(node, w)| (node, (1.0 - layout.apart) * w)).collect();
            let part = layout.apart / row.portion;
            own[row.index]
                .iter()
                .filter(|_| part > 0.0)
                .for_each(|&(node, w)| add_weight(&mut nodes, node, part * w));
            let free = nodes.iter().filter(|(node, _)| !self.network.is_fixed(*node));
            let free_share: f64 = free.map(|(_, w)| w).sum();
            let borne = row.portion * mobility(free_share);
            let series = series.map(|series| series.of_portion(borne));
            if series.is_some() && borne <= 0.0 {
                return None;
            }
            let whole_n = row.whole_n(&row_f);
            let RowLayout { index, normal, tip_m, force_n, .. } = row;
            let tip_m = tip_m - series.map_or(0.0, |series| series.lead_m) * normal;
            Some(PatchRow { index, nodes, free_share, normal, tip_m, series, force_n, whole_n })
        };
        let rows = layout.rows().filter_map(row).collect();
        ToolPatch { patch, corners, rest_normal, radius_m: layout.pressure.1, rows }
    }

    /// Compliance that the grid lacks of the law of a contact whose force is distributed over `nodes`.
    fn missing_compliance(
        &self,
        nodes: &[(usize, f64)],
        layout: &PatchLayout,
        modulus_pa: f64,
    ) -> Option<SeriesCompliance> {
        let mut sum = 0.0;
        for (i, &(a, w)) in nodes.iter().enumerate() {
            let other: Option<f64> =
                nodes[..i].iter().map(|&(b, o)| Some(o * self.grid_compliance_per_m(a, b)?)).sum();
            sum += w * (w * self.grid_compliance_per_m(a, a)? + 2.0 * other?);
        }
        layout.missing_compliance(sum / modulus_pa, &self.patch_scale())
    }
}
