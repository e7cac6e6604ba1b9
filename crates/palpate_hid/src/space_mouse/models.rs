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
