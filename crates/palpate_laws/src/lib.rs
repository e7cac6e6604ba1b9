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
//! * [`Patch`]: where a tool is pressed against a triangulated surface ([`PatchSurface`]), with its normal; [`Seed`]: where it starts;
//!   [`PatchLayout`]: the rows that it is divided into.
//! * [`Indentation`]: force and approach of a ball and a flat punch on a smooth elastic surface; [`SeriesCompliance`]: the share
//!   of it that a grid of cells lacks.
//! * [`lattice_compliance`]: how far a node of a lattice's surface moves under a force on another one.
//! * [`VolumeBarrier`]: the energy, forces and tangent that keep a cell from inversion, and turn it back.
//! * [`ToolShape`]: a sphere or a flat punch, and how its pressure is spread.
//!
//! # Units, frames, signs
//!
//! Everything is SI and `f64`. Vectors are in whatever frame the caller uses, the same for all of them.
//! A tension is positive when the spring is stretched; a spring's force is the force *on its node `a`*,
//! the force on `b` is its negative. Normals of surfaces are unit vectors out of the body; a tool pushes against them.
//!
//! # Accuracy and limits
//!
//! The damper acts along the spring's current axis only. [`SpringTangent`] leaves out the derivative of the
//! damper's force with respect to position (it is proportional to the velocity and not symmetric); everything
//! else is exact, the geometric stiffness included.
//!
//! The laws of indentation are those of a half-space without friction: Hertz under a ball, up to a contact as wide as the ball,
//! and Boussinesq under a flat punch (K. L. Johnson, Contact Mechanics, 1985, sections 4.2 and 3.8). Across the normal a contact
//! gives way as one that does not slip (R. D. Mindlin, J. Appl. Mech. 16 (1949) 259), for Poisson's ratio 1/4. A [`Patch`] has its
//! pressure at 48 points ([`PRESSURE_POINTS`]), which integrate moments up to the fourth exactly on a plane. The share that a grid lacks is
//! computed for a plane surface of one tissue; that compressed springs soften is in it to a strain of a third.

#![forbid(unsafe_code)]

mod carried_points;
mod constraint_row;
mod contact_gap;
mod coulomb;
mod coupling;
mod error;
mod force_law;
mod gauss_seidel;
mod grid_compliance;
mod indentation;
mod patch;
mod patch_rows;
mod patch_seed;
mod patch_surface;
mod pressure_points;
mod proxy_solver;
mod series_compliance;
mod skin_law;
mod smooth_step;
mod spring;
mod tension;
mod tool_shape;
mod triangle;
mod unilateral;
mod volume_barrier;

pub use carried_points::{CarriedPoint, MAX_CARRIED};
pub use constraint_row::{ConstraintLaw, ConstraintRow, GAP_TOLERANCE_M, MAX_CORRECTION_SPEED_M_PER_S};
pub use contact_gap::{ContactGap, SeriesDeflection, is_out_of_reach, mobility};
pub use coulomb::Coulomb;
pub use coupling::{ProxyStep, ToolMove, VirtualCoupling};
pub use error::LawError;
pub use force_law::ForceLaw;
pub use gauss_seidel::{ImpulseResponse, SolverLimits, SolverReport, solve_projected_gauss_seidel};
pub use grid_compliance::{lattice_compliance, normal_compliance_at, tangential_compliance_at};
pub use indentation::{Indentation, Pressure};
pub use patch::{Patch, PatchScale, PatchStart};
pub use patch_rows::{MAX_PATCHES, PatchLayout, RowLayout};
pub use patch_seed::{KnownPatch, KnownPatches, Seed};
pub use patch_surface::{Neighbour, POINT_NODES, PatchSurface, SurfacePlace};
pub use pressure_points::{PATCH_ROWS, PRESSURE_POINTS, PressurePoint};
pub use proxy_solver::{ProxyState, solve_with_proxies, solve_with_proxy};
pub use series_compliance::SeriesCompliance;
pub use skin_law::SkinLaw;
pub use spring::{Spring, SpringTangent};
pub use tension::Tension;
pub use tool_shape::ToolShape;
pub use triangle::nearest_weights;
pub use unilateral::unilateral_force;
pub use volume_barrier::VolumeBarrier;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
