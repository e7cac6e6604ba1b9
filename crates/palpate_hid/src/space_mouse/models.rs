//! USB IDs of the SpaceMouse models.

use crate::{HidInfo, Usage};

/// USB vendor ID of Logitech, which sold the older models.
const LOGITECH: u16 = 0x046D;
/// USB vendor ID of 3Dconnexion.
const CONNEXION: u16 = 0x256F;

/// Product IDs of caps by Logitech.
const OLDER: [u16; 11] =
    [0xC603, 0xC605, 0xC606, 0xC621, 0xC623, 0xC625, 0xC626, 0xC627, 0xC628, 0xC629, 0xC62B];
/// Product IDs of caps by 3Dconnexion, which also sells mice and keyboards.
const NEWER: [u16; 10] = [0xC62E, 0xC62F, 0xC631, 0xC632, 0xC633, 0xC635, 0xC636, 0xC638, 0xC63A, 0xC652];

/// Usage Multi-axis Controller; receivers also have collections for mice and keyboards.
const MULTI_AXIS: Usage = Usage::new(0x01, 0x08);

/// Whether `info` is a SpaceMouse.
pub(crate) fn is_space_mouse(info: &HidInfo) -> bool {
    let is_listed = match info.vendor {
        LOGITECH => OLDER.contains(&info.product),
        CONNEXION => NEWER.contains(&info.product),
        _ => false,
    };
    is_listed && info.applications.contains(&MULTI_AXIS)
}

/// Product IDs of SpaceMouse Plus XT and Classic, whose y points up and z away from the user. spacenavd lists them with neither
/// `DF_SWAPYZ` nor `DF_INVYZ` (src/dev.c at bac572a), unlike all other caps.
const Y_UP: [u16; 2] = [0xC603, 0xC606];

/// Whether the cap's y points up and its z away from the user. Otherwise y points towards the user and z down.
pub(super) fn has_y_up(info: &HidInfo) -> bool {
    info.vendor == LOGITECH && Y_UP.contains(&info.product)
}
