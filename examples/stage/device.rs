//! A device that is plugged in, in place of the scene's own hand.

use crate::scene::set_up_hands;
use crate::{Stage, StageOptions};
use bevy::prelude::*;
use bevy_palpate::HapticUpdateSystems;
use bevy_palpate::prelude::*;

/// The option `--hid`: the first of any kind, of one kind, or the one with a serial number.
///
/// # Errors
/// None: what is no kind is a serial number.
pub(crate) fn choice(text: &str) -> Result<HidSelector, String> {
    let kind = match text {
        "first" => return Ok(HidSelector::first()),
        "cap" => HidDeviceKind::SpaceMouse,
        "joystick" => HidDeviceKind::Joystick,
        "board" => HidDeviceKind::Board,
        serial => return Ok(HidSelector { serial: Some(serial.into()), ..default() }),
    };
    Ok(HidSelector { kind: Some(kind), ..HidSelector::first() })
}

/// Where the device of `--hid` gets its tool, unless the mouse has it.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct GiveHid;

/// Gives the first tool of a scene that has just been set up to the device of `--hid`.
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
    let Some(choice) = &options.hid else { return };
    let added = tools.iter_mut().filter(|(_, tool, _)| tool.is_added());
    let Some((_, mut tool, mut settings)) = added.min_by_key(|(entity, ..)| *entity) else { return };
    tool.device = DeviceSelector::Hid(choice.clone());
    // The middle of its workspace is a little above what the camera looks at.
    settings.frame.scale = f64::from(stage.magnified());
    settings.frame.offset_m = (stage.focus_m + Vec3::Y * 0.7 * stage.size_m).as_dvec3();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_named_by_kind_or_serial_number() {
        assert_eq!(choice("first"), Ok(HidSelector::first()));
        let board = choice("board").unwrap();
        assert!(board.kind == Some(HidDeviceKind::Board) && board.match_first && board.serial.is_none());
        assert_eq!(choice("A1B2").unwrap(), HidSelector { serial: Some("A1B2".into()), ..default() });
    }
}
