//! The mouse as a device.

use crate::device::{DeviceSelector, HapticDevices};
use crate::tool::ToolLoop;
use bevy::camera::{NormalizedRenderTarget, RenderTarget};
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use glam::DVec3;
use palpate_haptics::{DeviceFrame, FollowerSettings, FollowerTarget, Reading};
use std::sync::{Arc, Mutex, PoisonError};

/// Registers the mouse as the device [`MouseDevicePlugin::NAME`].
///
/// The target of the device is the intersection of the pointer's ray with the plane through the target that faces the camera; the wheel
/// moves it along the view. The camera is that of the primary window under the pointer. The tool is under the pointer for every
/// [`ToolSettings::frame`](crate::ToolSettings::frame), within the device's workspace.
///
/// The device follows the target as a mass on a spring ([`FollowerSettings`]), which turns 60 frames a second into a smooth motion of 1000
/// samples a second. A mouse cannot render force: the force acts on that mass instead.
#[derive(Clone, Copy, Debug)]
pub struct MouseDevicePlugin {
    /// Mass, spring, start and workspace of the device, in the device frame.
    pub hand: FollowerSettings,
    /// Distance that one line of the wheel moves the target away from the camera, m, world frame.
    pub line_m: f64,
    /// The mouse buttons that are the device's buttons 0, 1, … up to 31; later ones are ignored.
    pub buttons: &'static [MouseButton],
}

impl MouseDevicePlugin {
    /// Name of the device in [`HapticDevices`].
    pub const NAME: &'static str = "mouse";
}

impl Default for MouseDevicePlugin {
    /// [`FollowerSettings::default`], 2 mm per line, the left button.
    fn default() -> Self {
        Self { hand: FollowerSettings::default(), line_m: 0.002, buttons: &[MouseButton::Left] }
    }
}

/// Target of the mouse device.
#[derive(Resource, Debug, Reflect)]
#[reflect(Resource, Debug)]
pub struct MouseDevice {
    /// Position that the device moves to, m, device frame. Updated in every frame by the pointer.
    pub target_m: DVec3,
    line_m: f64,
    #[reflect(ignore)]
    buttons: &'static [MouseButton],
    /// Initial target, m.
    start_m: DVec3,
    /// Corners of the workspace, m.
    workspace_m: [DVec3; 2],
    /// Pressed buttons: bit i for button i.
    pressed: u32,
    /// The first tool with the mouse, and its frame.
    #[reflect(ignore)]
    framed: Option<(Entity, DeviceFrame)>,
    #[reflect(ignore)]
    follower: Follower,
}

/// Target of the newest device that was created. Loops never lock it.
type Follower = Arc<Mutex<Option<FollowerTarget>>>;

impl MouseDevice {
    /// Moves the target to the start.
    pub fn reset(&mut self) {
        self.target_m = self.start_m;
    }

    fn frame(&self) -> DeviceFrame {
        self.framed.map(|(_, frame)| frame).unwrap_or_default()
    }

    /// The target in the world frame, m.
    fn world_target_m(&self) -> DVec3 {
        self.frame().to_scene(&Reading::at(self.target_m)).position_m
    }

    /// Sets the target to `world_m` in the world frame, clamped to the workspace.
    fn set_world_target(&mut self, world_m: DVec3) {
        let [low, high] = self.workspace_m;
        self.target_m = self.frame().position_to_device_m(world_m).clamp(low, high);
    }
}

/// The set of the systems that read the mouse, in [`PreUpdate`] after Bevy's input. A run condition on it holds the target, for example
/// while the pointer is over a panel or rotates the camera.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MouseDeviceSystems;

impl Plugin for MouseDevicePlugin {
    fn build(&self, app: &mut App) {
        let (hand, follower) = (self.hand, Follower::default());
        let [low, high] = hand.workspace_m;
        let start_m = hand.start_m.clamp(low, high);
        app.register_type::<MouseDevice>().insert_resource(MouseDevice {
            target_m: start_m,
            line_m: self.line_m,
            buttons: self.buttons,
            start_m,
            workspace_m: [low, high],
            pressed: 0,
            framed: None,
            follower: follower.clone(),
        });
        app.init_resource::<HapticDevices>();
        app.world_mut().resource_mut::<HapticDevices>().register(Self::NAME, move || {
            let (target, device) = hand.follow()?;
            *follower.lock().unwrap_or_else(PoisonError::into_inner) = Some(target);
            Ok(device)
        });
        app.add_systems(
            PreUpdate,
            (keep_world_target, follow_pointer.in_set(MouseDeviceSystems), update_follower)
                .chain()
                .after(bevy::input::InputSystems),
        );
    }
}

