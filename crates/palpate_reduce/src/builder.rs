//! Builds local models of a body.

use crate::far_field::FarField;
use crate::near_field::{self, BuildInput, NearFieldBuilder, tick_integrator};
use crate::options::{BuilderOptions, MAX_ORDER, validate_horizon};
use crate::static_stiffness::StaticStiffness;
use crate::{ReduceError, krylov_linear, neighbourhood};
use glam::{DMat3, DVec3};
use palpate_body::{Body, BodyPoint, Tangent, TangentPattern, ToolContact, ToolPoint};
use palpate_local::{
    Capacity, Contact, LocalModel, ModelId, NearField, NearFieldCapacity, Scheme, TickIntegrator,
};
use std::time::Instant;

/// Properties of a local model that has been built, and the time it took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildReport {
    /// Scheme of the model.
    pub scheme: Scheme,
    /// Number of degrees of freedom that a tick integrates: those of S plus `order`.
    pub states: usize,
    /// Reduced order: the number of columns of the basis, or three times the nodes of a neighbourhood.
    pub order: usize,
    /// Number of nodes of the support set S.
    pub support_nodes: usize,
    /// Whether the clamped tangent was used because the exact one could not be factorised, for example in a buckling body. The far field
    /// is then stiffer than the body.
    pub tangent_clamped: bool,
    /// Whether S is too small: its maximum size left out nodes that the tool touches now, or touches within the horizon if it keeps its
    /// velocity. Nodes that it reaches only by accelerating do not count.
    pub support_truncated: bool,
    /// Integrator of the ticks; `None` for a model without support set.
    pub integrator: Option<TickIntegrator>,
    /// Bound of the relative error of the reduced dynamic stiffness at 80 Hz against a motion of S. Nonlinear motion of the far field adds to
    /// it. `None` for schemes other than [`Scheme::NearFieldExact`], and where there is no far field.
    pub error_bound: Option<f64>,
    /// Time that the build took, s.
    pub time_s: f64,
}

impl BuildReport {
    /// The report with the sizes of the near field `near`, or of a reduced system of order `order`.
    fn with_sizes(self, near: &NearField, order: usize) -> Self {
        let order = near.order.max(order);
        Self {
            states: 3 * near.nodes + order,
            order,
            support_nodes: near.nodes,
            support_truncated: near.is_cut,
            integrator: (near.nodes > 0).then_some(near.integrator),
            ..self
        }
    }
}

/// Builds local models of one body. The sparsity pattern of its tangent and the symbolic factorisations are computed once.
#[derive(Debug)]
pub struct LocalModelBuilder {
    options: BuilderOptions,
    pattern: TangentPattern,
    tangent: Tangent,
    static_stiffness: StaticStiffness,
    far_field: FarField,
    near_field: NearFieldBuilder,
    capacity: Capacity,
    neighbourhood: neighbourhood::Workspace,
}

impl LocalModelBuilder {
    /// A builder for `body`.
    ///
    /// # Errors
    /// [`ReduceError::Option`] for an option out of range, [`ReduceError::Symbolic`] when the tangent of the body is too large for a
    /// factorisation.
    pub fn new(body: &Body, options: BuilderOptions) -> Result<Self, ReduceError> {
        options.validate()?;
        let BuilderOptions { rings, regularisation_per_s, .. } = options;
        let (max_nodes, order_limit) = (options.max_nodes(), options.order_for(options.max_nodes()));
        let pattern = TangentPattern::new(body);
        let static_stiffness = StaticStiffness::new(&pattern, body, regularisation_per_s)?;
        let order_capacity = neighbourhood::Workspace::max_order(body, rings);
        if order_capacity > MAX_ORDER {
            let (what, allowed) = ("order of the largest neighbourhood", "at most 4096; reduce `rings`");
            return Err(ReduceError::Option { what, value: order_capacity as f64, allowed });
        }
        let far_field = FarField::new(body, &pattern)?;
        // A basis has at most as many columns as there are unknowns.
        let order = order_capacity.max(order_limit.min(3 * body.network().free().len()));
        let near = near_field::capacity(body, max_nodes, order_limit);
        Ok(Self {
            options,
            tangent: pattern.zero(),
            pattern,
            static_stiffness,
            far_field,
            near_field: NearFieldBuilder::new(body),
            capacity: Capacity { order, near, second: NearFieldCapacity::NONE },
            neighbourhood: neighbourhood::Workspace::new(body),
        })
    }

