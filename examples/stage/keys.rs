//! The keys, and what the mouse's buttons do beside the hand.

use crate::device::GiveHid;
use crate::scene::{ResetScene, set_up_hands};
use crate::{Stage, StageOptions, time};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticUpdateSystems, MouseDevice, MouseDevicePlugin};
use bevy_panorbit_camera::PanOrbitCamera;

pub(crate) struct KeysPlugin;

impl Plugin for KeysPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Hand>()
            .add_systems(
                PreUpdate,
                (give_mouse, grasp_with_mouse).chain().after(set_up_hands).before(HapticUpdateSystems::Tools),
            )
            .configure_sets(PreUpdate, GiveHid.after(give_mouse).run_if(not(is_the_mouses)))
            .add_systems(Update, (press.run_if(not(keys_are_elsewhere)), zoom));
    }
}

/// Whose hand moves the first tool.
#[derive(Resource, Default)]
pub(crate) enum Hand {
    /// The mouse's, if the scene does without its own and no device is asked for; not decided yet.
    #[default]
    Undecided,
    Mouse,
    /// The scene's, or that of the device that is asked for.
    Own,
}

fn is_the_mouses(hand: Res<Hand>) -> bool {
    matches!(*hand, Hand::Mouse)
}

/// The scheme of each digit, and the key.
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
        // A scene that begins again keeps it.
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

/// The first tool of a scene that has just been set up gets the mouse, if that is asked for or there is no other device.
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

/// A tool that grasps only while it has the mouse.
#[derive(Component)]
struct GraspsWithMouse;

/// A tool with the mouse grasps with the left button; one that got its grasp so loses it with the mouse. What was recorded of the
/// mouse grasps as the mouse did.
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

/// Ctrl and the wheel bring the camera nearer; the wheel alone is the hand's.
fn zoom(keys: Res<ButtonInput<KeyCode>>, mut cameras: Query<&mut PanOrbitCamera>) {
    let zooms = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    for mut camera in &mut cameras {
        camera.zoom_sensitivity = f32::from(zooms);
    }
}

/// The pointer turns or moves the camera, or the wheel is the camera's.
pub(crate) fn camera_turns(buttons: Res<ButtonInput<MouseButton>>, keys: Res<ButtonInput<KeyCode>>) -> bool {
    buttons.any_pressed([MouseButton::Right, MouseButton::Middle])
        || keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight])
}

/// The pointer is over something that is written on the scene.
#[cfg(feature = "panel")]
pub(crate) fn pointer_is_elsewhere(wants: Res<bevy_egui::input::EguiWantsInput>) -> bool {
    wants.wants_any_pointer_input()
}

/// There is nothing else that the pointer could be over.
#[cfg(not(feature = "panel"))]
pub(crate) fn pointer_is_elsewhere() -> bool {
    false
}

/// What is typed goes into a field of the panel.
#[cfg(feature = "panel")]
pub(crate) fn keys_are_elsewhere(wants: Option<Res<bevy_egui::input::EguiWantsInput>>) -> bool {
    wants.is_some_and(|wants| wants.wants_any_keyboard_input())
}

/// There is no field to type into.
#[cfg(not(feature = "panel"))]
pub(crate) fn keys_are_elsewhere() -> bool {
    false
}

#[cfg(test)]
mod tests;
