//! The mouse as a device, when there is no other.

use crate::device::{DeviceSelector, HapticDevices};
use crate::tool::ToolLoop;
use bevy::camera::{NormalizedRenderTarget, RenderTarget};
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use palpate_haptics::{DeviceFrame, FollowerSettings, FollowerTarget, Reading};
use std::sync::{Arc, Mutex, PoisonError};

/// Registers the mouse as the device [`MouseDevicePlugin::NAME`].
///
/// The hand goes where the pointer's ray meets the plane through the hand that faces the camera; the wheel takes it along the view.
/// The camera is the one of the primary window that is seen under the pointer. However the tool's frame lies, the tool is under the
/// pointer, as far as the hand's workspace reaches.
/// Pictures come sixty times a second and samples a thousand times: between them the hand follows as a mass on a
/// spring ([`FollowingHand`]), without steps, and as a mouse cannot push back, the force pushes that mass.
#[derive(Clone, Copy, Debug)]
pub struct MouseDevicePlugin {
    /// How the hand follows, where it starts and where it may go, m, in the frame of the device.
    pub hand: FollowerSettings,
    /// How far a line of the wheel takes it away from the eye, m in the scene.
    pub line_m: f32,
    /// The mouse's buttons that are the device's buttons 0, 1, … up to 31; those after them are not read.
    pub buttons: &'static [MouseButton],
}

impl MouseDevicePlugin {
    /// The device's name in [`HapticDevices`].
    pub const NAME: &'static str = "mouse";
}

impl Default for MouseDevicePlugin {
    /// [`FollowingHand::default`], 2 mm a line, the left button.
    fn default() -> Self {
        Self { hand: FollowerSettings::default(), line_m: 0.002, buttons: &[MouseButton::Left] }
    }
}

/// Where the mouse's hand is to go.
#[derive(Resource, Debug, Reflect)]
#[reflect(Resource, Debug)]
pub struct MouseDevice {
    /// The place, m, in the frame of the device.
    pub target_m: Vec3,
    line_m: f32,
    #[reflect(ignore)]
    buttons: &'static [MouseButton],
    /// Where it starts, and the corners of where it may go, m.
    start_m: Vec3,
    workspace_m: [Vec3; 2],
    /// Bit i: button i is pressed.
    pressed: u32,
    /// The first tool that has the mouse, and how the mouse lies in the scene for it.
    #[reflect(ignore)]
    framed: Option<(Entity, DeviceFrame)>,
    #[reflect(ignore)]
    followed: Followed,
}

/// The end of the device that was made last; there is one mouse. Never locked by a loop.
type Followed = Arc<Mutex<Option<FollowerTarget>>>;

impl MouseDevice {
    /// Puts the place to where the hand starts.
    pub fn reset(&mut self) {
        self.target_m = self.start_m;
    }

    fn frame(&self) -> DeviceFrame {
        self.framed.map(|(_, frame)| frame).unwrap_or_default()
    }

    /// The place in the scene, m.
    fn scene_m(&self) -> Vec3 {
        self.frame().to_scene(&Reading::at(self.target_m.as_dvec3())).position_m.as_vec3()
    }

