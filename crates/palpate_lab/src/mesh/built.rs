//! The body of `palpate-lab mesh`, built as in an app.

use super::arguments::Mesh;
use crate::error::LabError;
use crate::multirate::ms_since;
use palpate_body::{
    Body, BodyError, CellSize, ClosedMesh, Damping, Face, JoinOptions, JoinedMesh, MeshBody, MeshCells,
    MeshClosing, MeshError, MeshPart, PieceSelection, SemiImplicitEuler, ThinParts, Tissue,
};
use palpate_reduce::{BuilderOptions, LocalModelBuilder, ReduceError};
use std::time::Instant;

/// Share of the height that is fixed, from below.
const BASE: f64 = 0.2;
/// Density, kg/m³.
const DENSITY_KG_PER_M3: f64 = 1000.0;
/// Damping ratio of each spring.
const DAMPING_RATIO: f64 = 0.5;

/// A mesh that has become a body, with the builder of its local models.
pub(super) struct BuiltMesh {
    pub(super) closed: ClosedMesh,
    /// Number of pieces of the mesh, and the share of the body's piece in the volume of all.
    pub(super) piece_count: usize,
    pub(super) piece_share: f64,
    pub(super) cells: MeshCells,
    pub(super) thin_parts: ThinParts,
    /// Maximum distance of the mesh's enclosing surface from the touched one, m.
    pub(super) deviation_m: f64,
    pub(super) body: Body,
    pub(super) builder: LocalModelBuilder,
    /// Time from the triangles to the body and its builder, ms.
    pub(super) build_ms: f64,
}

impl BuiltMesh {
    /// The body of `part`, whose triangles were read at `start`.
    ///
    /// # Errors
    /// [`LabError::Mesh`] with the reason and the flag to change.
    pub(super) fn of(part: MeshPart, options: &Mesh, start: Instant) -> Result<Self, LabError> {
        let scale_m = match options.size_m {
            Some(size_m) => size_m / longest_extent(&part),
            None => options.scale,
        };
        build(part, options, scale_m, start).map_err(|error| {
            let flag = match &error {
                ReduceError::Body(BodyError::Mesh(
                    MeshError::TooManyNodes { .. } | MeshError::CoarseGrid { .. },
                )) => "; change --cells",
                _ => "",
            };
            options.rejected(format!("{}{flag}", palpate_haptics::report(&error)))
        })
    }
}

fn build(part: MeshPart, options: &Mesh, scale_m: f64, start: Instant) -> Result<BuiltMesh, ReduceError> {
    let closing = if options.strict {
        MeshClosing::Strict
    } else {
        MeshClosing::Enclose { thickness_m: options.thickness_m }
    };
    let pieces = options.piece.map_or(PieceSelection::Largest, PieceSelection::Index);
    let cells = options.cells.map_or_else(CellSize::default, CellSize::Along);
    let joined =
        JoinedMesh::new(&[part], JoinOptions { scale_m, closing, pieces, cells }).map_err(BodyError::from)?;
    let tissue = Tissue {
        youngs_modulus_pa: options.youngs_pa,
        density_kg_per_m3: DENSITY_KG_PER_M3,
        damping: Damping::Ratio(DAMPING_RATIO),
        ..Tissue::default()
    };
    let lattice = joined.lattice().map_err(BodyError::from)?;
    let lattice = lattice.fix_base(Face::NegY, BASE);
    let MeshBody { network, surface, cells, deviation_m, .. } = lattice.tissue(&tissue)?;
    let body = Body::new(network, surface)?;
    // Rejects a body that cannot be stepped.
    SemiImplicitEuler::default().substeps(&body)?;
    let builder = LocalModelBuilder::new(&body, BuilderOptions::of(&body))?;
    let build_ms = ms_since(start);
    let thin_parts = lattice.thin_parts();
    let JoinedMesh { mesh: closed, piece_count, piece_share, .. } = joined;
    Ok(BuiltMesh {
        closed,
        piece_count,
        piece_share,
        cells,
        thin_parts,
        deviation_m,
        body,
        builder,
        build_ms,
    })
}

/// Longest extent of the vertices that triangles use, in units of the file.
fn longest_extent(part: &MeshPart) -> f64 {
    let used = || part.triangles.iter().flatten().map(|&vertex| part.vertices[vertex].map(f64::from));
    let extent = |axis: usize| {
        let (low, high) =
            used().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x[axis]), h.max(x[axis])));
        high - low
    };
    (0..3).map(extent).fold(0.0, f64::max)
}
