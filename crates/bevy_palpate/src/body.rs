//! Bodies: what the user asks for, and what is simulated.

mod mesh;

use crate::diagnostics::FrameCost;
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::{HapticSystems, ModelStep};
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Block, Body, BodyError, StepReport};
use palpate_reduce::{BuilderOptions, LocalModelBuilder, ReduceError};

/// A body that can be touched. Its partners [`Tissue`], [`FixedRegion`] and [`Transform`] come by themselves.
///
/// The body is built where its transform places it (rotation and translation; a scale other than 1 is refused)
/// and then lives in the world: moving its transform later moves neither the body nor its picture.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[component(immutable)]
#[require(Tissue, FixedRegion, Transform)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub struct DeformableBody {
    /// Nodes along x, y, z.
    pub nodes: [usize; 3],
    /// Size along x, y, z, m.
    pub size_m: DVec3,
}

impl DeformableBody {
    /// A cube of `nodes` nodes along x, y, z and `edge_m` wide, round the entity's origin.
    #[must_use]
    pub fn block(nodes: [usize; 3], edge_m: f64) -> Self {
        Self { nodes, size_m: DVec3::splat(edge_m) }
    }

    /// A block of `nodes` nodes along x, y, z and of size `size_m`, round the entity's origin.
    #[must_use]
    pub fn block_of_size(nodes: [usize; 3], size_m: DVec3) -> Self {
        Self { nodes, size_m }
    }
}

/// What a body is made of: see [`palpate_body::Tissue`] for how it becomes springs. It may be changed while the
/// body is touched; the body keeps its shape and motion then.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct Tissue {
    /// Young's modulus, Pa. Soft organs: 1 kPa to 100 kPa. Poisson's ratio is 1/4.
    pub youngs_modulus_pa: f64,
    /// Density, kg/m³.
    pub density_kg_per_m3: f64,
    /// Damping of the springs; 0.5 is a tissue that hardly rings.
    pub damping_ratio: f64,
}

impl Default for Tissue {
    /// 20 kPa, 1000 kg/m³, 0.5.
    fn default() -> Self {
        let palpate_body::Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio } =
            palpate_body::Tissue::default();
        Self { youngs_modulus_pa, density_kg_per_m3, damping_ratio }
    }
}

/// Which part of a body cannot move.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub enum FixedRegion {
    /// Nothing: the body floats.
    #[default]
    Nothing,
    /// One side.
    Face(Face),
    /// Several sides.
    Faces(Vec<Face>),
}

/// A side of a block, in the body's own frame, named as in Bevy: y is up, −z is forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum Face {
    /// −x.
    Left,
    /// +x.
    Right,
    /// −y.
    Bottom,
    /// +y.
    Top,
    /// −z.
    Front,
    /// +z.
    Back,
}

impl From<Face> for palpate_body::Face {
    fn from(face: Face) -> Self {
        match face {
            Face::Left => Self::NegX,
            Face::Right => Self::PosX,
            Face::Bottom => Self::NegY,
            Face::Top => Self::PosY,
            Face::Front => Self::NegZ,
            Face::Back => Self::PosZ,
        }
    }
}

impl FixedRegion {
    fn faces(&self) -> &[Face] {
        match self {
            Self::Nothing => &[],
            Self::Face(face) => std::slice::from_ref(face),
            Self::Faces(faces) => faces,
        }
    }
}

/// The simulated body, in the world's frame: made from [`DeformableBody`] and its partners, stepped at the
/// model rate. Read it to look inside.
#[derive(Component, Debug)]
pub struct SimulatedBody {
    pub(crate) body: Body,
    pub(crate) builder: LocalModelBuilder,
    pub(crate) epoch: u64,
    pub(crate) last_step: StepReport,
    /// The first build with these nodes, and these fixed.
    pub(crate) shape: u64,
    /// Why the last step failed, so that it is said once.
    pub(crate) failed: Option<std::mem::Discriminant<BodyError>>,
    /// Where the entity was when the body was built.
    place: GlobalTransform,
    picture: mesh::Picture,
}

impl SimulatedBody {
    /// The full body: network, surface, positions, velocities, forces.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Which build it is: every build of a body in an app has a higher number than those before.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// How every node moves with column `column` of the newest local model's basis; `None` where there is no such column. See
    /// [`LocalModelBuilder::basis_column`].
    #[must_use]
    pub fn basis_column(&self, column: usize) -> Option<Vec<DVec3>> {
        self.builder.basis_column(&self.body, column)
    }

    /// What the last model step did.
    #[must_use]
    pub fn last_step(&self) -> StepReport {
        self.last_step
    }
}

/// Builds the bodies and writes their meshes. Their steps are the tools' affair
/// ([`ToolPlugin`](crate::ToolPlugin)), because a body is moved along its tool's path.
#[derive(Clone, Copy, Debug, Default)]
pub struct BodyPlugin;

