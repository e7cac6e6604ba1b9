//! From the state of a body to a local model.

use crate::near_field::{self, LocalIntegrator, Moment};
use crate::static_stiffness::StaticStiffness;
use crate::{ReduceError, neighbourhood};
use glam::{DMat3, DVec3};
use palpate_body::{Body, BodyPoint, Tangent, TangentPattern, ToolContact, ToolPoint};
use palpate_local::{Capacity, Contact, LocalModel, ModelId, Scheme, TickIntegrator};
use std::time::Instant;

/// What a builder is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuilderOptions {
    /// Length of the loop's tick, the step of the local model's implicit Euler, s.
    pub tick_s: f64,
    /// Rings of nodes round the tool that `Neighbourhood` lets move.
    pub rings: usize,
    /// σ₀, 1/s: K is regularised by σ₀² M, which a network with null directions (a plane lattice in space)
    /// needs.
    pub regularisation_per_s: f64,
    /// Real frequencies at which `KrylovLinear` and `NearFieldExact` match the body's response, Hz.
    pub shifts_hz: [Option<f64>; 4],
    /// Columns of the basis are left out when what they add is less than that share of their length.
    pub basis_tolerance: f64,
    /// Most columns of the basis.
    pub order_limit: usize,
    /// Most nodes of the support set of `NearFieldExact`.
    pub support_nodes: usize,
    /// How long a local model may have to speak, s: the support set holds what the tool can reach until then.
    pub horizon_s: f64,
    /// How the ticks of `NearFieldExact` are integrated.
    pub integrator: LocalIntegrator,
}

impl Default for BuilderOptions {
    /// 1 ms, one ring, 2π · 0.01 s⁻¹, one shift at 20 Hz, tolerance 1e-9, order 48, 9 nodes, 0.1 s, the integrator chosen by
    /// its cost.
    fn default() -> Self {
        Self {
            tick_s: 1e-3,
            rings: 1,
            regularisation_per_s: 0.01 * std::f64::consts::TAU,
            shifts_hz: [Some(20.0), None, None, None],
            basis_tolerance: 1e-9,
            order_limit: 48,
            support_nodes: 9,
            horizon_s: 0.1,
            integrator: LocalIntegrator::Auto,
        }
    }
}

impl BuilderOptions {
    /// The defaults for `body`: where cells carry its surface a point of it has eight nodes, so that a support set needs 27, those
    /// of eight cells, and a basis order 96.
    #[must_use]
    pub fn of(body: &Body) -> Self {
        let is_embedded = body.surface().points.iter().any(|point| point.nodes().len() > 1);
        if is_embedded {
            Self { support_nodes: 27, order_limit: 96, ..Self::default() }
        } else {
            Self::default()
        }
    }
}

/// What a local model is that has been built, and what that took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildReport {
    /// Its scheme.
    pub scheme: Scheme,
    /// Degrees of freedom that it steps at a tick: those of S and the columns of its basis.
    pub states: usize,
    /// Columns of its basis.
    pub order: usize,
    /// Nodes of S.
    pub support_nodes: usize,
    /// Whether the body's tangent could not be factorised, because the body buckles for instance, and the clamped one took its
    /// place: the far field is stiffer than the body.
    pub tangent_clamped: bool,
    /// Whether nodes that the tool may reach before the next hand-over had to be left out of S.
    pub support_truncated: bool,
    /// How its ticks are integrated; `None` for a scheme that steps no near field.
    pub integrator: Option<TickIntegrator>,
    /// A bound of the relative error of the reduced stiffness against a motion of S at 80 Hz; `None` for other schemes than
    /// [`Scheme::NearFieldExact`]. What the body does that is not linear about its present state comes on top.
    pub error_bound: Option<f64>,
    /// How long it took to build, s.
    pub time_s: f64,
}

/// The largest reduced order that a loop has room for.
const LARGEST_ORDER: usize = 4096;
/// The largest support set.
const LARGEST_SUPPORT: usize = 32;

/// Builds local models of one body. The pattern of its tangent and the symbolic factorisation are made once.
#[derive(Debug)]
pub struct LocalModelBuilder {
    options: BuilderOptions,
    pattern: TangentPattern,
    tangent: Tangent,
    static_stiffness: StaticStiffness,
    near_field: near_field::Workspace,
    capacity: Capacity,
    /// Reused by `neighbourhood`.
    neighbourhood: neighbourhood::Workspace,
}

