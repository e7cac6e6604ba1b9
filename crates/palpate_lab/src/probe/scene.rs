//! The body and the tool of `palpate-lab probe`.

use super::arguments::Probe;
use super::options::{CouplingKind, Lump, Tool};
use crate::app_tool::COUPLING;
use crate::element_options::ElementOption;
use crate::error::LabError;
use crate::mesh_input;
use crate::top::Top;
use glam::{DQuat, DVec3};
use palpate_body::{
    Block, Body, BodyError, CellLattice, CellSize, ClosedMesh, Damping, Face, MeshError, MeshPart, Network,
    Region, Surface, Tissue, ToolContact, ToolShape,
};
use palpate_files::{MeshFile, MeshSelection};
use std::path::Path;

/// A body at rest with its lowest layer fixed, and the tool that presses it.
pub(super) struct Scene {
    /// Turned by `turn`.
    pub(super) body: Body,
    pub(super) contact: ToolContact,
    /// Rotation of body and hand about y.
    pub(super) turn: DQuat,
    /// The surface before the rotation.
    pub(super) top: Top,
}

impl Scene {
    pub(super) fn of(probe: &Probe) -> Result<Self, LabError> {
        let tissue = Tissue {
            youngs_modulus_pa: probe.youngs_pa,
            density_kg_per_m3: probe.density,
            poissons_ratio: probe.elements.poissons_ratio(),
            damping: Damping::Ratio(probe.damping),
            law: probe.elements.law.into(),
            ..Tissue::default()
        };
        let (network, surface) = match &probe.mesh {
            Some(path) => mesh(probe, path, tissue)?,
            None => block(probe, tissue)?,
        };
        let turn = DQuat::from_rotation_y(probe.turn_deg.to_radians());
        let turned = network.clone().placed(turn, DVec3::ZERO)?;
        let top = Top::of(&Body::new(network, surface.clone())?);
        Ok(Self { body: Body::new(turned, surface)?, contact: contact(probe)?, turn, top })
    }
}

fn contact(probe: &Probe) -> Result<ToolContact, LabError> {
    let shape = match probe.tool {
        Tool::Sphere { radius_m } => ToolShape::Sphere { radius_m },
        Tool::Punch { radius_m } => ToolShape::FlatPunch { radius_m, axis: -DVec3::Y },
    };
    let contact = ToolContact::touch(shape, probe.friction)?;
    Ok(match probe.coupling {
        CouplingKind::Rigid => contact,
        CouplingKind::Virtual => contact.with_coupling(COUPLING)?,
    })
}

/// Unturned network and surface of a block of cubic cells, its lowest face fixed, the centre of its top at (0, edge / 2, 0).
fn block(probe: &Probe, tissue: Tissue) -> Result<(Network, Surface), LabError> {
    let nodes = probe.nodes.0;
    let cell_m = probe.edge_m / (nodes[0] - 1) as f64;
    let size_m = cell_m * DVec3::from_array(nodes.map(|n| (n - 1) as f64));
    let block = Block::new(nodes, size_m)?.fix(Face::NegY);
    let made = match probe.elements.element {
        ElementOption::Spring => block.tissue(&tissue)?,
        ElementOption::Hex => block.elements(&tissue)?,
        ElementOption::Tet => block.tetrahedra(&tissue)?,
    };
    let mut network = made.network;
    if let Some(lump) = probe.lump {
        let inside = lump.region(0.5 * size_m.y * DVec3::Y);
        let middle = |link: &palpate_body::Link| 0.5 * (network.rest_m()[link.a] + network.rest_m()[link.b]);
        let center = |nodes: &[usize]| {
            nodes.iter().map(|node| network.rest_m()[*node]).sum::<DVec3>() / nodes.len() as f64
        };
        let of_links = network.links().iter().map(middle);
        let of_hexahedra = network.hexahedra().iter().map(|element| center(&element.nodes));
        let of_tetrahedra = network.tetrahedra().iter().map(|nodes| center(&nodes));
        if !of_links.chain(of_hexahedra).chain(of_tetrahedra).any(|at| inside.contains(at)) {
            return Err(lump.empty(cell_m));
        }
        // Dampers are proportional to the root of the stiffness.
        let factor = lump.youngs_pa / tissue.youngs_modulus_pa;
        network = network.edit().region(|x| inside.contains(x), factor, factor.sqrt(), 1.0).build()?;
    }
    Ok((network, made.surface))
}

