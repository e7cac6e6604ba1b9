//! Keys, and the mouse's effect on tools and camera.

use crate::device::GiveHid;
use crate::scene::{ResetScene, set_up_hands};
use crate::{Stage, StageOptions, time};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{DeviceSelector, HapticUpdateSystems, MouseDevice, MouseDevicePlugin};
use bevy_panorbit_camera::PanOrbitCamera;

pub(crate) struct KeysPlugin;

impl Plugin for KeysPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Hand>()
            .add_systems(
                PreUpdate,
                (give_mouse, grasp_with_mouse).chain().after(set_up_hands).before(HapticUpdateSystems::Tools),
            )
            .configure_sets(PreUpdate, GiveHid.after(give_mouse).run_if(not(has_mouse)))
            .add_systems(Update, (press.run_if(not(keys_are_elsewhere)), zoom));
    }
}

/// Device of the first tool.
#[derive(Resource, Default)]
pub(crate) enum Hand {
    /// Not decided yet: the mouse if the scene has no device and `--hid` is not given.
    #[default]
    Undecided,
    Mouse,
    /// The scene's own device, or that of `--hid`.
    Own,
}

fn has_mouse(hand: Res<Hand>) -> bool {
    matches!(*hand, Hand::Mouse)
}

/// The key of each scheme, in the order of [`Scheme::ALL`].
const SCHEME_KEYS: [KeyCode; 6] =
    [KeyCode::Digit1, KeyCode::Digit2, KeyCode::Digit3, KeyCode::Digit4, KeyCode::Digit5, KeyCode::Digit6];

fn press(world: &mut World) {
    let keys = world.resource::<ButtonInput<KeyCode>>();
    let pressed = |key| keys.just_pressed(key);
    let (reset, pause, slow, mouse) =
        (pressed(KeyCode::KeyR), pressed(KeyCode::Space), pressed(KeyCode::KeyS), pressed(KeyCode::KeyM));
    let scheme =
        Scheme::ALL.into_iter().zip(SCHEME_KEYS).find(|(_, key)| pressed(*key)).map(|(scheme, _)| scheme);
    if let Some(scheme) = scheme {
        let mut tools = world.query::<&mut HapticTool>();
        tools.iter_mut(world).for_each(|mut tool| tool.scheme = scheme);
        // A restarted scene keeps the scheme.
        world.resource_mut::<StageOptions>().scheme = scheme;
    }
    if pause {
        let mut time = world.resource_mut::<Time<Virtual>>();
        if time.is_paused() {
            time.unpause();
        } else {
            time.pause();
        }
    }
    if slow {
        let is_slow = time::is_slow(world.resource::<Time<Virtual>>());
        time::set_slow(world, !is_slow);
    }
    if mouse {
        let hand = if matches!(world.resource::<Hand>(), Hand::Mouse) { Hand::Own } else { Hand::Mouse };
        world.insert_resource(hand);
    }
    if reset || mouse {
        world.resource_mut::<MouseDevice>().reset();
        world.write_message(ResetScene);
    }
}

/// Selects the mouse for the first tool of a new scene, if it was chosen or there is no other device.
fn give_mouse(
    mut tools: Query<(Entity, &mut HapticTool)>,
    stage: Res<Stage>,
    options: Res<StageOptions>,
    mut hand: ResMut<Hand>,
) {
    if matches!(*hand, Hand::Undecided) {
        *hand = if stage.has_hand || options.hid.is_some() { Hand::Own } else { Hand::Mouse };
    }
    let added = tools.iter_mut().filter(|(_, tool)| tool.is_added());
    let first = added.min_by_key(|(entity, _)| *entity).filter(|_| matches!(*hand, Hand::Mouse));
    if let Some((_, mut tool)) = first {
        tool.device = DeviceSelector::named(MouseDevicePlugin::NAME);
    }
}

/// Marks a tool that has its grasp from the mouse.
#[derive(Component)]
struct GraspsWithMouse;

/// Adds a grasp to a tool with the mouse, and removes it with the mouse. A recording of the mouse keeps the grasp.
fn grasp_with_mouse(
    mut commands: Commands,
    tools: Query<(Entity, &HapticTool, Has<ToolGrasp>, Has<GraspsWithMouse>), Changed<HapticTool>>,
    stage: Res<Stage>,
) {
    for (entity, tool, grasps, with_mouse) in &tools {
        if tool.device == DeviceSelector::named(MouseDevicePlugin::NAME) {
            if !grasps {
                let usual = ToolGrasp::default();
                let reach_m = f64::from(stage.magnified()) * usual.reach_m;
                commands.entity(entity).insert((ToolGrasp { reach_m, ..usual }, GraspsWithMouse));
            }
        } else if with_mouse && !matches!(tool.device, DeviceSelector::Replay { .. }) {
            commands.entity(entity).remove::<(ToolGrasp, GraspsWithMouse)>();
        }
    }
}

/// Zooms with Ctrl and the wheel; the wheel alone moves the tool.
fn zoom(keys: Res<ButtonInput<KeyCode>>, mut cameras: Query<&mut PanOrbitCamera>) {
    let zooms = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    for mut camera in &mut cameras {
        camera.zoom_sensitivity = f32::from(zooms);
    }
}

/// Whether the mouse controls the camera.
pub(crate) fn camera_turns(buttons: Res<ButtonInput<MouseButton>>, keys: Res<ButtonInput<KeyCode>>) -> bool {
    buttons.any_pressed([MouseButton::Right, MouseButton::Middle])
        || keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight])
}

/// Whether the pointer is over the panel.
#[cfg(feature = "panel")]
pub(crate) fn pointer_is_elsewhere(wants: Res<bevy_egui::input::EguiWantsInput>) -> bool {
    wants.wants_any_pointer_input()
}

/// Without a panel the pointer is always over the scene.
#[cfg(not(feature = "panel"))]
pub(crate) fn pointer_is_elsewhere() -> bool {
    false
}

/// Whether a text field of the panel has the keyboard.
#[cfg(feature = "panel")]
pub(crate) fn keys_are_elsewhere(wants: Option<Res<bevy_egui::input::EguiWantsInput>>) -> bool {
    wants.is_some_and(|wants| wants.wants_any_keyboard_input())
}

/// Without a panel there is no text field.
#[cfg(not(feature = "panel"))]
pub(crate) fn keys_are_elsewhere() -> bool {
    false
}

#[cfg(test)]
mod tests;