    /// Maximum sizes of the local models of this body: the capacity for [`LocalModel::empty`] and for the loop.
    #[must_use]
    pub fn capacity(&self) -> Capacity {
        self.capacity
    }

    /// Maximum sizes of the local models of this body and a second one: see [`BodyUnderTool::build_pair`].
    #[must_use]
    pub fn capacity_with(&self, second: &Self) -> Capacity {
        let order = self.capacity.order.max(second.capacity.order);
        Capacity { order, near: self.capacity.near, second: second.capacity.near }
    }

    /// Sets the horizon of the next local models, s: see [`BuilderOptions::horizon_s`].
    ///
    /// # Errors
    /// [`ReduceError::Option`] for a horizon outside 0.001 to 10; the previous horizon then stays.
    pub fn set_horizon_s(&mut self, horizon_s: f64) -> Result<(), ReduceError> {
        validate_horizon(horizon_s)?;
        self.options.horizon_s = horizon_s;
        Ok(())
    }

    /// The support set of the last local model of [`Scheme::NearFieldExact`], as node indices of the body; empty where the tool reaches
    /// nothing. Beyond these nodes the surface is static for the loop.
    #[must_use]
    pub fn support(&self) -> &[usize] {
        self.near_field.support()
    }

    /// Number of columns of the basis V of the last local model; 0 for schemes other than [`Scheme::NearFieldExact`] and
    /// [`Scheme::KrylovLinear`].
    #[must_use]
    pub fn basis_order(&self) -> usize {
        self.far_field.order()
    }

    /// Column `column` of the basis V of the last local model: a displacement of every node of `body`, without unit. It is zero for fixed
    /// nodes and those of the support set. `None` where `column` is not below [`LocalModelBuilder::basis_order`].
    #[must_use]
    pub fn basis_column(&self, body: &Body, column: usize) -> Option<Vec<DVec3>> {
        let network = body.network();
        let all = self.far_field.column(network, column)?;
        let of = |node| network.free_index(node).map(|i| DVec3::from_slice(&all[3 * i..3 * i + 3]));
        Some((0..network.node_count()).map(|node| of(node).unwrap_or_default()).collect())
    }

    /// Builds the local model of `scheme` at the current state of `body` into `model`, with `contact` and the tool at `tool`. Every field of
    /// `model` that the scheme uses is written.
    ///
    /// # Errors
    /// [`ReduceError::Body`] when `contact` belongs to another body, [`ReduceError::Singular`] when neither the exact nor the clamped tangent
    /// can be factorised, [`ReduceError::LocalModel`] when the capacity of `model` is too small. `model` then displays zero force.
    pub fn build(
        &mut self,
        scheme: Scheme,
        body: &Body,
        contact: &ToolContact,
        tool: ToolPoint,
        id: ModelId,
        model: &mut LocalModel,
    ) -> Result<BuildReport, ReduceError> {
        self.build_with_other_tools(scheme, body, (contact, tool), &[], id, model)
    }

    /// As [`LocalModelBuilder::build`], with other tools on the body. The forces of the `others` in the last step of the body are constant
    /// until the next local model, except in [`Scheme::NearFieldExact`] that of the nearest one with an identity
    /// ([`ToolContact::with_identity`]): it follows the samples ([`palpate_local::Sample::other`]). [`Scheme::Neighbourhood`] ignores the
    /// others, as in the seed paper.
    ///
    /// # Errors
    /// As [`LocalModelBuilder::build`], of every contact.
    pub fn build_with_other_tools(
        &mut self,
        scheme: Scheme,
        body: &Body,
        (contact, tool): (&ToolContact, ToolPoint),
        others: &[&ToolContact],
        id: ModelId,
        model: &mut LocalModel,
    ) -> Result<BuildReport, ReduceError> {
        #[expect(clippy::disallowed_methods, reason = "the duration is reported only")]
        let now = || Instant::now();
        let start = now();
        let written = self.write(scheme, body, (contact, tool), others, id, model);
        let error_bound = written.inspect_err(|_| model.reduced.order = 0)?;
        let of =
            BuildReport { scheme, tangent_clamped: model.clamped, error_bound, ..BuildReport::default() };
        let time_s = (now() - start).as_secs_f64();
        Ok(BuildReport { time_s, ..of.with_sizes(&model.near, model.reduced.order) })
    }

