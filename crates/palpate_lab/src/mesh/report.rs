//! Results of `palpate-lab mesh`: JSON and text.

use super::built::BuiltMesh;
use super::taps::{TappedPlace, Taps};
use crate::app_tool::limit_reached;
use crate::error::LabError;
use palpate_body::{ImplausibleSize, ThinParts, VirtualCoupling};
use palpate_files::MeshPiece;
use serde::Serialize;
use std::io::Write;

/// A file that has become a body.
#[derive(Serialize)]
pub(super) struct Report {
    accepted: bool,
    /// Reason of a rejection: none.
    reason: Option<String>,
    pieces: usize,
    /// Share of the body's piece in the volume of all pieces.
    piece_share: f64,
    size_m: [f64; 3],
    nodes: usize,
    fixed_nodes: usize,
    cells: usize,
    cell_m: f64,
    volume_m3: f64,
    mass_kg: f64,
    /// Holes that count as closed.
    holes: usize,
    /// Pairs of triangles that cross.
    crossings: usize,
    /// Parts that faced inward and were turned.
    reoriented: usize,
    /// Share of the bounds in which the inside is uncertain.
    uncertain_share: f64,
    /// Share of the volume that is thinner than two cells, and the side of the cells that resolve it, m.
    thin_share: f64,
    resolving_cell_m: Option<f64>,
    /// Maximum distance of the mesh's inside from the touched surface, m.
    deviation_m: f64,
    /// Time from the triangles to the body, ms.
    build_ms: f64,
    taps: Vec<TapReport>,
    live_error: LiveError,
    /// Model steps in which the tool touched nodes beyond the support set of its local model.
    beyond_support: usize,
    /// Sentences about thin parts, an implausible size and a force at its limit, with the flag to change.
    warnings: Vec<String>,
    /// What was assumed, as a sentence.
    #[serde(skip)]
    assumed: Option<String>,
}

#[derive(Serialize)]
struct TapReport {
    /// Place of the undeformed surface, in the coordinates of the mesh, m.
    place_m: [f64; 3],
    /// Maximum force on the hand in the first tap, N.
    peak_n: f64,
    /// (max − min) / max of the maximum forces of all taps of the place; none without a force.
    repeat_spread: Option<f64>,
}

/// Errors of the loop over the model steps whose force counts; none without contact.
#[derive(Serialize)]
struct LiveError {
    median: Option<f64>,
    p95: Option<f64>,
    largest: Option<f64>,
    /// Maximum over the first counted step of each tap.
    first_touch: Option<f64>,
    /// Maximum difference between the two forces in any tick, N.
    difference_n: f64,
}

/// A file that is rejected.
#[derive(Serialize)]
pub(super) struct RejectedReport {
    accepted: bool,
    reason: String,
}

/// A piece in the list of a file's content.
#[derive(Serialize)]
pub(super) struct ListedPiece<'a> {
    mesh: usize,
    primitive: usize,
    node: Option<&'a str>,
    mesh_name: Option<&'a str>,
    material: Option<&'a str>,
    triangles: usize,
}

impl Report {
    pub(super) fn of(built: &BuiltMesh, taps: &Taps, coupling: VirtualCoupling) -> Self {
        let network = built.body.network();
        let assumptions = built.closed.assumptions();
        let assumed = assumptions.unwrap_or_default();
        let [low, high] = built.closed.bounds_m();
        let mut errors = taps.errors.clone();
        errors.sort_by(f64::total_cmp);
        let size = ImplausibleSize::of((high - low).max_element());
        let peak_n = taps.places.iter().flat_map(|tapped| tapped.peaks_n).fold(0.0, f64::max);
        let thin = &built.thin_parts;
        let warnings = [
            (thin.share > ThinParts::MAX_SHARE).then(|| format!("{thin}; change --cells")),
            size.map(|size| format!("{size}; change --scale or --size-m")),
            limit_reached(coupling, peak_n).map(|limit| format!("{limit}; change --max-force-n")),
        ];
        Self {
            accepted: true,
            reason: None,
            pieces: built.piece_count,
            piece_share: built.piece_share,
            size_m: (high - low).to_array(),
            nodes: network.node_count(),
            fixed_nodes: network.node_count() - network.free().len(),
            cells: built.cells.cells,
            cell_m: built.cells.cell_m,
            volume_m3: built.closed.volume_m3(),
            mass_kg: network.mass_kg().iter().sum(),
            holes: assumed.hole_count,
            crossings: assumed.crossing_count,
            reoriented: assumed.reoriented_part_count,
            uncertain_share: assumed.uncertain_share,
            thin_share: thin.share,
            resolving_cell_m: thin.resolving_cell_m,
            deviation_m: built.deviation_m,
            build_ms: built.build_ms,
            taps: taps.places.iter().map(TapReport::of).collect(),
            live_error: LiveError {
                median: quantile(&errors, 0.5),
                p95: quantile(&errors, 0.95),
                largest: quantile(&errors, 1.0),
                first_touch: taps.first_touch,
                difference_n: taps.max_difference_n,
            },
            beyond_support: taps.beyond_support,
            warnings: warnings.into_iter().flatten().collect(),
            assumed: assumptions.map(|assumptions| assumptions.to_string()),
        }
    }

