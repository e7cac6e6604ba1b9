//! The full deformable body of palpate: point masses joined by springs and dampers, some of them fixed, with
//! full geometric nonlinearity. It is what the local model approximates and what every scheme is judged by.
//!
//! # Getting started
//!
//! ```
//! use glam::DVec3;
//! use palpate_body::{Block, Body, Face, SemiImplicitEuler, ToolContact, ToolPoint, UniformLattice};
//!
//! # fn main() -> Result<(), palpate_body::BodyError> {
//! // 6 x 6 x 6 nodes, 10 cm wide, 1 kg, its bottom fixed.
//! let block = Block::new([6, 6, 6], DVec3::splat(0.1))?
//!     .fix(Face::NegZ)
//!     .uniform(&UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 })?;
//! let mut body = Body::new(block.network, block.surface)?;
//!
//! // A tool that holds one node and pushes it down by 1 mm within one tick of 1 ms.
//! let node = 3 + 6 * (3 + 6 * 5);
//! let from = ToolPoint::at_rest(body.positions_m()[node]);
//! let to = ToolPoint { position_m: from.position_m - 1e-3 * DVec3::Z, velocity_m_per_s: -DVec3::Z };
//! let mut tool = ToolContact::hold(&body, node, from.position_m)?;
//! body.advance(Some((&mut tool, &[from, to])), 1, SemiImplicitEuler::default())?;
//! assert!(tool.displayed_force_n(&body).z > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Contents
//!
//! * Networks: [`Network`], made by a [`NetworkBuilder`] from nodes and [`Link`]s; the regular [`Lattice`] in one to three
//!   dimensions; the [`Block`] with its [`Surface`], whole or with a
//!   [`Slit`].
//! * Meshes: a [`ClosedMesh`] from any triangles that enclose a volume, or a [`MeshError`] that says what to do; the
//!   [`CellLattice`] fitted to it, with tissue and what is fixed by [`Region`], which becomes a [`MeshBody`]; its [`Skin`].
//! * Material: [`UniformLattice`] (every spring alike) and [`Tissue`] (from Young's modulus and density).
//! * State and time: [`Body`], [`BodyState`], [`Integrator`], [`StepReport`]; energy: [`Energy`], [`EnergyBooks`].
//! * The tool: [`ToolContact`], [`ToolPoint`]; what is in the way: [`Obstacle`], [`NodeContact`];
//!   what holds points: [`Tie`], [`BodyPoint`];
//!   the nearest point of the surface: [`SurfaceTree`].
//! * Linearisation: [`TangentPattern`], [`Tangent`].
//!
//! # Units, frames, signs
//!
//! SI and `f64` throughout; one frame, the body's. A displayed force is what the body does to the hand: along
//! the surface's outward normal it pushes the tool out.
//!
//! # Accuracy and limits
//!
//! * A tool touches the surface at points of its triangles, up to 64 nodes in all, one-sided and with Coulomb friction
//!   ([`ToolContact`]); where a sphere is large beside the triangles, edges below a quarter of its radius, at their corners.
//!   A punch is met at its face, with its rim in eight points, and at corners beside it by its side, as long as its radius.
//!   What is fixed is not touched, nor a point with less than 0.3 of its weight on free nodes.
//! * What is displayed of a touch is the force on the nodes that it touches, their own weight among it.
//! * Nodes meet obstacles one-sided and with friction, exactly but for spheres, which a step knows by their tangent plane: a
//!   long step may meet one that it would have passed. Impacts are without rebound. Ties are rigid, but for threads that are made to
//!   stretch: see [`Tie`].
//! * With the implicit step every node in contact costs three solutions with the whole body's matrix, so that many nodes
//!   on the ground are slow. A linearised step keeps a free body's momentum, but its spin to the first order only.
//! * The cells of blocks and of cell lattices have volume barriers ([`VolumeBarrier`]): a body that is pressed or drawn through
//!   itself returns to rest once it is released. A stronger pressure than one to two times Young's modulus inverts a cell as long
//!   as it acts ([`StepReport::inverted_cells`]). A body whose nodes are set at random, several cells from rest, may stay folded.
//!   A network from single springs has no barriers.
//! * Both integrators are of first order. Semi-implicit Euler takes as many substeps as its stability needs
//!   ([`SemiImplicitEuler`]), which is many for stiff tissue on a fine lattice; [`LinearlyImplicitEuler`] takes any, and
//!   damps what is fast compared with its step.

#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod block;
mod body;
mod cell_lattice;
mod cells;
mod closed_mesh;
mod contact;
mod energy;
mod error;
mod integrator;
mod lattice;
mod network;
mod obstacle;
mod region;
mod skin;
mod surface;
mod tangent;
mod tie;
mod tissue;
mod tool;
mod touch_surface;

pub use block::{Block, BlockBody, Face, Slit, UniformLattice};
pub use body::{Body, BodyState, StepReport, ToolRun};
pub use cell_lattice::{CellLattice, CellSize, MeshBody, MeshCells};
pub use cells::BarrierTetrahedron;
pub use closed_mesh::{ClosedMesh, MeshError, MeshRepairs};
pub use energy::{Energy, EnergyBooks};
pub use error::BodyError;
pub use integrator::{Integrator, LinearSolver, LinearlyImplicitEuler, SemiImplicitEuler, SolvedBy};
pub use lattice::{Lattice, Neighbours};
pub use network::{Link, Network, NetworkBuilder};
pub use obstacle::{NodeContact, Obstacle};
pub use palpate_laws::{Coupling, ToolShape, VolumeBarrier};
pub use region::Region;
pub use skin::Skin;
pub use surface::{ClosestPoint, Surface, SurfaceTree};
pub use tangent::{Tangent, TangentPattern};
pub use tie::{BodyPoint, Tie};
pub use tissue::{CellStiffness, Tissue};
pub use tool::{ToolContact, ToolPoint, TouchedPoint};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
