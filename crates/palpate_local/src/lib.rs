//! The local model of palpate: what the haptic loop evaluates at every tick of 1 ms between two steps of the
//! full body.
//!
//! A [`LocalModel`] is plain data, made by the model side and handed over whole. [`HandOver`] keeps the one
//! that speaks, its [`LocalState`], and the one that is catching up. Nothing here allocates after
//! construction, reads a clock or takes a lock.
//!
//! # Getting started
//!
//! ```
//! use glam::{DMat3, DVec3};
//! use palpate_local::{
//!     Contact, HandOver, HandOverSettings, LocalModel, ModelId, Offer, Sample, Scheme,
//! };
//!
//! # fn main() -> Result<(), palpate_local::LocalModelError> {
//! let settings = HandOverSettings::default();
//! let mut hand_over = HandOver::new(settings)?;
//! // The hand goes down by 10 µm in every tick of 1 ms.
//! let sample = |sequence: u64| Sample {
//!     sequence,
//!     position_m: DVec3::Y * -1e-5 * sequence as f64,
//!     ..Sample::default()
//! };
//! hand_over.push(sample(0));
//! assert_eq!(hand_over.speak().force_n, DVec3::ZERO);
//!
//! // What a model step made of the body at that sample: 1 N, and 500 N/m against going on.
//! let mut model = LocalModel::silent(settings.capacity);
//! model.id = ModelId { body: 1, epoch: 0, sequence: 0 };
//! (model.scheme, model.contact) = (Scheme::Tangent, Contact::Held);
//! (model.force_n, model.stiffness_n_per_m) = (DVec3::Y, DMat3::from_diagonal(DVec3::splat(500.0)));
//! assert_eq!(hand_over.offer(&model), Offer::Taken);
//!
//! // It speaks at every tick until there is a newer one.
//! hand_over.push(sample(1));
//! assert!((hand_over.speak().force_n.y - (1.0 + 500.0 * 1e-5)).abs() < 1e-12);
//! hand_over.push(sample(2));
//! assert!((hand_over.speak().force_n.y - (1.0 + 500.0 * 2e-5)).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # Schemes
//!
//! With N the model step, x, v the tool's position and velocity, dx = x − x_N, dv = v − v_N, f_N the force at
//! N, and K, B the tangent of the body at N, split into the driven node c and the other free nodes r:
//!
//! | [`Scheme`] | force between two model steps |
//! | --- | --- |
//! | `Hold` | f_N |
//! | `LowPass` | f_N through a first-order low-pass |
//! | `Tangent` | f_N − (K_cc − K_cr K_rr⁻¹ K_rc) dx |
//! | `Neighbourhood`, `KrylovLinear` | f_N − K_cc dx − B_cc dv − K_cr V q − B_cr V (q̇ − q̇_N), with q a reduced dynamic state |
//! | `NearFieldExact` | the internal force of the springs at the tool, on what is held or touched |
//!
//! For `Neighbourhood`, the seed paper's local linear approximation (its Fig. 8), V selects the nodes within
//! some rings of the driven node and
//!
//! ```text
//! M̃ q̈ + B̃ (q̇ − q̇_N) + K̃ q = Vᵀ F_N − Vᵀ K_rc dx − Vᵀ B_rc dv,    q(t_N) = 0,  q̇(t_N) = Vᵀ v_N
//! ```
//!
//! is stepped by linearly implicit Euler, one step a tick.
//!
//! `KrylovLinear` is the same with V spanning what the whole body answers to the tool with.
//!
//! `NearFieldExact`, the default, keeps the springs at the tool exact and reduces all others; the tool is met in the tick. With
//! S the nodes that it can reach, z = (δx_S, q), V of the nodes beyond S, orthonormal in the masses,
//!
//! ```text
//! M_S ẍ_S = F_near(x_S, V q, …) + what acts on S from outside + contact
//! q̈ + B̃ (q̇ − q̇_N) + K̃ q = Vᵀ F_far,N + Vᵀ F_near(x_S, V q, …)
//! ```
//!
//! is stepped as the body is or linearly implicitly ([`TickIntegrator`]); see [`NearField`].
//!
//! # Units, frames, signs
//!
//! SI, `f64`, the scene's frame. Force is what the body does to the hand.
//!
//! # Accuracy and limits
//!
//! `NearFieldExact` finds contact patches as the body does and feels a touch in the tick in which it is made: on the nodes of S, and beyond
//! them on the triangles that are known about S ([`NearTriangle::is_reachable`]). Those are where they were at the model step, stand still
//! until the next hand-over, have no friction and give way as a half-space of the tissue does. With the other schemes contact is decided at
//! the model step: a touch made between two steps is felt after the next one; and they leave out the compliance that a contact has
//! below the size of a cell. The force errors against the full body are on the project's front page.

#![forbid(unsafe_code)]

mod dense;
mod error;
mod hand_over;
mod low_pass;
mod model;
mod near_field;
mod near_tick;
mod near_touch;
mod sample;
mod tick;

pub use dense::Cholesky;
pub use error::LocalModelError;
pub use hand_over::{HandOver, HandOverSettings, ModelSwap, RenderedForce, SubmitResult};
pub use low_pass::LowPass;
pub use model::{Capacity, Contact, LocalModel, ModelId, Scheme};
pub use near_field::{
    NearContact, NearEnd, NearField, NearFieldCapacity, NearPatch, NearPoint, NearSpring, NearTetrahedron,
    NearTriangle, Support, TickIntegrator,
};
pub use sample::{Sample, SampleHistory, SampleOrigin};
pub use tick::LocalState;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
