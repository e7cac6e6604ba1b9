//! The mouse as a device, when there is no other.

use crate::device::HapticDevices;
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use palpate_haptics::{FollowedPlace, FollowingHand};
use std::sync::{Arc, Mutex, PoisonError};

/// Registers the mouse as the device [`MouseDevicePlugin::NAME`].
///
/// The hand goes where the pointer's ray meets the plane through the hand that faces the camera; the wheel takes it along the view.
/// Pictures come sixty times a second and samples a thousand times: between them the hand follows as a mass on a
/// spring ([`FollowingHand`]), without steps, and as a mouse cannot push back, the force pushes that mass.
#[derive(Clone, Copy, Debug)]
pub struct MouseDevicePlugin {
    /// How the hand follows, where it starts and where it may go, m, in the frame of the device.
    pub hand: FollowingHand,
    /// How far a line of the wheel takes it away from the eye, m.
    pub line_m: f32,
    /// The mouse's buttons that are the device's buttons 0, 1, …
    pub buttons: &'static [MouseButton],
}

impl MouseDevicePlugin {
    /// The device's name in [`HapticDevices`].
    pub const NAME: &'static str = "mouse";
}

impl Default for MouseDevicePlugin {
    /// [`FollowingHand::default`], 2 mm a line, the left button.
    fn default() -> Self {
        Self { hand: FollowingHand::default(), line_m: 0.002, buttons: &[MouseButton::Left] }
    }
}

/// Where the mouse's hand is to go.
#[derive(Resource, Debug, Reflect)]
#[reflect(Resource, Debug)]
pub struct MouseHand {
    /// The place, m, in the frame of the device.
    pub place_m: Vec3,
    line_m: f32,
    #[reflect(ignore)]
    buttons: &'static [MouseButton],
    /// Where it starts, and the corners of where it may go, m.
    start_m: Vec3,
    workspace_m: [Vec3; 2],
    #[reflect(ignore)]
    followed: Followed,
}

/// The end of the device that was made last; there is one mouse. Never locked by a loop.
type Followed = Arc<Mutex<Option<FollowedPlace>>>;

impl MouseHand {
    /// Puts the place to where the hand starts.
    pub fn start_again(&mut self) {
        self.place_m = self.start_m;
    }
}

/// Where the mouse is read, in [`PreUpdate`] after Bevy's input. Give it a run condition to keep the hand still, while the
/// pointer is over a panel or turns the camera for instance.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MouseDeviceSystems;

impl Plugin for MouseDevicePlugin {
    fn build(&self, app: &mut App) {
        let (hand, followed) = (self.hand, Followed::default());
        let [low, high] = hand.workspace_m.map(|corner| corner.as_vec3());
        let start_m = hand.start_m.as_vec3().clamp(low, high);
        app.register_type::<MouseHand>().insert_resource(MouseHand {
            place_m: start_m,
            line_m: self.line_m,
            buttons: self.buttons,
            start_m,
            workspace_m: [low, high],
            followed: followed.clone(),
        });
        app.init_resource::<HapticDevices>();
        app.world_mut().resource_mut::<HapticDevices>().register(Self::NAME, move || {
            let (place, device) = hand.follow()?;
            *followed.lock().unwrap_or_else(PoisonError::into_inner) = Some(place);
            Ok(device)
        });
        app.add_systems(
            PreUpdate,
            follow_pointer.in_set(MouseDeviceSystems).after(bevy::input::InputSystems),
        );
    }
}

fn follow_pointer(
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(&Camera, &GlobalTransform), With<Camera3d>>,
    pressed: Res<ButtonInput<MouseButton>>,
    wheel: Res<AccumulatedMouseScroll>,
    mut hand: ResMut<MouseHand>,
) {
    let pointer = windows.single().ok().and_then(Window::cursor_position);
    let eye = cameras.iter().find(|(camera, _)| camera.is_active);
    if let (Some(pointer), Some((camera, at))) = (pointer, eye)
        && let Ok(ray) = camera.viewport_to_world(at, pointer)
    {
        let pixels_in_a_line = match wheel.unit {
            MouseScrollUnit::Line => 1.0,
            MouseScrollUnit::Pixel => MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
        };
        let away_m = hand.line_m * wheel.delta.y / pixels_in_a_line;
        let place_m = place_on_ray(ray, hand.place_m, at.forward(), away_m);
        let [low, high] = hand.workspace_m;
        hand.place_m = place_m.unwrap_or(hand.place_m).clamp(low, high);
    }
    let buttons =
        hand.buttons.iter().enumerate().map(|(bit, &button)| u32::from(pressed.pressed(button)) << bit);
    let (place_m, buttons) = (hand.place_m.as_dvec3(), buttons.sum());
    if let Some(followed) = &mut *hand.followed.lock().unwrap_or_else(PoisonError::into_inner) {
        followed.set(place_m, buttons);
    }
}

