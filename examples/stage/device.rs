//! The HID device of `--hid`, instead of the scene's own device.

use crate::scene::set_up_hands;
use crate::{Stage, StageOptions};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticUpdateSystems, HidDeviceKind, HidSelector};

/// Parses the option `--hid`: the first device of any kind, of one kind, or the device with a serial number.
///
/// # Errors
/// Never: any other text is a serial number.
pub(crate) fn selector(text: &str) -> Result<HidSelector, String> {
    let kind = match text {
        "first" => return Ok(HidSelector::first()),
        "cap" => HidDeviceKind::SpaceMouse,
        "joystick" => HidDeviceKind::Joystick,
        "board" => HidDeviceKind::Board,
        serial => return Ok(HidSelector { serial: Some(serial.into()), ..default() }),
    };
    Ok(HidSelector { kind: Some(kind), ..HidSelector::first() })
}

/// The set of the system that selects the device of `--hid`, unless the mouse is selected.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct GiveHid;

/// Selects the device of `--hid` for the first tool of a new scene.
pub(crate) fn add(app: &mut App) {
    app.add_systems(
        PreUpdate,
        give_hid.in_set(GiveHid).after(set_up_hands).before(HapticUpdateSystems::Tools),
    );
}

fn give_hid(
    mut tools: Query<(Entity, &mut HapticTool, &mut ToolSettings)>,
    stage: Res<Stage>,
    options: Res<StageOptions>,
) {
    let Some(selector) = &options.hid else { return };
    let added = tools.iter_mut().filter(|(_, tool, _)| tool.is_added());
    let Some((_, mut tool, mut settings)) = added.min_by_key(|(entity, ..)| *entity) else { return };
    tool.device = selector.clone().into();
    // The centre of the workspace is a little above the focus of the camera.
    settings.frame.scale = f64::from(stage.magnified());
    settings.frame.offset_m = (stage.focus_m + Vec3::Y * 0.7 * stage.size_m).as_dvec3();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selector_is_parsed_from_kind_or_serial_number() {
        assert_eq!(selector("first"), Ok(HidSelector::first()));
        let board = selector("board").unwrap();
        assert!(board.kind == Some(HidDeviceKind::Board) && board.match_first && board.serial.is_none());
        assert_eq!(selector("A1B2").unwrap(), HidSelector { serial: Some("A1B2".into()), ..default() });
    }
}