impl LocalModelBuilder {
    /// A builder for `body`.
    ///
    /// # Errors
    /// [`ReduceError::Option`] for an option that makes no sense, [`ReduceError::Symbolic`] when the body is
    /// too large to be factorised.
    pub fn new(body: &Body, options: BuilderOptions) -> Result<Self, ReduceError> {
        let BuilderOptions { tick_s, rings, regularisation_per_s, .. } = options;
        let shift = options.shifts_hz.into_iter().flatten().find(|hz| !(hz.is_finite() && *hz > 0.0));
        let BuilderOptions { basis_tolerance, order_limit, support_nodes, horizon_s, .. } = options;
        let substeps = match options.integrator {
            LocalIntegrator::Implicit { substeps } => substeps,
            LocalIntegrator::Auto | LocalIntegrator::Explicit => 1,
        };
        check_horizon(horizon_s)?;
        for (what, value, ok, allowed) in [
            ("tick, s", tick_s, tick_s.is_finite() && tick_s > 0.0, "finite and above 0"),
            ("rings of nodes", rings as f64, (1..=8).contains(&rings), "1 to 8"),
            (
                "regularisation, 1/s",
                regularisation_per_s,
                regularisation_per_s.is_finite() && regularisation_per_s >= 0.0,
                "finite and at least 0",
            ),
            ("steps in a tick", f64::from(substeps), (1..=64).contains(&substeps), "1 to 64"),
            ("shift, Hz", shift.unwrap_or(1.0), shift.is_none(), "finite and above 0"),
            (
                "tolerance of the basis",
                basis_tolerance,
                basis_tolerance > 0.0 && basis_tolerance < 1.0,
                "above 0 and below 1",
            ),
            ("order limit", order_limit as f64, (1..=LARGEST_ORDER).contains(&order_limit), "1 to 4096"),
            (
                "nodes of the support set",
                support_nodes as f64,
                (3..=LARGEST_SUPPORT).contains(&support_nodes),
                "3 to 32",
            ),
        ] {
            if !ok {
                return Err(ReduceError::Option { what, value, allowed });
            }
        }
        let pattern = TangentPattern::new(body);
        let static_stiffness = StaticStiffness::new(&pattern, body, regularisation_per_s)?;
        let order_capacity = neighbourhood::Workspace::largest_order(body, rings);
        if order_capacity > LARGEST_ORDER {
            let (what, allowed) = ("order of the largest neighbourhood", "at most 4096: take fewer rings");
            return Err(ReduceError::Option { what, value: order_capacity as f64, allowed });
        }
        let near_field = near_field::Workspace::new(body, &pattern)?;
        // A basis has no more columns than there are unknowns, and S is surrounded by at most its neighbours.
        let order = order_capacity.max(order_limit.min(3 * body.network().free().len()));
        let near = near_field::capacity(body, support_nodes, order_limit);
        Ok(Self {
            options,
            tangent: pattern.zero(),
            pattern,
            static_stiffness,
            near_field,
            capacity: Capacity { order, near },
            neighbourhood: neighbourhood::Workspace::new(body),
        })
    }

    /// The largest local model that [`LocalModelBuilder::build`] can make of this body, so the room that
    /// [`LocalModel::silent`] and the loop need.
    #[must_use]
    pub fn capacity(&self) -> Capacity {
        self.capacity
    }

    /// How long the next local models may have to speak, s ([`BuilderOptions::horizon_s`]).
    ///
    /// # Errors
    /// [`ReduceError::Option`] unless 0.001 to 10; the old one stays then.
    pub fn set_horizon_s(&mut self, horizon_s: f64) -> Result<(), ReduceError> {
        check_horizon(horizon_s)?;
        self.options.horizon_s = horizon_s;
        Ok(())
    }

    /// The support set of the last local model of [`Scheme::NearFieldExact`], as the body numbers its nodes; empty where there
    /// was nothing within reach. Where a tool has touched other nodes since, the surface stood still for the loop.
    #[must_use]
    pub fn support(&self) -> &[usize] {
        self.near_field.support()
    }

    /// Columns of the basis V of the last local model; 0 where it has none, as with other schemes than
    /// [`Scheme::NearFieldExact`] and [`Scheme::KrylovLinear`].
    #[must_use]
    pub fn basis_order(&self) -> usize {
        self.near_field.basis_order()
    }

    /// Column `column` of that basis: how every node of `body` moves with it, in no unit; zero for fixed nodes and those of the
    /// support set. `None` where there is no such column.
    #[must_use]
    pub fn basis_column(&self, body: &Body, column: usize) -> Option<Vec<DVec3>> {
        let network = body.network();
        let all = self.near_field.basis_column(network, column)?;
        let of = |node| network.free_index(node).map(|i| DVec3::from_slice(&all[3 * i..3 * i + 3]));
        Some((0..network.node_count()).map(|node| of(node).unwrap_or_default()).collect())
    }

    /// Builds into `model` the local model of `scheme` at the present state of `body`, with `contact` and the
    /// tool at `tool`. Every field of `model` that its scheme uses is written. Returns what it is.
    ///
    /// # Errors
    /// [`ReduceError::Body`] when `contact` belongs to another body, [`ReduceError::Singular`] when the tangent cannot be factorised even when clamped,
    /// [`ReduceError::LocalModel`] when `model` has too little room. `model` is silent then.
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

