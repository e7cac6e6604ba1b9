//! The full deformable body of palpate: a network of point masses with springs, dampers and elements between them, with full geometric
//! nonlinearity.
//!
//! The crate builds bodies as blocks, as lattices or from closed meshes, and steps them through time with tools,
//! obstacles, grasps and threads. The local models of palpate approximate such a body, and their error is measured
//! against it. Force laws and the contact solver come from `palpate_laws`.
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
//! // A tool holds one node and pushes it down by 1 mm within one tick of 1 ms.
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
//! * Networks: [`Network`], built by a [`NetworkBuilder`] from nodes, [`Link`]s and [`Hexahedra`]; [`Lattice`], regular in one to
//!   three dimensions; [`Block`], a lattice with its [`Surface`], with or without a [`Slit`].
//! * Meshes: [`ClosedMesh`] from triangles that enclose a volume, or a [`MeshError`] with the remedy; [`JoinedMesh`] from
//!   several [`MeshPart`]s, each with a [`Region`];
//!   [`CellLattice`], cubic cells fitted to it, with tissue and fixed nodes by [`Region`]; the resulting [`MeshBody`]
//!   with its [`Skin`].
//! * Material: [`UniformLattice`], equal springs; [`Tissue`], from Young's modulus and density, as springs or as elements with an [`ElasticLaw`].
//! * State and time: [`Body`], [`BodyState`], [`Integrator`], [`StepReport`]; [`Energy`], [`EnergyBalance`].
//! * Tools: [`ToolContact`] and [`ToolPoint`]; [`TouchedPoint`], a row of a contact patch on the [`ContactSurface`];
//!   the [`Grid`] of cells below it; [`SurfaceTree`], the nearest point of the surface. A [`SharedTool`] touches several
//!   bodies, which [`advance_bodies`] steps together.
//! * Constraints: [`Obstacle`] with [`ObstacleContact`], [`ObstacleReaction`], [`RigidMass`] and [`RigidMotion`],
//!   or [`CoupledMotion`] and [`RigidResponse`]; [`Tie`] between [`BodyPoint`]s.
//! * Linearisation: [`TangentPattern`], [`Tangent`].
//!
//! # Units, frames, signs
//!
//! SI units and `f64` throughout. All vectors are in the frame of the body. A displayed force is the force of the
//! body on the hand: along the outward normal of the surface it pushes the tool out. Poisson's ratio of a body of
//! springs is 1/4.
//!
//! # Sources
//!
//! * From Young's modulus to springs: Cauchy's relations for central forces; the derivation is in [`Tissue`].
//! * Linearly implicit Euler: D. Baraff and A. Witkin, SIGGRAPH 98, pp. 43-54.
//! * Contact and indentation: see `palpate_laws`.
//! * Winding numbers with exact signs: H. Edelsbrunner and E. P. Mücke, ACM Trans. Graph. 9 (1990) 66.
//!
//! # Accuracy and limits
//!
//! * A tool touches the surface in at most four contact patches, unilaterally and with Coulomb friction
//!   ([`ToolContact`]). A patch is one row while the contact radius is below 0.8 cells. Above it is nine rows, which
//!   separate continuously up to two cells. Each row is the mean of the surface under its part of the tool's pressure.
//!   The normal is that of a ring at least a cell wide, so finer detail does not change the direction of the force. A
//!   tilted punch touches with its rim.
//! * Blocks with a [`Tissue`] and cell lattices add the contact compliance that cells lack below their size, along
//!   the normal and across it. It is computed for a plane surface of one tissue, and is less accurate on edges and at
//!   borders of tissues. Over all positions in a cell, a ball of half a cell, one and two cells deviates from Hertz's
//!   force by 0.4, 0.1 and -3.2 % in the mean, with a ripple of 0.5, 1.9 and 1.9 %. The values hold for a block of 11 x
//!   11 x 11 nodes at a depth of 0.4 radii.
//! * [`Body::add_compliance`] switches that compliance off. Without it, and on blocks of equal springs
//!   ([`UniformLattice`]), a twentieth of the smooth law remains. A network without cells has none, and a ball touches
//!   it at a point.
//! * A row with less than 0.3 of its weight on free nodes cannot be touched; 0.1 is enough once it bears a force.
//! * A tool is swept along its path and crosses no surface at up to 25 m/s. A faster tool counts as having jumped. If
//!   it lands inside a body, it touches nothing until all of it has left.
//! * The displayed force of a touch is the force on the touched nodes, including their own weight.
//! * Points of the surface meet obstacles unilaterally and with friction ([`Body::obstacle_points`]). What is smaller than
//!   their distance may enter between them: a corner of an obstacle, or a loose body of less than two cells. Of a body of a
//!   mesh, the surface between its points enters by up to a tenth of a cell on a ball of four cells' radius. A step treats
//!   a curved obstacle as its tangent plane, so a long step may meet a sphere that the point would have passed. Impacts are
//!   inelastic. Ties are rigid, except elastic threads; see [`Tie`].
//! * A rigid body ([`Obstacle::with_mass`]) and a soft body are solved together, so their masses and stiffness may have any
//!   ratio. Rigid bodies do not touch each other. Momentum and angular momentum of both are conserved by explicit steps; a
//!   linearised implicit step preserves momentum, and angular momentum to first order.
//! * A point that is pressed into an obstacle by another one, moved, has no solution; [`StepReport::unconverged`] counts
//!   such steps.
//! * With the implicit step every node in contact costs three solutions with the matrix of the whole body, and many
//!   nodes on the ground are slow.
//! * The cells of blocks and of cell lattices have volume barriers ([`VolumeBarrier`]): a body that is pressed or
//!   drawn through itself returns to rest once it is released. A pressure above one to two times Young's modulus
//!   inverts cells while it acts ([`StepReport::inverted_cells`]). A body whose nodes are set at random, several cells
//!   from rest, may stay folded. A network of single springs has no barriers.
//! * Both integrators are of first order. Semi-implicit Euler takes as many substeps as its stability needs
//!   ([`SemiImplicitEuler`]), which is many for stiff tissue on a fine lattice. [`LinearlyImplicitEuler`] is stable at
//!   any step length, and damps motion that is fast compared with its step.

