//! Tissues with published parameters.

use crate::{Damping, Tissue};
use palpate_laws::{ElasticLaw, Relaxation};

/// Poisson's ratio of all of them.
const POISSONS_RATIO: f64 = 0.45;

/// Young's modulus, Pa, of a shear modulus.
const fn from_shear(modulus_pa: f64) -> f64 {
    2.0 * (1.0 + POISSONS_RATIO) * modulus_pa
}

const fn tissue(youngs_modulus_pa: f64, density_kg_per_m3: f64) -> Tissue {
    Tissue {
        youngs_modulus_pa,
        poissons_ratio: POISSONS_RATIO,
        density_kg_per_m3,
        damping: Damping::Ratio(0.5),
        law: ElasticLaw::NeoHookean,
        relaxation: Relaxation::NONE,
    }
}

/// # Published tissues
///
/// Studies differ severalfold, with the method, the speed, the strain and the specimen. Each constant is one study, whose spread is stated. Elastography at
/// high frequencies finds stiffer tissue than a slow finger. Where a study has no damping, the damping ratio is that of [`Tissue::SOFT`].
///
/// All are neo-Hookean with Poisson's ratio 0.45; the studies assume, or find, incompressible tissue. An indentation needs 6 % less force than at
/// 0.5, which is far less than the spread. Where a study states a shear modulus μ, it is kept: E = 2 (1 + ν) μ. Densities are those of P. A. Hasgall et al.,
/// IT'IS database for thermal and electromagnetic parameters of biological tissues, version 4.0 (2018).
impl Tissue {
    /// Liver: μ = 1160 Pa at low frequency (standard deviation 280 Pa, 8 volunteers), and the loss factor 0.2 at 5 Hz of the measured viscosity.
    ///
    /// In vivo, magnetic resonance elastography at several frequencies, Zener model: P. Asbach et al., Magnetic Resonance in Medicine 60 (2008)
    /// 373–379. A spring of 1970 Pa with a dashpot of 7.3 Pa s acts in parallel; below 10 Hz it is a dashpot of 7.3 Pa s.
    pub const LIVER: Self = Self {
        damping: Damping::LossFactor { loss_factor: 0.2, frequency_hz: 5.0 },
        ..tissue(from_shear(1160.0), 1079.0)
    };

    /// Kidney: shear waves of 1.93 m/s (standard deviation 0.22 m/s, 9 volunteers), so μ = ρ c² = 3970 Pa.
    ///
    /// In vivo, magnetic resonance elastography at several frequencies: F. Dittmann et al., Magnetic Resonance in Medicine 78 (2017) 976–983.
    pub const KIDNEY: Self = tissue(from_shear(1066.0 * 1.93 * 1.93), 1066.0);

    /// Spleen: shear waves of 2.20 m/s (standard deviation 0.10 m/s, 9 volunteers), so μ = ρ c² = 5270 Pa.
    ///
    /// Method and study as [`Tissue::KIDNEY`].
    pub const SPLEEN: Self = tissue(from_shear(1089.0 * 2.20 * 2.20), 1089.0);

    /// Brain: μ = 842 Pa of fast loading, of which 45 % relaxes with 0.5 s and 36.5 % with 50 s.
    ///
    /// Swine, in vitro, tension and compression to large strains: K. Miller and K. Chinzei, Journal of Biomechanics 35 (2002) 483–490. Its Ogden
    /// law is stiffer in compression than in tension, which the neo-Hookean one is not. Another study of pig brain finds 900 Pa with a
    /// standard deviation of 312 Pa (V. Balbi et al., Soft Matter 15 (2019)).
    pub const BRAIN: Self = Self {
        relaxation: Relaxation { shares: [0.450, 0.365, 0.0], times_s: [0.50, 50.0, 0.0] },
        ..tissue(from_shear(842.0), 1045.0)
    };

