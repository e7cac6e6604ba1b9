//! The panel and the gizmos, drawn off-screen: their content, and their cost.
//!
//! Skipped, with the reason printed, without a graphics driver (Mesa's software Vulkan is sufficient).

use bevy::camera::RenderTarget;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_egui::{EguiGlobalSettings, PrimaryEguiContext};
use bevy_palpate::prelude::*;
use bevy_palpate::{
    HapticGizmos, HapticGizmosPlugin, HapticPanel, HapticPanelPlugin, HapticSchedulePlugin, LoopMode,
};
use palpate_haptics::{Reading, ScriptedDevice};
use std::path::PathBuf;
use std::time::Duration;

const SIZE: UVec2 = UVec2::new(1280, 720);
/// Approximate left edge of the panel, pixels.
const PANEL: u32 = 900;

/// Whether there is a graphics driver; prints the reason of a skipped test.
#[expect(clippy::print_stderr, reason = "the reason of a skipped test")]
fn has_driver() -> bool {
    let instance = wgpu::Instance::default();
    let found = !bevy::tasks::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY)).is_empty();
    if !found {
        eprintln!("skipped: there is no graphics driver (Vulkan on Linux)");
    }
    found
}

#[derive(Resource, Default)]
struct Picture(Option<Image>);

#[derive(Resource)]
struct Target(Handle<Image>);

/// A block under a tool that presses and slides, with a camera that renders to an image; each update is a model step.
fn app() -> App {
    let mut app = App::new();
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    // The pipelines must be ready before the first picture.
    let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
    app.add_plugins(DefaultPlugins.set(window).set(render).disable::<WinitPlugin>())
        .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
        .add_plugins((HapticPanelPlugin::default(), HapticGizmosPlugin))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)))
        .insert_resource(ClearColor(Color::srgb(0.09, 0.10, 0.12)))
        .init_resource::<Picture>()
        .add_systems(Startup, setup);
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
        Ok(ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let (depth, aside) = (0.004 * (2.0 * t).sin().abs(), 0.008 * (3.0 * t).sin());
            Ok(Reading::at(DVec3::new(0.012 + aside, 0.0555 - depth, 0.011)))
        }))
    });
    app.finish();
    app.cleanup();
    app
}