    /// Puts the place to `scene_m` in the scene, as far as the hand may go.
    fn go_to(&mut self, scene_m: Vec3) {
        let [low, high] = self.workspace_m;
        self.target_m = self.frame().position_to_device_m(scene_m.as_dvec3()).as_vec3().clamp(low, high);
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
        app.register_type::<MouseDevice>().insert_resource(MouseDevice {
            target_m: start_m,
            line_m: self.line_m,
            buttons: self.buttons,
            start_m,
            workspace_m: [low, high],
            pressed: 0,
            framed: None,
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
            (keep_place, follow_pointer.in_set(MouseDeviceSystems), tell_hand)
                .chain()
                .after(bevy::input::InputSystems),
        );
    }
}

/// Another frame of the same tool leaves the place where it is in the scene.
fn keep_place(tools: Query<(Entity, &ToolLoop)>, mut hand: ResMut<MouseDevice>) {
    let mouse = DeviceSelector::named(MouseDevicePlugin::NAME);
    let with_mouse = tools.iter().filter(|(_, tool)| tool.device == mouse);
    let framed =
        with_mouse.min_by_key(|(entity, _)| *entity).map(|(entity, tool)| (entity, tool.settings.frame));
    if hand.framed == framed {
        return;
    }
    let scene_m = hand.scene_m();
    let before = std::mem::replace(&mut hand.framed, framed);
    if before.zip(framed).is_some_and(|((before, _), (tool, _))| before == tool) {
        hand.go_to(scene_m);
    }
}

fn follow_pointer(
    windows: Query<(Entity, &Window), With<PrimaryWindow>>,
    cameras: Query<(&Camera, &RenderTarget, &GlobalTransform), With<Camera3d>>,
    pressed: Res<ButtonInput<MouseButton>>,
    wheel: Res<AccumulatedMouseScroll>,
    mut hand: ResMut<MouseDevice>,
) {
    let pointer = windows.single().ok().and_then(|(window, seen)| Some((window, seen.cursor_position()?)));
    if let Some((window, pointer)) = pointer
        && let Some((camera, at)) = camera_under(pointer, window, &cameras)
        && let Ok(ray) = camera.viewport_to_world(at, pointer)
    {
        let pixels_in_a_line = match wheel.unit {
            MouseScrollUnit::Line => 1.0,
            MouseScrollUnit::Pixel => MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
        };
        let away_m = hand.line_m * wheel.delta.y / pixels_in_a_line;
        let scene_m = place_on_ray(ray, hand.scene_m(), at.forward(), away_m);
        scene_m.into_iter().for_each(|scene_m| hand.go_to(scene_m));
    }
    hand.pressed = bits(hand.buttons, &pressed);
}

/// What is pressed of `buttons`, as the bits of a reading.
fn bits(buttons: &[MouseButton], pressed: &ButtonInput<MouseButton>) -> u32 {
    let bits = (0..u32::BITS).zip(buttons).map(|(bit, &button)| u32::from(pressed.pressed(button)) << bit);
    bits.sum()
}

/// The camera whose picture is seen at `pointer` in `window`, and where it is.
fn camera_under<'a>(
    pointer: Vec2,
    window: Entity,
    cameras: &'a Query<(&Camera, &RenderTarget, &GlobalTransform), With<Camera3d>>,
) -> Option<(&'a Camera, &'a GlobalTransform)> {
    let is_in_window = |target: &RenderTarget| {
        let target = target.normalize(Some(window));
        matches!(target, Some(NormalizedRenderTarget::Window(seen)) if seen.entity() == window)
    };
    let is_seen = |camera: &Camera| camera.logical_viewport_rect().is_some_and(|seen| seen.contains(pointer));
    let seen = cameras
        .iter()
        .filter(|(camera, target, _)| camera.is_active && is_in_window(target) && is_seen(camera));
    seen.max_by_key(|(camera, ..)| camera.order).map(|(camera, _, at)| (camera, at))
}

