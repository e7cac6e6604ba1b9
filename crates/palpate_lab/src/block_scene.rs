//! The scene that several commands share: a block with its bottom fixed, a tool at the middle of its top, and a movement.

use crate::element_options::BlockMaterial;
use crate::error::LabError;
use clap::ValueEnum;
use glam::DVec3;
use palpate_body::{Block, Body, Damping, Face, Tissue, ToolContact, ToolShape, UniformLattice};
use std::f64::consts::TAU;

/// Coefficient of friction of a tool that touches.
const FRICTION: f64 = 0.3;

/// A cube of equal springs, or of elements, with its bottom fixed.
#[derive(Clone, Copy, Debug)]
pub struct BlockScene {
    /// Number of nodes along x, y and z.
    pub nodes: [usize; 3],
    /// Length of each edge, m.
    pub edge_m: f64,
    /// Mass of the block, shared equally by its nodes, kg.
    pub mass_kg: f64,
    /// Stiffness of each spring, N/m. Elements have the Young's modulus of the springs.
    pub stiffness_n_per_m: f64,
    /// What the block consists of.
    pub material: BlockMaterial,
    /// Damping of each damper over the root of stiffness times mass of a node.
    pub damping_ratio: f64,
    /// Contact between the tool and the block.
    pub contact: ContactKind,
}

/// Contact between a tool and a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ContactKind {
    /// The tool holds the node, pushes and pulls
    Held,
    /// The tool touches the surface, as a sphere of a tenth of the edge, and pushes only
    Touch,
}

impl Default for BlockScene {
    /// The block of the seed paper's section 6: 6 x 6 x 6 nodes, held.
    fn default() -> Self {
        Self {
            nodes: [6; 3],
            edge_m: 0.1,
            mass_kg: 1.0,
            stiffness_n_per_m: 100.0,
            damping_ratio: 0.7,
            material: BlockMaterial::Springs,
            contact: ContactKind::Held,
        }
    }
}

impl BlockScene {
    /// Body at rest, tool at the middle of its top, and start of the tool's movement, m.
    ///
    /// # Errors
    /// [`LabError::Body`] when a parameter is out of range.
    pub fn build(&self) -> Result<(Body, ToolContact, DVec3), LabError> {
        let lattice = UniformLattice {
            stiffness_n_per_m: self.stiffness_n_per_m,
            damping_ratio: self.damping_ratio,
            mass_kg: self.mass_kg,
        };
        let [x, y, z] = self.nodes;
        let block = Block::new(self.nodes, DVec3::splat(self.edge_m))?.fix(Face::NegZ);
        let node = block.node([x / 2, y / 2, z - 1]);
        let springs = block.uniform(&lattice)?;
        let youngs_modulus_pa = springs.network.grid().map_or(0.0, |grid| grid.youngs_modulus_pa()[node]);
        let tissue = |law, poissons_ratio| Tissue {
            youngs_modulus_pa,
            poissons_ratio,
            density_kg_per_m3: self.mass_kg / self.edge_m.powi(3),
            damping: Damping::Ratio(self.damping_ratio),
            law,
            ..Tissue::default()
        };
        let block = match self.material {
            BlockMaterial::Springs => springs,
            BlockMaterial::Hexahedra { law, poissons_ratio } => {
                block.elements(&tissue(law, poissons_ratio))?
            }
            BlockMaterial::Tetrahedra { law, poissons_ratio } => {
                block.tetrahedra(&tissue(law, poissons_ratio))?
            }
        };
        let body = Body::new(block.network, block.surface)?;
        let at = body.positions_m()[node];
        let (contact, start) = match self.contact {
            ContactKind::Held => (ToolContact::hold(&body, node, at)?, at),
            ContactKind::Touch => {
                let radius_m = 0.1 * self.edge_m;
                (ToolContact::touch(ToolShape::Sphere { radius_m }, FRICTION)?, at + radius_m * DVec3::Z)
            }
        };
        Ok((body, contact, start))
    }
}

/// Whole milliseconds in a period of the full model, at `rate_hz` of at most 1000.
pub fn period_ticks(rate_hz: f64) -> usize {
    // A thousandth more than the quotient: rounding must not cut 1000/1000 to zero.
    (1e3 / rate_hz + 1e-3) as usize
}

/// Built-in movement: offset of the tool from its start at `t_s`, m. It presses 10 mm deep and shears 3 mm, with faster movements on
/// top.
pub fn builtin_offset_m(t_s: f64) -> DVec3 {
    let t = t_s;
    let slow = 0.010 * (1.0 - (TAU * t).cos()) / 2.0;
    let late = if t > 0.3 { 0.002 * (TAU * 3.3 * t).sin() } else { 0.0 };
    DVec3::new(0.003 * (TAU * 1.7 * t).sin(), 0.0, -(slow + 0.0008 * (TAU * 9.0 * t).sin() + late))
}
