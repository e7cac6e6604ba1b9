//! The command line.

use bevy::prelude::Resource;
use clap::Parser;
use palpate_haptics::Trajectory;
use palpate_stage::{StageOptions, folder};
use std::path::PathBuf;

/// The hand that comes with the repository.
const BUILT_IN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/trajectories/probe.csv");

/// A recorded hand probes a soft organ; every scheme is then judged against the full body.
#[derive(Clone, Debug, Parser, Resource)]
#[command(
    after_help = "The organ is 126 by 67 by 76 mm, its top at y = 0.054 m; a lump lies below it at x = -10, z = -6 mm. The tool is \
    a sphere of 5 mm radius.\n\nExamples:\n  probing --seconds 10 --scheme hold\n  probing --trajectory hand.csv --out results"
)]
pub struct Options {
    #[command(flatten)]
    pub stage: StageOptions,
    /// A hand of your own: CSV with the header t_s,x_m,y_m,z_m and a row each millisecond, positions of the
    /// tool's centre in the scene; it is repeated at its end
    #[arg(long, value_name = "FILE", default_value = BUILT_IN, hide_default_value = true, value_parser = trajectory)]
    pub trajectory: Trajectory,
    /// Where the trace and the plot are written
    #[arg(long, value_name = "DIR", default_value = "target/palpate/probing", value_parser = folder)]
    pub out: PathBuf,
}

/// Reads the file before anything starts, so that what is wrong with it is said at once.
fn trajectory(path: &str) -> Result<Trajectory, String> {
    Trajectory::from_csv_file(path).map_err(|error| {
        let cause = std::error::Error::source(&error).map(|cause| format!(": {cause}"));
        format!("{error}{}", cause.unwrap_or_default())
    })
}