    /// Fat: μ = 530 Pa (standard deviation 310 Pa), of which 39 % (3 %) relaxes with 700 s (255 s).
    ///
    /// Porcine, indentation in a magnetic resonance scanner and inverse finite elements: A. M. Sims et al., Biomechanics and Modeling in
    /// Mechanobiology 9 (2010) 703–711. The modulus is taken as that of fast loading.
    pub const FAT: Self = Self {
        relaxation: Relaxation { shares: [0.39, 0.0, 0.0], times_s: [700.0, 0.0, 0.0] },
        ..tissue(from_shear(530.0), 911.0)
    };

    /// Skeletal muscle at rest: μ = 3910 Pa (rectus femoris, standard deviation 160 Pa; 29 volunteers, other muscles of the thigh up to 6150 Pa).
    ///
    /// In vivo, magnetic resonance elastography at 90 Hz: G. Chakouch, F. Charleux and S. F. Bensamoun, PLoS ONE 10 (2015) e0138873. Muscle is
    /// anisotropic; the constant is isotropic. The loss factor 0.42 between 25 and 62.5 Hz, here at 40 Hz, is that of D. Klatt et al., Physics in
    /// Medicine and Biology 55 (2010) 6445–6459.
    pub const MUSCLE: Self = Self {
        damping: Damping::LossFactor { loss_factor: 0.42, frequency_hz: 40.0 },
        ..tissue(from_shear(3910.0), 1090.0)
    };

    /// Skin with what is below it: E = 6.25 kPa, the middle of 4.5 to 8 kPa.
    ///
    /// In vivo, indentation of the forearm with a ball: C. Pailler-Mattei, S. Bec and H. Zahouani, Medical Engineering & Physics 30 (2008) 599–606. Shear
    /// waves in the skin alone find two to three times as much.
    pub const SKIN: Self = tissue(6250.0, 1109.0);

    /// Prostate: E = 7.1 kPa at 5 Hz with the loss factor 0.35.
    ///
    /// Human, ex vivo, stress relaxation, of which the fractional Kelvin–Voigt model E* = 3.61 kPa (iω · 1 s)^0.215 is evaluated at 5 Hz: K. Hoyt et al., Cancer
    /// Biomarkers 4 (2008) 213–225. The same group finds 15.9 kPa at 150 Hz with a standard deviation of 5.9 kPa (8 specimens), and 40.4 kPa in
    /// cancer: M. Zhang et al., Ultrasound in Medicine and Biology 34 (2008) 1033–1042.
    pub const PROSTATE: Self = Self {
        damping: Damping::LossFactor { loss_factor: 0.35, frequency_hz: 5.0 },
        ..tissue(7140.0, 1045.0)
    };

    /// Breast, fibroglandular tissue: E = 3.24 kPa (standard deviation 0.61 kPa, 26 specimens). Breast fat has nearly the same, 3.25 kPa (0.91 kPa,
    /// 71 specimens).
    ///
    /// Human, ex vivo, slow indentation and inverse finite elements: A. Samani, J. Zubovits and D. Plewes, Physics in Medicine and Biology 52 (2007)
    /// 1565–1576.
    pub const BREAST: Self = tissue(3240.0, 1041.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_valid_and_have_the_published_moduli() {
        for (tissue, modulus_pa) in [
            (Tissue::LIVER, 3364.0),
            (Tissue::KIDNEY, 11_515.0),
            (Tissue::SPLEEN, 15_285.0),
            (Tissue::BRAIN, 2442.0),
            (Tissue::FAT, 1537.0),
            (Tissue::MUSCLE, 11_339.0),
            (Tissue::SKIN, 6250.0),
            (Tissue::PROSTATE, 7140.0),
            (Tissue::BREAST, 3240.0),
        ] {
            assert_eq!(tissue.validate(), Ok(()));
            assert!((tissue.youngs_modulus_pa - modulus_pa).abs() < 1.0, "{tissue:?}");
        }
        // The storage modulus and the loss factor of the fractional model at 5 Hz.
        let (modulus_pa, turn) =
            (3610.0 * (std::f64::consts::TAU * 5.0).powf(0.215), 0.215 * std::f64::consts::FRAC_PI_2);
        assert!((modulus_pa * turn.cos() / Tissue::PROSTATE.youngs_modulus_pa - 1.0).abs() < 0.01);
        assert!((turn.tan() - 0.35).abs() < 0.01);
    }
}
