//! Builds local models of a full body, compares them with it, and analyses the small motions of a body as a linear system.
//!
//! # Local models
//!
//! * [`LocalModelBuilder`]: builds a [`palpate_local::LocalModel`] from the state of a body and a tool.
//! * [`Comparison`]: the force of every scheme against the oracle, the full body stepped every tick, on the same samples.
//! * [`Bode`]: the frequency response of a local model and of its body.
//!
//! # Linear systems
//!
//! * [`SecondOrderSystem`], [`DenseSystem`]: M q̈ + B q̇ + K q = input, sparse or dense, with projections by congruence.
//! * [`StateSpace`], [`PoleResidue`]: the equivalent first-order system; its transfer function at many frequencies.
//! * [`SecondOrderSystem::krylov_basis`], [`SecondOrderSystem::modal_basis`]: bases for projection.
//! * [`Gramians`], [`Balancing`], [`HInf`]: balanced truncation, and the H∞ norm of its error.
//!
//! # Sources
//!
//! * The seed paper, with the multirate method and the local linear approximation: M. C. Çavuşoğlu, *Multirate Simulation for High Fidelity
//!   Haptic Interaction with Deformable Objects in Virtual Environments*, UCB/ERL M00/5, 2000.
//! * Rational Krylov projection of second-order systems: Z. Bai and Y. Su, SIAM J. Sci. Comput. 26 (2005) 1692; C. Beattie and S. Gugercin,
//!   Syst. Control Lett. 58 (2009) 225.
//! * Gramians by the squared Smith method: R. A. Smith, SIAM J. Appl. Math. 16 (1968) 198; T. Penzl, SIAM J. Sci. Comput. 21 (1999) 1401.
//! * Balanced truncation by the square-root method: M. S. Tombs and I. Postlethwaite, Int. J. Control 46 (1987) 1319. Its error bound:
//!   K. Glover, Int. J. Control 39 (1984) 1115.
//! * H∞ norm: S. Boyd, V. Balakrishnan and P. Kabamba, Math. Control Signals Systems 2 (1989) 207; N. A. Bruinsma and M. Steinbuch, Systems &
//!   Control Letters 14 (1990) 287.
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
//! SI, `f64`; samples, models and bodies in one frame. The force is that of the body on the hand.
//!
//! # Accuracy and limits
//!
//! K is exact and includes the geometric stiffness. If it cannot be factorised, for example in a buckling body, the clamped positive
//! semidefinite tangent is used, and [`palpate_local::LocalModel::clamped`] is set.
//!
//! A near field has the contact patches of the body, the surface of the support set, and the nearest other triangles. The latter are limited
//! by its capacity and to 1.5 m from the tool, and are static until the next hand-over. Contacts of the body with obstacles are
//! constraints until then: they neither open nor close, and slip only if they slip now. Ties, and contacts with rigid bodies that give way
//! more than a twentieth as easily as the body, are constant forces. The linear schemes, the static stiffness and [`Bode`]
//! leave out the compliance of contacts smaller than a cell.

#![forbid(unsafe_code)]

mod balancing;
mod bode;
mod builder;
mod comparison;
mod dense_system;
mod dynamic_stiffness;
mod error;
mod far_field;
mod gramians;
mod hinf;
mod krylov_linear;
mod local_model_system;
mod near_field;
mod neighbourhood;
mod obstacle_constraints;
mod options;
mod pole_residue;
mod reduction_bases;
mod second_order_system;
mod state_space;
mod static_stiffness;
mod tangent_block;

pub use balancing::{Balancing, Truncated};
pub use bode::{Bode, BodePoint};
pub use builder::{BodyUnderTool, BuildReport, LocalModelBuilder};
pub use comparison::{Comparison, ComparisonOptions, relative_rms_error};
pub use dense_system::DenseSystem;
pub use error::ReduceError;
pub use gramians::Gramians;
pub use hinf::HInf;
pub use options::{BuilderOptions, LocalIntegrator};
pub use pole_residue::PoleResidue;
pub use second_order_system::SecondOrderSystem;
pub use state_space::StateSpace;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
