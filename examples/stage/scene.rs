//! A scene on the stage: start, restart, exit.

use crate::hand::HandTimes;
use crate::progress::ProgressPlugin;
use crate::{StageOptions, assets, time};
use bevy::app::ScheduleRunnerPlugin;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    HapticSchedulePlugin, HapticSystems, HapticUpdateSystems, LoopMode, Model, ModelRate, ModelSchedule,
    SimulatedBody,
};
use std::time::Duration;

/// Schedule that spawns a scene's bodies, at the start and at every restart.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash)]
pub struct SetUpScene;

/// Schedule that spawns a scene's tools once its bodies are built.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash)]
pub struct SetUpHands;

/// State of the wait of the scene's tools for its bodies.
#[derive(Resource, Default)]
struct AwaitsBodies {
    /// Whether the tools wait.
    waits: bool,
    /// Time of the model at which all bodies were built, s.
    built_s: Option<f64>,
}

/// Description of a scene.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Stage {
    /// Name of the scene.
    pub name: &'static str,
    /// Title, one line.
    pub title: &'static str,
    /// Initial position of the camera, m.
    pub eye_m: Vec3,
    /// Initial focus of the camera, m.
    pub focus_m: Vec3,
    /// Height of the floor, m.
    pub floor_m: f32,
    /// Size of the scene, m, which scales fog, shadows, the mouse's workspace and arrows.
    pub size_m: f32,
    /// Duration without a window, s.
    pub seconds: f64,
    /// Mode of the loops without a window.
    pub mode: LoopMode,
    /// Whether the scene has a device of its own; otherwise the mouse moves the first tool.
    pub has_hand: bool,
    /// Whether the tools wait until the bodies have come to rest, for at most 5 s.
    pub settles: bool,
}

/// Maximum time that tools wait for bodies to come to rest, s.
const MAX_SETTLING_S: f64 = 5.0;

/// Reference size of the stage's own sizes, m.
const USUAL_M: f32 = 0.1;

impl Default for Stage {
    fn default() -> Self {
        Self {
            name: "",
            title: "",
            eye_m: Vec3::new(0.13, 0.14, 0.18),
            focus_m: Vec3::new(0.0, 0.01, 0.0),
            floor_m: -0.0502,
            size_m: USUAL_M,
            seconds: 5.0,
            mode: LoopMode::Lockstep,
            has_hand: true,
            settles: false,
        }
    }
}

/// Colour of a tool; blue by default.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToolPaint {
    /// For the first of several tools, or the only one.
    #[default]
    Blue,
    /// For the second tool.
    Orange,
}

/// Time of the model steps since the scene's tools were spawned, s.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct SceneTime(pub f64);

/// Restarts the scene.
#[derive(Message, Clone, Copy, Debug)]
pub(crate) struct ResetScene;

/// Output of a scene.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shown {
    #[cfg(feature = "window")]
    InWindow,
    #[cfg(feature = "window")]
    InPictures,
    Headless,
}

impl Stage {
    /// Returns the stage for a scene between two corners, m, viewed from above in front, with the floor just below.
    #[must_use]
    pub fn around(self, [low_m, high_m]: [Vec3; 2]) -> Self {
        let size_m = (high_m - low_m).max_element().clamp(1e-4, 1e4);
        let focus_m = 0.5 * (low_m + high_m);
        // The same apparent size as in the other scenes.
        let eye_m = focus_m + 1.35 * size_m * Vec3::new(0.75, 0.80, 1.05);
        Self { eye_m, focus_m, floor_m: low_m.y - 0.002 * size_m, size_m, ..self }
    }

    /// Returns the size relative to the reference size.
    #[must_use]
    pub(crate) fn magnified(&self) -> f32 {
        self.size_m / USUAL_M
    }

