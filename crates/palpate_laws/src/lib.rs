//! Force laws shared by the full body and the local model of palpate, so that both speak the same physics.
//!
//! # Getting started
//!
//! ```
//! use glam::{DMat3, DVec3};
//! use palpate_laws::{Coulomb, Spring};
//!
//! # fn main() -> Result<(), palpate_laws::LawError> {
//! // 200 N/m, 10 mm long at rest, beside a damper; its far end 2 mm too far away and going away at 50 mm/s.
//! let spring = Spring::linear(200.0, 0.010, 0.1)?;
//! let (apart_m, going_m_per_s) = (DVec3::X * 0.012, DVec3::X * 0.05);
//! let pull_n = spring.force_on_a(apart_m, going_m_per_s);
//! assert!((pull_n.x - (200.0 * 0.002 + 0.1 * 0.05)).abs() < 1e-12);
//!
//! // A mass of 0.1 kg that falls on a floor at 1 m/s and slides along it at 2 m/s: the impulse that stops the fall, and the
//! // friction that it allows.
//! let floor = Coulomb::new(DVec3::Z, 0.3)?;
//! let per_kg = DMat3::from_diagonal(DVec3::splat(1.0 / 0.1));
//! let impulse_ns = floor.impulse(per_kg, DVec3::new(2.0, 0.0, -1.0));
//! assert!((impulse_ns - DVec3::new(-0.03, 0.0, 0.1)).length() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # Contents
//!
//! * [`Spring`]: a spring and a damper along one axis, with its force, its energy and its exact tangent.
//! * [`ForceLaw`]: linear, that of skin ([`SkinLaw`], the seed paper's equation 5), or stiffening exponentially.
//! * [`one_sided`]: the rule that a surface pushes and never pulls; [`Coulomb`]: the same with friction, in impulses;
//!   [`solve_rows`]: several contacts, grasps and threads as one problem.
//! * [`Coupling`]: a tool that gives way instead of dragging a body through itself.
//! * [`lattice_compliance`]: how far a node of a lattice's surface moves under a force on another one.
//! * [`ToolShape`]: where a sphere or a flat punch touches a triangle.
//!
//! # Units, frames, signs
//!
//! Everything is SI and `f64`. Vectors are in whatever frame the caller uses, the same for all of them.
//! A tension is positive when the spring is stretched; a spring's force is the force *on its node `a`*,
//! the force on `b` is its negative.
//!
//! # Accuracy and limits
//!
//! The damper acts along the spring's current axis only. [`SpringTangent`] leaves out the derivative of the
//! damper's force with respect to position (it is proportional to the velocity and not symmetric); everything
//! else is exact, the geometric stiffness included.

#![forbid(unsafe_code)]

mod contact;
mod coulomb;
mod coupling;
mod error;
mod grid_compliance;
mod law;
mod rows;
mod skin;
mod spring;
mod touch;
mod volume;

pub use contact::one_sided;
pub use coulomb::Coulomb;
pub use coupling::{Coupling, DrawnTool, ProxyStep, ToolMove, solve_with_proxies, solve_with_proxy};
pub use error::LawError;
pub use grid_compliance::{lattice_compliance, normal_compliance_at, tangential_compliance_at};
pub use law::{ForceLaw, Tension};
pub use rows::{Answer, CLOSED_M, CLOSING_M_PER_S, Effort, Row, RowLaw, Sweeps, solve_rows};
pub use skin::SkinLaw;
pub use spring::{Spring, SpringTangent};
pub use touch::{Feature, FeatureGap, POINT_NODES, ToolShape, nearest_weights};
pub use volume::VolumeBarrier;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
