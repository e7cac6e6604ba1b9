//! Reports model steps that take longer than their period.

use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind, SlowStep};
use crate::model_time::{LoopMode, ModelPeriod};
use crate::step_times::StepTimes;
use bevy::prelude::*;

/// Time without a slow model step after which one is reported again, s.
const IN_TIME_S: f64 = 1.0;

/// Reports the first of several model steps that take longer than their period. Lock step has no real-time period.
pub(crate) fn report_slow_step(
    mut times: ResMut<StepTimes>,
    bodies: Query<(Entity, &SimulatedBody)>,
    mode: Res<LoopMode>,
    period: ModelPeriod,
    mut in_time_s: Local<Option<f64>>,
    mut faults: FaultWriter,
) {
    if !times.take_is_new() {
        return;
    }
    let (bodies_ms, local_models_ms) = (times.bodies.take_ms(), times.local_models.take_ms());
    let (step_s, period_s) = (times.last.as_secs_f64(), period.s());
    if *mode == LoopMode::Lockstep {
        return;
    }
    if step_s <= period_s {
        *in_time_s = in_time_s.map(|in_time_s| in_time_s + period_s).filter(|s| *s < IN_TIME_S - 1e-9);
        return;
    }
    // `None` means that no slow step has been reported recently.
    if in_time_s.replace(0.0).is_some() {
        return;
    }
    let nodes = |simulated: &SimulatedBody| simulated.body().network().node_count();
    let largest = bodies.iter().max_by_key(|(entity, simulated)| (nodes(simulated), *entity));
    let fewer = |cells: usize| {
        let cells_along = cells as f64 * (period_s / step_s).cbrt();
        (cells_along as usize).max(1)
    };
    let kind = HapticFaultKind::SlowStep(SlowStep {
        step_ms: 1e3 * step_s,
        period_ms: 1e3 * period_s,
        bodies_ms,
        local_models_ms,
        nodes: largest.map_or(0, |(_, simulated)| nodes(simulated)),
        suggested_cells_along: largest.and_then(|(_, simulated)| simulated.cells_along()).map(fewer),
    });
    faults.write(largest.map(|(entity, _)| entity), kind);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::{FaultLimits, HapticFault};
    use crate::model_time::ModelRate;
    use std::time::Duration;

    /// The reported durations, without the limit of their rate.
    fn reported(world: &mut World, steps_ms: &[(u64, usize)]) -> Vec<f64> {
        world.insert_resource(FaultLimits::default());
        for (ms, times) in steps_ms {
            for _ in 0..*times {
                world.resource_mut::<StepTimes>().record(Duration::from_millis(*ms));
                world.run_system_cached(report_slow_step).unwrap();
                // A frame without a model step reports nothing.
                world.run_system_cached(report_slow_step).unwrap();
            }
        }
        let duration_ms = |fault: HapticFault| match fault.kind {
            HapticFaultKind::SlowStep(step) => step.step_ms,
            other => panic!("{other}"),
        };
        world.resource_mut::<Messages<HapticFault>>().drain().map(duration_ms).collect()
    }

    fn world(mode: LoopMode) -> World {
        let mut world = World::new();
        world.insert_resource(mode);
        world.insert_resource(ModelRate::default());
        world.init_resource::<StepTimes>();
        world.init_resource::<Messages<HapticFault>>();
        world
    }

    #[test]
    fn reports_a_slow_step_once_until_a_second_without_one() {
        let mut world = world(LoopMode::Threaded);
        assert_eq!(reported(&mut world, &[(20, 5), (60, 1)]), [60.0]);
        assert_eq!(reported(&mut world, &[(180, 20), (20, 19), (70, 1), (20, 19)]), [0.0; 0]);
        assert_eq!(reported(&mut world, &[(20, 1), (90, 3)]), [90.0]);
    }

    #[test]
    fn reports_no_slow_step_in_lock_step() {
        assert_eq!(reported(&mut world(LoopMode::Lockstep), &[(500, 5)]), [0.0; 0]);
    }
}
