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
//! * The tool: [`ToolContact`], [`ToolPoint`]; where it touches: [`TouchedPoint`], on the [`ContactSurface`]; the [`Grid`] below it;
//!   what is in the way: [`Obstacle`], [`NodeContact`];
//!   what holds points: [`Tie`], [`BodyPoint`];
//!   the nearest point of the surface: [`SurfaceTree`].
//! * Linearisation: [`TangentPattern`], [`Tangent`].
//!
//! # Units, frames, signs
//!
//! SI and `f64` throughout; one frame, the body's. A displayed force is what the body does to the hand: along
//! the surface's outward normal it pushes the tool out. Poisson's ratio of a body of springs is 1/4.
//!
//! # Accuracy and limits
//!
//! * A tool touches the surface in contact patches, at most four, one-sided and with Coulomb friction ([`ToolContact`]). A patch is one
//!   row while the radius of the contact is below 0.8 cells, and above it nine, which move apart continuously up to two cells. A row is
//!   the mean of the surface under its part of the tool's pressure: Hertz's under a ball, Boussinesq's under a flat punch (K. L. Johnson,
//!   Contact Mechanics, 1985). The normal is that of a ring at least a cell wide: what is finer is not felt in the force's direction. A
//!   punch that is tilted touches with its rim.
//! * Blocks with a [`Tissue`] and cell lattices add to contact the compliance that cells lack below their size, along the normal and across it
//!   (R. D. Mindlin, J. Appl. Mech. 16 (1949) 259). It is computed for a plane surface of one tissue, and is less accurate on edges and
//!   where tissues meet. Over the places in a cell, a ball of half a cell, one and two cells meets Hertz's force to 0.4, 0.1 and
//!   -3.2 % in the mean, with a ripple of 0.5, 1.9 and 1.9 %, on a block of 11 x 11 x 11 nodes and 0.4 of its radius deep.
//!   [`Body::add_compliance`] takes the compliance away. Without it, and on blocks of equal springs ([`UniformLattice`]), a twentieth of the
//!   smooth law is left; a network without cells has none, and a ball touches it at a point.
//! * What is fixed is not touched, nor a row with less than 0.3 of its weight on free nodes; 0.1 is enough once it bears a force.
//! * A tool is swept along its way: at up to 25 m/s it does not pass through a surface. One that moves farther in a millisecond has
//!   jumped; inside a body it then touches nothing until all of it has left.
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
mod body_point;
mod cell_lattice;
mod cells;
mod closed_mesh;
mod conjugate_gradients;
mod eigenvalue;
mod energy;
mod error;
mod impulse_response;
mod integrator;
mod lattice;
mod limits;
mod link;
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
mod weights;

pub use block::{Block, BlockBody, Face, Slit, UniformLattice};
pub use body::{Body, BodyState, StepReport, ToolRun};
pub use body_point::BodyPoint;
pub use cell_lattice::{CellLattice, CellSize, MeshBody, MeshCells};
pub use cells::BarrierTetrahedron;
pub use closed_mesh::{ClosedMesh, MeshError, MeshRepairs};
pub use energy::{Energy, EnergyBalance};
pub use error::BodyError;
pub use integrator::{Integrator, LinearSolver, LinearlyImplicitEuler, SemiImplicitEuler, SolvedBy};
pub use lattice::{Lattice, Neighbours};
pub use link::Link;
pub use network::{Grid, Network, NetworkBuilder};
pub use obstacle::{NodeContact, Obstacle};
pub use palpate_laws::{ToolShape, VirtualCoupling, VolumeBarrier};
pub use region::Region;
pub use skin::Skin;
pub use surface::{ClosestPoint, ContactSurface, Surface, SurfaceTree};
pub use tangent::{Tangent, TangentPattern};
pub use tie::Tie;
pub use tissue::{CellStiffness, Tissue};
pub use tool::{ToolContact, ToolPoint, TouchedPoint};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
