//! Recorded trajectories as assets.

use crate::fault::DeviceFault;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use palpate_haptics::{CsvError, Trajectory, TrajectoryError};

/// A recorded trajectory as an asset, for [`DeviceSelector::Replay`](crate::DeviceSelector::Replay).
///
/// [`TrajectoryLoader`] loads it from a CSV file ([`Trajectory`] has the format); a computed one is added to `Assets<TrajectoryAsset>`.
/// Assets need Bevy's `AssetPlugin`; without it only tools that replay a trajectory fail, with [`DeviceFault::NoTrajectories`].
///
/// A tool starts once its trajectory is loaded. A load that fails is a fault, and so is a trajectory that is not loaded after 5 s; the tool
/// starts if it is loaded later. A trajectory that is modified, or reloaded because its file has changed, starts the tool again at the
/// first row. A removed trajectory has no effect on a running tool, which has a copy.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_palpate::{DeviceSelector, TrajectoryAsset, palpate_haptics::Trajectory, prelude::*};
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>, mut trajectories: ResMut<Assets<TrajectoryAsset>>) {
///     // The folder is Bevy's: `assets` next to `Cargo.toml`, or next to the program.
///     commands.spawn(HapticTool::new(assets.load::<TrajectoryAsset>("hand.csv")));
///     let down = (0..1000).map(|ms| DVec3::Y * (0.06 - 1e-5 * f64::from(ms)));
///     if let Ok(trajectory) = Trajectory::from_positions(down.collect()) {
///         let trajectory = trajectories.add(TrajectoryAsset(trajectory));
///         commands.spawn(HapticTool::new(DeviceSelector::Replay { trajectory, repeat: false }));
///     }
/// }
/// # let mut app = bevy_palpate::testing::headless_app();
/// # app.add_systems(Startup, setup);
/// # bevy_palpate::testing::advance_model_steps(&mut app, 1);
/// ```
#[derive(Asset, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Debug, PartialEq, Clone)]
pub struct TrajectoryAsset(pub Trajectory);

/// Loads a [`TrajectoryAsset`] from a CSV file.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct TrajectoryLoader;

impl AssetLoader for TrajectoryLoader {
    type Asset = TrajectoryAsset;
    type Settings = ();
    type Error = TrajectoryError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<TrajectoryAsset, TrajectoryError> {
        let path = context.path().to_string();
        let mut bytes = Vec::new();
        reader
            .read_to_end(&mut bytes)
            .await
            .map_err(|source| CsvError::File { path: (&path).into(), source })?;
        Trajectory::from_csv(bytes.as_slice(), path).map(TrajectoryAsset)
    }

    fn extensions(&self) -> &[&str] {
        &["csv"]
    }
}

/// Adds the asset and its loader, if the app has assets and does not have the trajectories yet.
pub(crate) fn add_trajectory_assets(app: &mut App) {
    let world = app.world();
    if world.contains_resource::<AssetServer>() && !world.contains_resource::<Assets<TrajectoryAsset>>() {
        app.init_asset::<TrajectoryAsset>()
            .register_asset_reflect::<TrajectoryAsset>()
            .init_asset_loader::<TrajectoryLoader>();
    }
}

/// The fault of a trajectory that is not loaded.
pub(super) fn not_loaded(trajectory: &Handle<TrajectoryAsset>) -> DeviceFault {
    let number = || trajectory.id().to_string();
    DeviceFault::TrajectoryNotLoaded {
        trajectory: trajectory.path().map_or_else(number, ToString::to_string),
    }
}
