//! From the material parameters of a tissue to the springs of a lattice.

use crate::error::{check, check_positive};
use crate::{BodyError, Damping};
use glam::DVec3;
use palpate_laws::{ElasticLaw, LameParameters, Relaxation};

/// A homogeneous isotropic tissue, represented by a lattice of springs or by elements.
///
/// # From Young's modulus to springs
///
/// A network of central springs in which every node is a centre of symmetry has the stiffness tensor
///
/// ```text
/// C_ijkl = (1/V) Σ_e k_e ℓ_e² n_i n_j n_k n_l          (sum over the springs of one cell, n = axis of e)
/// ```
///
/// It is fully symmetric (Cauchy's relations). It is isotropic if C_1111 = 3 C_1122 = 3μ, so Poisson's ratio is
/// always 1/4, λ = μ and E = 5μ/2. A cell of sides a, b, c has seven families of springs: three along the sides,
/// three across the faces and one through the cell, with κ = k ℓ²/V each. The six conditions leave one parameter
/// free, κ_s of the family through the cell. It is chosen as κ_s = μ L⁴ / (12 max(a²b², b²c², c²a²)), L² = a² + b² +
/// c², which keeps every stiffness positive for cells close to a cube. For a cube of side h it gives k = (8/15) E h
/// along the sides, half of it across the faces and 3/16 of it through the cell.
///
/// A spring is shared by the one, two or four cells around it, each of which contributes its part. Springs and masses
/// on the surface are therefore smaller, and a block under uniform strain has exactly the given modulus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tissue {
    /// Young's modulus E, Pa. Soft organs have 1 kPa to 100 kPa.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio ν of elements, 0 to 0.49. A lattice of springs always has 1/4.
    pub poissons_ratio: f64,
    /// Density ρ, kg/m³.
    pub density_kg_per_m3: f64,
    /// Damping.
    pub damping: Damping,
    /// Elastic law of elements.
    pub law: ElasticLaw,
    /// Stress relaxation of elements. Young's modulus and Poisson's ratio are those of fast loading.
    pub relaxation: Relaxation,
}

impl Default for Tissue {
    /// [`Tissue::SOFT`].
    fn default() -> Self {
        Self::SOFT
    }
}

impl Tissue {
    /// A soft, nearly incompressible tissue with the density of water: 20 kPa, Poisson's ratio 0.45, 1000 kg/m³, damping ratio 0.5,
    /// neo-Hookean.
    pub const SOFT: Self = Self {
        youngs_modulus_pa: 20e3,
        poissons_ratio: 0.45,
        density_kg_per_m3: 1000.0,
        damping: Damping::Ratio(0.5),
        law: ElasticLaw::NeoHookean,
        relaxation: Relaxation::NONE,
    };

    /// Checks the parameters.
    pub(crate) fn validate(&self) -> Result<(), BodyError> {
        check_positive("density, kg/m3", self.density_kg_per_m3)?;
        check_positive("Young's modulus, Pa", self.youngs_modulus_pa)?;
        let (ratio, most) = (self.poissons_ratio, LameParameters::MAX_POISSONS_RATIO);
        check("Poisson's ratio", ratio, (0.0..=most).contains(&ratio), "0 to 0.49")?;
        self.damping.validate()?;
        Ok(self.relaxation.validate()?)
    }
}

/// Stiffness of the seven families of springs inside a large lattice, N/m (see [`Tissue`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellStiffness {
    /// Springs along x, y, z.
    pub side: [f64; 3],
    /// Springs across the face with normal x, y, z.
    pub face: [f64; 3],
    /// Springs through the cell.
    pub through: f64,
}

impl CellStiffness {
    /// Stiffness of an isotropic network with Young's modulus `youngs_modulus_pa` and cells of `cell_m`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] for a modulus or size that is not finite or not above zero, [`BodyError::CellShape`]
    /// for cells too far from cubes.
    pub fn isotropic(youngs_modulus_pa: f64, cell_m: DVec3) -> Result<Self, BodyError> {
        let mu = 0.4 * check_positive("Young's modulus, Pa", youngs_modulus_pa)?;
        check_positive("smallest side of a cell, m", cell_m.min_element())?;
        let s = cell_m * cell_m;
        let volume = cell_m.element_product();
        let through_length2 = s.element_sum();
        // Indexed by the normal of the face.
        let pair = DVec3::new(s.y * s.z, s.z * s.x, s.x * s.y);
        let kappa_through = mu * through_length2.powi(2) / (12.0 * pair.max_element());
        let kappa_over_l4 = kappa_through / through_length2.powi(2);
        let (mut side, mut face) = ([0.0; 3], [0.0; 3]);
        for n in 0..3 {
            let length2 = s[(n + 1) % 3] + s[(n + 2) % 3];
            let kappa = (mu - 4.0 * kappa_over_l4 * pair[n]) * length2.powi(2) / (2.0 * pair[n]);
            face[n] = kappa * volume / length2;
        }
        for n in 0..3 {
            let (p, q) = (s[(n + 1) % 3], s[(n + 2) % 3]);
            let kappa = 3.0 * mu - mu * (s[n] / p + s[n] / q) + 4.0 * kappa_over_l4 * s[n] * s[n];
            side[n] = kappa * volume / s[n];
        }
        let through = kappa_through * volume / through_length2;
        if side.iter().chain(&face).all(|&k| k > 0.0) && through > 0.0 {
            Ok(Self { side, face, through })
        } else {
            Err(BodyError::CellShape { x_m: cell_m.x, y_m: cell_m.y, z_m: cell_m.z })
        }
    }