/// Tells the device where to go. A button that is released is released, even while the pointer is not followed.
fn tell_hand(pressed: Res<ButtonInput<MouseButton>>, mut hand: ResMut<MouseDevice>) {
    let pressed = hand.pressed & bits(hand.buttons, &pressed);
    let hand = hand.bypass_change_detection();
    hand.pressed = pressed;
    if let Some(followed) = &mut *hand.followed.lock().unwrap_or_else(PoisonError::into_inner) {
        followed.set(hand.target_m.as_dvec3(), pressed);
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
    use bevy::camera::{RenderTargetInfo, Viewport};
    use bevy::time::TimeUpdateStrategy;
    use bevy::window::WindowResolution;
    use std::time::Duration;

    /// A camera half a metre before the origin, looking at it, over a window of 400 by 400 pixels, and a tool with the mouse.
    fn app() -> (App, Entity) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::input::InputPlugin))
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin { mode: LoopMode::Lockstep, ..default() }))
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

    /// A camera above the other that looks from elsewhere, and draws into `target`.
    fn another_camera(app: &mut App, target: RenderTarget, viewport: Option<Viewport>) {
        let mut cameras = app.world_mut().query::<&Camera>();
        let first = cameras.iter(app.world()).next().unwrap().clone();
        let camera = Camera { viewport, order: 1, ..first };
        let at = GlobalTransform::from(Transform::from_xyz(0.0, 0.0, 5.0));
        app.world_mut().spawn((Camera3d::default(), camera, target)).insert(at);
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
        app.world_mut().resource_mut::<MouseDevice>().reset();
        assert_eq!(app.world().resource::<MouseDevice>().target_m, Vec3::ZERO);
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
        let most_m = FollowerSettings::default().max_speed_m_per_s * 1e-3;
        for pair in samples.windows(2) {
            assert!(pair[0].position_m.distance(pair[1].position_m) <= most_m + 1e-12);
        }
        assert!((samples.last().unwrap().position_m.x - 0.2).abs() < 1e-5);
        assert_eq!((samples[100].buttons, samples.last().unwrap().buttons), (0, 1));
    }

    #[test]
    fn the_tool_is_under_the_pointer_whatever_its_frame() {
        let (mut app, tool) = app();
        point_at(&mut app, Vec2::new(240.0, 180.0));
        let expected = Vec3::new(0.1, 0.05, 0.0);
        settled(&mut app, tool);
        let set = |app: &mut App, frame| {
            app.world_mut().get_mut::<ToolSettings>(tool).unwrap().frame = frame;
        };
        let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.8);
        let turned = DeviceFrame { rotation, scale: 2.5, offset_m: DVec3::new(0.1, 0.2, -0.1) };
        set(&mut app, turned);
        let at = settled(&mut app, tool);
        assert!((at - expected).length() < 1e-5, "{at}");
        // While the pointer is over a panel as well.
        let mut windows = app.world_mut().query::<&mut Window>();
        windows.single_mut(app.world_mut()).unwrap().set_cursor_position(None);
        set(&mut app, DeviceFrame { scale: 1.5, ..turned });
        let at = settled(&mut app, tool);
        assert!((at - expected).length() < 1e-5, "{at}");
        // A frame that is refused is not in force.
        set(&mut app, DeviceFrame { scale: 0.0, ..turned });
        let at = settled(&mut app, tool);
        assert!((at - expected).length() < 1e-5, "{at}");
    }

    #[test]
    fn the_ray_is_that_of_the_camera_under_the_pointer() {
        let (mut app, tool) = app();
        another_camera(&mut app, RenderTarget::None { size: UVec2::splat(400) }, None);
        let corner = Viewport { physical_size: UVec2::splat(50), ..default() };
        another_camera(&mut app, RenderTarget::default(), Some(corner));
        point_at(&mut app, Vec2::new(240.0, 180.0));
        let at = settled(&mut app, tool);
        assert!((at - Vec3::new(0.1, 0.05, 0.0)).length() < 1e-5, "{at}");
    }

    #[test]
    fn more_buttons_than_a_reading_has_bits_are_not_read() {
        let (mut app, tool) = app();
        let mut buttons = vec![MouseButton::Left; 31];
        buttons.extend([MouseButton::Right; 9]);
        app.world_mut().resource_mut::<MouseDevice>().buttons = buttons.leak();
        app.world_mut().entity_mut(tool).insert(crate::TickRecording::default());
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Right);
        settled(&mut app, tool);
        let samples = &app.world().get::<crate::TickRecording>(tool).unwrap().samples;
        assert_eq!(samples.last().unwrap().buttons, 1 << 31);
    }

    #[test]
    fn a_button_that_is_released_over_a_panel_is_released() {
        let (mut app, tool) = app();
        app.insert_resource(OverPanel(false))
            .configure_sets(PreUpdate, MouseDeviceSystems.run_if(|over: Res<OverPanel>| !over.0));
        app.world_mut().entity_mut(tool).insert(crate::TickRecording::default());
        let newest = |app: &mut App| {
            settled(app, tool);
            app.world().get::<crate::TickRecording>(tool).unwrap().samples.last().unwrap().buttons
        };
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        assert_eq!(newest(&mut app), 1);
        app.insert_resource(OverPanel(true));
        assert_eq!(newest(&mut app), 1);
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().release(MouseButton::Left);
        assert_eq!(newest(&mut app), 0);
        // What is pressed there is the panel's.
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        assert_eq!(newest(&mut app), 0);
    }

    #[derive(Resource)]
    struct OverPanel(bool);

    #[test]
    fn its_place_can_be_looked_at_by_reflection() {
        let (app, _) = app();
        let registry = app.world().resource::<AppTypeRegistry>().read();
        let known = registry.get(std::any::TypeId::of::<MouseDevice>()).unwrap();
        assert!(known.data::<ReflectResource>().is_some());
        let hand: &dyn Reflect = app.world().resource::<MouseDevice>();
        let place = hand.reflect_ref().as_struct().unwrap().field("place_m").unwrap();
        assert_eq!(place.try_downcast_ref::<Vec3>(), Some(&Vec3::ZERO));
    }

    #[test]
    fn a_ray_along_the_plane_leaves_the_hand_where_it_is() {
        let ray = Ray3d::new(Vec3::ZERO, Dir3::X);
        assert_eq!(place_on_ray(ray, Vec3::Y, Dir3::Y, 0.0), None);
    }
}
