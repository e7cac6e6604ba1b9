//! Builds a local model from a full body, judges local models against the full body, and analyses a body's small
//! motions as a linear system.
//!
//! * [`LocalModelBuilder`]: from the state of a body to a [`palpate_local::LocalModel`].
//! * [`Comparison`]: every scheme against the oracle on the same samples.
//! * [`Bode`]: how a local model answers over frequency, beside the body.
//! * [`SecondOrderSystem`], [`StateSpace`]: a body driven at some nodes, its response, poles and asymptotes;
//!   [`PoleResidue`] for many frequencies.
//! * [`DenseSystem`]: its projections by congruence, on Krylov bases and modes.
//! * [`Gramians`], [`Balancing`], [`HInf`]: what is needed of a system's states, balanced truncation, and the norm of
//!   what it leaves out.
//!
//! # Getting started
//!
//! ```
//! use glam::DVec3;
//! use palpate_body::{Block, Body, Face, ToolContact, UniformLattice};
//! use palpate_local::{Sample, Scheme};
//! use palpate_reduce::{Comparison, ComparisonOptions};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
//! let block = Block::new([4, 4, 4], DVec3::splat(0.1))?.fix(Face::NegZ).uniform(&lattice)?;
//! let body = Body::new(block.network, block.surface)?;
//! let node = 1 + 4 * (1 + 4 * 3);
//! let start = body.positions_m()[node];
//! let samples: Vec<Sample> = (0..300)
//!     .map(|i| {
//!         let t = f64::from(i) * 1e-3;
//!         Sample {
//!             sequence: i as u64,
//!             position_m: start - DVec3::Z * 0.005 * (10.0 * t).sin(),
//!             velocity_m_per_s: -DVec3::Z * 0.05 * (10.0 * t).cos(),
//!             ..Sample::default()
//!         }
//!     })
//!     .collect();
//! let contact = ToolContact::hold(&body, node, start)?;
//! let comparison = Comparison::run(&body, &contact, &samples, &Scheme::ALL, &ComparisonOptions::default())?;
//! let error = |scheme| comparison.relative_rms_error(scheme, 100).unwrap();
//! assert!(error(Scheme::Tangent) < error(Scheme::Hold));
//! # Ok(())
//! # }
//! ```
//!
//! # Units, frames, signs
//!
//! SI, `f64`; samples, models and bodies in one frame. Force is what the body does to the hand.
//!
//! # Accuracy and limits
//!
//! K is exact with its geometric stiffness. Where it cannot be factorised (a body that buckles) the clamped
//! positive semidefinite tangent takes its place, and [`palpate_local::LocalModel::clamped`] says so.
//!
//! A near field has the contact patches of the body, the surface that the support set carries, and the nearest triangles beside that, up to
//! its room and 1.5 m from the tool, where they are at the model step. The linear schemes, the static stiffness and [`Bode`] leave out the
//! compliance that a contact has below the size of a cell.

#![forbid(unsafe_code)]

mod balance;
mod bode;
mod builder;
mod compare;
mod dense;
mod dynamic;
mod error;
mod gramian;
mod hinf;
mod krylov;
mod local_response;
mod near_field;
mod neighbourhood;
mod pole_residue;
mod state_space;
mod static_stiffness;
mod system;

pub use balance::{Balancing, Truncated};
pub use bode::{Bode, BodePoint};
pub use builder::{BuildReport, BuilderOptions, LocalModelBuilder};
pub use compare::{Comparison, ComparisonOptions, relative_rms_error};
pub use dense::DenseSystem;
pub use error::ReduceError;
pub use gramian::Gramians;
pub use hinf::HInf;
pub use near_field::LocalIntegrator;
pub use pole_residue::PoleResidue;
pub use state_space::StateSpace;
pub use system::SecondOrderSystem;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