    /// Stiffness of the spring in the direction of `step`.
    pub(crate) fn along(&self, step: [i32; 3]) -> f64 {
        match step.map(|s| s != 0) {
            [true, true, true] => self.through,
            [false, true, true] => self.face[0],
            [true, false, true] => self.face[1],
            [true, true, false] => self.face[2],
            [true, false, false] => self.side[0],
            [false, true, false] => self.side[1],
            [false, false, _] => self.side[2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Block, Network};
    use glam::DMat3;
    use palpate_laws::ForceLaw;

    /// Elastic energy of `network` under the infinitesimal affine displacement x → x + ε x.
    fn energy(network: &Network, strain: DMat3) -> f64 {
        let x = network.rest_m();
        network
            .links()
            .iter()
            .map(|link| {
                let ForceLaw::Linear { stiffness_n_per_m: k } = link.spring.law() else { unreachable!() };
                let d = x[link.b] - x[link.a];
                let extension = d.dot(strain * d) / d.length();
                0.5 * k * extension * extension
            })
            .sum()
    }

    #[test]
    fn uniform_strain_costs_exactly_the_energy_of_an_isotropic_solid() {
        let e = 20e3;
        let (lambda, mu) = (0.4 * e, 0.4 * e);
        for size in [DVec3::splat(0.1), DVec3::new(0.1, 0.11, 0.09)] {
            let block = Block::new([6, 6, 6], size).unwrap().allow_unconstrained();
            let network =
                block.tissue(&Tissue { youngs_modulus_pa: e, ..Tissue::default() }).unwrap().network;
            for strain in [
                DMat3::from_diagonal(DVec3::new(0.01, -0.0025, -0.0025)),
                DMat3::from_diagonal(DVec3::new(0.0, 0.02, 0.01)),
                DMat3::from_cols(
                    DVec3::new(0.0, 0.01, 0.0),
                    DVec3::new(0.01, 0.0, -0.003),
                    DVec3::new(0.0, -0.003, 0.0),
                ),
            ] {
                let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
                let square: f64 = strain.to_cols_array().iter().map(|v| v * v).sum();
                let density = 0.5 * lambda * trace * trace + mu * square;
                let expected = density * size.element_product();
                let got = energy(&network, strain);
                assert!((got / expected - 1.0).abs() < 1e-12, "{size}: {got} J, not {expected} J");
            }
        }
    }

    #[test]
    fn cube_has_the_closed_form_stiffness_and_the_block_its_mass() {
        let springs = CellStiffness::isotropic(20e3, DVec3::splat(0.02)).unwrap();
        let side = 8.0 / 15.0 * 20e3 * 0.02;
        for n in 0..3 {
            assert!((springs.side[n] / side - 1.0).abs() < 1e-14);
            assert!((springs.face[n] / side - 0.5).abs() < 1e-14);
        }
        assert!((springs.through / side - 3.0 / 16.0).abs() < 1e-14);
        let block = Block::new([4, 5, 6], DVec3::new(0.09, 0.12, 0.15)).unwrap().allow_unconstrained();
        let mass: f64 = block.tissue(&Tissue::default()).unwrap().network.mass_kg().iter().sum();
        assert!((mass / (1000.0 * 0.09 * 0.12 * 0.15) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn accepts_cells_up_to_1_2_times_longer_and_rejects_longer_ones() {
        for cell in [DVec3::new(1.2, 1.0, 1.0), DVec3::new(1.2, 1.2, 1.0), DVec3::new(1.0, 1.1, 1.2)] {
            assert!(CellStiffness::isotropic(1e3, 0.01 * cell).is_ok(), "{cell}");
        }
        let long = CellStiffness::isotropic(1e3, DVec3::new(0.02, 0.01, 0.01));
        assert_eq!(long, Err(BodyError::CellShape { x_m: 0.02, y_m: 0.01, z_m: 0.01 }));
    }

    #[test]
    fn rejects_invalid_tissue() {
        let block = Block::new([3, 3, 3], DVec3::splat(0.1)).unwrap();
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(block.tissue(&Tissue { youngs_modulus_pa: bad, ..Tissue::default() }).is_err());
            assert!(block.tissue(&Tissue { density_kg_per_m3: bad, ..Tissue::default() }).is_err());
        }
        assert!(block.tissue(&Tissue { damping: Damping::Ratio(-0.1), ..Tissue::default() }).is_err());
    }
}
