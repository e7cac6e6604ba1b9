//! Arms of 3-DOF boards.

use clap::ValueEnum;
use palpate_hid::BoardKinematics;

/// Arms with published dimensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Arm {
    /// WoodenHaptics of 2015
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

    /// Home position of the arm and the assumption about its dimensions, for a person.
    pub(super) fn home(self) -> &'static str {
        match self {
            Self::WoodenHaptics => {
                "link B up, link C to the front. Motors and dimensions of a WoodenHaptics of 2015 are assumed (--board)"
            }
            Self::PolhemV2 => {
                "folded, as its maker documents. Motors and dimensions of a Polhem 2 are assumed; pull it out of the home position to get a force"
            }
            Self::PolhemV3 => {
                "folded, as its maker documents. Motors and dimensions of a Polhem 3 are assumed; pull it out of the home position to get a force"
            }
        }
    }
}