/// Where `ray` meets the plane through `place_m` with normal `forward`, moved `away_m` along that; `None` where it does not.
fn place_on_ray(ray: Ray3d, place_m: Vec3, forward: Dir3, away_m: f32) -> Option<Vec3> {
    let origin = place_m + forward * away_m;
    ray.intersect_plane(origin, InfinitePlane3d::new(forward)).map(|distance| ray.get_point(distance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use bevy::camera::RenderTargetInfo;
    use bevy::time::TimeUpdateStrategy;
    use bevy::window::WindowResolution;
    use std::time::Duration;

    /// A camera half a metre before the origin, looking at it, over a window of 400 by 400 pixels, and a tool with the mouse.
    fn app() -> (App, Entity) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::input::InputPlugin))
            .add_plugins(
                PalpatePlugins.set(HapticSchedulePlugin { clock: HapticClock::Lockstep, ..default() }),
            )
            .add_plugins(MouseDevicePlugin::default())
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
        let resolution = WindowResolution::new(400, 400);
        app.world_mut().spawn((Window { resolution, ..default() }, PrimaryWindow));
        let mut camera = Camera::default();
        let physical_size = UVec2::splat(400);
        camera.computed.target_info = Some(RenderTargetInfo { physical_size, scale_factor: 1.0 });
        // 90 degrees: at half a metre the view is one metre wide.
        camera.computed.clip_from_view =
            Mat4::perspective_infinite_reverse_rh(90_f32.to_radians(), 1.0, 0.01);
        let at = GlobalTransform::from(Transform::from_xyz(0.0, 0.0, 0.5).looking_at(Vec3::ZERO, Vec3::Y));
        app.world_mut().spawn((Camera3d::default(), camera)).insert(at);
        let device = DeviceSelector::named(MouseDevicePlugin::NAME);
        let tool = app.world_mut().spawn(HapticTool { device, ..default() }).id();
        (app, tool)
    }

    fn point_at(app: &mut App, pixel: Vec2) {
        let mut windows = app.world_mut().query::<&mut Window>();
        windows.single_mut(app.world_mut()).unwrap().set_cursor_position(Some(pixel));
    }

    fn settled(app: &mut App, tool: Entity) -> Vec3 {
        (0..30).for_each(|_| app.update());
        app.world().get::<Transform>(tool).unwrap().translation
    }

    #[test]
    fn the_tool_goes_where_the_pointer_is_and_the_wheel_takes_it_away() {
        let (mut app, tool) = app();
        point_at(&mut app, Vec2::new(240.0, 180.0));
        // 40 and 20 pixels from the middle, 1/400 m each.
        let expected = Vec3::new(0.1, 0.05, 0.0);
        let at = settled(&mut app, tool);
        assert!((at - expected).length() < 1e-5, "{at}");
        // Ten lines, 2 mm each, along the view; the ray is wider there.
        app.world_mut().resource_mut::<AccumulatedMouseScroll>().delta.y = 10.0;
        app.world_mut().run_system_cached(follow_pointer).unwrap();
        app.world_mut().resource_mut::<AccumulatedMouseScroll>().delta.y = 0.0;
        let at = settled(&mut app, tool);
        assert!((at - Vec3::new(0.104, 0.052, -0.02)).length() < 1e-5, "{at}");
        // Not farther than it may: 20 cm.
        point_at(&mut app, Vec2::new(399.0, 200.0));
        let at = settled(&mut app, tool);
        assert!((at.x - 0.2).abs() < 1e-5, "{at}");
        app.world_mut().resource_mut::<MouseHand>().start_again();
        assert_eq!(app.world().resource::<MouseHand>().place_m, Vec3::ZERO);
    }

    #[test]
    fn between_two_pictures_the_hand_makes_no_step_and_its_button_is_told() {
        let (mut app, tool) = app();
        app.world_mut().entity_mut(tool).insert(crate::TickRecording::default());
        settled(&mut app, tool);
        point_at(&mut app, Vec2::new(280.0, 200.0));
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        settled(&mut app, tool);
        let samples = &app.world().get::<crate::TickRecording>(tool).unwrap().samples;
        let most_m = FollowingHand::default().max_speed_m_per_s * 1e-3;
        for pair in samples.windows(2) {
            assert!(pair[0].position_m.distance(pair[1].position_m) <= most_m + 1e-12);
        }
        assert!((samples.last().unwrap().position_m.x - 0.2).abs() < 1e-5);
        assert_eq!((samples[100].buttons, samples.last().unwrap().buttons), (0, 1));
    }

    #[test]
    fn its_place_can_be_looked_at_by_reflection() {
        let (app, _) = app();
        let registry = app.world().resource::<AppTypeRegistry>().read();
        let known = registry.get(std::any::TypeId::of::<MouseHand>()).unwrap();
        assert!(known.data::<ReflectResource>().is_some());
        let hand: &dyn Reflect = app.world().resource::<MouseHand>();
        let place = hand.reflect_ref().as_struct().unwrap().field("place_m").unwrap();
        assert_eq!(place.try_downcast_ref::<Vec3>(), Some(&Vec3::ZERO));
    }

    #[test]
    fn a_ray_along_the_plane_leaves_the_hand_where_it_is() {
        let ray = Ray3d::new(Vec3::ZERO, Dir3::X);
        assert_eq!(place_on_ray(ray, Vec3::Y, Dir3::Y, 0.0), None);
    }
}
