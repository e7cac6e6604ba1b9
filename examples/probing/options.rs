//! The command line.

use bevy::prelude::Resource;
use clap::Parser;
use palpate_haptics::Trajectory;
use palpate_stage::{StageOptions, folder};
use std::path::PathBuf;

/// The trajectory in the repository.
const BUILT_IN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/trajectories/probe.csv");

/// A recorded motion probes a soft organ; every scheme is then compared with the full body.
#[derive(Clone, Debug, Parser, Resource)]
#[command(
    after_help = "The organ of 126 by 67 by 76 mm lies on a table at y = 0. At rest its top is at y = 0.052 m; a lump lies below it at \
    x = -10, z = -6 mm. The tool is a sphere of 5 mm radius.\n\nExamples:\n  probing --seconds 10 --scheme hold\n  \
    probing --trajectory hand.csv --out results"
)]
pub struct Options {
    #[command(flatten)]
    pub(crate) stage: StageOptions,
    /// Recorded trajectory: CSV with the header t_s,x_m,y_m,z_m and a row per millisecond, positions of the tool's
    /// centre in the scene; it repeats
    #[arg(long, value_name = "FILE", default_value = BUILT_IN, hide_default_value = true, value_parser = trajectory)]
    pub trajectory: Trajectory,
    /// Folder of the trace and the plot
    #[arg(long, value_name = "DIR", default_value = "target/palpate/probing", value_parser = folder)]
    pub out: PathBuf,
}

/// Reads the file, which reports errors before the scene starts.
fn trajectory(path: &str) -> Result<Trajectory, String> {
    Trajectory::from_csv_file(path).map_err(|error| {
        let cause = std::error::Error::source(&error).map(|cause| format!(": {cause}"));
        format!("{error}{}", cause.unwrap_or_default())
    })
}
