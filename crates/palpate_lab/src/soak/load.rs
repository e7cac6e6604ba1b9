//! Load that keeps the machine busy during a run.

use crate::error::LabError;
use clap::ValueEnum;
use std::io::{self, Read, Seek, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

/// Kind of load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LoadKind {
    /// As many busy threads as cores, of normal priority
    Cpu,
    /// Two threads that write files, synchronise them with the disk, and read them again
    Io,
    /// No load except the body itself
    None,
}

impl LoadKind {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Io => "io",
            Self::None => "none",
        }
    }
}

/// Number of threads that write files.
const WRITERS: usize = 2;
/// Size of a file, in chunks.
const CHUNKS: usize = 128;
/// Size of a chunk, bytes.
const CHUNK_BYTES: usize = 64 << 10;

/// Running load; dropping it stops its threads.
#[derive(Debug)]
pub(super) struct Load {
    stop: Arc<AtomicBool>,
    /// Number of completed rounds of work.
    rounds: Arc<AtomicU64>,
    threads: Vec<JoinHandle<io::Result<()>>>,
}

impl Load {
    pub(super) fn start(kind: LoadKind) -> Result<Self, LabError> {
        let (stop, rounds) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let mut load = Self { stop, rounds, threads: Vec::new() };
        match kind {
            LoadKind::None => {}
            LoadKind::Cpu => {
                let cores = std::thread::available_parallelism().map_or(1, usize::from);
                (0..cores).try_for_each(|_| load.spawn(compute))?;
            }
            LoadKind::Io => {
                for _ in 0..WRITERS {
                    // An unnamed file leaves nothing behind.
                    let mut file = tempfile::tempfile().map_err(LabError::Load)?;
                    let mut chunk = vec![0x5a; CHUNK_BYTES];
                    load.spawn(move || write_and_read(&mut file, &mut chunk))?;
                }
            }
        }
        Ok(load)
    }

    /// Starts a thread that repeats `round` until the load stops.
    fn spawn(&mut self, mut round: impl FnMut() -> io::Result<()> + Send + 'static) -> Result<(), LabError> {
        let (stop, rounds) = (Arc::clone(&self.stop), Arc::clone(&self.rounds));
        let repeat = move || {
            while !stop.load(Ordering::Acquire) {
                round()?;
                rounds.fetch_add(1, Ordering::Relaxed);
            }
            Ok(())
        };
        let thread = std::thread::Builder::new().name("load".into()).spawn(repeat).map_err(LabError::Load)?;
        self.threads.push(thread);
        Ok(())
    }

    /// Stops the load and returns the number of completed rounds.
    pub(super) fn stop(mut self) -> Result<u64, LabError> {
        self.stop_threads().map_err(LabError::Load)?;
        Ok(self.rounds.load(Ordering::Relaxed))
    }

    fn stop_threads(&mut self) -> io::Result<()> {
        self.stop.store(true, Ordering::Release);
        let ended = self.threads.drain(..).map(JoinHandle::join);
        // All threads are joined before the first error is returned. No round panics.
        let ended: Vec<_> = ended.map(|joined| joined.unwrap_or(Ok(()))).collect();
        ended.into_iter().collect()
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        // `stop` reports errors.
        let _ = self.stop_threads();
    }
}

/// About a millisecond of arithmetic.
fn compute() -> io::Result<()> {
    let mut state = 1_u64;
    for _ in 0..500_000 {
        state = std::hint::black_box(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
    }
    Ok(())
}

fn write_and_read(file: &mut std::fs::File, chunk: &mut [u8]) -> io::Result<()> {
    file.rewind()?;
    for _ in 0..CHUNKS {
        file.write_all(chunk)?;
    }
    file.sync_all()?;
    file.rewind()?;
    for _ in 0..CHUNKS {
        file.read_exact(chunk)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_load_does_work_and_stops() {
        for kind in [LoadKind::None, LoadKind::Cpu, LoadKind::Io] {
            let load = Load::start(kind).unwrap();
            while kind != LoadKind::None && load.rounds.load(Ordering::Relaxed) < 2 {
                std::thread::yield_now();
            }
            let threads = load.threads.len();
            assert!(threads > 0 || kind == LoadKind::None);
            assert_eq!(load.stop().unwrap() > 1, kind != LoadKind::None);
        }
    }
}
