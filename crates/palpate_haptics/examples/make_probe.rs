//! This example writes `assets/trajectories/probe.csv`, the trajectory that the `probing` example replays.

use palpate_haptics::Probe;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/trajectories/probe.csv");
    Probe::default().trajectory()?.to_csv(std::io::BufWriter::new(std::fs::File::create(path)?))?;
    Ok(())
}