impl Plugin for BodyPlugin {
    fn build(&self, app: &mut App) {
        let cost = FrameCost::of(app);
        app.register_type::<DeformableBody>()
            .register_type::<Tissue>()
            .register_type::<FixedRegion>()
            .add_message::<HapticFault>()
            .add_systems(
                PreUpdate,
                (cost.timed(build_bodies), cost.timed(mesh::give_meshes))
                    .chain()
                    .in_set(HapticSetupSystems::Bodies),
            )
            .add_observer(remove_simulation)
            .add_systems(ModelStep, mesh::write_meshes.in_set(HapticSystems::Writeback));
    }
}

/// A body that is a body no longer is not simulated, and loses the mesh that it was given.
fn remove_simulation(
    removed: On<Remove, DeformableBody>,
    bodies: Query<(&SimulatedBody, Option<&Mesh3d>)>,
    mut commands: Commands,
) {
    let Ok((simulated, mesh)) = bodies.get(removed.entity) else { return };
    let mut entity = commands.entity(removed.entity);
    if mesh.is_some_and(|mesh| simulated.picture.is_shown_by(mesh)) {
        entity.try_remove::<Mesh3d>();
    }
    entity.try_remove::<SimulatedBody>();
}

/// What is made of new or changed components, in [`PreUpdate`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HapticSetupSystems {
    /// Builds bodies.
    Bodies,
    /// Starts and sets loops.
    Tools,
}

#[derive(QueryData)]
#[query_data(mutable)]
struct Asked {
    entity: Entity,
    shape: Ref<'static, DeformableBody>,
    tissue: Ref<'static, Tissue>,
    fixed: Ref<'static, FixedRegion>,
    transform: Ref<'static, Transform>,
    simulated: Option<&'static mut SimulatedBody>,
}

fn build_bodies(
    mut commands: Commands,
    mut bodies: Query<Asked>,
    transforms: TransformHelper,
    mut faults: MessageWriter<HapticFault>,
    mut builds: Local<u64>,
) {
    for mut asked in &mut bodies {
        let changed = asked.shape.is_changed() || asked.tissue.is_changed() || asked.fixed.is_changed();
        // What could not be built where it was may be built where it is now.
        if !(changed || asked.simulated.is_none() && asked.transform.is_changed()) {
            continue;
        }
        let entity = asked.entity;
        let place = match &asked.simulated {
            Some(old) => old.place,
            // The only error is a missing transform, which the body requires.
            None => transforms.compute_global_transform(entity).unwrap_or_default(),
        };
        *builds += 1;
        match simulate(&asked, &place, *builds) {
            Ok(new) => match asked.simulated.as_mut() {
                Some(old) => rebuild(old, new),
                None => {
                    commands.entity(entity).try_insert(new);
                }
            },
            Err(kind) => {
                faults.write(HapticFault { entity: Some(entity), kind });
            }
        }
    }
}

/// Puts `new` in the place of `old`: with its shape and motion if it has the same nodes, at rest if not.
fn rebuild(old: &mut SimulatedBody, mut new: SimulatedBody) {
    let same = old.body.network().rest_m() == new.body.network().rest_m()
        && old.body.network().free() == new.body.network().free();
    if same {
        // It fits, since the nodes are the same.
        let _ = new.body.set_state(old.body.positions_m(), old.body.velocities_m_per_s());
        new.shape = old.shape;
    }
    new.picture = std::mem::take(&mut old.picture);
    *old = new;
}

fn simulate(
    asked: &AskedItem,
    place: &GlobalTransform,
    epoch: u64,
) -> Result<SimulatedBody, HapticFaultKind> {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    if !(scale.is_finite() && rotation.is_finite() && translation.is_finite()) {
        return Err(HapticFaultKind::Place);
    }
    if (scale - Vec3::ONE).abs().max_element() > 1e-4 {
        return Err(HapticFaultKind::Scaled { scale });
    }
    let build = || -> Result<(Body, LocalModelBuilder), ReduceError> {
        let mut block = Block::new(asked.shape.nodes, asked.shape.size_m)?;
        for &face in asked.fixed.faces() {
            block = block.fix(face.into());
        }
        if asked.fixed.faces().is_empty() {
            block = block.allow_free();
        }
        let Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio } = *asked.tissue;
        let block = block
            .tissue(&palpate_body::Tissue { youngs_modulus_pa, density_kg_per_m3, damping_ratio })?
            .placed(rotation.as_dquat().normalize(), translation.as_dvec3())?;
        let body = Body::new(block.network, block.surface)?;
        // A body that cannot be stepped is refused here, not at its first step.
        palpate_body::SemiImplicitEuler::default().substeps(&body)?;
        let builder = LocalModelBuilder::new(&body, BuilderOptions::default())?;
        Ok((body, builder))
    };
    match build() {
        Ok((body, builder)) => Ok(SimulatedBody {
            body,
            builder,
            epoch,
            last_step: StepReport::default(),
            shape: epoch,
            failed: None,
            place: *place,
            picture: mesh::Picture::default(),
        }),
        Err(ReduceError::Body(error)) => Err(HapticFaultKind::BuildBody(error)),
        Err(error) => Err(HapticFaultKind::LocalModel(error)),
    }
}
