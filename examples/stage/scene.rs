//! A scene on the stage: begun, begun again, ended.

use crate::hand::HandTimes;
use crate::progress::ProgressPlugin;
use crate::{StageOptions, assets, time};
use bevy::app::ScheduleRunnerPlugin;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticUpdateSystems, SimulatedBody};
use std::time::Duration;

/// Spawns a scene's bodies, at the start and at every reset: systems are added to it as to `Startup`.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash)]
pub struct SetUpScene;

/// Spawns a scene's tools, once its bodies are there: one that is read from a file takes its time.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash)]
pub struct SetUpHands;

/// The scene's hands are still to come.
#[derive(Resource, Default)]
struct AwaitsBodies(bool);

/// What a scene says of itself.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Stage {
    /// Its name.
    pub name: &'static str,
    /// What it shows, in one line.
    pub title: &'static str,
    /// Where the camera is at first, m, and what it looks at.
    pub eye_m: Vec3,
    /// What it looks at.
    pub focus_m: Vec3,
    /// Where the floor is, m.
    pub floor_m: f32,
    /// How large what is shown is, m: fog, shadows, the mouse's way and the length of arrows go with it.
    pub size_m: f32,
    /// How long it takes, s.
    pub seconds: f64,
    /// The clock of the loops where there is no window.
    pub mode: LoopMode,
    /// The scene's own hand is there, so the mouse is not the first device.
    pub has_hand: bool,
}

/// The size for which the stage's own sizes are given, m.
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
        }
    }
}

/// What a tool is painted with; blue if nothing is said.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToolPaint {
    /// The first of several, or the only one.
    #[default]
    Blue,
    /// The second.
    Orange,
}

/// Time since the scene's hands came, s, in model steps.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct SceneTime(pub f64);

/// Asks for the scene as it was at the start.
#[derive(Message, Clone, Copy, Debug)]
pub(crate) struct ResetScene;

/// How a scene is shown.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shown {
    #[cfg(feature = "window")]
    InWindow,
    #[cfg(feature = "window")]
    InPictures,
    Headless,
}

impl Stage {
    /// The same stage round what lies between two corners, m: seen from in front and above, its floor just below.
    #[must_use]
    pub fn around(self, [low_m, high_m]: [Vec3; 2]) -> Self {
        let size_m = (high_m - low_m).max_element().clamp(1e-4, 1e4);
        let focus_m = 0.5 * (low_m + high_m);
        // As large as in the other scenes.
        let eye_m = focus_m + 1.35 * size_m * Vec3::new(0.75, 0.80, 1.05);
        Self { eye_m, focus_m, floor_m: low_m.y - 0.002 * size_m, size_m, ..self }
    }

    /// Its size as a multiple of the usual one.
    #[must_use]
    pub(crate) fn magnified(&self) -> f32 {
        self.size_m / USUAL_M
    }

    /// An app with this stage, to which the scene's own systems are added.
    pub fn app(self, options: &StageOptions) -> App {
        let mut app = App::new();
        app.insert_resource(options.clone()).insert_resource(self).init_resource::<SceneTime>();
        let shown = show(&mut app, &self, options);
        let clock = match shown {
            #[cfg(feature = "window")]
            Shown::InWindow => LoopMode::Threaded,
            #[cfg(feature = "window")]
            Shown::InPictures => LoopMode::Lockstep,
            // A device that is plugged in has the time of its hand.
            Shown::Headless if options.hid.is_some() => LoopMode::Threaded,
            Shown::Headless => self.mode,
        };
        if shown == Shown::Headless {
            let frame = Duration::from_millis(if clock == LoopMode::Threaded { 5 } else { 0 });
            let runner = ScheduleRunnerPlugin::run_loop(frame);
            app.add_plugins((MinimalPlugins.set(runner), LogPlugin::default(), ProgressPlugin));
            assets::add_without_window(&mut app);
        }
        crate::device::add(&mut app);
        if clock == LoopMode::Lockstep {
            time::step_by_step(&mut app);
        }
        app.insert_resource(shown)
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin { mode: clock, ..default() }))
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
                (end_if_refused, set_up_hands)
                    .chain()
                    .after(HapticUpdateSystems::Bodies)
                    .before(HapticUpdateSystems::Tools)
                    .run_if(|awaits: Res<AwaitsBodies>| awaits.0),
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
            .add_systems(Update, end_in_time);
        app
    }

    /// How long the scene runs, s; `None` until it is closed.
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
        say("this program cannot draw: build it with --features panel,gizmos");
    }
    Shown::Headless
}

/// Says something before there is a log.
#[expect(clippy::print_stderr, reason = "there is no log before there is an app")]
pub(crate) fn say(what: &str) {
    eprintln!("{what}");
}

fn set_up(world: &mut World) {
    let mut there =
        world.query_filtered::<Entity, Or<(With<DeformableBody>, With<HapticTool>, With<Suture>)>>();
    for entity in there.iter(world).collect::<Vec<_>>() {
        world.despawn(entity);
    }
    // With the tools their loops have ended.
    world.resource::<HandTimes>().begin_again();
    world.insert_resource(SceneTime::default());
    world.insert_resource(AwaitsBodies(true));
    world.run_schedule(SetUpScene);
}

/// Spawns the hands once all bodies are there.
pub(crate) fn set_up_hands(world: &mut World) {
    let mut to_come = world.query_filtered::<(), (With<DeformableBody>, Without<SimulatedBody>)>();
    if to_come.iter(world).next().is_none() {
        world.insert_resource(AwaitsBodies(false));
        world.run_schedule(SetUpHands);
    }
}

/// A body that cannot be built is the end of its scene; what to do about it is in the fault, which is logged.
fn end_if_refused(
    mut faults: MessageReader<HapticFault>,
    to_come: Query<(), (With<DeformableBody>, Without<SimulatedBody>)>,
    mut exit: MessageWriter<AppExit>,
) {
    if faults.read().any(|fault| fault.entity.is_some_and(|entity| to_come.contains(entity))) {
        exit.write(AppExit::error());
    }
}

fn count_time(rate: Res<ModelRate>, awaits: Res<AwaitsBodies>, mut time: ResMut<SceneTime>) {
    if !awaits.0 {
        time.0 += rate.period_s();
    }
}

fn end_in_time(
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