fn setup(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let image = images.add(Image::new_target_texture(SIZE.x, SIZE.y, TextureFormat::Rgba8UnormSrgb, None));
    commands.insert_resource(Target(image.clone()));
    commands.spawn((
        Camera3d::default(),
        PrimaryEguiContext,
        RenderTarget::Image(image.into()),
        Msaa::Off,
        Projection::Perspective(PerspectiveProjection { near: 0.005, ..default() }),
        Transform::from_xyz(0.18, 0.12, 0.22).looking_at(Vec3::new(0.05, 0.0, 0.0), Vec3::Y),
    ));
    commands.spawn((
        Name::new("block"),
        DeformableBody::block([6, 6, 6], 0.1),
        Tissue::default(),
        FixedRegion::Face(BoxFace::Bottom),
        MeshMaterial3d(materials.add(Color::srgb(0.62, 0.30, 0.28))),
    ));
    let light = DirectionalLight { illuminance: 5_000.0, ..default() };
    commands.spawn((light, Transform::from_xyz(0.3, 0.8, 0.5).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((Name::new("hand"), HapticTool::new("hand")));
}

/// Updates without an active camera, to draw nothing.
fn pass(app: &mut App, updates: usize) {
    let set_cameras = |app: &mut App, is_active| {
        let world = app.world_mut();
        world.query::<&mut Camera>().iter_mut(world).for_each(|mut camera| camera.is_active = is_active);
    };
    app.update();
    set_cameras(app, false);
    (1..updates).for_each(|_| app.update());
    set_cameras(app, true);
}

/// The picture after further updates, which is also saved as `name`.
fn picture(app: &mut App, updates: usize, name: &str) -> Image {
    (0..updates).for_each(|_| app.update());
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let target = app.world().resource::<Target>().0.clone();
    app.world_mut().resource_mut::<Picture>().0 = None;
    app.world_mut().spawn(Screenshot::image(target)).observe(save_to_disk(path)).observe(
        |captured: On<ScreenshotCaptured>, mut picture: ResMut<Picture>| {
            picture.0 = Some(captured.image.clone());
        },
    );
    for _ in 0..50 {
        app.update();
        if let Some(image) = app.world_mut().resource_mut::<Picture>().0.take() {
            return image;
        }
    }
    panic!("no picture after 50 updates");
}

/// Number of pixels of `image` from x = `from` to `to` that are close to `color` (sRGB, 0 to 255).
fn count(image: &Image, (from, to): (u32, u32), color: [i32; 3]) -> usize {
    let near = |pixel: &[u8]| (0..3).all(|i| (i32::from(pixel[i]) - color[i]).abs() <= 24);
    let all = (0..SIZE.y).flat_map(|y| (from..to).map(move |x| UVec3::new(x, y, 0)));
    all.filter(|at| image.pixel_bytes(*at).is_ok_and(near)).count()
}

fn median_ms(app: &App, path: &bevy::diagnostic::DiagnosticPath) -> f64 {
    let store = app.world().resource::<DiagnosticsStore>();
    let mut values: Vec<f64> = store.get(path).unwrap().values().copied().collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn panel_draws_its_curves_and_closes() {
    if !has_driver() {
        return;
    }
    let mut app = app();
    let open = picture(&mut app, 60, "panel.png");
    let (panel, scene) = ((PANEL, SIZE.x), (0, PANEL));
    // The curves of the full body and of the near field exact, and text.
    let [full, near, text] =
        [[240, 242, 246], [40, 200, 150], [140, 140, 140]].map(|c| count(&open, panel, c));
    assert!(full > 300 && near > 100 && text > 300, "{full} {near} {text}");
    let scene_of = |image: &Image| count(image, scene, [24, 26, 31]);
    assert!(scene_of(&open) > 100_000, "the panel leaves the scene free: {}", scene_of(&open));

    app.world_mut().resource_mut::<HapticPanel>().open = false;
    let closed = picture(&mut app, 25, "panel_closed.png");
    let background = count(&closed, panel, [24, 26, 31]);
    assert!(background > 200_000, "{background}");
    // The last twenty frames were closed ones.
    let store = app.world().resource::<DiagnosticsStore>();
    let cost = store.get(&HapticPanelPlugin::COST).unwrap();
    let mut recent: Vec<f64> = cost.values().skip(cost.history_len() - 20).copied().collect();
    recent.sort_by(f64::total_cmp);
    assert!(recent[10] < 0.5, "a closed panel costs {} ms", recent[10]);
}

#[test]
fn gizmos_draw_the_selected_parts() {
    if !has_driver() {
        return;
    }
    let mut app = app();
    app.world_mut().resource_mut::<HapticPanel>().open = false;
    pass(&mut app, 12);
    let plain = picture(&mut app, 8, "gizmos_default.png");
    {
        let mut store = app.world_mut().resource_mut::<GizmoConfigStore>();
        let (_, parts) = store.config_mut::<HapticGizmos>();
        (parts.lattice, parts.fixed, parts.near_field) = (true, true, true);
    }
    let lattice = picture(&mut app, 1, "gizmos_lattice.png");
    {
        let mut store = app.world_mut().resource_mut::<GizmoConfigStore>();
        let (_, parts) = store.config_mut::<HapticGizmos>();
        (parts.near_field, parts.basis) = (false, Some(0));
    }
    let basis = picture(&mut app, 1, "gizmos_basis.png");
    let whole = (0, SIZE.x);
    let yellow = [250, 230, 40];
    let green = [51, 242, 153];
    assert!(count(&lattice, whole, green) > 50 && count(&plain, whole, green) < 5, "the near field");
    assert!(count(&basis, whole, yellow) > 20 && count(&lattice, whole, yellow) < 20);
    let cost = median_ms(&app, &HapticGizmosPlugin::COST);
    assert!(cost < 20.0, "{cost} ms");
    // Without gizmos.
    app.world_mut().resource_mut::<GizmoConfigStore>().config_mut::<HapticGizmos>().0.enabled = false;
    let nothing = picture(&mut app, 1, "gizmos_off.png");
    let tool = [217, 230, 255];
    assert!(count(&plain, whole, tool) > 20 && count(&nothing, whole, tool) == 0);
}
