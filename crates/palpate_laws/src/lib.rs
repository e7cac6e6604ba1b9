//! Force laws and contact mechanics of palpate, shared by the full body and the local model.
//!
//! The crate has no state and no body. It contains springs, the unilateral contact problem with Coulomb friction, the
//! constraint solver, contact patches on triangulated surfaces and the laws of indentation.
//!
//! # Getting started
//!
//! ```
//! use glam::{DMat3, DVec3};
//! use palpate_laws::{Coulomb, Spring};
//!
//! # fn main() -> Result<(), palpate_laws::LawError> {
//! // A spring of 200 N/m, 10 mm long at rest, with a parallel damper. It is stretched by 2 mm and lengthens at 50 mm/s.
//! let spring = Spring::linear(200.0, 0.010, 0.1)?;
//! let (d_m, d_dot_m_per_s) = (DVec3::X * 0.012, DVec3::X * 0.05);
//! let pull_n = spring.force_on_a(d_m, d_dot_m_per_s);
//! assert!((pull_n.x - (200.0 * 0.002 + 0.1 * 0.05)).abs() < 1e-12);
//!
//! // A mass of 0.1 kg hits a floor at 1 m/s and slides along it at 2 m/s: the contact impulse with friction.
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
//! * Springs: [`Spring`], a spring with a parallel damper, with force, energy and exact tangent; [`ForceLaw`], linear,
//!   measured on skin ([`SkinLaw`]) or exponential.
//! * Elements: [`ElasticLaw`], corotational linear or neo-Hookean, with [`LameParameters`]; [`HexahedronShape`], an eight-node hexahedron with
//!   force, energy, exact tangent and bounds; [`ElementMaterial`], with [`Relaxation`] by a Prony series.
//! * One contact: [`unilateral_force`], the condition that a surface only pushes; [`Coulomb`], the same with friction, in
//!   impulses.
//! * The constraint problem: [`ConstraintRow`] and [`ConstraintLaw`]; [`solve_projected_gauss_seidel`];
//!   [`ImpulseResponse`], the Delassus operator that a body provides.
//! * Proxies: [`VirtualCoupling`] between a device and the tool; [`solve_with_proxies`], the solver with force limits.
//! * Contact patches: [`ToolShape`]; [`PatchSurface`], a triangulated surface; [`Seed`], where a patch starts; [`Patch`],
//!   where it is; [`PatchLayout`], its rows; [`ContactGap`], the gap of a row.
//! * Indentation: [`Indentation`], force and approach of a ball and a flat punch on an elastic half-space;
//!   [`lattice_compliance`], the surface compliance of a lattice of springs; [`SeriesCompliance`], what a lattice lacks of
//!   the half-space.
//! * [`VolumeBarrier`]: energy, force and tangent that keep a cell from inversion and restore it.
//!
//! # Units, frames, signs
//!
//! SI units and `f64` throughout. All vectors of a call are in the same frame, which the caller chooses. A tension is
//! positive when the spring is stretched. The force of a spring is the force on its node `a`; the force on `b` is the
//! negative. Normals of surfaces are outward unit vectors of the body.
//!
//! # Sources
//!
//! * The condition of Signorini and Coulomb in impulses, and projected Gauss-Seidel: F. Jourdan, P. Alart, M. Jean, Comput.
//!   Methods Appl. Mech. Eng. 155 (1998) 31.
//! * The virtual coupling: J. E. Colgate, M. C. Stanley, J. M. Brown, Proc. IROS 1995.
//! * Indentation: K. L. Johnson, Contact Mechanics (1985), sections 3.8 (Boussinesq, flat punch) and 4.2 (Hertz, ball).
//!   Across the normal: R. D. Mindlin, J. Appl. Mech. 16 (1949) 259.
//! * The law of skin: D. d'Aulignac, C. Laugier, M. C. Çavuşoğlu, IROS'99. Exponential stiffening: Y. C. Fung, Am. J.
//!   Physiol. 213 (1967) 1532.
//! * The patches, the compliance of the lattice and the volume barrier were derived for this crate; their modules
//!   contain the derivations.
//!
//! # Accuracy and limits
//!
//! * A hexahedron has one integration point. With 16 cells along the longest edge, bonded blocks, cantilevers and natural frequencies deviate from
//!   converged solutions by at most 1 %, at Poisson's ratios up to 0.49. Tetrahedra are averaged around nodes, and deviate by at most 3 %.
//! * The damper of a spring acts along its current axis only. [`SpringTangent`] omits the derivative of the damper's force
//!   with respect to position, which is proportional to the velocity and not symmetric. The rest is exact, including the
//!   geometric stiffness.
//! * The laws of indentation are frictionless and hold for a half-space. Hertz's law is used up to a contact as wide as the
//!   ball. Across the normal a contact deflects as in stick.
//! * A [`Patch`] has its pressure at 48 points ([`PRESSURE_POINTS`]), which integrate moments up to the fourth exactly on a
//!   plane.
//! * The compliance that a lattice lacks is computed for a plane surface of one tissue. It includes the softening of
//!   compressed springs up to a strain of a third.

