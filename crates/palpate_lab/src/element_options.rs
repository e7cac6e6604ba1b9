//! What the bodies of commands consist of: springs, or elements with a law and a Poisson's ratio.

use crate::error::{LabError, check, number};
use clap::{Args, ValueEnum};
use palpate_body::ElasticLaw;

/// What a block consists of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BlockMaterial {
    /// Equal springs.
    Springs,
    /// Hexahedral elements.
    Hexahedra {
        /// Elastic law.
        law: ElasticLaw,
        /// Poisson's ratio.
        poissons_ratio: f64,
    },
    /// Tetrahedral elements, six for each cell.
    Tetrahedra {
        /// Elastic law.
        law: ElasticLaw,
        /// Poisson's ratio.
        poissons_ratio: f64,
    },
}

/// Options of commands for what a body consists of.
#[derive(Clone, Copy, Debug, Args)]
pub struct ElementOptions {
    /// What the body consists of
    #[arg(long, value_enum, default_value = "spring")]
    pub element: ElementOption,
    /// Elastic law of elements
    #[arg(long, value_enum, default_value = "neo-hookean")]
    pub law: LawOption,
    /// Poisson's ratio of elements, 0 to 0.49; springs have 0.25
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.45)]
    poisson: f64,
}

impl ElementOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`LabError::Parameter`].
    pub fn validate(&self) -> Result<(), LabError> {
        check("--poisson", self.poisson, (0.0..=0.49).contains(&self.poisson), "0 to 0.49")
    }

    /// Poisson's ratio of the body.
    pub fn poissons_ratio(&self) -> f64 {
        match self.element {
            ElementOption::Spring => 0.25,
            ElementOption::Hex | ElementOption::Tet => self.poisson,
        }
    }

    /// What a block consists of.
    pub fn material(&self) -> BlockMaterial {
        match self.element {
            ElementOption::Spring => BlockMaterial::Springs,
            ElementOption::Hex => {
                BlockMaterial::Hexahedra { law: self.law.into(), poissons_ratio: self.poisson }
            }
            ElementOption::Tet => {
                BlockMaterial::Tetrahedra { law: self.law.into(), poissons_ratio: self.poisson }
            }
        }
    }
}

/// Elements of a body, as options of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ElementOption {
    /// Springs between the nodes
    Spring,
    /// Eight-node hexahedra
    Hex,
    /// Four-node tetrahedra, six for each cell of a block
    Tet,
}

impl ElementOption {
    /// Name of the option.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spring => "spring",
            Self::Hex => "hex",
            Self::Tet => "tet",
        }
    }

    /// Name of several elements.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Spring => "springs",
            Self::Hex => "hexahedra",
            Self::Tet => "tetrahedra",
        }
    }
}

/// Elastic laws of elements, as options of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LawOption {
    /// Linear elasticity in the rotated frame
    Corotational,
    /// Compressible neo-Hookean solid
    NeoHookean,
}

impl LawOption {
    /// Name of the option.
    pub fn name(self) -> &'static str {
        match self {
            Self::Corotational => "corotational",
            Self::NeoHookean => "neo-hookean",
        }
    }
}

impl From<LawOption> for ElasticLaw {
    fn from(law: LawOption) -> Self {
        match law {
            LawOption::Corotational => Self::CorotationalLinear,
            LawOption::NeoHookean => Self::NeoHookean,
        }
    }
}