    pub(super) fn table(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let [x, y, z] = self.size_m.map(|m| 1e3 * m);
        let percent =
            |share: Option<f64>| share.map_or("-".into(), |share| format!("{:.2} %", 100.0 * share));
        writeln!(out, "accepted           yes")?;
        if self.piece_share < 1.0 {
            let share = percent(Some(self.piece_share));
            writeln!(
                out,
                "pieces             {}, one with {share} of the volume is the body (--piece)",
                self.pieces
            )?;
        } else {
            writeln!(out, "pieces             {}", self.pieces)?;
        }
        writeln!(out, "size, mm           {x:.1} x {y:.1} x {z:.1}")?;
        writeln!(out, "nodes              {}, {} of them fixed", self.nodes, self.fixed_nodes)?;
        writeln!(out, "cells              {} of {:.2} mm", self.cells, 1e3 * self.cell_m)?;
        writeln!(out, "volume, ml         {:.2}", 1e6 * self.volume_m3)?;
        writeln!(out, "mass, kg           {:.4}", self.mass_kg)?;
        writeln!(out, "assumed            {}", self.assumed.as_deref().unwrap_or("nothing"))?;
        writeln!(out, "deviation, mm      {:.3}", 1e3 * self.deviation_m)?;
        writeln!(out, "build, ms          {:.0}", self.build_ms)?;
        for tap in &self.taps {
            let [x, y, z] = tap.place_m.map(|m| 1e3 * m);
            let spread = percent(tap.repeat_spread);
            writeln!(
                out,
                "tap                {:.4} N at {x:.1}, {y:.1}, {z:.1} mm, repeated within {spread}",
                tap.peak_n
            )?;
        }
        self.warnings.iter().try_for_each(|warning| writeln!(out, "warning            {warning}"))?;
        if self.taps.is_empty() {
            return Ok(());
        }
        let LiveError { median, p95, largest, first_touch, difference_n } = self.live_error;
        writeln!(
            out,
            "error of the loop  median {}, 95th percentile {}, largest {}, at first touch {}; at most {difference_n:.4} N",
            percent(median),
            percent(p95),
            percent(largest),
            percent(first_touch)
        )?;
        writeln!(out, "beyond support     {} model steps", self.beyond_support)
    }
}

impl TapReport {
    fn of(tapped: &TappedPlace) -> Self {
        let peaks_n = tapped.peaks_n;
        let high = peaks_n.into_iter().fold(0.0, f64::max);
        let low = peaks_n.into_iter().fold(f64::INFINITY, f64::min);
        Self {
            place_m: tapped.place_m.to_array(),
            peak_n: peaks_n[0],
            repeat_spread: (high > 0.0).then(|| (high - low) / high),
        }
    }
}

impl RejectedReport {
    pub(super) fn of(error: &LabError) -> Self {
        Self { accepted: false, reason: palpate_haptics::report(error) }
    }
}

impl<'a> ListedPiece<'a> {
    pub(super) fn of(piece: &'a MeshPiece) -> Self {
        Self {
            mesh: piece.mesh,
            primitive: piece.primitive,
            node: piece.node.as_deref(),
            mesh_name: piece.mesh_name.as_deref(),
            material: piece.material.as_deref(),
            triangles: piece.triangles.len(),
        }
    }
}

/// The smallest of the `sorted` values that at least `share` of them do not exceed; none of an empty list.
fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn quantiles_are_nearest_ranks() {
        let twenty: Vec<f64> = (1..=20).map(f64::from).collect();
        let of = |share| quantile(&twenty, share);
        assert_eq!([of(0.5), of(0.95), of(1.0)], [Some(10.0), Some(19.0), Some(20.0)]);
        assert_eq!((quantile(&[3.0], 0.5), quantile(&[], 0.5)), (Some(3.0), None));
    }

    #[test]
    fn spread_is_relative_to_the_larger_peak() {
        let of = |peaks_n| TapReport::of(&TappedPlace { place_m: DVec3::ZERO, peaks_n });
        let report = of([1.5, 2.0]);
        assert_eq!((report.peak_n, report.repeat_spread), (1.5, Some(0.25)));
        assert_eq!(of([0.0, 0.0]).repeat_spread, None);
    }
}