    /// Writes `model` as [`LocalModelBuilder::build_with_other_tools`] does, and returns the bound of its error where there is one.
    fn write(
        &mut self,
        scheme: Scheme,
        body: &Body,
        (contact, tool): (&ToolContact, ToolPoint),
        others: &[&ToolContact],
        id: ModelId,
        model: &mut LocalModel,
    ) -> Result<Option<f64>, ReduceError> {
        model.id = id;
        model.scheme = scheme;
        model.position_m = tool.position_m;
        model.velocity_m_per_s = tool.velocity_m_per_s;
        model.force_n = DVec3::ZERO;
        model.stiffness_n_per_m = DMat3::ZERO;
        model.damping_ns_per_m = DMat3::ZERO;
        model.clamped = false;
        model.reduced.order = 0;
        model.near.clear();
        model.second.clear();
        model.contact = Contact::Apart;
        self.far_field.set_basis(None);
        contact.validate(body)?;
        others.iter().try_for_each(|other| other.validate(body))?;
        let mut error_bound = None;
        if scheme == Scheme::NearFieldExact {
            model.force_n = contact.displayed_force_n(body);
            let input = (body, id.body, contact, tool, others);
            (error_bound, model.clamped) = self.write_near_field(input, None, &mut model.near)?;
        }
        let points = contact.points();
        let Some(node) = max_weight_node(&points, body) else {
            return Ok(error_bound);
        };
        // Without friction the surface follows the tool along the contact normals only.
        let normals: Vec<DVec3> = contact.touched().iter().map(|t| t.normal).collect();
        let normals = contact.shape().filter(|(_, friction)| *friction == 0.0).map(|_| &normals[..]);
        model.force_n = contact.displayed_force_n(body);
        match scheme {
            Scheme::Hold | Scheme::LowPass => {}
            Scheme::Tangent => self.with_tangent(body, |this, is_clamped| {
                model.clamped = is_clamped;
                let touched = (normals, contact.touched());
                model.stiffness_n_per_m =
                    this.static_stiffness.at(&mut this.tangent, body, &points, touched)?;
                Ok(())
            })?,
            Scheme::Neighbourhood => self.with_tangent(body, |this, is_clamped| {
                model.clamped = is_clamped;
                let BuilderOptions { tick_s, rings, .. } = this.options;
                this.neighbourhood.build(body, &this.tangent, node, rings, tick_s, model)
            })?,
            Scheme::KrylovLinear => self.with_tangent(body, |this, is_clamped| {
                model.clamped = is_clamped;
                let (far_field, tangent, options) = (&mut this.far_field, &this.tangent, &this.options);
                krylov_linear::build(far_field, (body, others), tangent, node, options, model)
            })?,
            Scheme::NearFieldExact => {}
        }
        model.contact = contact.normal().map_or(Contact::Held, |normal| Contact::Touching { normal });
        Ok(error_bound)
    }

    /// Writes the near field of a body with `contact`, with the exact tangent, or with the clamped one if the exact one cannot be
    /// factorised. Returns the bound of its error where there is one, and whether the tangent is clamped.
    fn write_near_field(
        &mut self,
        (body, identity, contact, tool, others): (&Body, u64, &ToolContact, ToolPoint, &[&ToolContact]),
        integrator: Option<TickIntegrator>,
        near: &mut NearField,
    ) -> Result<(Option<f64>, bool), ReduceError> {
        let built = self.with_tangent(body, |this, is_clamped| {
            let (tangent, options) = (&this.tangent, &this.options);
            let input = BuildInput {
                body,
                tangent,
                is_clamped,
                contact,
                tool,
                others,
                identity,
                options,
                integrator,
            };
            Ok((this.near_field.build(&mut this.far_field, &input, near)?, is_clamped))
        });
        built.inspect_err(|_| near.clear())
    }

    /// Runs `build` with the exact tangent, and with the clamped one if the exact one cannot be factorised. `build` gets whether it is
    /// clamped.
    fn with_tangent<T>(
        &mut self,
        body: &Body,
        mut build: impl FnMut(&mut Self, bool) -> Result<T, ReduceError>,
    ) -> Result<T, ReduceError> {
        let mut is_clamped = false;
        loop {
            self.pattern.fill(body, is_clamped, &mut self.tangent);
            match build(self, is_clamped) {
                Err(error) if is_indefinite(&error) && !is_clamped => is_clamped = true,
                result => return result,
            }
        }
    }
}