    /// As [`LocalModelBuilder::build`], for a tool that is not alone: what the `others` did to the body in its last step is
    /// held constant until the next local model. [`Scheme::Neighbourhood`] knows of no others, as in the seed paper.
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
        #[expect(clippy::disallowed_methods, reason = "how long it takes is reported, and decides nothing")]
        let now = || Instant::now();
        let began = now();
        let error_bound = self.write(scheme, body, (contact, tool), others, id, model)?;
        let LocalModel { near, reduced, .. } = &*model;
        let (is_near, order) = (near.nodes > 0, near.order.max(reduced.order));
        Ok(BuildReport {
            scheme,
            states: 3 * near.nodes + order,
            order,
            support_nodes: near.nodes,
            tangent_clamped: model.clamped,
            support_truncated: near.is_cut,
            integrator: is_near.then_some(near.integrator),
            error_bound,
            time_s: (now() - began).as_secs_f64(),
        })
    }

    /// As [`LocalModelBuilder::build`]; a bound of the error, as far as there is one.
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
        model.contact = Contact::Apart;
        self.near_field.forget_basis();
        contact.validate(body)?;
        others.iter().try_for_each(|other| other.validate(body))?;
        let mut error_bound = None;
        if scheme == Scheme::NearFieldExact {
            model.force_n = contact.displayed_force_n(body);
            error_bound = self.exact_or_clamped(body, model, |this, model| {
                let LocalModel { near, clamped, .. } = model;
                let (tangent, options) = (&this.tangent, &this.options);
                let moment = Moment { body, tangent, is_clamped: *clamped, contact, tool, others, options };
                this.near_field.build(&moment, near)
            })?;
        }
        let points = contact.points();
        let Some(node) = heaviest(&points, body) else {
            return Ok(error_bound);
        };
        // Without friction the surface follows the tool along its normals only.
        let normals: Vec<DVec3> = contact.touched().iter().map(|t| t.normal).collect();
        let normals = contact.shape().filter(|(_, friction)| *friction == 0.0).map(|_| &normals[..]);
        model.force_n = contact.displayed_force_n(body);
        match scheme {
            Scheme::Hold | Scheme::LowPass => {}
            Scheme::Tangent => self.exact_or_clamped(body, model, |this, model| {
                model.stiffness_n_per_m = this.static_stiffness.at(
                    &mut this.tangent,
                    body,
                    &points,
                    (normals, contact.touched()),
                )?;
                Ok(())
            })?,
            Scheme::Neighbourhood => self.exact_or_clamped(body, model, |this, model| {
                let BuilderOptions { tick_s, rings, .. } = this.options;
                this.neighbourhood.build(body, &this.tangent, node, rings, tick_s, model)
            })?,
            Scheme::KrylovLinear => self.exact_or_clamped(body, model, |this, model| {
                this.near_field.build_linear((body, others), &this.tangent, node, &this.options, model)
            })?,
            Scheme::NearFieldExact => {}
        }
        model.contact = contact.normal().map_or(Contact::Held, |normal| Contact::Touching { normal });
        Ok(error_bound)
    }

    /// Runs `build` with the exact tangent, and if that cannot be factorised with the clamped one.
    fn exact_or_clamped<T>(
        &mut self,
        body: &Body,
        model: &mut LocalModel,
        build: impl Fn(&mut Self, &mut LocalModel) -> Result<T, ReduceError>,
    ) -> Result<T, ReduceError> {
        let mut clamped = false;
        loop {
            self.pattern.fill(body, clamped, &mut self.tangent);
            model.clamped = clamped;
            match build(self, model) {
                Err(error) if is_indefinite(&error) && !clamped => clamped = true,
                result => {
                    return result.inspect_err(|_| {
                        model.reduced.order = 0;
                        model.near.clear();
                    });
                }
            }
        }
    }
}

fn check_horizon(horizon_s: f64) -> Result<(), ReduceError> {
    let (what, allowed) = ("horizon of a local model, s", "0.001 to 10");
    let ok = (1e-3..=10.0).contains(&horizon_s);
    if ok { Ok(()) } else { Err(ReduceError::Option { what, value: horizon_s, allowed }) }
}

/// The free node with the greatest weight: the one that the seed paper's method takes for the tool's.
pub(crate) fn heaviest(points: &[BodyPoint], body: &Body) -> Option<usize> {
    let nodes = points.iter().flat_map(BodyPoint::nodes).filter(|(node, _)| !body.network().is_fixed(*node));
    nodes.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map(|(node, _)| *node)
}

fn is_indefinite(error: &ReduceError) -> bool {
    use palpate_local::LocalModelError::Pivot;
    matches!(error, ReduceError::Singular { .. } | ReduceError::LocalModel(Pivot { .. }))
}
