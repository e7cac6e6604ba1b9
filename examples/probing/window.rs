//! The same scene with a window, lit, the block deforming under the tool.

use crate::options::Options;
use bevy::prelude::*;
use bevy_palpate::SimulatedBody;
use bevy_palpate::prelude::*;

/// Adds a window and what is to be seen in it, unless there is no place for one; says why not.
#[expect(clippy::print_stderr, reason = "there is no log before there is an app")]
pub fn add_plugins(app: &mut App, options: &Options) -> bool {
    if options.headless {
        return false;
    }
    if let Err(why) = display::check() {
        eprintln!("{why}: probing without a window");
        return false;
    }
    let window = Window { title: "palpate: probing".into(), ..default() };
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .insert_resource(ClearColor(Color::srgb(0.09, 0.10, 0.12)))
        .insert_resource(GlobalAmbientLight { brightness: 250.0, ..default() })
        .add_systems(Startup, set_up_stage)
        .add_systems(PreUpdate, (dress_body, dress_tool));
    true
}

fn set_up_stage(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((
        Camera3d::default(),
        // Centimetres are seen from near: the default near plane would cut into the block.
        Projection::Perspective(PerspectiveProjection { near: 0.005, ..default() }),
        Transform::from_xyz(0.14, 0.14, 0.2).looking_at(Vec3::new(0.0, 0.005, 0.0), Vec3::Y),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 6_000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(0.3, 0.8, 0.4).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(0.6, 0.6))),
        MeshMaterial3d(materials.add(Color::srgb(0.25, 0.27, 0.30))),
        Transform::from_xyz(0.0, -0.0502, 0.0),
    ));
}

fn dress_body(
    mut commands: Commands,
    bodies: Query<Entity, Added<SimulatedBody>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for body in &bodies {
        let flesh = StandardMaterial {
            base_color: Color::srgb(0.85, 0.45, 0.42),
            perceptual_roughness: 0.6,
            ..default()
        };
        commands.entity(body).insert(MeshMaterial3d(materials.add(flesh)));
    }
}

fn dress_tool(
    mut commands: Commands,
    tools: Query<(Entity, &HapticTool), Added<HapticTool>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (entity, tool) in &tools {
        let steel = StandardMaterial {
            base_color: Color::srgb(0.75, 0.78, 0.82),
            metallic: 0.7,
            perceptual_roughness: 0.35,
            ..default()
        };
        commands.entity(entity).insert((
            Mesh3d(meshes.add(Sphere::new(tool.radius_m as f32))),
            MeshMaterial3d(materials.add(steel)),
        ));
    }
}

/// Whether a window can be opened here. winit and wgpu panic where it cannot, so it is asked before.
mod display {
    use std::os::unix::net::UnixStream;
    use std::path::PathBuf;

    pub fn check() -> Result<(), String> {
        if !wayland_answers() && !x11_answers() {
            return Err("there is no display (neither WAYLAND_DISPLAY nor DISPLAY leads to one)".into());
        }
        let instance = wgpu::Instance::default();
        let adapters = instance.enumerate_adapters(wgpu::Backends::VULKAN | wgpu::Backends::GL);
        if bevy::tasks::block_on(adapters).is_empty() {
            return Err("there is no graphics driver (neither Vulkan nor OpenGL)".into());
        }
        Ok(())
    }

    fn wayland_answers() -> bool {
        let Some(name) = std::env::var_os("WAYLAND_DISPLAY") else { return false };
        let folder = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).unwrap_or_default();
        UnixStream::connect(folder.join(name)).is_ok()
    }

    /// A display on this machine must answer; one on another (`host:0`) is taken at its word.
    fn x11_answers() -> bool {
        let Ok(display) = std::env::var("DISPLAY") else { return false };
        let Some((host, screen)) = display.rsplit_once(':') else { return false };
        let number = screen.split('.').next().unwrap_or_default();
        !host.is_empty() && host != "unix" || UnixStream::connect(format!("/tmp/.X11-unix/X{number}")).is_ok()
    }
}
