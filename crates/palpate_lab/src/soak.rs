//! `palpate-lab soak`: the real loop under load, its guarantees, and its lateness compared with a thread without work.

mod deadline_audit;
mod limits;
mod load;
mod memory;
mod model_side;
mod probing_hand;
mod report;

use crate::block_scene::{BlockScene, ContactKind};
use crate::error::{LabError, check, number, whole};
use crate::output::Output;
use crate::progress;
use clap::Args;
use deadline_audit::DeadlineAudit;
use limits::Limits;
use load::{Load, LoadKind};
use memory::Memory;
use model_side::{ModelSide, ModelSideStats, PERIOD};
use palpate_haptics::{
    BaselineThread, HapticDevice, HapticLoop, LoopConfig, LoopSettings, RealTimeRequest, SafetySettings,
    StoppedLoop, haptic_loop, run_with_baseline,
};
use palpate_local::HandOverSettings;
use palpate_reduce::{BuilderOptions, LocalModelBuilder};
use probing_hand::ProbingHand;
use report::{Outcome, Report};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Model periods after which the force of a local model fades: three seconds.
const STALE_AFTER: f64 = 60.0;
/// Samples kept for a local model that arrives late: four seconds.
const HISTORY: usize = 4096;

/// The loop on its own thread while the machine is busy: guarantees and lateness
///
/// A simulated hand probes a block of NODES x NODES x NODES nodes at 1 kHz on the loop's own thread; another thread steps the body at
/// 20 Hz. A bare thread without work runs at the same time, under the same load: same priority, same absolute deadlines half a
/// period later, so neither thread waits for the other on a shared core. Its lateness is that of the machine;
/// `lateness_ratio_p99` is the lateness of the loop divided by it.
///
/// The exit code is 1 if a deadline is unaccounted for, a force at the device exceeds its limits, or memory is allocated or freed on
/// the loop's thread. Lateness and memory are reported and do not change the exit code.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab soak --seconds 600 --load cpu --json\n  palpate-lab soak --load io --core 1\n  \
                  palpate-lab soak --load none --priority none"
)]
pub(crate) struct Soak {
    /// Duration, s
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 60)]
    seconds: usize,
    /// Load of the machine
    #[arg(long, value_enum, default_value_t = LoadKind::Cpu)]
    load: LoadKind,
    /// Nodes along each edge of the block
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 10)]
    nodes: usize,
    /// Stiffness of each spring, N/m; more takes more substeps of the body
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 50.0)]
    stiffness: f64,
    /// Damping of each damper over the root of stiffness times mass of a node; more takes more substeps of the body
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.2)]
    damping_ratio: f64,
    /// Core of the loop's thread and of the bare thread [default: any]
    #[arg(value_parser = whole, allow_hyphen_values = true, long)]
    core: Option<usize>,
    /// Real-time priority to request for both threads, 1 to 99 on Linux, or none
    #[arg(long, value_parser = priority, allow_hyphen_values = true, default_value = "80")]
    priority: Priority,
}

/// Priority to request.
#[derive(Clone, Copy, Debug)]
struct Priority(Option<u8>);

fn priority(text: &str) -> Result<Priority, &'static str> {
    if text.trim() == "none" {
        return Ok(Priority(None));
    }
    let number = text.trim().parse().ok().filter(|number| (1..=99).contains(number));
    number.map(|number| Priority(Some(number))).ok_or("it must be 1 to 99, or none")
}

