//! The view: camera, light, floor, and the looks of bodies, tools and threads.

use crate::scene::{Shown, ToolPaint, print_error};
use crate::{Stage, StageOptions, assets, display, instruments, keys};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{MouseDevicePlugin, MouseDeviceSystems, SimulatedBody};
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use palpate_haptics::FollowerSettings;

const BLUE: Color = Color::srgb(0.10, 0.42, 0.85);
const ORANGE: Color = Color::srgb(0.95, 0.60, 0.10);
const FLESH: Color = Color::srgb(0.74, 0.31, 0.28);
const FLOOR: Color = Color::srgb(0.13, 0.15, 0.185);
const BACKGROUND: Color = Color::srgb(0.035, 0.042, 0.055);
const THREAD: Color = Color::srgb(0.93, 0.93, 0.86);

/// Opens a window with the view. Without a display or a driver, prints the reason and runs headless.
pub(crate) fn open_window(app: &mut App, stage: &Stage, options: &StageOptions) -> Shown {
    if let Err(reason) = display::check() {
        print_error(&format!("{reason}: {} runs without a window", stage.name));
        return Shown::Headless;
    }
    let window = Window { title: format!("{}: {}", stage.name, stage.title), ..default() };
    app.add_plugins(
        DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }).set(assets::plugin()),
    )
    .add_plugins((PanOrbitCameraPlugin, mouse(stage), keys::KeysPlugin));
    furnish(app, options);
    app.add_systems(PostStartup, add_orbit_camera).configure_sets(
        PreUpdate,
        MouseDeviceSystems.run_if(not(keys::camera_turns).and_then(not(keys::pointer_is_elsewhere))),
    );
    Shown::InWindow
}

/// The mouse device: starts above the focus of the camera, with a workspace and a maximum speed proportional to the size of the stage.
fn mouse(stage: &Stage) -> MouseDevicePlugin {
    let magnified = f64::from(stage.magnified());
    let start_m = (stage.focus_m + Vec3::Y * 0.7 * stage.size_m).as_dvec3();
    let usual = FollowerSettings::default();
    let workspace_m = usual.workspace_m.map(|corner_m| stage.focus_m.as_dvec3() + magnified * corner_m);
    let max_speed_m_per_s = magnified * usual.max_speed_m_per_s;
    let hand = FollowerSettings { start_m, workspace_m, max_speed_m_per_s, ..usual };
    let usual = MouseDevicePlugin::default();
    MouseDevicePlugin { hand, line_m: magnified * usual.line_m, ..usual }
}

/// Adds light, floor, looks, captions and instruments.
pub(crate) fn furnish(app: &mut App, options: &StageOptions) {
    app.insert_resource(ClearColor(BACKGROUND))
        .insert_resource(GlobalAmbientLight { brightness: 150.0, ..default() })
        .add_systems(Startup, light_up)
        .add_systems(PreUpdate, (dress_bodies, dress_tools, dress_sutures))
        .add_systems(PostUpdate, stretch_threads.before(TransformSystems::Propagate));
    instruments::add(app, options);
    #[cfg(feature = "panel")]
    app.add_plugins(crate::caption::CaptionPlugin);
}

fn light_up(
    mut commands: Commands,
    stage: Res<Stage>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let magnified = stage.magnified();
    commands.spawn((
        Camera3d::default(),
        // The default near plane would cut into a body of centimetres.
        Projection::Perspective(PerspectiveProjection { near: 0.005 * magnified, ..default() }),
        Transform::from_translation(stage.eye_m).looking_at(stage.focus_m, Vec3::Y),
        // Hides the edges of the floor.
        DistanceFog {
            color: BACKGROUND,
            falloff: FogFalloff::Linear { start: 0.35 * magnified, end: 1.3 * magnified },
            ..default()
        },
    ));
    commands.spawn((
        DirectionalLight {
            illuminance: 8_500.0,
            color: Color::srgb(1.0, 0.96, 0.90),
            shadow_maps_enabled: true,
            ..default()
        },
        // Shadows within a decimetre, instead of the default hundred metres.
        bevy::light::CascadeShadowConfigBuilder {
            num_cascades: 1,
            minimum_distance: 0.02 * magnified,
            maximum_distance: 0.8 * magnified,
            ..default()
        }
        .build(),
        // Low, to give an indentation a dark side.
        Transform::from_xyz(0.75, 0.62, 0.30).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    // A weaker light from the other side, to brighten the dark faces.
    commands.spawn((
        DirectionalLight {
            illuminance: 1_300.0,
            color: Color::srgb(0.75, 0.85, 1.0),
            shadow_maps_enabled: false,
            ..default()
        },
        Transform::from_xyz(-0.6, 0.45, 0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(4.0 * magnified, 4.0 * magnified))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color: FLOOR,
            perceptual_roughness: 0.9,
            ..default()
        })),
        Transform::from_xyz(stage.focus_m.x, stage.floor_m, stage.focus_m.z),
    ));
}

