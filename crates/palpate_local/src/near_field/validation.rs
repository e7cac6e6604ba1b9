//! Validation of a near field before a tick uses it.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::{MAX_SUBSTEPS, NearEnd, NearField, NearPoint, Support};
use crate::LocalModelError;
use glam::DVec3;
use palpate_laws::{HexahedronShape, MAX_PATCHES};

/// Minimum radius of a tool, m.
const MIN_RADIUS_M: f64 = 1e-6;

impl NearField {
    /// Checks sizes and indices, and that every number in use is finite.
    ///
    /// # Errors
    /// [`LocalModelError::Capacity`], [`LocalModelError::Size`], [`LocalModelError::NotFinite`], [`LocalModelError::Index`],
    /// [`LocalModelError::Setting`].
    pub fn validate(&self) -> Result<(), LocalModelError> {
        // Checked first: the products below then cannot overflow.
        self.fits(self.capacity())?;
        if self.is_empty() {
            return Ok(());
        }
        for (what, values, needed) in self.parts() {
            match values.get(..needed) {
                None => {
                    let (found, order) = (values.len(), self.order);
                    return Err(LocalModelError::Size { what, found, needed, order });
                }
                Some(used) if !used.iter().all(|v| v.is_finite()) => {
                    return Err(LocalModelError::NotFinite { what });
                }
                Some(_) => {}
            }
        }
        let finite = |places: &[DVec3]| places.iter().all(|x| x.is_finite());
        let end_is_finite = |end: &NearEnd| !matches!(end, NearEnd::Fixed(x) if !x.is_finite());
        let springs = self.near.get(..self.springs).unwrap_or_default();
        let tetrahedra = self.tetrahedron.get(..self.tetrahedra).unwrap_or_default();
        let hexahedra = self.hexahedron.get(..self.hexahedra).unwrap_or_default();
        let domains = self.domain.get(..self.domains).unwrap_or_default();
        let domain_nodes = self.domain_node.get(..self.domain_nodes()).unwrap_or_default();
        let domain_gradients = self.domain_gradient_per_m.get(..domain_nodes.len()).unwrap_or_default();
        let shapes = self.shape.get(..self.shapes).unwrap_or_default();
        let points = self.point.get(..self.points).unwrap_or_default();
        let triangles = self.triangle.get(..self.triangles).unwrap_or_default();
        for (what, ok) in [
            ("positions of S", self.node_m.get(..self.nodes).is_some_and(finite)),
            ("positions of the ring", self.ring_m.get(..self.ring).is_some_and(finite)),
            ("ends of near springs", springs.iter().all(|spring| end_is_finite(&spring.b))),
            (
                "materials of near hexahedra",
                hexahedra
                    .iter()
                    .all(|of| of.material.is_finite() && of.relaxed.iter().flatten().all(|h| h.is_finite())),
            ),
            (
                "materials of near domains",
                domains
                    .iter()
                    .all(|of| of.material.is_finite() && of.relaxed.iter().flatten().all(|h| h.is_finite())),
            ),
            ("gradients of near domains", finite(domain_gradients)),
            ("shapes of near hexahedra", shapes.iter().all(HexahedronShape::is_finite)),
            (
                "weights of the surface",
                points.iter().all(|point| {
                    point.nodes.iter().all(|(_, w)| w.is_finite())
                        && point.fixed_m.is_finite()
                        && point.modulus_pa.is_finite()
                }),
            ),
            ("normals of triangles", triangles.iter().all(|triangle| triangle.rest_normal.is_finite())),
            ("contact", self.contact.is_finite()),
            ("tick", self.tick_s.is_finite() && self.tick_s > 0.0),
            ("start of the tool", self.start_m.is_finite() && self.proxy_m.is_finite()),
            ("coupling of the tool", self.coupling.is_none_or(|coupling| coupling.validate().is_ok())),
            ("energy", self.energy_j.is_finite()),
            ("force of another tool", self.other.force_n.is_finite()),
            ("factor", !self.integrator.is_implicit() || self.factor.is_finite()),
        ] {
            if !ok {
                return Err(LocalModelError::NotFinite { what });
            }
        }
        let in_range = |end: &NearEnd| match *end {
            NearEnd::Support(node) => node < self.nodes,
            NearEnd::Ring(node) => node < self.ring,
            NearEnd::Fixed(_) => true,
        };
        for (what, ok) in [
            ("a near spring", springs.iter().all(|spring| spring.a < self.nodes && in_range(&spring.b))),
            (
                "a near tetrahedron",
                tetrahedra
                    .iter()
                    .flat_map(|tetrahedron| tetrahedron.nodes)
                    .all(|node| node < self.nodes + self.ring),
            ),
            (
                "a near hexahedron",
                hexahedra.iter().all(|of| {
                    of.shape < self.shapes
                        && of.nodes.iter().all(|node| usize::from(*node) < self.nodes + self.ring)
                }),
            ),
            (
                "a near domain",
                domain_gradients.len() == self.domain_nodes()
                    && domains.iter().all(|of| of.part(domain_nodes).len() == of.entries.1)
                    && domain_nodes.iter().all(|node| usize::from(*node) < self.nodes + self.ring),
            ),
            (
                "a point of the surface",
                points.iter().flat_map(NearPoint::carriers).all(|(node, _)| node < self.nodes + self.ring),
            ),
            (
                "a triangle",
                triangles.iter().flat_map(|triangle| triangle.points).all(|point| point < self.points),
            ),
            (
                "a neighbour of a triangle",
                triangles
                    .iter()
                    .flat_map(|triangle| triangle.neighbours)
                    .all(|n| n.triangle.is_none_or(|triangle| (triangle as usize) < self.triangles)),
            ),
            (
                "a patch",
                self.contact.count <= MAX_PATCHES
                    && self.contact.patches().iter().all(|p| p.patch.foot.triangle < self.triangles),
            ),
        ] {
            if !ok {
                return Err(LocalModelError::Index { what });
            }
        }
        let (found, needed) = (self.factor.order(), self.unknowns());
        if self.integrator.is_implicit() && found != needed {
            let (what, order) = ("implicit factor", self.order);
            return Err(LocalModelError::Size { what, found: found * found, needed: needed * needed, order });
        }
        let substeps = self.integrator.substeps();
        if !(1..=MAX_SUBSTEPS).contains(&substeps) {
            return Err(LocalModelError::Setting {
                what: "substeps of a local tick",
                value: f64::from(substeps),
                allowed: "1 to 64",
            });
        }
        let mass = self.node_per_kg.iter().take(self.nodes);
        let min_per_kg = mass.clone().fold(f64::INFINITY, |a, b| a.min(*b));
        let free = self.weight.iter().zip(mass).filter(|(_, per_kg)| **per_kg > 0.0);
        let squares: f64 = free.map(|(w, _)| w * w).sum();
        let (value, allowed, what, ok) = match self.support {
            _ if min_per_kg < 0.0 => (min_per_kg, "at least 0", "inverse mass, 1/kg", false),
            Support::Driven => (self.nodes as f64, "1", "number of driven nodes", self.nodes == 1),
            Support::Held => {
                let ok = squares.is_finite() && squares > 0.0;
                (squares, "finite and above 0", "sum of squared weights of the held point", ok)
            }
            Support::Touched { shape, .. }
                if shape.validate().is_err() || shape.radius_m() < MIN_RADIUS_M =>
            {
                (shape.radius_m(), "a radius of at least 1e-6 and an axis of length 1", "tool, m", false)
            }
            Support::Touched { friction, .. } => {
                (friction, "finite and at least 0", "friction", friction.is_finite() && friction >= 0.0)
            }
        };
        if ok { Ok(()) } else { Err(LocalModelError::Setting { what, value, allowed }) }
    }
}