/// Unturned network and surface of cells fitted to the mesh of a file, the lowest layer of nodes fixed.
fn mesh(probe: &Probe, path: &Path, tissue: Tissue) -> Result<(Network, Surface), LabError> {
    let failed = |error| rejected(path, &error);
    let file = MeshFile::read(path).and_then(|file| mesh_input::join(&file, &MeshSelection::All));
    let MeshPart { vertices, triangles, .. } = file.map_err(|error| unusable(path, &error))?;
    let mesh = ClosedMesh::from_single(&vertices, probe.scale, triangles);
    let mesh = mesh.map_err(|error| failed(error.into()))?;
    let lattice =
        CellLattice::fit(&mesh, CellSize::Along(probe.cells)).map_err(|error| failed(error.into()))?;
    let cell_m = lattice.cell_m();
    let [low, high] = mesh.bounds_m();
    let (lattice, regions) = match probe.lump {
        Some(lump) => {
            let top = DVec3 { y: high.y, ..0.5 * (low + high) };
            let inner = Tissue { youngs_modulus_pa: lump.youngs_pa, ..tissue };
            (lattice.region(lump.region(top), inner), 1)
        }
        None => (lattice, 0),
    };
    // The lowest layer of nodes lies up to half a cell from the lowest point of the mesh. Nearly empty cells are left out, and then
    // the layer above is the lowest.
    let fixed = |layers: f64| {
        let plane = Region::HalfSpace { point_m: low + layers * cell_m * DVec3::Y, outward: DVec3::Y };
        let lattice = lattice.clone().fix(plane);
        match probe.elements.element {
            ElementOption::Spring => lattice.tissue(&tissue),
            ElementOption::Hex | ElementOption::Tet => lattice.elements(&tissue),
        }
    };
    let is_empty = |error: &BodyError| matches!(error, BodyError::Mesh(MeshError::EmptyRegion { what, .. }) if what.contains("fixed"));
    let made = match fixed(0.5) {
        Err(error) if is_empty(&error) => fixed(1.5),
        made => made,
    };
    match (made, probe.lump) {
        (Err(BodyError::Mesh(MeshError::EmptyRegion { .. })), Some(lump)) if regions > 0 => {
            Err(lump.empty(cell_m))
        }
        (made, _) => {
            let made = made.map_err(failed)?;
            Ok((made.network, made.surface))
        }
    }
}

/// Error for a mesh that cannot become a body, with the flag to change where there is one.
fn rejected(path: &Path, error: &BodyError) -> LabError {
    let flag = match error {
        BodyError::Mesh(
            MeshError::TooManyNodes { .. } | MeshError::CoarseGrid { .. } | MeshError::Pieces { .. },
        ) => "; change --cells",
        _ => "",
    };
    unusable(path, &format!("{error}{flag}"))
}

fn unusable(path: &Path, why: &impl ToString) -> LabError {
    LabError::Mesh { flag: "--mesh ", path: path.to_owned(), why: why.to_string() }
}

impl Lump {
    /// Region of the lump in a body with the centre of its top at `top_m`.
    fn region(self, top_m: DVec3) -> Region {
        Region::Sphere {
            center_m: top_m + 1e-3 * DVec3::from_array(self.center_mm),
            radius_m: 1e-3 * self.radius_mm,
        }
    }

    fn empty(self, cell_m: f64) -> LabError {
        LabError::EmptyLump { radius_mm: self.radius_mm, cell_mm: 1e3 * cell_m }
    }
}