    /// Returns an app with this stage, for the scene's own systems.
    pub fn app(self, options: &StageOptions) -> App {
        let mut app = App::new();
        app.insert_resource(options.clone()).insert_resource(self).init_resource::<SceneTime>();
        let shown = show(&mut app, &self, options);
        let mode = match shown {
            #[cfg(feature = "window")]
            Shown::InWindow => LoopMode::Threaded,
            #[cfg(feature = "window")]
            Shown::InPictures => LoopMode::Lockstep,
            // A real device runs in real time.
            Shown::Headless if options.hid.is_some() => LoopMode::Threaded,
            Shown::Headless => self.mode,
        };
        if shown == Shown::Headless {
            let frame = Duration::from_millis(if mode == LoopMode::Threaded { 5 } else { 0 });
            let runner = ScheduleRunnerPlugin::run_loop(frame);
            app.add_plugins((MinimalPlugins.set(runner), LogPlugin::default(), ProgressPlugin));
            assets::add_without_window(&mut app);
        }
        crate::device::add(&mut app);
        if mode == LoopMode::Lockstep {
            time::step_by_step(&mut app);
        }
        app.insert_resource(shown)
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(mode)))
            .add_message::<ResetScene>()
            .init_schedule(SetUpScene)
            .init_schedule(SetUpHands)
            .init_resource::<AwaitsBodies>()
            .init_resource::<HandTimes>()
            .add_systems(Startup, set_up)
            .add_systems(
                PreUpdate,
                set_up.run_if(on_message::<ResetScene>).before(HapticUpdateSystems::Bodies),
            )
            .add_systems(
                PreUpdate,
                (exit_if_rejected, set_up_hands)
                    .chain()
                    .after(HapticUpdateSystems::Bodies)
                    .before(HapticUpdateSystems::Tools)
                    .run_if(|awaits: Res<AwaitsBodies>| awaits.waits),
            )
            .add_systems(
                ModelSchedule,
                (
                    count_time.before(HapticSystems::First),
                    time::return_to_full_speed
                        .after(HapticSystems::Last)
                        .run_if(resource_exists::<time::Returning>),
                ),
            )
            .add_systems(Update, exit_in_time);
        app
    }

    /// Returns the duration of the scene, s; `None` if it runs until it is closed.
    #[must_use]
    pub(crate) fn end_s(&self, options: &StageOptions, shown: Shown) -> Option<f64> {
        options.seconds.or((shown == Shown::Headless).then_some(self.seconds))
    }
}

#[cfg(feature = "window")]
fn show(app: &mut App, stage: &Stage, options: &StageOptions) -> Shown {
    if options.headless {
        return Shown::Headless;
    }
    if let Some(folder) = &options.pictures {
        return crate::picture::draw(app, stage, folder, options);
    }
    crate::view::open_window(app, stage, options)
}

#[cfg(not(feature = "window"))]
fn show(_app: &mut App, _stage: &Stage, options: &StageOptions) -> Shown {
    if options.pictures.is_some() || options.panel {
        print_error("this program cannot draw: build it with --features panel,gizmos");
    }
    Shown::Headless
}

/// Prints a message to the error output, before the app has a log.
#[expect(clippy::print_stderr, reason = "without an app there is no log")]
pub(crate) fn print_error(text: &str) {
    eprintln!("{text}");
}

/// Exits the app with an error if the report of a scene failed.
pub fn exit_on_error(In(result): In<Result>, mut exit: MessageWriter<AppExit>) {
    if let Err(error) = result {
        error!("the report failed: {error}");
        exit.write(AppExit::error());
    }
}

fn set_up(world: &mut World) {
    let mut previous = world
        .query_filtered::<Entity, Or<(With<DeformableBody>, With<HapticTool>, With<Suture>, With<Obstacle>)>>(
        );
    for entity in previous.iter(world).collect::<Vec<_>>() {
        world.despawn(entity);
    }
    // The loops have ended with their tools.
    world.resource::<HandTimes>().restart();
    world.insert_resource(SceneTime::default());
    world.insert_resource(AwaitsBodies { waits: true, built_s: None });
    world.run_schedule(SetUpScene);
}

/// Spawns the tools once all bodies are built, and at rest if the scene has bodies that settle.
pub(crate) fn set_up_hands(world: &mut World) {
    let mut pending = world.query_filtered::<(), (With<DeformableBody>, Without<SimulatedBody>)>();
    if pending.iter(world).next().is_some() {
        return;
    }
    let now_s = world.resource::<Time<Model>>().elapsed_secs_f64();
    let built_s = *world.resource_mut::<AwaitsBodies>().built_s.get_or_insert(now_s);
    let mut bodies = world.query::<&SimulatedBody>();
    let is_settling = world.resource::<Stage>().settles
        && now_s < built_s + MAX_SETTLING_S
        && bodies.iter(world).any(|body| !body.body().is_settled());
    if !is_settling {
        world.insert_resource(AwaitsBodies::default());
        world.run_schedule(SetUpHands);
    }
}

/// Exits if a body is rejected; the fault in the log has the reason.
fn exit_if_rejected(
    mut faults: MessageReader<HapticFault>,
    pending: Query<(), (With<DeformableBody>, Without<SimulatedBody>)>,
    mut exit: MessageWriter<AppExit>,
) {
    if faults.read().any(|fault| fault.entity.is_some_and(|entity| pending.contains(entity))) {
        exit.write(AppExit::error());
    }
}

fn count_time(rate: Res<ModelRate>, awaits: Res<AwaitsBodies>, mut time: ResMut<SceneTime>) {
    if !awaits.waits {
        time.0 += rate.period_s();
    }
}

fn exit_in_time(
    time: Res<SceneTime>,
    stage: Res<Stage>,
    options: Res<StageOptions>,
    shown: Res<Shown>,
    mut exit: MessageWriter<AppExit>,
) {
    if stage.end_s(&options, *shown).is_some_and(|end_s| time.0 > end_s - 1e-9) {
        exit.write(AppExit::Success);
    }
}

#[cfg(test)]
mod tests;
