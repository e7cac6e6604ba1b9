//! Pictures without a window, for documents and tests.

use crate::scene::{SceneTime, Shown, print_error};
use crate::{Stage, StageOptions, assets, display, view};
use bevy::app::ScheduleRunnerPlugin;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::DebandDither;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The pictures to be drawn.
#[derive(Resource)]
struct Album {
    name: &'static str,
    folder: PathBuf,
    /// Times in descending order, s.
    at_s: Vec<f64>,
    drawn: usize,
    target: Handle<Image>,
    waits: bool,
}

/// Draws the scene into `folder` as `NAME-1.png` and so on, and exits. Without a driver, prints the reason and exits with an error.
pub(crate) fn draw(app: &mut App, stage: &Stage, folder: &Path, options: &StageOptions) -> Shown {
    if let Err(reason) = display::check_driver() {
        print_error(&format!("{reason}: {} draws nothing", stage.name));
        app.add_plugins(MinimalPlugins).add_systems(Startup, |mut exit: MessageWriter<AppExit>| {
            exit.write(AppExit::error());
        });
        return Shown::InPictures;
    }
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    // The pipelines must be ready before the first picture.
    let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
    app.add_plugins(DefaultPlugins.set(window).set(render).set(assets::plugin()).disable::<WinitPlugin>())
        .add_plugins(ScheduleRunnerPlugin::run_loop(Duration::ZERO));
    view::furnish(app, options);
    let mut at_s = options.at.clone();
    at_s.sort_by(|a, b| b.total_cmp(a));
    let [width, height] = options.size;
    // The captions need this format.
    let image = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
    let target = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    app.insert_resource(Album {
        name: stage.name,
        folder: folder.into(),
        at_s,
        drawn: 0,
        target,
        waits: false,
    })
    .add_systems(PostStartup, aim)
    .add_systems(Update, take);
    Shown::InPictures
}

fn aim(mut commands: Commands, album: Res<Album>, cameras: Query<Entity, With<Camera3d>>) {
    for camera in &cameras {
        let mut camera = commands.entity(camera);
        // Dithering doubles the size of a file.
        camera.insert((RenderTarget::Image(album.target.clone().into()), DebandDither::Disabled));
        #[cfg(feature = "panel")]
        camera.insert(bevy_egui::PrimaryEguiContext);
    }
}

/// Takes each picture at its time; pauses the time until it is saved.
fn take(
    mut commands: Commands,
    mut album: ResMut<Album>,
    scene: Res<SceneTime>,
    mut time: ResMut<Time<Virtual>>,
    mut exit: MessageWriter<AppExit>,
) {
    if album.waits {
        return;
    }
    let Some(&next_s) = album.at_s.last() else {
        exit.write(AppExit::Success);
        return;
    };
    if scene.0 < next_s - 1e-9 {
        return;
    }
    album.at_s.pop();
    album.drawn += 1;
    album.waits = true;
    time.pause();
    let file = album.folder.join(format!("{}-{}.png", album.name, album.drawn));
    commands.spawn(Screenshot::image(album.target.clone())).observe(save_to_disk(file)).observe(
        |_: On<ScreenshotCaptured>, mut album: ResMut<Album>, mut time: ResMut<Time<Virtual>>| {
            album.waits = false;
            time.unpause();
        },
    );
}
