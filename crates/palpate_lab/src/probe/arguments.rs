//! Arguments of `palpate-lab probe` and their allowed ranges.

use super::options::{self, BuiltinBody, CouplingKind, IntegratorKind, Lump, Nodes, Place, Scan, Tool};
use crate::element_options::{ElementOption, ElementOptions};
use crate::error::{LabError, check, number, whole};
use clap::Args;
use palpate_body::CellLattice;
use std::path::PathBuf;

/// The force on a hand that presses a tool into a body, from the full body and from the loop
///
/// The hand starts above the body, moves down at a constant speed, stops at its depth and holds until the body has settled.
/// y is up; x and z are measured from the centre of the top; the lowest layer of the body is fixed. Depth is measured from the
/// height at which the tool first touches the undeformed surface. The loop uses local models built at 20 Hz, in lock
/// step. Without friction and with a rigid coupling the force can be compared with Hertz's; an app has by default
/// --friction 0.3 --coupling virtual.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab probe --at 4.3,1 --depth-mm 5\n  palpate-lab probe --nodes 11,11,11 --scan -20:20:1 --out results\n  \
                  palpate-lab probe --mesh liver.glb --cells 12 --lump 0,-12,0:6:200000 --scan -20:20:2 --json"
)]
pub(crate) struct Probe {
    /// Built-in body
    #[arg(long, value_enum, default_value = "block", conflicts_with = "mesh", help_heading = "Body")]
    pub(super) body: BuiltinBody,
    /// Nodes of the block along x, y and z
    #[arg(value_parser = options::nodes, allow_hyphen_values = true, long, default_value = "6,6,6", value_name = "X,Y,Z", conflicts_with = "mesh", help_heading = "Body")]
    pub(super) nodes: Nodes,
    /// Edge of the block along x, m; its cells are cubes
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.1, conflicts_with = "mesh", help_heading = "Body")]
    pub(super) edge_m: f64,
    /// Body from a closed mesh: a .glb, .gltf, .obj, .stl or .ply file
    #[arg(long, value_name = "FILE", help_heading = "Body")]
    pub(super) mesh: Option<PathBuf>,
    /// Cells along the longest side of the mesh
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 10, requires = "mesh", help_heading = "Body")]
    pub(super) cells: usize,
    /// Length of a unit of the mesh file, m: 0.001 for millimetres
    #[arg(value_parser = number, allow_hyphen_values = true, long, value_name = "M_PER_UNIT", default_value_t = 1.0, requires = "mesh", help_heading = "Body")]
    pub(super) scale: f64,
    /// Young's modulus, Pa
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 20e3, help_heading = "Body")]
    pub(super) youngs_pa: f64,
    /// Density, kg/m3
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1000.0, help_heading = "Body")]
    pub(super) density: f64,
    /// Damping ratio of each spring, or of the elements
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.5, help_heading = "Body")]
    pub(super) damping: f64,
    #[command(flatten)]
    pub(super) elements: ElementOptions,
    /// Sphere of other tissue: centre (y from the top, negative inside), radius, Young's modulus
    #[arg(value_parser = options::lump, allow_hyphen_values = true, long, value_name = "X_MM,Y_MM,Z_MM:RADIUS_MM:YOUNGS_PA", help_heading = "Body")]
    pub(super) lump: Option<Lump>,
    /// Shape and radius, m; a punch is flat and presses along -y
    #[arg(value_parser = options::tool, allow_hyphen_values = true, long, default_value = "sphere:0.005", value_name = "sphere:RADIUS_M|punch:RADIUS_M", help_heading = "Tool")]
    pub(super) tool: Tool,
    /// Coefficient of friction between tool and body
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.0, help_heading = "Tool")]
    pub(super) friction: f64,
    /// Connection between hand and tool
    #[arg(long, value_enum, default_value = "rigid", help_heading = "Tool")]
    pub(super) coupling: CouplingKind,
    /// Place of a press, mm from the centre of the top; can be repeated [default: 0,0 without --scan]
    #[arg(value_parser = options::place, allow_hyphen_values = true, long, value_name = "X_MM,Z_MM", help_heading = "Hand")]
    pub(super) at: Vec<Place>,
    /// Presses along x, mm
    #[arg(value_parser = options::scan, allow_hyphen_values = true, long, value_name = "FROM:TO:STEP", help_heading = "Hand")]
    pub(super) scan: Option<Scan>,
    /// z of the scan, mm
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.0, requires = "scan", help_heading = "Hand")]
    pub(super) z_mm: f64,
    /// Depth of the hand, mm
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 2.0, help_heading = "Hand")]
    pub(super) depth_mm: f64,
    /// Speed of approach, m/s
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.1, help_heading = "Hand")]
    pub(super) speed_m_per_s: f64,
    /// Longest time at depth, s; a press ends earlier when the body has settled
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 5.0, help_heading = "Hand")]
    pub(super) hold_s: f64,
    /// Turn body and hand about y, degrees; forces are reported unturned
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.0, help_heading = "Hand")]
    pub(super) turn_deg: f64,
    /// Integrator of body and local model
    #[arg(long, value_enum, default_value = "auto")]
    pub(super) integrator: IntegratorKind,
}