#![forbid(unsafe_code)]

mod carried_points;
mod constraint_row;
mod contact_gap;
mod coulomb;
mod coupling;
mod elastic_law;
mod element_material;
mod error;
mod force_law;
mod gauss_seidel;
mod grid_compliance;
mod hexahedron;
mod indentation;
mod patch;
mod patch_rows;
mod patch_seed;
mod patch_surface;
mod pressure_points;
mod proxy_solver;
mod relaxation;
mod series_compliance;
mod singular_values;
mod skin_law;
mod smooth_step;
mod smoothed_domain;
mod spring;
mod stress_state;
mod symmetric;
mod tension;
mod tool_shape;
mod triangle;
mod unilateral;
mod volume_barrier;

pub use carried_points::{LoadedPoint, MAX_LOADED_POINTS};
pub use constraint_row::{ConstraintLaw, ConstraintRow, GAP_TOLERANCE_M, MAX_CORRECTION_SPEED_M_PER_S};
pub use contact_gap::{ContactGap, SeriesDeflection, is_out_of_reach, mobility};
pub use coulomb::Coulomb;
pub use coupling::{ProxyStep, ToolMove, VirtualCoupling};
pub use elastic_law::{ElasticLaw, LameParameters, StressTangent, stress_block, stress_change};
pub use element_material::ElementMaterial;
pub use error::LawError;
pub use force_law::ForceLaw;
pub use gauss_seidel::{ImpulseResponse, SolverLimits, SolverReport, solve_projected_gauss_seidel};
pub use grid_compliance::{
    hexahedra_compliance, lattice_compliance, normal_compliance_at, tangential_compliance_at,
};
pub use hexahedron::{HexahedronBlocks, HexahedronShape};
pub use indentation::{Indentation, Pressure};
pub use patch::{Patch, PatchScale, PatchStart};
pub use patch_rows::{MAX_PATCHES, PatchLayout, RowLayout};
pub use patch_seed::{ActivePatch, ActivePatches, Seed};
pub use patch_surface::{Neighbour, POINT_NODES, PatchSurface, SurfacePlace};
pub use pressure_points::{PATCH_ROWS, PRESSURE_POINTS, PressurePoint};
pub use proxy_solver::{ProxyState, solve_with_proxies, solve_with_proxy};
pub use relaxation::{MAX_PRONY_TERMS, PronyTerm, Relaxation, RelaxedStress};
pub use series_compliance::SeriesCompliance;
pub use skin_law::SkinLaw;
pub use smoothed_domain::{DomainMaterial, domain_gradient};
pub use spring::{Spring, SpringTangent};
pub use stress_state::StressState;
pub use tension::Tension;
pub use tool_shape::ToolShape;
pub use triangle::nearest_weights;
pub use unilateral::unilateral_force;
pub use volume_barrier::VolumeBarrier;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
