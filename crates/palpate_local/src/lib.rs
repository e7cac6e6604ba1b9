//! The local model of palpate: what the haptic loop evaluates at every tick of 1 ms between two steps of the
//! full body.
//!
//! A [`LocalModel`] is plain data, made by the model side and handed over whole. [`HandOver`] keeps the one
//! that speaks, its [`LocalState`], and the one that is catching up. Nothing here allocates after
//! construction, reads a clock or takes a lock.
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
//! | `Neighbourhood` | f_N − K_cc dx − B_cc dv − K_cr V q − B_cr V (q̇ − q̇_N), with q a reduced dynamic state |
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
//! # Units, frames, signs
//!
//! SI, `f64`, the scene's frame. Force is what the body does to the hand.
//!
//! # Accuracy and limits
//!
//! Contact is decided at the model step: a touch made between two model steps is felt after the next one. The
//! force errors of the four schemes against the full body are in the table of the project's front page.

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
pub use hand_over::{HandOver, HandOverSettings, Offer, Spoken, Swap};
pub use low_pass::LowPass;
pub use model::{Capacity, Contact, LocalModel, ModelId, Scheme};
pub use near_field::{NearEnd, NearField, NearFieldCapacity, NearSpring, Support, TickIntegrator};
pub use sample::{Sample, SampleHistory, SampleOrigin};
pub use tick::LocalState;
