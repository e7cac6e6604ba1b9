//! What the user asks a body to be made of.

use super::region::BodyRegion;
use bevy::prelude::*;

/// What a body is made of: see [`palpate_body::Tissue`] for how it becomes springs. It may be changed while the
/// body is touched; the body keeps its shape and motion then.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct Tissue {
    /// Young's modulus, Pa. Soft organs: 1 kPa to 100 kPa. Poisson's ratio is 1/4.
    pub youngs_modulus_pa: f64,
    /// Density, kg/m³.
    pub density_kg_per_m3: f64,
    /// Damping of the springs; 0.5 is a tissue that hardly rings.
    pub damping_ratio: f64,
}

impl Default for Tissue {
    /// 20 kPa, 1000 kg/m³, 0.5.
    fn default() -> Self {
        let palpate_body::Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio } =
            palpate_body::Tissue::default();
        Self { youngs_modulus_pa, density_kg_per_m3, damping_ratio }
    }
}

impl From<Tissue> for palpate_body::Tissue {
    fn from(tissue: Tissue) -> Self {
        let Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio } = tissue;
        Self { youngs_modulus_pa, density_kg_per_m3, damping_ratio }
    }
}

/// Parts of a mesh body that are made of something else, a lump in an organ for instance; where they overlap the last counts.
/// Put it beside [`DeformableBody`](crate::DeformableBody); it may be changed while the body is touched. A block is one tissue
/// throughout.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct Inclusions(pub Vec<Inclusion>);

/// A part of a body that is made of something else.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub struct Inclusion {
    /// Where, in the body's own frame.
    pub region: BodyRegion,
    /// What it is made of.
    pub tissue: Tissue,
}
