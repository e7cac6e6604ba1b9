//! The state of a local model and its tick: advances to a sample, then displays a force.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::{dot, subtract_product, zeros};
use crate::near_fields_state::NearFieldsState;
use crate::{Capacity, Contact, LocalModel, MAX_BODIES, ModelId, NearField, Sample, Scheme};
use glam::DVec3;
use palpate_laws::unilateral_force;

/// The state of a local model: (q, q̇) of the reduced dynamics or the state of the near field, and the buffers of a tick.
#[derive(Clone, Debug)]
pub struct LocalState {
    q: Vec<f64>,
    q_dot: Vec<f64>,
    rhs: Vec<f64>,
    scratch: Vec<f64>,
    near: NearFieldsState,
}

/// Cost of a row update of the contact solver, in multiplications.
const ROW_UPDATE_WORK: usize = 3000;

impl LocalState {
    /// A state for models up to `capacity`.
    #[must_use]
    pub fn with_capacity(capacity: Capacity) -> Self {
        let zero = zeros(capacity.order);
        let near = NearFieldsState::with_capacity(capacity);
        Self { q: zero.clone(), q_dot: zero.clone(), rhs: zero.clone(), scratch: zero, near }
    }

    /// Resets to the model step of `model`: q = 0, q̇ = q̇_N.
    pub fn start(&mut self, model: &LocalModel) {
        self.near.start(model.near_fields(), model.force_n);
        self.q.fill(0.0);
        self.q_dot.fill(0.0);
        for (to, from) in self.q_dot.iter_mut().zip(&model.reduced.velocity).take(model.reduced.order) {
            *to = *from;
        }
    }

    /// Advances the state by one tick to `sample`; `step_s` is the step h of the model's implicit factor, s.
    ///
    /// For the reduced dynamics: linearly implicit Euler in increments, with dx, dv of the new sample,
    /// (M̃/h + B̃ + hK̃) Δq̇ = Vᵀ(F_N − K_rc dx − B_rc dv) − B̃ (q̇ − q̇_N) − K̃ (q + h q̇).
    pub fn advance(&mut self, model: &LocalModel, sample: &Sample, step_s: f64) {
        if !model.has_state() {
            return;
        }
        if model.scheme == Scheme::NearFieldExact {
            self.near.advance(model.near_fields(), sample);
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

    /// The force on the hand that `model` displays at `sample` in this state, N, before any filter.
    #[must_use]
    pub fn force_n(&self, model: &LocalModel, sample: &Sample) -> DVec3 {
        let dx = sample.position_m - model.position_m;
        let dv = sample.velocity_m_per_s - model.velocity_m_per_s;
        let force = match (model.contact, model.scheme) {
            (_, Scheme::NearFieldExact) => {
                return if model.has_near_field() { self.near.displayed_n() } else { DVec3::ZERO };
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

    /// The force of the tool on each body of `model`, N, the mean of its contact impulses over the last tick, with the identity of the body.
    /// Zero for schemes other than [`Scheme::NearFieldExact`], which solve no contact.
    #[must_use]
    pub fn forces_on_bodies_n(&self, model: &LocalModel) -> [(u64, DVec3); MAX_BODIES] {
        let [first, second] = self.near.applied_n();
        match model.scheme {
            Scheme::NearFieldExact => [(model.id.body, first), (model.second.body, second)],
            _ => [(ModelId::NO_BODY, DVec3::ZERO); MAX_BODIES],
        }
    }

    /// Whether the contact solver failed to converge in the last tick: a limit of rows or row updates was reached, or the constraints
    /// contradict each other. Always false for schemes that solve no contacts in a tick.
    #[must_use]
    pub fn is_unconverged(&self, model: &LocalModel) -> bool {
        model.scheme == Scheme::NearFieldExact
            && model.has_near_field()
            && self.near.is_unconverged(model.near_fields())
    }

    /// Approximate cost of the last tick, in multiplications.
    pub(crate) fn work(&self, model: &LocalModel) -> usize {
        if model.scheme != Scheme::NearFieldExact {
            return 3 * model.reduced.order * model.reduced.order;
        }
        let fields = model.near_fields().into_iter().filter(|field| !field.is_empty());
        let of_fields = fields.map(NearField::multiplications).reduce(usize::saturating_add);
        let contacts = ROW_UPDATE_WORK * self.near.row_updates();
        of_fields.map_or(0, |work| work.saturating_add(contacts))
    }

    /// Energy of all bodies in this state of `model`, J; `None` for schemes other than [`Scheme::NearFieldExact`] and where the tool
    /// reaches nothing.
    #[must_use]
    pub fn energy_j(&self, model: &LocalModel) -> Option<f64> {
        let has_energy = model.scheme == Scheme::NearFieldExact && model.has_near_field();
        has_energy.then(|| self.near.energy_j(model.near_fields()))
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
