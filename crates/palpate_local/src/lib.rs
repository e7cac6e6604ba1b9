//! The local model of a soft body: the part of palpate that a haptic loop evaluates every millisecond, between two steps of the
//! full body.
//!
//! A full body of a few thousand springs takes 20 to 50 ms a step; haptic rendering requires a force every 1 ms. The model step therefore
//! builds a local model of the body near the tool, and the loop evaluates it until the next one arrives. This crate has the
//! local model as data, its tick, and the hand-over between models. Nothing in it allocates after construction, reads a clock or takes
//! a lock.
//!
//! * [`LocalModel`]: plain data, written by the model step and copied as a whole. [`Scheme`] selects the approximation.
//! * [`LocalState`]: the dynamic state of a local model, and its tick.
//! * [`HandOver`]: keeps the active model, replays missed samples into a newer one, swaps the two, and renders the force.
//! * [`NearField`]: the data of the default scheme, [`Scheme::NearFieldExact`].
//! * [`Sample`], [`SampleHistory`]: readings of the device, one a tick.
//!
//! # Getting started
//!
//! ```
//! use glam::{DMat3, DVec3};
//! use palpate_local::{
//!     Contact, HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult,
//! };
//!
//! # fn main() -> Result<(), palpate_local::LocalModelError> {
//! let settings = HandOverSettings::default();
//! let mut hand_over = HandOver::new(settings)?;
//! // The device moves down by 10 µm in every tick of 1 ms.
//! let sample = |sequence: u64| Sample {
//!     sequence,
//!     position_m: DVec3::Y * -1e-5 * sequence as f64,
//!     ..Sample::default()
//! };
//! hand_over.push(sample(0));
//! assert_eq!(hand_over.render().force_n, DVec3::ZERO);
//!
//! // A local model built at that sample: a force of 1 N, and a static stiffness of 500 N/m.
//! let mut model = LocalModel::empty(settings.capacity);
//! model.id = ModelId { body: 1, epoch: 0, sequence: 0 };
//! (model.scheme, model.contact) = (Scheme::Tangent, Contact::Held);
//! (model.force_n, model.stiffness_n_per_m) = (DVec3::Y, DMat3::from_diagonal(DVec3::splat(500.0)));
//! assert_eq!(hand_over.submit(&model), SubmitResult::Accepted);
//!
//! // It renders the force of every tick until a newer model replaces it.
//! hand_over.push(sample(1));
//! assert!((hand_over.render().force_n.y - (1.0 + 500.0 * 1e-5)).abs() < 1e-12);
//! hand_over.push(sample(2));
//! assert!((hand_over.render().force_n.y - (1.0 + 500.0 * 2e-5)).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # Schemes
//!
//! With N the model step, x, v the tool's position and velocity, dx = x − x_N, dv = v − v_N, f_N the force at N, and K, B the tangent
//! stiffness and damping of the body at N, partitioned into the driven node c and the other free nodes r:
//!
//! | [`Scheme`] | force between two model steps |
//! | --- | --- |
//! | `Hold` | f_N |
//! | `LowPass` | f_N through a first-order low-pass filter |
//! | `Tangent` | f_N − (K_cc − K_cr K_rr⁻¹ K_rc) dx |
//! | `Neighbourhood`, `KrylovLinear` | f_N − K_cc dx − B_cc dv − K_cr V q − B_cr V (q̇ − q̇_N), with q a reduced dynamic state |
//! | `NearFieldExact` | the internal force of the springs at the tool, on the held point or the touched surface |
//!
//! For `Neighbourhood`, the local linear approximation of the seed paper (M. C. Çavuşoğlu, *Multirate Simulation for High Fidelity Haptic
//! Interaction with Deformable Objects in Virtual Environments*, UCB/ERL M00/5, 2000, Fig. 8), V selects the nodes within a
//! number of rings of the driven node and
//!
//! ```text
//! M̃ q̈ + B̃ (q̇ − q̇_N) + K̃ q = Vᵀ F_N − Vᵀ K_rc dx − Vᵀ B_rc dv,    q(t_N) = 0,  q̇(t_N) = Vᵀ v_N
//! ```
//!
//! is integrated by linearly implicit Euler, one step a tick.
//!
//! `KrylovLinear` is the same with a V that spans a rational Krylov space of the response of the whole body to the tool.
//!
//! `NearFieldExact`, the default, keeps the springs at the tool exact, reduces all others, and solves contact in the tick. With
//! S the nodes that the tool can reach, z = (δx_S, q), and V a basis of the nodes beyond S, orthonormal with respect to the mass matrix,
//!
//! ```text
//! M_S ẍ_S = F_near(x_S, V q, …) + external force on S + contact
//! q̈ + B̃ (q̇ − q̇_N) + K̃ q = Vᵀ F_far,N + Vᵀ F_near(x_S, V q, …)
//! ```
//!
//! is integrated explicitly, as the body is, or linearly implicitly ([`TickIntegrator`]); see [`NearField`]. Contact impulses are found by
//! projected Gauss-Seidel on the Delassus operator of the active rows ([`palpate_laws::solve_projected_gauss_seidel`]).
//!
//! A model of `NearFieldExact` contains up to two bodies ([`SecondBody`]), for an instrument between two organs. Each has a near field of
//! its own. They share the tool: its proxy, and one solution of the contacts of both with the coupling.
//!
//! # Units, frames, signs
//!
//! SI, `f64`, the frame of the scene. The force is that of the body on the hand.
//!
//! # Accuracy and limits
//!
//! `NearFieldExact` detects contact patches as the body does, and renders a new contact in the tick in which it begins. This holds on the
//! surface of S and on the other triangles of the near field ([`NearTriangle::is_reachable`]). The latter stay at their positions of the
//! model step, have no friction until loaded, and yield like a half-space of the tissue. The other schemes decide contact at the model
//! step: a new contact is rendered after the next one. They also leave out the compliance of a contact smaller than a cell. Force errors
//! against the full body are on the front page of the project.

#![forbid(unsafe_code)]

mod dense;
mod error;
mod hand_over;
mod joint_contact;
mod low_pass;
mod model;
mod near_field;
mod near_field_contact;
mod near_field_state;
mod near_fields_state;
mod sample;
mod tick;

pub use dense::Cholesky;
pub use error::LocalModelError;
pub use hand_over::{HandOver, HandOverSettings, ModelSwap, RenderedForce, SubmitResult};
pub use low_pass::LowPass;
pub use model::{Capacity, Contact, LocalModel, MAX_BODIES, ModelId, Scheme, SecondBody};
pub use near_field::{
    NearContact, NearDomain, NearEnd, NearField, NearFieldCapacity, NearHexahedron, NearPatch, NearPoint,
    NearSpring, NearTetrahedron, NearTriangle, Support, TickIntegrator,
};
pub use sample::{OtherToolForce, Sample, SampleHistory, SampleOrigin};
pub use tick::LocalState;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
