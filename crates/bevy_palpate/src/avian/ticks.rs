//! What happens in every tick of avian: the forces of the soft bodies act, and the motion is recorded.

use super::coupling::{Coupling, Kinematics, MassProperties, State, Tick};
use super::math::{Wrench, single};
use crate::model_time::ModelRate;
use avian3d::dynamics::integrator::VelocityIntegrationData;
use avian3d::dynamics::solver::solver_body::SolverBody;
use avian3d::prelude::{SubstepCount, Substeps};
use bevy::prelude::*;
use glam::DVec3;

/// Model periods without a model step after which the forces end.
const MAX_PERIODS: f64 = 3.0;

/// Adds the forces of the soft bodies to those of avian, and records the state before the tick.
pub(super) fn apply_forces(
    mut bodies: Query<(
        &mut Coupling,
        Kinematics,
        MassProperties,
        Option<&mut VelocityIntegrationData>,
        Has<SolverBody>,
    )>,
    (time, substep, substeps): (Res<Time>, Res<Time<Substeps>>, Res<SubstepCount>),
    fixed: Option<Res<Time<Fixed>>>,
    rate: Res<ModelRate>,
) {
    let duration_s = time.delta_secs_f64();
    // The substeps are whole nanoseconds.
    let force_s = substep.delta_secs_f64() * f64::from(substeps.0);
    let fixed_s = fixed.map_or(duration_s, |fixed| fixed.delta_secs_f64());
    for (mut coupling, kinematics, mass, integration, is_awake) in &mut bodies {
        let before = kinematics.state();
        coupling.start.get_or_insert(before);
        let mut applied = Wrench::ZERO;
        let is_expired = coupling.elapsed_s > MAX_PERIODS * rate.period_s();
        if let (Some(mut integration), true, false) = (integration, is_awake, is_expired)
            && coupling.force != Wrench::ZERO
            && mass.mass_kg() > 0.0
        {
            let acceleration = single(coupling.force.linear / mass.mass_kg());
            integration.apply_linear_acceleration(acceleration);
            integration.apply_angular_acceleration(single(
                mass.response(before.rotation).angular * coupling.force.angular,
            ));
            applied = coupling.force * force_s;
        }
        // The angular impulse is about the centre of mass until the end of the tick.
        coupling.tick = Some(Tick { before, after: before, duration_s, fixed_s, applied });
    }
}

/// Records the state after the tick, and adds what it applied to the account.
pub(super) fn record_ticks(
    mut bodies: Query<(&mut Coupling, Kinematics, MassProperties)>,
    substeps: Res<SubstepCount>,
) {
    for (mut coupling, kinematics, mass) in &mut bodies {
        let coupling = &mut *coupling;
        let Some(tick) = &mut coupling.tick else { continue };
        tick.after = kinematics.state();
        let is_applied = tick.applied != Wrench::ZERO;
        tick.applied = tick.applied.about_origin(mean_center_m(tick, mass.center_m(), substeps.0));
        coupling.elapsed_s += tick.duration_s;
        coupling.applied += tick.applied;
        for share in coupling.shares.iter_mut().filter(|_| is_applied) {
            share.applied += share.force * tick.duration_s;
        }
    }
}

/// Mean of the positions of the centre of mass at which the substeps of a tick apply a constant force, m: avian changes the
/// velocity first and then the position, so substep i of n begins after i moves with velocities v₀ + k a h, k = 1 … i.
fn mean_center_m(tick: &Tick, local_m: DVec3, substeps: u32) -> DVec3 {
    let State { velocity, .. } = tick.before;
    let (n, h) = (f64::from(substeps.max(1)), tick.duration_s);
    let change = tick.after.velocity.linear - velocity.linear;
    tick.before.center_m(local_m)
        + velocity.linear * (h * (n - 1.0) / (2.0 * n))
        + change * (h * (n * n - 1.0) / (6.0 * n * n))
}
