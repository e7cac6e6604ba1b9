//! The tissue of a cell.

use crate::damping::DampingCoefficients;
use crate::{BodyError, Tissue};
use palpate_laws::{ElasticLaw, ElementMaterial, LameParameters, Relaxation};

/// Tissue of a cell, which may be a mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellTissue {
    pub(crate) youngs_modulus_pa: f64,
    pub(crate) poissons_ratio: f64,
    pub(crate) density_kg_per_m3: f64,
    pub(crate) damping: DampingCoefficients,
    pub(crate) law: ElasticLaw,
    pub(crate) relaxation: Relaxation,
}

/// β of elements by the size, the density and Young's modulus, for a damping ratio of 1: √(15/8).
const ELEMENT_DAMPING: f64 = 1.369_306_393_762_915_4;

impl CellTissue {
    /// The tissue of a cell of one tissue.
    pub(crate) fn of(tissue: &Tissue) -> Self {
        let Tissue { youngs_modulus_pa, poissons_ratio, density_kg_per_m3, damping, law, relaxation } =
            *tissue;
        let damping = damping.coefficients();
        Self { youngs_modulus_pa, poissons_ratio, density_kg_per_m3, damping, law, relaxation }
    }

    /// Material of an element of `volume_m3`, of which the share `fill` is filled.
    pub(crate) fn element_material(&self, volume_m3: f64, fill: f64) -> Result<ElementMaterial, BodyError> {
        let parameters_pa = LameParameters::new(self.youngs_modulus_pa, self.poissons_ratio)?;
        let DampingCoefficients { ratio, shear_s, stiffness_s, .. } = self.damping;
        let size_over_speed_s = volume_m3.cbrt() * (self.density_kg_per_m3 / self.youngs_modulus_pa).sqrt();
        let shear_s = shear_s + ELEMENT_DAMPING * ratio * size_over_speed_s;
        let parameters_j = parameters_pa.scaled(volume_m3 * fill);
        let LameParameters { mu, lambda } = parameters_j;
        let viscous_js = LameParameters {
            mu: (shear_s + stiffness_s) * mu,
            lambda: shear_s * lambda.min(mu) + stiffness_s * lambda,
        };
        Ok(ElementMaterial { law: self.law, parameters_j, viscous_js, relaxation: self.relaxation })
    }

    /// Coefficient of the drag on a part of `mass_kg`, N s/m.
    pub(crate) fn drag_ns_per_m(&self, mass_kg: f64) -> f64 {
        self.damping.mass_per_s * mass_kg
    }
}
