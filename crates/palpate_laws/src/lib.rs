//! Force laws shared by the full body and the local model of palpate, so that both speak the same physics.
//!
//! * [`Spring`]: a spring and a damper along one axis, with its force, its energy and its exact tangent.
//! * [`ForceLaw`]: linear, that of skin ([`SkinLaw`], the seed paper's equation 5), or stiffening exponentially.
//! * [`one_sided`]: the rule that a surface pushes and never pulls; [`Coulomb`]: the same with friction, in impulses;
//!   [`solve_rows`]: several contacts, grasps and threads as one problem.
//! * [`Coupling`]: a tool that gives way instead of dragging a body through itself.
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
mod law;
mod rows;
mod skin;
mod spring;
mod touch;

pub use contact::one_sided;
pub use coulomb::Coulomb;
pub use coupling::{Coupling, DrawnTool, ProxyStep, ToolMove, solve_with_proxies, solve_with_proxy};
pub use error::LawError;
pub use law::{ForceLaw, Tension};
pub use rows::{Answer, CLOSED_M, CLOSING_M_PER_S, Effort, Row, RowLaw, Sweeps, solve_rows};
pub use skin::SkinLaw;
pub use spring::{Spring, SpringTangent};
pub use touch::{Feature, FeatureGap, POINT_NODES, ToolShape, nearest_weights};
