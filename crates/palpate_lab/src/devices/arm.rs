//! Arms of boards.

use clap::ValueEnum;
use palpate_hid::BoardKinematics;

/// The arms of boards whose sizes are published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Arm {
    /// The WoodenHaptics of 2015
    #[value(name = "woodenhaptics")]
    WoodenHaptics,
    /// Polhem 2
    PolhemV2,
    /// Polhem 3
    PolhemV3,
}

impl Arm {
    pub(super) fn kinematics(self) -> BoardKinematics {
        match self {
            Self::WoodenHaptics => BoardKinematics::woodenhaptics_v2015(),
            Self::PolhemV2 => BoardKinematics::polhem_v2(),
            Self::PolhemV3 => BoardKinematics::polhem_v3(),
        }
    }

    /// Where somebody has to put it, and what it is taken for.
    pub(super) fn home(self) -> &'static str {
        match self {
            Self::WoodenHaptics => {
                "link B up, link C to the front. Its motors and sizes are taken for those of a WoodenHaptics of 2015 (--board)"
            }
            Self::PolhemV2 => {
                "folded, as its maker has it. Its motors and sizes are taken for those of a Polhem 2; draw it out of there for any force"
            }
            Self::PolhemV3 => {
                "folded, as its maker has it. Its motors and sizes are taken for those of a Polhem 3; draw it out of there for any force"
            }
        }
    }
}
