//! The same scene with a window, lit, the block deforming under the tool.

use crate::options::Options;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{SimulatedBody, TickRecording};

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
        .add_systems(PreUpdate, (dress_body, dress_tool, keep_a_minute));
    true
}

/// A window may stay open for hours: the report at its end is of the last minute or two.
fn keep_a_minute(mut tools: Query<&mut TickRecording, Added<TickRecording>>) {
    tools.iter_mut().for_each(|mut recording| recording.keep = 60_000);
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
    pub fn check() -> Result<(), String> {
        #[cfg(target_os = "linux")]
        linux::display()?;
        let wanted = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
        let instance = wgpu::Instance::default();
        if bevy::tasks::block_on(instance.enumerate_adapters(wanted & wgpu::Backends::PRIMARY)).is_empty() {
            return Err("there is no graphics driver (Vulkan on Linux)".into());
        }
        Ok(())
    }

    #[cfg(target_os = "linux")]
    mod linux {
        use std::os::unix::net::UnixStream;
        use std::path::PathBuf;

        /// winit takes Wayland if `WAYLAND_DISPLAY` is set and does not fall back to X11.
        pub fn display() -> Result<(), String> {
            if let Some(name) = std::env::var_os("WAYLAND_DISPLAY").filter(|name| !name.is_empty()) {
                let folder = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).unwrap_or_default();
                let answers = UnixStream::connect(folder.join(name)).is_ok();
                return answers.then_some(()).ok_or("the Wayland display does not answer".into());
            }
            let Some(display) = std::env::var("DISPLAY").ok().filter(|display| !display.is_empty()) else {
                return Err("there is no display (neither WAYLAND_DISPLAY nor DISPLAY is set)".into());
            };
            if x11_answers(&display) { Ok(()) } else { Err(format!("the display {display} does not answer")) }
        }

        /// A display on this machine must answer; one on another (`host:0`) is taken at its word.
        fn x11_answers(display: &str) -> bool {
            let Some((host, screen)) = display.rsplit_once(':') else { return false };
            let number = screen.split('.').next().unwrap_or_default();
            let here = host.is_empty() || host == "unix";
            !here || UnixStream::connect(format!("/tmp/.X11-unix/X{number}")).is_ok()
        }
    }
}