/// A body under a tool that touches two bodies.
#[derive(Debug)]
pub struct BodyUnderTool<'a> {
    /// Builder of the body.
    pub builder: &'a mut LocalModelBuilder,
    /// The body.
    pub body: &'a Body,
    /// Contact of the tool with the body.
    pub contact: &'a ToolContact,
    /// The other tools on the body: see [`LocalModelBuilder::build_with_other_tools`].
    pub others: &'a [&'a ToolContact],
    /// Identity and epoch of the body: see [`ModelId`].
    pub identity: (u64, u64),
}

impl BodyUnderTool<'_> {
    /// Builds the local model of [`Scheme::NearFieldExact`] of two bodies under one tool into `model`, at their current states with the tool
    /// at `tool`, for the sample `sequence`. The model has the capacity of [`LocalModelBuilder::capacity_with`]. Returns the reports of both
    /// bodies.
    ///
    /// # Errors
    /// As [`LocalModelBuilder::build`], with the index of the body. `model` then displays zero force.
    pub fn build_pair(
        first: Self,
        second: Self,
        tool: ToolPoint,
        sequence: u64,
        model: &mut LocalModel,
    ) -> Result<[BuildReport; 2], (usize, ReduceError)> {
        model.clear(sequence);
        (model.scheme, model.clamped) = (Scheme::NearFieldExact, false);
        let written = Self::write_pair([first, second], tool, sequence, model);
        written.inspect_err(|_| model.clear(sequence))
    }

    fn write_pair(
        pair: [Self; 2],
        tool: ToolPoint,
        sequence: u64,
        model: &mut LocalModel,
    ) -> Result<[BuildReport; 2], (usize, ReduceError)> {
        #[expect(clippy::disallowed_methods, reason = "the duration is reported only")]
        let now = || Instant::now();
        for (index, Self { body, contact, others, .. }) in pair.iter().enumerate() {
            let all = std::iter::once(contact).chain(*others);
            all.copied().try_for_each(|other| other.validate(body)).map_err(|error| (index, error.into()))?;
        }
        model.force_n = ToolContact::shared_force_n(pair.iter().map(|of| (of.contact, of.body)));
        (model.position_m, model.velocity_m_per_s) = (tool.position_m, tool.velocity_m_per_s);
        let normal = pair.iter().find_map(|of| of.contact.normal());
        model.contact = normal.map_or(Contact::Apart, |normal| Contact::Touching { normal });
        // All fields of a tick have the same substeps, as the bodies in the full step.
        let integrators = pair.each_ref().map(|of| tick_integrator::select(of.body, &of.builder.options));
        let [a, b] = integrators.map(TickIntegrator::substeps);
        let mut reports = [BuildReport::default(); 2];
        for (index, (of, integrator)) in pair.into_iter().zip(integrators).enumerate() {
            let start = now();
            let Self { builder, body, contact, others, identity } = of;
            let near = if index == 0 {
                model.id = ModelId { body: identity.0, epoch: identity.1, sequence };
                &mut model.near
            } else {
                (model.second.body, model.second.epoch) = identity;
                &mut model.second.near
            };
            builder.far_field.set_basis(None);
            let integrator = Some(tick_integrator::with_substeps(integrator, a.max(b)));
            let (error_bound, tangent_clamped) = builder
                .write_near_field((body, identity.0, contact, tool, others), integrator, near)
                .map_err(|error| (index, error))?;
            model.clamped |= tangent_clamped;
            let scheme = Scheme::NearFieldExact;
            let report = BuildReport { scheme, tangent_clamped, error_bound, ..BuildReport::default() };
            let time_s = (now() - start).as_secs_f64();
            if let Some(to) = reports.get_mut(index) {
                *to = BuildReport { time_s, ..report.with_sizes(near, 0) };
            }
        }
        Ok(reports)
    }
}

/// The free node of maximum weight in `points`: the driven node of the linear schemes.
pub(crate) fn max_weight_node(points: &[BodyPoint], body: &Body) -> Option<usize> {
    let nodes = points.iter().flat_map(BodyPoint::nodes).filter(|(node, _)| !body.network().is_fixed(*node));
    nodes.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map(|(node, _)| *node)
}

fn is_indefinite(error: &ReduceError) -> bool {
    use palpate_local::LocalModelError::Pivot;
    matches!(error, ReduceError::Singular { .. } | ReduceError::LocalModel(Pivot { .. }))
}
