//! Arguments of `palpate-lab mesh` and their allowed ranges.

use crate::app_tool::COUPLING;
use crate::error::{LabError, check, number, whole};
use clap::Args;
use palpate_body::{CellLattice, ClosedMesh, VirtualCoupling};
use palpate_files::MeshSelection;
use std::path::PathBuf;

/// A mesh file as a body: whether it is accepted, what was assumed about it, and how it feels
///
/// The primitives of the file's scene are joined, with the transforms of their nodes. The body is their inside, where their winding number
/// exceeds 1/2. Its lowest fifth is fixed; y is up. A hand taps it from above, with friction and virtual coupling of an app. The first
/// place is above the centre of mass, the others are far from it and from each other, where the surface faces up and is free. Each place is
/// tapped twice in a row, 1.5 s each, on a body at rest at first: a ball of 1/12 of the body's smallest side goes down to 1/10 of that side
/// below the surface. The hand feels local models at 1 kHz, built at 20 Hz in lock step. The error of a model step is the RMS of the
/// difference between that force and the full body's, over the RMS of the latter; steps with less than 1 % of the maximum force of their tap
/// do not count.
///
/// A rejected file ends the program with exit code 2. With `--json` the reason is printed as JSON, too.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab mesh liver.glb --json\n  palpate-lab mesh liver.obj --size-m 0.2 --cells 14\n  palpate-lab mesh organs.glb --list"
)]
pub(crate) struct Mesh {
    /// A .glb, .gltf, .obj, .stl or .ply file
    pub(super) file: PathBuf,
    /// List the primitives of the file, and end
    #[arg(long, help_heading = "File")]
    pub(super) list: bool,
    /// Use only the mesh with this index, from 0
    #[arg(value_parser = whole, allow_hyphen_values = true, long, value_name = "INDEX", conflicts_with = "node", help_heading = "File")]
    mesh: Option<usize>,
    /// Use only the nodes with this name
    #[arg(long, value_name = "NAME", help_heading = "File")]
    node: Option<String>,
    /// Length of a unit of the file, m: 0.001 for millimetres
    #[arg(value_parser = number, allow_hyphen_values = true, long, value_name = "M_PER_UNIT", default_value_t = 1.0, help_heading = "Body")]
    pub(super) scale: f64,
    /// Longest extent of the selected primitives, m: they are scaled to it
    #[arg(value_parser = number, allow_hyphen_values = true, long, value_name = "L", conflicts_with = "scale", help_heading = "Body")]
    pub(super) size_m: Option<f64>,
    /// Cells along the longest side [default: 10; more where parts are thin, and at most 400 nodes]
    #[arg(value_parser = whole, allow_hyphen_values = true, long, help_heading = "Body")]
    pub(super) cells: Option<usize>,
    /// Accept only a mesh that is closed and does not cross itself
    #[arg(long, help_heading = "Body")]
    pub(super) strict: bool,
    /// Thickness of parts with holes, m: they become sheets; without it their holes are closed
    #[arg(value_parser = number, allow_hyphen_values = true, long, value_name = "M", conflicts_with = "strict", help_heading = "Body")]
    pub(super) thickness_m: Option<f64>,
    /// Use only the piece with this index, from 0, in the order of descending volumes, instead of the largest
    #[arg(value_parser = whole, allow_hyphen_values = true, long, value_name = "INDEX", help_heading = "Body")]
    pub(super) piece: Option<usize>,
    /// Young's modulus, Pa
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 10e3, help_heading = "Body")]
    pub(super) youngs_pa: f64,
    /// Maximum force of the virtual coupling, N
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = COUPLING.max_force_n, help_heading = "Hand")]
    pub(super) max_force_n: f64,
    /// Places that are tapped
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 3, help_heading = "Hand")]
    pub(super) taps: usize,
}

/// Maximum number of places.
const MAX_TAPS: usize = 100;

impl Mesh {
    pub(super) fn validate(&self) -> Result<(), LabError> {
        check("--scale", self.scale, (1e-9..=1e9).contains(&self.scale), "1e-9 to 1e9")?;
        if let Some(size_m) = self.size_m {
            let (least, most) = (ClosedMesh::MIN_SIZE_M, ClosedMesh::MAX_SIZE_M);
            check("--size-m", size_m, (least..=most).contains(&size_m), format!("{least} to {most}"))?;
        }
        let most = CellLattice::MAX_CELLS_ALONG;
        let allowed = format!("1 to {most} along the longest side");
        if let Some(cells) = self.cells {
            check("--cells", cells as f64, (1..=most).contains(&cells), allowed)?;
        }
        if let Some(thickness_m) = self.thickness_m {
            check("--thickness-m", thickness_m, thickness_m > 0.0, "finite and above 0")?;
        }
        check("--youngs-pa", self.youngs_pa, (1.0..=1e9).contains(&self.youngs_pa), "1 to 1e9")?;
        let max_force_n = self.max_force_n;
        check("--max-force-n", max_force_n, (1e-3..=1e3).contains(&max_force_n), "0.001 to 1000")?;
        check("--taps", self.taps as f64, self.taps <= MAX_TAPS, format!("0 to {MAX_TAPS}"))
    }

    pub(super) fn selection(&self) -> MeshSelection {
        MeshSelection::new(self.mesh, self.node.as_deref())
    }

    /// Coupling between the hand and the tool.
    pub(super) fn coupling(&self) -> VirtualCoupling {
        VirtualCoupling { max_force_n: self.max_force_n, ..COUPLING }
    }

    /// The error of a file that is rejected because of `why`.
    pub(super) fn rejected(&self, why: String) -> LabError {
        LabError::Mesh { flag: "", path: self.file.clone(), why }
    }
}