impl Soak {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        self.validate()?;
        let report = Report::of(self.seconds, self.load, self.experiment()?);
        output.print(&report, |out| report.table(out))?;
        report.check_guarantees()
    }

    fn validate(&self) -> Result<(), LabError> {
        let seconds = self.seconds;
        check("--seconds", seconds as f64, (1..=86_400).contains(&seconds), "1 to 86400")?;
        check("--nodes", self.nodes as f64, (2..=24).contains(&self.nodes), "2 to 24")?;
        check("--stiffness", self.stiffness, self.stiffness > 0.0, "finite and above 0")?;
        let damping = self.damping_ratio;
        check("--damping-ratio", damping, (0.0..=10.0).contains(&damping), "0 to 10")
    }

    fn experiment(&self) -> Result<Outcome, LabError> {
        let block = BlockScene {
            nodes: [self.nodes; 3],
            stiffness_n_per_m: self.stiffness,
            damping_ratio: self.damping_ratio,
            contact: ContactKind::Touch,
            ..BlockScene::default()
        };
        let (body, contact, start_m) = block.build()?;
        let builder = LocalModelBuilder::new(&body, BuilderOptions::default())?;
        let config = LoopConfig {
            hand_over: HandOverSettings {
                capacity: builder.capacity(),
                history: HISTORY,
                ..HandOverSettings::default()
            },
            real_time: RealTimeRequest {
                priority: self.priority.0,
                core: self.core,
                ..RealTimeRequest::default()
            },
            // Capacity for eight seconds in which the model side reads nothing.
            event_capacity: 8192,
            record_capacity: 8192,
            ..LoopConfig::default()
        };
        // On a machine too busy for 20 model steps a second, old models stay active: the run must produce forces to check.
        let safety = SafetySettings { stale_after_periods: STALE_AFTER, ..SafetySettings::default() };
        let model_period_s = PERIOD.as_secs_f64();
        let settings = LoopSettings { record: true, model_period_s, safety, ..LoopSettings::default() };
        let limits = Limits {
            magnitude_n: settings.safety.max_force_n.min(config.device.force_n),
            growth_n: settings.safety.max_slew_n_per_s * config.hand_over.tick_s,
        };
        let period_ns = Duration::from_secs_f64(config.hand_over.tick_s).as_nanos() as u64;
        let (handle, haptic_loop) = haptic_loop(config, settings)?;
        let audit = DeadlineAudit::new(period_ns, limits);
        let (stats, consumed, path) = (ModelSideStats::default(), None, Vec::with_capacity(256));
        let model_side = ModelSide { body, contact, builder, handle, audit, stats, consumed, path };
        self.run_under_load(model_side, haptic_loop, ProbingHand::new(start_m, limits), config)
    }

    /// Runs all threads for the duration and stops them in order: the loop, then the model side, which reads the loop's last
    /// events, then the load.
    fn run_under_load(
        &self,
        model_side: ModelSide,
        haptic_loop: HapticLoop,
        mut hand: ProbingHand,
        config: LoopConfig,
    ) -> Result<Outcome, LabError> {
        let bare = BaselineThread::spawn(&config)?;
        let load = Load::start(self.load)?;
        let (stop, ended) = (AtomicBool::new(false), AtomicBool::new(false));
        let (memory, loop_result, model_side) = std::thread::scope(|scope| {
            let looping = scope.spawn(|| run_loop(haptic_loop, &mut hand, &stop, &bare, config.real_time));
            let modelling = scope.spawn(|| model_side.run(&ended));
            let memory = watch(self.seconds, || looping.is_finished() || modelling.is_finished());
            stop.store(true, Ordering::Release);
            let loop_result = looping.join();
            ended.store(true, Ordering::Release);
            (memory, loop_result, modelling.join())
        });
        let (_, allocations) = loop_result.map_err(|_| LabError::Ended("loop's thread"))?;
        let model_side = model_side.map_err(|_| LabError::Ended("model side"))??;
        let bare = bare.stop().ok_or(LabError::Ended("bare thread"))?;
        let load_rounds = load.stop()?;
        Ok(Outcome { model_side, felt: hand.felt, allocations, bare, memory, load_rounds })
    }
}

/// Runs the loop on this thread until `stop`. Also returns the number of allocations on this thread, and of frees of memory that was
/// allocated elsewhere, from opening the device to the end of the loop.
fn run_loop(
    haptic_loop: HapticLoop,
    hand: &mut dyn HapticDevice,
    stop: &AtomicBool,
    bare: &BaselineThread,
    real_time: RealTimeRequest,
) -> (Option<StoppedLoop>, u64) {
    // The loop requests its real-time settings before it starts, and pinning to a core allocates. The same request is measured here
    // and subtracted.
    let set_up = allocation_counter::measure(|| {
        let _ = real_time.apply_to_current_thread();
    });
    let mut stopped = None;
    let all =
        allocation_counter::measure(|| stopped = Some(run_with_baseline(haptic_loop, hand, stop, bare)));
    let freed = (all.count_current - set_up.count_current).min(0).unsigned_abs();
    (stopped, all.count_total.saturating_sub(set_up.count_total) + freed)
}

/// Records once a second the memory in use, for `seconds` or until `is_over`.
#[expect(
    clippy::disallowed_methods,
    reason = "the duration of a run is wall-clock time and affects no result"
)]
fn watch(seconds: usize, is_over: impl Fn() -> bool) -> Memory {
    let mut memory = Memory::at_start();
    let bar = progress::bar(seconds);
    bar.set_message("the loop under load");
    let start = Instant::now();
    for second in 1..=seconds as u64 {
        std::thread::sleep(Duration::from_secs(second).saturating_sub(start.elapsed()));
        memory.record(second);
        bar.inc(1);
        if is_over() {
            break;
        }
    }
    memory
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use palpate_haptics::{Reading, ScriptedDevice};
    use std::sync::Arc;

    /// Allocations counted during thirty reads of a device that allocates `at_each` times per read.
    fn counted(at_each: usize, real_time: RealTimeRequest) -> u64 {
        let config = LoopConfig { real_time, ..LoopConfig::default() };
        let (_handle, haptic_loop) = haptic_loop(config, LoopSettings::default()).unwrap();
        let bare = BaselineThread::spawn(&config).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let mut device = ScriptedDevice::new(move |n, _| {
            flag.store(n == 29, Ordering::Release);
            (0..at_each).for_each(|i| drop(std::hint::black_box(Box::new(i))));
            Ok(Reading::at(DVec3::ZERO))
        });
        std::thread::scope(|scope| {
            scope.spawn(|| run_loop(haptic_loop, &mut device, &stop, &bare, real_time).1).join()
        })
        .unwrap()
    }

    #[test]
    fn allocations_of_ticks_count_and_those_of_set_up_do_not() {
        for real_time in [RealTimeRequest::NONE, RealTimeRequest { core: Some(0), ..RealTimeRequest::NONE }] {
            assert_eq!(counted(0, real_time), 0);
            assert_eq!(counted(2, real_time), 60);
        }
    }
}
