//! The tissue of a body, and inclusions of other tissue.

use super::region::BodyRegion;
use bevy::prelude::*;
use palpate_body::{Damping, ElasticLaw, Relaxation};

/// Elastic tissue of a body, by default [`Tissue::SOFT`]. Tissues with published parameters are [`Tissue::LIVER`] and the other
/// constants.
///
/// A change during contact keeps the shape and the motion of the body.
///
/// ```
/// # use bevy_palpate::prelude::*;
/// // A liver whose tumour is ten times stiffer.
/// let liver = Tissue::LIVER;
/// let tumour = Tissue { youngs_modulus_pa: 10.0 * liver.youngs_modulus_pa, ..liver };
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct Tissue {
    /// Young's modulus, Pa: 1 kPa to 100 kPa for soft organs.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio, 0 to 0.49. Soft tissue is nearly incompressible; close to 0.5 a model step needs more substeps. Springs have 1/4.
    pub poissons_ratio: f64,
    /// Density, kg/m³.
    pub density_kg_per_m3: f64,
    /// Damping.
    #[reflect(remote = crate::reflect::ReflectedDamping)]
    pub damping: Damping,
    /// Elastic law of elements.
    #[reflect(remote = crate::reflect::ReflectedElasticLaw)]
    pub law: ElasticLaw,
    /// Stress relaxation of elements. Young's modulus is that of fast loading.
    #[reflect(remote = crate::reflect::ReflectedRelaxation)]
    pub relaxation: Relaxation,
}

impl Default for Tissue {
    /// [`Tissue::SOFT`].
    fn default() -> Self {
        Self::SOFT
    }
}

impl Tissue {
    /// [`palpate_body::Tissue::SOFT`]: 20 kPa, Poisson's ratio 0.45, 1000 kg/m³, damping ratio 0.5, neo-Hookean.
    pub const SOFT: Self = Self::of(palpate_body::Tissue::SOFT);

    const fn of(tissue: palpate_body::Tissue) -> Self {
        let palpate_body::Tissue {
            youngs_modulus_pa,
            poissons_ratio,
            density_kg_per_m3,
            damping,
            law,
            relaxation,
        } = tissue;
        Self { youngs_modulus_pa, poissons_ratio, density_kg_per_m3, damping, law, relaxation }
    }
}

/// Declares the constants of published tissues.
macro_rules! published_tissues {
    ($($name:ident),*) => {
        /// Tissues with published parameters.
        impl Tissue {
            $(
                #[doc = concat!("[`palpate_body::Tissue::", stringify!($name), "`], which states the study, its method and its spread.")]
                pub const $name: Self = Self::of(palpate_body::Tissue::$name);
            )*
        }
    };
}

published_tissues!(LIVER, KIDNEY, SPLEEN, BRAIN, FAT, MUSCLE, SKIN, PROSTATE, BREAST);

impl From<palpate_body::Tissue> for Tissue {
    fn from(tissue: palpate_body::Tissue) -> Self {
        Self::of(tissue)
    }
}

impl From<Tissue> for palpate_body::Tissue {
    fn from(tissue: Tissue) -> Self {
        let Tissue { youngs_modulus_pa, poissons_ratio, density_kg_per_m3, damping, law, relaxation } =
            tissue;
        Self { youngs_modulus_pa, poissons_ratio, density_kg_per_m3, damping, law, relaxation }
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