fn add_orbit_camera(mut commands: Commands, cameras: Query<Entity, With<Camera3d>>, stage: Res<Stage>) {
    for camera in &cameras {
        commands.entity(camera).insert(PanOrbitCamera {
            focus: stage.focus_m,
            button_orbit: MouseButton::Right,
            button_pan: MouseButton::Middle,
            // The wheel changes the depth of the mouse device; `keys` enables zoom with Ctrl.
            zoom_sensitivity: 0.0,
            zoom_lower_limit: 0.05 * stage.magnified(),
            use_real_time: true,
            ..default()
        });
    }
}

fn dress_bodies(
    mut commands: Commands,
    bodies: Query<Entity, (Added<SimulatedBody>, Without<MeshMaterial3d<StandardMaterial>>)>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for body in &bodies {
        let flesh = StandardMaterial {
            base_color: FLESH,
            perceptual_roughness: 0.36,
            reflectance: 0.5,
            // A slit shows the inside, and a thin body both sides.
            double_sided: true,
            cull_mode: None,
            ..default()
        };
        commands.entity(body).insert(MeshMaterial3d(materials.add(flesh)));
    }
}

/// The shape that a tool shows.
#[derive(Component)]
struct Dressed(ToolShape);

/// Adds a tip of the tool's size, and a handle, which is visible from all sides.
fn dress_tools(
    mut commands: Commands,
    tools: Query<(Entity, &HapticTool, Option<&ToolPaint>), Changed<HapticTool>>,
    dressed: Query<&Dressed>,
    stage: Res<Stage>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let magnified = stage.magnified();
    for (entity, &HapticTool { shape, .. }, paint) in &tools {
        if dressed.get(entity).is_ok_and(|dressed| dressed.0 == shape) {
            continue;
        }
        let steel = materials.add(StandardMaterial {
            base_color: match paint.copied().unwrap_or_default() {
                ToolPaint::Blue => BLUE,
                ToolPaint::Orange => ORANGE,
            },
            metallic: 0.15,
            perceptual_roughness: 0.3,
            ..default()
        });
        let radius = shape.radius_m() as f32;
        let (tip, handle) = match shape {
            ToolShape::Sphere { .. } => {
                let lean = Quat::from_rotation_z(-0.3) * Quat::from_rotation_x(-0.35);
                let at = Transform::from_rotation(lean).with_translation(lean * Vec3::Y * 0.04 * magnified);
                let rod = Capsule3d::new((0.45 * radius).min(0.004 * magnified), 0.08 * magnified);
                (Mesh::from(Sphere::new(radius)), (Mesh::from(rod), at))
            }
            ToolShape::FlatPunch { axis, .. } => {
                let up = Quat::from_rotation_arc(Vec3::Y, -axis.as_vec3());
                // The position of a punch is the centre of its face.
                let at = |height: f32| {
                    Transform::from_rotation(up).with_translation(up * Vec3::Y * (0.5 * height))
                };
                let rod = Cylinder::new(0.004, 0.07);
                let tip = Mesh::from(Cylinder::new(radius, 0.012)).transformed_by(at(0.012));
                (tip, (Mesh::from(rod), at(0.07)))
            }
        };
        commands.entity(entity).despawn_children().insert((
            Dressed(shape),
            Mesh3d(meshes.add(tip)),
            MeshMaterial3d(steel.clone()),
            children![(Mesh3d(meshes.add(handle.0)), MeshMaterial3d(steel), handle.1)],
        ));
    }
}

/// Radius of a thread, m.
const THREAD_M: f32 = 0.0009;

fn dress_sutures(
    mut commands: Commands,
    sutures: Query<Entity, Added<Suture>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for suture in &sutures {
        let silk = StandardMaterial { base_color: THREAD, perceptual_roughness: 0.5, ..default() };
        commands.entity(suture).insert((
            Mesh3d(meshes.add(Cylinder::new(THREAD_M, 1.0))),
            MeshMaterial3d(materials.add(silk)),
            Transform::from_scale(Vec3::ZERO),
        ));
    }
}

/// Stretches each thread between its ends; hides a torn one.
fn stretch_threads(mut sutures: Query<(&SutureForce, &mut Transform), With<Suture>>) {
    for (force, mut transform) in &mut sutures {
        let [a, b] = force.ends_m.map(|end| end.as_vec3() + Vec3::Y * THREAD_M);
        let along = b - a;
        let visible = if force.is_torn { 0.0 } else { 1.0 };
        *transform = Transform {
            translation: 0.5 * (a + b),
            rotation: along.try_normalize().map_or(Quat::IDENTITY, |d| Quat::from_rotation_arc(Vec3::Y, d)),
            scale: visible * Vec3::new(1.0, along.length(), 1.0),
        };
    }
}