/// Keeps the target's position in the world when the frame of the tool changes.
fn keep_world_target(tools: Query<(Entity, &ToolLoop)>, mut mouse: ResMut<MouseDevice>) {
    let selector = DeviceSelector::named(MouseDevicePlugin::NAME);
    let with_mouse = tools.iter().filter(|(_, tool)| tool.device == selector);
    let framed =
        with_mouse.min_by_key(|(entity, _)| *entity).map(|(entity, tool)| (entity, tool.settings.frame));
    if mouse.framed == framed {
        return;
    }
    let world_m = mouse.world_target_m();
    let before = std::mem::replace(&mut mouse.framed, framed);
    if before.zip(framed).is_some_and(|((before, _), (tool, _))| before == tool) {
        mouse.set_world_target(world_m);
    }
}

fn follow_pointer(
    windows: Query<(Entity, &Window), With<PrimaryWindow>>,
    cameras: Query<(&Camera, &RenderTarget, &GlobalTransform), With<Camera3d>>,
    pressed: Res<ButtonInput<MouseButton>>,
    wheel: Res<AccumulatedMouseScroll>,
    mut mouse: ResMut<MouseDevice>,
) {
    let pointer =
        windows.single().ok().and_then(|(entity, window)| Some((entity, window.cursor_position()?)));
    if let Some((window, pointer)) = pointer
        && let Some((camera, at)) = camera_under(pointer, window, &cameras)
        && let Ok(ray) = camera.viewport_to_world(at, pointer)
    {
        let pixels_per_line = match wheel.unit {
            MouseScrollUnit::Line => 1.0,
            MouseScrollUnit::Pixel => MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
        };
        let away_m = mouse.line_m * f64::from(wheel.delta.y / pixels_per_line);
        let world_m = target_on_ray(ray, mouse.world_target_m(), at.forward(), away_m);
        world_m.into_iter().for_each(|world_m| mouse.set_world_target(world_m));
    }
    mouse.pressed = bits(mouse.buttons, &pressed);
}

/// The pressed ones of `buttons`, as the bits of a reading.
fn bits(buttons: &[MouseButton], pressed: &ButtonInput<MouseButton>) -> u32 {
    let bits = (0..u32::BITS).zip(buttons).map(|(bit, &button)| u32::from(pressed.pressed(button)) << bit);
    bits.sum()
}

/// The camera whose viewport is visible at `pointer` in `window`, with its transform.
fn camera_under<'a>(
    pointer: Vec2,
    window: Entity,
    cameras: &'a Query<(&Camera, &RenderTarget, &GlobalTransform), With<Camera3d>>,
) -> Option<(&'a Camera, &'a GlobalTransform)> {
    let is_in_window = |target: &RenderTarget| {
        let target = target.normalize(Some(window));
        matches!(target, Some(NormalizedRenderTarget::Window(target)) if target.entity() == window)
    };
    let contains_pointer =
        |camera: &Camera| camera.logical_viewport_rect().is_some_and(|viewport| viewport.contains(pointer));
    let visible = cameras
        .iter()
        .filter(|(camera, target, _)| camera.is_active && is_in_window(target) && contains_pointer(camera));
    visible.max_by_key(|(camera, ..)| camera.order).map(|(camera, _, at)| (camera, at))
}

/// Passes target and buttons to the device. A released button counts as released even while the pointer is not followed.
fn update_follower(pressed: Res<ButtonInput<MouseButton>>, mut mouse: ResMut<MouseDevice>) {
    let pressed = mouse.pressed & bits(mouse.buttons, &pressed);
    let mouse = mouse.bypass_change_detection();
    mouse.pressed = pressed;
    if let Some(follower) = &mut *mouse.follower.lock().unwrap_or_else(PoisonError::into_inner) {
        follower.set(mouse.target_m, pressed);
    }
}

