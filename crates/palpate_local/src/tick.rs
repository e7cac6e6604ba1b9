//! One tick of a local model: sample in, force out.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::{dot, subtract_product, zeros};
use crate::near_tick::NearState;
use crate::{Capacity, Contact, LocalModel, Sample, Scheme};
use glam::DVec3;
use palpate_laws::unilateral_force;

/// The state of a local model's own dynamics: q, q̇ and room to compute in.
#[derive(Clone, Debug)]
pub struct LocalState {
    q: Vec<f64>,
    q_dot: Vec<f64>,
    rhs: Vec<f64>,
    scratch: Vec<f64>,
    near: NearState,
}

/// What a contact answers to is worth so many multiplications.
const ANSWER: usize = 3000;

impl LocalState {
    /// Room for `capacity`.
    #[must_use]
    pub fn with_capacity(capacity: Capacity) -> Self {
        let zero = zeros(capacity.order);
        let near = NearState::with_capacity(capacity.near);
        Self { q: zero.clone(), q_dot: zero.clone(), rhs: zero.clone(), scratch: zero, near }
    }

    /// The state at the model step: q = 0, q̇ = q̇_N.
    pub fn start(&mut self, model: &LocalModel) {
        self.near.start(&model.near, model.force_n);
        self.q.fill(0.0);
        self.q_dot.fill(0.0);
        for (to, from) in self.q_dot.iter_mut().zip(&model.reduced.velocity).take(model.reduced.order) {
            *to = *from;
        }
    }

    /// Steps the state by `step_s` to `sample`; `step_s` is the h of the model's implicit factor.
    ///
    /// Linearly implicit Euler in increments, with dx, dv of the new sample:
    /// (M̃/h + B̃ + hK̃) Δq̇ = Vᵀ(F_N − K_rc dx − B_rc dv) − B̃ (q̇ − q̇_N) − K̃ (q + h q̇).
    pub fn advance(&mut self, model: &LocalModel, sample: &Sample, step_s: f64) {
        if !model.has_state() {
            return;
        }
        if model.scheme == Scheme::NearFieldExact {
            self.near.advance(&model.near, sample);
            return;
        }
        let r = &model.reduced;
        let p = r.order;
        let (Some(q), Some(q_dot), Some(rhs), Some(scratch)) =
            (self.q.get_mut(..p), self.q_dot.get_mut(..p), self.rhs.get_mut(..p), self.scratch.get_mut(..p))
        else {
            return;
        };
        let (dx, dv) =
            (sample.position_m - model.position_m, sample.velocity_m_per_s - model.velocity_m_per_s);
        for (rhs, force) in rhs.iter_mut().zip(&r.force) {
            *rhs = *force;
        }
        subtract_product(rhs, &r.stiffness_rc, &dx.to_array());
        subtract_product(rhs, &r.damping_rc, &dv.to_array());
        for ((out, q_dot), q_dot_n) in scratch.iter_mut().zip(&*q_dot).zip(&r.velocity) {
            *out = q_dot - q_dot_n;
        }
        subtract_product(rhs, &r.damping, scratch);
        for ((out, q), q_dot) in scratch.iter_mut().zip(&*q).zip(&*q_dot) {
            *out = q + step_s * q_dot;
        }
        subtract_product(rhs, &r.stiffness, scratch);
        r.implicit.solve_in_place(rhs);
        for ((q, q_dot), change) in q.iter_mut().zip(q_dot).zip(&*rhs) {
            *q_dot += change;
            *q += step_s * *q_dot;
        }
    }

    /// The force that `model` displays at `sample` in this state, N, before any filter.
    #[must_use]
    pub fn force_n(&self, model: &LocalModel, sample: &Sample) -> DVec3 {
        let dx = sample.position_m - model.position_m;
        let dv = sample.velocity_m_per_s - model.velocity_m_per_s;
        let force = match (model.contact, model.scheme) {
            (_, Scheme::NearFieldExact) => {
                return if !model.near.is_empty() { self.near.displayed_n() } else { DVec3::ZERO };
            }
            (Contact::Apart, _) => return DVec3::ZERO,
            (_, Scheme::Hold | Scheme::LowPass) => model.force_n,
            (_, Scheme::Tangent) => model.force_n - model.stiffness_n_per_m * dx,
            (_, Scheme::Neighbourhood | Scheme::KrylovLinear) => {
                model.force_n
                    - model.stiffness_n_per_m * dx
                    - model.damping_ns_per_m * dv
                    - self.coupling(model)
            }
        };
        match model.contact {
            Contact::Touching { normal } => unilateral_force(force, normal),
            Contact::Apart | Contact::Held => force,
        }
    }

    /// Whether the impulses of the tool's contacts were not found as well as they should be at the last sample: there were too
    /// many of them for the time of a tick, or they contradict each other.
    #[must_use]
    pub fn is_unconverged(&self, model: &LocalModel) -> bool {
        model.scheme == Scheme::NearFieldExact && !model.near.is_empty() && self.near.is_unconverged()
    }

    /// About how many multiplications the last tick took.
    pub(crate) fn work(&self, model: &LocalModel) -> usize {
        if model.scheme != Scheme::NearFieldExact {
            return 3 * model.reduced.order * model.reduced.order;
        }
        let contacts = ANSWER * self.near.row_updates();
        if !model.near.is_empty() { model.near.multiplications().saturating_add(contacts) } else { 0 }
    }

    /// Energy of the whole body as `model` has it in this state, J; `None` for schemes that know none.
    #[must_use]
    pub fn energy_j(&self, model: &LocalModel) -> Option<f64> {
        let knows = model.scheme == Scheme::NearFieldExact && !model.near.is_empty();
        knows.then(|| self.near.energy_j(&model.near))
    }

    /// K_cr V q + B_cr V (q̇ − q̇_N).
    fn coupling(&self, model: &LocalModel) -> DVec3 {
        let r = &model.reduced;
        let rows = r.stiffness_rc.chunks_exact(3).zip(r.damping_rc.chunks_exact(3));
        let states = self.q.iter().zip(&self.q_dot).zip(&r.velocity);
        let mut sum = [0.0; 3];
        for ((k, b), ((q, q_dot), q_dot_n)) in rows.zip(states).take(r.order) {
            for ((sum, k), b) in sum.iter_mut().zip(k).zip(b) {
                *sum += dot(&[*k, *b], &[*q, q_dot - q_dot_n]);
            }
        }
        DVec3::from_array(sum)
    }
}