/// Maximum number of presses.
const MAX_PRESSES: usize = 1000;

impl Probe {
    /// Number of presses that are not part of the scan; they come first.
    pub(super) fn at_count(&self) -> usize {
        if self.at.is_empty() && self.scan.is_none() { 1 } else { self.at.len() }
    }

    /// All places with the flag that named them.
    pub(super) fn places(&self) -> Vec<(Place, &'static str)> {
        let default = (self.at_count() > self.at.len()).then_some(Place { x_mm: 0.0, z_mm: 0.0 });
        let at = self.at.iter().copied().chain(default).map(|place| (place, "--at"));
        let scan = self.scan.iter().flat_map(|scan| scan.places(self.z_mm)).map(|place| (place, "--scan"));
        at.chain(scan).collect()
    }

    pub(super) fn validate(&self) -> Result<(), LabError> {
        for nodes in self.nodes.0 {
            check("--nodes", nodes as f64, (2..=24).contains(&nodes), "2 to 24 along each axis")?;
        }
        check("--edge-m", self.edge_m, (1e-3..=10.0).contains(&self.edge_m), "0.001 to 10")?;
        let most = CellLattice::MAX_CELLS_ALONG;
        let allowed = format!("1 to {most} along the longest side");
        check("--cells", self.cells as f64, (1..=most).contains(&self.cells), allowed)?;
        check("--scale", self.scale, (1e-9..=1e9).contains(&self.scale), "1e-9 to 1e9")?;
        check("--youngs-pa", self.youngs_pa, (1.0..=1e9).contains(&self.youngs_pa), "1 to 1e9")?;
        check("--density", self.density, (1.0..=1e5).contains(&self.density), "1 to 100000")?;
        self.elements.validate()?;
        if self.mesh.is_some() && self.elements.element == ElementOption::Tet {
            return Err(LabError::TetrahedraInMesh);
        }
        check("--damping", self.damping, (0.0..=100.0).contains(&self.damping), "0 to 100")?;
        self.lump.map_or(Ok(()), Lump::validate)?;
        let radius = self.tool.radius_m();
        check("radius of --tool, m", radius, (1e-5..=1.0).contains(&radius), "1e-5 to 1")?;
        check("--friction", self.friction, (0.0..=100.0).contains(&self.friction), "0 to 100")?;
        for value in self.at.iter().flat_map(|place| [place.x_mm, place.z_mm]) {
            check("--at", value, value.abs() <= 1e4, "-10000 to 10000 mm")?;
        }
        if let Some(scan) = self.scan {
            check("start of --scan", scan.from_mm, scan.from_mm.abs() <= 1e4, "-10000 to 10000 mm")?;
            let allowed = format!("at least its start, {}, and at most 10000 mm", scan.from_mm);
            check("end of --scan", scan.to_mm, (scan.from_mm..=1e4).contains(&scan.to_mm), allowed)?;
            check("step of --scan", scan.step_mm, scan.step_mm > 0.0, "finite and above 0 mm")?;
        }
        check("--z-mm", self.z_mm, self.z_mm.abs() <= 1e4, "-10000 to 10000")?;
        let count = self.scan.map_or(0, Scan::count).saturating_add(self.at.len());
        let allowed = format!("at most {MAX_PRESSES}: take fewer --at or a longer step of --scan");
        check("number of presses", count as f64, count <= MAX_PRESSES, allowed)?;
        let depth = self.depth_mm;
        check("--depth-mm", depth, depth > 0.0 && depth <= 1000.0, "above 0 and at most 1000")?;
        let speed = self.speed_m_per_s;
        check("--speed-m-per-s", speed, (1e-3..=15.0).contains(&speed), "0.001 to 15")?;
        check("--hold-s", self.hold_s, (0.1..=60.0).contains(&self.hold_s), "0.1 to 60")?;
        check("--turn-deg", self.turn_deg, self.turn_deg.abs() <= 360.0, "-360 to 360")
    }
}