#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod block;
mod body;
mod body_point;
mod cell_lattice;
mod cell_size;
mod cell_tissue;
mod cells;
mod closed_mesh;
mod conjugate_gradients;
mod contact_newton;
mod damping;
mod disjoint_sets;
mod eigenvalue;
mod energy;
mod error;
mod face;
mod hexahedra;
mod implausible_size;
mod impulse_response;
mod incidence;
mod integrator;
mod lattice;
mod limits;
mod link;
mod mesh_parts;
mod mesh_pieces;
mod network;
mod obstacle;
mod obstacle_points;
mod obstacle_step;
mod optimization;
mod parallel;
mod published_tissues;
mod region;
mod relaxed_stress;
mod skin;
mod smoothed_domains;
mod surface;
mod tangent;
mod tetrahedra;
mod tetrahedral_mesh;
mod tie;
mod tissue;
mod tissue_sampling;
mod tool;
mod touch_surface;
mod triangle_bvh;
mod vertex_normals;
mod weights;

pub use block::{Block, BlockBody, Slit, UniformLattice, cell_tetrahedra};
pub use body::{Body, BodyState, CellPlace, Deformation, SharedTool, StepReport, ToolRun, advance_bodies};
pub use body_point::BodyPoint;
pub use cell_lattice::{CellLattice, MeshBody, MeshCells};
pub use cell_size::CellSize;
pub use cells::BarrierTetrahedron;
pub use closed_mesh::{ClosedMesh, MeshAssumptions, MeshClosing, MeshError, MeshRepairs, ThinParts};
pub use damping::Damping;
pub use energy::{Energy, EnergyBalance};
pub use error::{BodyError, JointStepError};
pub use face::Face;
pub use hexahedra::{Hexahedra, Hexahedron};
pub use implausible_size::ImplausibleSize;
pub use integrator::{Integrator, LinearSolver, LinearlyImplicitEuler, SemiImplicitEuler, SolvedBy};
pub use lattice::{Lattice, Neighbours};
pub use link::Link;
pub use mesh_parts::{JoinOptions, JoinedMesh, MeshPart};
pub use mesh_pieces::{MeshPiece, PieceSelection};
pub use network::{Grid, Network, NetworkBuilder};
pub use obstacle::{
    CoupledMotion, Obstacle, ObstacleContact, ObstacleReaction, RigidMass, RigidMotion, RigidResponse,
};
pub use optimization::is_optimized;
pub use palpate_laws::{
    ElasticLaw, PronyTerm, Relaxation, RelaxedStress, StressState, ToolShape, VirtualCoupling, VolumeBarrier,
};
pub use region::Region;
pub use skin::Skin;
pub use smoothed_domains::{SmoothedDomain, SmoothedDomains};
pub use surface::{ClosestPoint, ContactSurface, Surface, SurfaceTree};
pub use tangent::{Tangent, TangentPattern};
pub use tetrahedra::Tetrahedra;
pub use tetrahedral_mesh::{TetrahedralBody, TetrahedralMesh, TetrahedralMeshError, TetrahedralReport};
pub use tie::Tie;
pub use tissue::{CellStiffness, Tissue};
pub use tool::{ToolContact, ToolPoint, TouchedPoint};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
