//! Options of `palpate-lab continuum`, and their defaults.

use crate::element_options::{ElementOption, LawOption};
use crate::error::{LabError, check, number, whole};
use clap::{Args, ValueEnum};
use glam::DVec3;
use palpate_body::Tissue;

/// Force, deflection or frequency of a standard case of elasticity
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab continuum --case bonded-cube --poisson 0.45 --cells 16 --json\n  \
                  palpate-lab continuum --case cantilever --law neo-hookean --load 0.054 --cells 16\n  \
                  palpate-lab continuum --case modes --element hex"
)]
pub(crate) struct Continuum {
    /// What is computed
    #[arg(long, value_enum)]
    pub(super) case: Case,
    /// Elastic law of the elements
    #[arg(long, value_enum, default_value = "corotational")]
    pub(super) law: LawOption,
    /// Poisson's ratio, 0 to 0.49; springs have 0.25
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.25)]
    pub(super) poisson: f64,
    /// Young's modulus, Pa
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 20e3)]
    pub(super) youngs_pa: f64,
    /// Edges of the body along x, y and z, m, or one number for a cube; by default those of the case
    #[arg(value_parser = size, allow_hyphen_values = true, long, value_name = "X,Y,Z")]
    size: Option<Size>,
    /// Number of cells along the longest edge
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 16)]
    pub(super) cells: usize,
    /// Displacement in m (bonded-cube 0.001, punch 0.001, layer 0.001), force in N (cantilever 0.001) or angle in degrees (twist 1); natural frequencies have none
    #[arg(value_parser = number, allow_hyphen_values = true, long)]
    load: Option<f64>,
    /// What the body consists of
    #[arg(long, value_enum, default_value = "hex")]
    pub(super) element: ElementOption,
}

/// A case of elasticity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Case {
    /// Bottom and top are bonded, the top is lowered: the force, N
    BondedCube,
    /// A flat frictionless square punch of a fifth of the edge pushes into the top: the force, N
    Punch,
    /// The same on a layer whose thickness is that of the punch: the force, N
    Layer,
    /// The end at low x is clamped, a force pulls the other one along z: mean deflection of that end, m
    Cantilever,
    /// Bottom and top are bonded, the top is turned about z: the torque, N m
    Twist,
    /// The bottom is bonded: frequency of the lowest sway, and those of torsion and axial motion, Hz
    Modes,
}

/// Edges of a body, m.
#[derive(Clone, Copy, Debug)]
struct Size(DVec3);

fn size(text: &str) -> Result<Size, &'static str> {
    let list: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
    match list[..] {
        [edge] => Ok(Size(DVec3::splat(edge))),
        [x, y, z] => Ok(Size(DVec3::new(x, y, z))),
        _ => Err("it must be one number or three, as in 0.1,0.02,0.02"),
    }
}

/// Maximum number of nodes: the factorisation of more takes gigabytes.
const MAX_NODES: f64 = 20_000.0;

impl Case {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::BondedCube => "bonded-cube",
            Self::Punch => "punch",
            Self::Layer => "layer",
            Self::Cantilever => "cantilever",
            Self::Twist => "twist",
            Self::Modes => "modes",
        }
    }

    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::BondedCube | Self::Punch | Self::Layer => "N",
            Self::Cantilever => "m",
            Self::Twist => "N m",
            Self::Modes => "Hz",
        }
    }

    fn default_size_m(self) -> DVec3 {
        match self {
            Self::Cantilever => DVec3::new(0.1, 0.02, 0.02),
            Self::Layer => DVec3::new(0.2, 0.2, 0.02),
            _ => DVec3::splat(0.1),
        }
    }

    fn default_load(self) -> Option<f64> {
        match self {
            Self::BondedCube | Self::Punch | Self::Layer | Self::Cantilever => Some(1e-3),
            Self::Twist => Some(1.0),
            Self::Modes => None,
        }
    }
}

impl Continuum {
    pub(super) fn validate(&self) -> Result<(), LabError> {
        check("--cells", self.cells as f64, (2..=100).contains(&self.cells), "2 to 100")?;
        let size = self.size_m();
        let (least, most) = (size.min_element(), size.max_element());
        check(
            "--size",
            least,
            least >= 1e-3 && most <= 10.0 && most.is_finite(),
            "0.001 to 10 m along each axis",
        )?;
        check("--youngs-pa", self.youngs_pa, self.youngs_pa > 0.0, "finite and above 0")?;
        let nodes: f64 =
            size.to_array().iter().map(|side| (side / most * self.cells as f64).round() + 1.0).product();
        check(
            "--cells",
            self.cells as f64,
            nodes <= MAX_NODES,
            format!("fewer: at most {MAX_NODES} nodes in all"),
        )?;
        let (poisson, is_spring) = (self.poisson, self.element == ElementOption::Spring);
        check("--poisson", poisson, (0.0..=0.49).contains(&poisson), "0 to 0.49")?;
        check("--poisson", poisson, !is_spring || poisson == 0.25, "0.25 with --element spring")?;
        if let Some(load) = self.load {
            let is_used = self.case.default_load().is_some();
            check("--load", load, is_used, "left out for natural frequencies")?;
            check("--load", load, load != 0.0, "other than 0")?;
        }
        Ok(())
    }

    pub(super) fn size_m(&self) -> DVec3 {
        self.size.map_or_else(|| self.case.default_size_m(), |size| size.0)
    }

    /// The load, if the case has one.
    pub(super) fn load_or_default(&self) -> Option<f64> {
        self.load.or(self.case.default_load())
    }

    pub(super) fn tissue(&self) -> Tissue {
        Tissue {
            youngs_modulus_pa: self.youngs_pa,
            poissons_ratio: self.poisson,
            law: self.law.into(),
            ..Tissue::default()
        }
    }
}
