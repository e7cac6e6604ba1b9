//! The tissue of a body, and inclusions of other tissue.

use super::region::BodyRegion;
use bevy::prelude::*;

/// Elastic tissue of a body. [`palpate_body::Tissue`] derives the springs from it.
///
/// A change during contact keeps the shape and the motion of the body.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct Tissue {
    /// Young's modulus, Pa: 1 kPa to 100 kPa for soft organs. Poisson's ratio is 1/4.
    pub youngs_modulus_pa: f64,
    /// Density, kg/m³.
    pub density_kg_per_m3: f64,
    /// Damping ratio of the springs; 0.5 is a tissue that hardly oscillates.
    pub damping_ratio: f64,
}

impl Default for Tissue {
    /// 20 kPa, 1000 kg/m³, 0.5.
    fn default() -> Self {
        let palpate_body::Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio, .. } =
            palpate_body::Tissue::default();
        Self { youngs_modulus_pa, density_kg_per_m3, damping_ratio }
    }
}

impl From<Tissue> for palpate_body::Tissue {
    fn from(tissue: Tissue) -> Self {
        let Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio } = tissue;
        Self { youngs_modulus_pa, density_kg_per_m3, damping_ratio, ..Self::default() }
    }
}

/// Regions of a body with other tissue, for example a lump in an organ. Where regions overlap the last one applies.
///
/// Insert the component on the entity with [`DeformableBody`](crate::DeformableBody); it may change or be removed during contact. A cell
/// that lies partly in a region takes the mean over 4 × 4 × 4 places in it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct Inclusions(pub Vec<Inclusion>);

/// A region of a body with other tissue.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub struct Inclusion {
    /// Region of the inclusion, in the body's own frame.
    pub region: BodyRegion,
    /// Tissue of the inclusion.
    pub tissue: Tissue,
}
