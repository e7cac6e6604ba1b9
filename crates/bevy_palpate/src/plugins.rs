//! The plugin group and the log of faults.

use crate::body::BodyPlugin;
use crate::diagnostics::HapticDiagnosticsPlugin;
use crate::fault::log_faults;
use crate::schedule::HapticSchedulePlugin;
use crate::surroundings::SurroundingsPlugin;
use crate::suture::SuturePlugin;
use crate::tool::ToolPlugin;
use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

/// All plugins of palpate that need no window, as one group.
///
/// | plugin | adds |
/// | --- | --- |
/// | [`HapticSchedulePlugin`] | the schedule [`ModelSchedule`](crate::ModelSchedule), its rate and the mode of the loops |
/// | [`BodyPlugin`] | deformable bodies and their meshes |
/// | [`ToolPlugin`] | devices, loops, model steps, local models, results |
/// | [`SurroundingsPlugin`] | gravity, obstacles and external forces |
/// | `AvianPlugin`, with the feature `avian` | the colliders of avian3d as obstacles |
/// | [`SuturePlugin`] | threads through bodies |
/// | [`HapticDiagnosticsPlugin`] | durations and errors in Bevy's diagnostics |
/// | [`FaultLogPlugin`] | faults in the log |
///
/// Each plugin can be set, disabled or replaced as in any group:
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{FaultLogPlugin, HapticSchedulePlugin, LoopMode, prelude::*};
/// # let mut app = App::new();
/// app.add_plugins(MinimalPlugins).add_plugins(
///     PalpatePlugins
///         .set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep))
///         .disable::<FaultLogPlugin>(),
/// );
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct PalpatePlugins;

impl PluginGroup for PalpatePlugins {
    fn build(self) -> PluginGroupBuilder {
        let plugins = PluginGroupBuilder::start::<Self>()
            .add(HapticSchedulePlugin::default())
            .add(BodyPlugin)
            .add(ToolPlugin)
            .add(SurroundingsPlugin)
            .add(SuturePlugin)
            .add(HapticDiagnosticsPlugin)
            .add(FaultLogPlugin);
        #[cfg(feature = "avian")]
        let plugins = plugins.add(crate::avian::AvianPlugin);
        plugins
    }
}

/// Writes every [`HapticFault`](crate::HapticFault) to the log: [`FaultSeverity::Error`](crate::FaultSeverity::Error) as an error, others
/// as a warning, and missed deadlines at debug level. Recoveries are no faults; the loops log them as info.
#[derive(Clone, Copy, Debug, Default)]
pub struct FaultLogPlugin;

impl Plugin for FaultLogPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Last, log_faults);
    }
}
