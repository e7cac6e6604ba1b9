//! What keeps the machine busy meanwhile.

use crate::error::LabError;
use clap::ValueEnum;
use std::io::{self, Read, Seek, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

/// The kind of load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LoadKind {
    /// As many busy threads as cores, of normal priority
    Cpu,
    /// Two threads that write files, wait until they are on the disk, and read them again
    Io,
    /// Nothing beside the body itself
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

/// Threads that write files.
const WRITERS: usize = 2;
/// Size of a file, in chunks.
const CHUNKS: usize = 128;
const CHUNK_BYTES: usize = 64 << 10;

/// A running load; dropping it ends it.
#[derive(Debug)]
pub(super) struct Load {
    stop: Arc<AtomicBool>,
    /// Rounds that the threads have done.
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
                    // It has no name, so that nothing of it is left however this ends.
                    let mut file = tempfile::tempfile().map_err(LabError::Load)?;
                    let mut chunk = vec![0x5a; CHUNK_BYTES];
                    load.spawn(move || write_and_read(&mut file, &mut chunk))?;
                }
            }
        }
        Ok(load)
    }

    /// A thread that does one round after another.
    fn spawn(&mut self, mut round: impl FnMut() -> io::Result<()> + Send + 'static) -> Result<(), LabError> {
        let (stop, rounds) = (Arc::clone(&self.stop), Arc::clone(&self.rounds));
        let turn = move || {
            while !stop.load(Ordering::Acquire) {
                round()?;
                rounds.fetch_add(1, Ordering::Relaxed);
            }
            Ok(())
        };
        let thread = std::thread::Builder::new().name("load".into()).spawn(turn).map_err(LabError::Load)?;
        self.threads.push(thread);
        Ok(())
    }

    /// Ends it and returns the rounds that were done.
    pub(super) fn stop(mut self) -> Result<u64, LabError> {
        self.end().map_err(LabError::Load)?;
        Ok(self.rounds.load(Ordering::Relaxed))
    }

    fn end(&mut self) -> io::Result<()> {
        self.stop.store(true, Ordering::Release);
        let ended = self.threads.drain(..).map(JoinHandle::join);
        // Every one is waited for, then the first fault counts. No round panics.
        let ended: Vec<_> = ended.map(|joined| joined.unwrap_or(Ok(()))).collect();
        ended.into_iter().collect()
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        // Whoever wants to know calls `stop`.
        let _ = self.end();
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
    fn every_load_works_and_ends() {
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