/// Intersection of `ray` with the plane through `target_m` with normal `forward`, moved by `away_m` along the normal; `None` if they are
/// parallel, or if it lies behind the ray.
fn target_on_ray(ray: Ray3d, target_m: DVec3, forward: Dir3, away_m: f64) -> Option<DVec3> {
    let (normal, direction) = (forward.as_dvec3(), ray.direction.as_dvec3());
    let towards = direction.dot(normal);
    let distance_m = ((target_m - ray.origin.as_dvec3()).dot(normal) + away_m) / towards;
    (towards.abs() > f64::from(f32::EPSILON) && distance_m > 0.0)
        .then(|| ray.origin.as_dvec3() + distance_m * direction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use crate::{HapticSchedulePlugin, LoopMode};
    use bevy::camera::{RenderTargetInfo, Viewport};
    use bevy::time::TimeUpdateStrategy;
    use bevy::window::WindowResolution;
    use glam::DQuat;
    use palpate_haptics::DeviceFrame;
    use std::time::Duration;

    /// A camera half a metre in front of the origin, a window of 400 by 400 pixels, and a tool with the mouse.
    fn app() -> (App, Entity) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::input::InputPlugin))
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
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
        let tool = app.world_mut().spawn(HapticTool::new(MouseDevicePlugin::NAME)).id();
        (app, tool)
    }

    /// A second camera of a higher order that looks from another position and draws into `target`.
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
    fn pointer_and_wheel_move_the_tool() {
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
        // At the edge of the workspace, 20 cm.
        point_at(&mut app, Vec2::new(399.0, 200.0));
        let at = settled(&mut app, tool);
        assert!((at.x - 0.2).abs() < 1e-5, "{at}");
        app.world_mut().resource_mut::<MouseDevice>().reset();
        assert_eq!(app.world().resource::<MouseDevice>().target_m, DVec3::ZERO);
    }

    #[test]
    fn samples_between_frames_have_limited_speed_and_carry_the_button() {
        let (mut app, tool) = app();
        app.world_mut().entity_mut(tool).insert(crate::TickRecording::default());
        settled(&mut app, tool);
        point_at(&mut app, Vec2::new(280.0, 200.0));
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        settled(&mut app, tool);
        let samples = &app.world().get::<crate::TickRecording>(tool).unwrap().samples;
        let max_step_m = FollowerSettings::default().max_speed_m_per_s * 1e-3;
        for pair in samples.windows(2) {
            assert!(pair[0].position_m.distance(pair[1].position_m) <= max_step_m + 1e-12);
        }
        assert!((samples.last().unwrap().position_m.x - 0.2).abs() < 1e-5);
        assert_eq!((samples[100].buttons, samples.last().unwrap().buttons), (0, 1));
    }

    #[test]
    fn tool_is_under_the_pointer_for_every_frame() {
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
        // Also while the pointer is over a panel.
        let mut windows = app.world_mut().query::<&mut Window>();
        windows.single_mut(app.world_mut()).unwrap().set_cursor_position(None);
        set(&mut app, DeviceFrame { scale: 1.5, ..turned });
        let at = settled(&mut app, tool);
        assert!((at - expected).length() < 1e-5, "{at}");
        // A rejected frame has no effect.
        set(&mut app, DeviceFrame { scale: 0.0, ..turned });
        let at = settled(&mut app, tool);
        assert!((at - expected).length() < 1e-5, "{at}");
    }

    #[test]
    fn ray_is_that_of_the_camera_under_the_pointer() {
        let (mut app, tool) = app();
        another_camera(&mut app, RenderTarget::None { size: UVec2::splat(400) }, None);
        let corner = Viewport { physical_size: UVec2::splat(50), ..default() };
        another_camera(&mut app, RenderTarget::default(), Some(corner));
        point_at(&mut app, Vec2::new(240.0, 180.0));
        let at = settled(&mut app, tool);
        assert!((at - Vec3::new(0.1, 0.05, 0.0)).length() < 1e-5, "{at}");
    }

    #[test]
    fn ignores_buttons_beyond_the_bits_of_a_reading() {
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
    fn button_released_over_a_panel_is_released() {
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
        // A button pressed over the panel is not read.
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        assert_eq!(newest(&mut app), 0);
    }

    #[derive(Resource)]
    struct OverPanel(bool);

    #[test]
    fn target_is_reflected() {
        let (app, _) = app();
        let registry = app.world().resource::<AppTypeRegistry>().read();
        let registration = registry.get(std::any::TypeId::of::<MouseDevice>()).unwrap();
        assert!(registration.data::<ReflectResource>().is_some());
        let mouse: &dyn Reflect = app.world().resource::<MouseDevice>();
        let target = mouse.reflect_ref().as_struct().unwrap().field("target_m").unwrap();
        assert_eq!(target.try_downcast_ref::<DVec3>(), Some(&DVec3::ZERO));
    }

    #[test]
    fn ray_parallel_to_the_plane_has_no_target() {
        let ray = Ray3d::new(Vec3::ZERO, Dir3::X);
        assert_eq!(target_on_ray(ray, DVec3::Y, Dir3::Y, 0.0), None);
        // Behind the camera.
        assert_eq!(target_on_ray(ray, -DVec3::X, Dir3::X, 0.5), None);
        assert_eq!(target_on_ray(ray, DVec3::X, Dir3::X, 0.5), Some(1.5 * DVec3::X));
    }
}
