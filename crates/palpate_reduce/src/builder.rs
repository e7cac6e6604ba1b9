//! From the state of a body to a local model.

use crate::static_stiffness::StaticStiffness;
use crate::{ReduceError, neighbourhood};
use glam::{DMat3, DVec3};
use palpate_body::{Body, BodyPoint, Tangent, TangentPattern, ToolContact, ToolPoint};
use palpate_local::{Contact, LocalModel, ModelId, Scheme};

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
}

impl Default for BuilderOptions {
    /// 1 ms, one ring, 2π · 0.01 s⁻¹.
    fn default() -> Self {
        Self { tick_s: 1e-3, rings: 1, regularisation_per_s: 0.01 * std::f64::consts::TAU }
    }
}

/// The largest reduced order that a loop has room for.
const LARGEST_ORDER: usize = 4096;

/// Builds local models of one body. The pattern of its tangent and the symbolic factorisation are made once.
#[derive(Debug)]
pub struct LocalModelBuilder {
    options: BuilderOptions,
    pattern: TangentPattern,
    tangent: Tangent,
    static_stiffness: StaticStiffness,
    order_capacity: usize,
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
        let BuilderOptions { tick_s, rings, regularisation_per_s } = options;
        for (what, value, ok, allowed) in [
            ("tick, s", tick_s, tick_s.is_finite() && tick_s > 0.0, "finite and above 0"),
            ("rings of nodes", rings as f64, (1..=8).contains(&rings), "1 to 8"),
            (
                "regularisation, 1/s",
                regularisation_per_s,
                regularisation_per_s.is_finite() && regularisation_per_s >= 0.0,
                "finite and at least 0",
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
        Ok(Self {
            options,
            tangent: pattern.zero(),
            pattern,
            static_stiffness,
            order_capacity,
            neighbourhood: neighbourhood::Workspace::new(body),
        })
    }

    /// The largest reduced order that [`LocalModelBuilder::build`] can give a model of this body, so the room
    /// that [`LocalModel::silent`] and the loop need.
    #[must_use]
    pub fn order_capacity(&self) -> usize {
        self.order_capacity
    }

    /// Builds into `model` the local model of `scheme` at the present state of `body`, with `contact` and the
    /// tool at `tool`. Every field of `model` that its scheme uses is written.
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
    ) -> Result<(), ReduceError> {
        model.id = id;
        model.scheme = scheme;
        model.position_m = tool.position_m;
        model.velocity_m_per_s = tool.velocity_m_per_s;
        model.force_n = DVec3::ZERO;
        model.stiffness_n_per_m = DMat3::ZERO;
        model.damping_ns_per_m = DMat3::ZERO;
        model.clamped = false;
        model.reduced.order = 0;
        model.contact = Contact::Apart;
        contact.validate(body)?;
        let points = contact.points();
        let Some(node) = heaviest(&points, body) else {
            return Ok(());
        };
        // Without friction the surface follows the tool along its normals only.
        let normals: Vec<DVec3> = contact.touched().iter().map(|t| t.normal).collect();
        let normals = contact.shape().filter(|(_, friction)| *friction == 0.0).map(|_| &normals[..]);
        model.force_n = contact.displayed_force_n(body);
        match scheme {
            Scheme::Hold | Scheme::LowPass => {}
            Scheme::Tangent => self.exact_or_clamped(body, model, |this, model| {
                model.stiffness_n_per_m =
                    this.static_stiffness.at(&mut this.tangent, body, &points, normals)?;
                Ok(())
            })?,
            Scheme::Neighbourhood => self.exact_or_clamped(body, model, |this, model| {
                let BuilderOptions { tick_s, rings, .. } = this.options;
                this.neighbourhood.build(body, &this.tangent, node, rings, tick_s, model)
            })?,
        }
        model.contact = contact.normal().map_or(Contact::Held, |normal| Contact::Touching { normal });
        Ok(())
    }

    /// Runs `build` with the exact tangent, and if that cannot be factorised with the clamped one.
    fn exact_or_clamped(
        &mut self,
        body: &Body,
        model: &mut LocalModel,
        build: impl Fn(&mut Self, &mut LocalModel) -> Result<(), ReduceError>,
    ) -> Result<(), ReduceError> {
        for clamped in [false, true] {
            self.pattern.fill(body, clamped, &mut self.tangent);
            model.clamped = clamped;
            match build(self, model) {
                Err(error) if is_indefinite(&error) && !clamped => {}
                result => return result.inspect_err(|_| model.reduced.order = 0),
            }
        }
        Ok(())
    }
}

/// The free node with the greatest weight: the one that the seed paper's method takes for the tool's.
fn heaviest(points: &[BodyPoint], body: &Body) -> Option<usize> {
    let nodes = points.iter().flat_map(BodyPoint::nodes).filter(|(node, _)| !body.network().is_fixed(*node));
    nodes.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map(|(node, _)| *node)
}

fn is_indefinite(error: &ReduceError) -> bool {
    use palpate_local::LocalModelError::Pivot;
    matches!(error, ReduceError::Singular { .. } | ReduceError::LocalModel(Pivot { .. }))
}
