//! Putting a network together, or changing one.

use super::{Grid, Network, NetworkParts};
use crate::error::{check, check_positive};
use crate::{BodyError, Link};
use glam::DVec3;
use palpate_laws::{ForceLaw, Spring};

/// A network in the making: nodes, springs between them, what is fixed, and regions of another material.
///
/// Errors of single steps are kept and told by [`NetworkBuilder::build`], the first of them.
///
/// ```
/// use glam::DVec3;
/// use palpate_body::NetworkBuilder;
/// use palpate_laws::ForceLaw;
///
/// # fn main() -> Result<(), palpate_body::BodyError> {
/// // Two masses hanging from a hook, the lower spring twice as stiff.
/// let mut network = NetworkBuilder::new();
/// let nodes = [0.0, -0.1, -0.2].map(|z| network.node(DVec3::Z * z, 0.01));
/// network.spring(nodes[0], nodes[1], ForceLaw::Linear { stiffness_n_per_m: 50.0 }, 0.1);
/// network.spring(nodes[1], nodes[2], ForceLaw::Linear { stiffness_n_per_m: 50.0 }, 0.1);
/// let network = network.fix([nodes[0]]).region(|x| x.z < -0.12, 2.0, 1.0, 1.0).build()?;
/// assert_eq!(network.free(), [1, 2]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct NetworkBuilder {
    rest_m: Vec<DVec3>,
    mass_kg: Vec<f64>,
    fixed: Vec<bool>,
    links: Vec<Link>,
    cells: Vec<[usize; 8]>,
    allow_free: bool,
    /// Of a network that is edited, as long as it has the same nodes.
    grid: Option<Grid>,
    error: Option<BodyError>,
}

impl Network {
    /// The same network, to be changed.
    #[must_use]
    pub fn edit(self) -> NetworkBuilder {
        let cells = self.cells().to_vec();
        let Self { rest_m, mass_kg, fixed, links, allow_free, grid, .. } = self;
        NetworkBuilder { rest_m, mass_kg, fixed, links, cells, allow_free, grid, error: None }
    }
}

impl NetworkBuilder {
    /// An empty network.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Of lists as [`Network::new`] takes them.
    pub(crate) fn of(rest_m: Vec<DVec3>, mass_kg: Vec<f64>, fixed: Vec<bool>, links: Vec<Link>) -> Self {
        Self { rest_m, mass_kg, fixed, links, cells: Vec::new(), allow_free: false, grid: None, error: None }
    }

    /// The same network with hexahedral cells between its nodes.
    pub(crate) fn with_cells(self, cells: Vec<[usize; 8]>) -> Self {
        Self { cells, ..self }
    }

    /// Adds a free node at `rest_m` (m) of mass `mass_kg`, and returns its index.
    pub fn node(&mut self, rest_m: DVec3, mass_kg: f64) -> usize {
        self.rest_m.push(rest_m);
        self.mass_kg.push(mass_kg);
        self.fixed.push(false);
        self.rest_m.len() - 1
    }

    /// Adds a spring of law `law` between nodes `a` and `b`, at rest where they are, beside a damper of
    /// `damping_ns_per_m`, and returns its index.
    pub fn spring(&mut self, a: usize, b: usize, law: ForceLaw, damping_ns_per_m: f64) -> usize {
        let (link, nodes) = (self.links.len(), self.rest_m.len());
        let (Some(&x_a), Some(&x_b)) = (self.rest_m.get(a), self.rest_m.get(b)) else {
            let node = if a < nodes { b } else { a };
            return self.refuse(BodyError::NodeOutOfRange { link, node, nodes });
        };
        if a == b {
            return self.refuse(BodyError::SelfLink { link, node: a });
        }
        if x_a == x_b {
            return self.refuse(BodyError::ZeroLength { link, a, b });
        }
        match Spring::new(law, x_a.distance(x_b), damping_ns_per_m) {
            Ok(spring) => self.link(Link { a, b, spring }),
            Err(source) => self.refuse(BodyError::Law { link, source }),
        }
    }

    /// Adds a link, whose spring need not be at rest, and returns its index.
    pub fn link(&mut self, link: Link) -> usize {
        self.links.push(link);
        self.links.len() - 1
    }

    /// Fixes nodes.
    #[must_use]
    pub fn fix(mut self, nodes: impl IntoIterator<Item = usize>) -> Self {
        for node in nodes {
            match self.fixed.get_mut(node) {
                Some(fixed) => *fixed = true,
                None => {
                    let below = self.rest_m.len();
                    self.refuse(BodyError::Fixed { node, nodes: below });
                }
            }
        }
        self
    }

    /// Fixes the nodes whose rest position (m) is `where_at`.
    #[must_use]
    pub fn fix_where(self, where_at: impl Fn(DVec3) -> bool) -> Self {
        let nodes: Vec<usize> = (0..self.rest_m.len()).filter(|&node| where_at(self.rest_m[node])).collect();
        self.fix(nodes)
    }

    /// A region of another material: springs whose middle at rest (m) is `inside` get `stiffness` times their force and
    /// `damping` times their damping, nodes inside `mass` times their mass.
    #[must_use]
    pub fn region(mut self, inside: impl Fn(DVec3) -> bool, stiffness: f64, damping: f64, mass: f64) -> Self {
        let checked = check_positive("stiffness of a region, as a factor", stiffness)
            .and(check_positive("mass of a region, as a factor", mass))
            .and(check(
                "damping of a region, as a factor",
                damping,
                damping.is_finite() && damping >= 0.0,
                "finite and at least 0",
            ));
        if let Err(error) = checked {
            self.refuse(error);
            return self;
        }
        for link in 0..self.links.len() {
            let Link { a, b, spring } = self.links[link];
            let (Some(x_a), Some(x_b)) = (self.rest_m.get(a), self.rest_m.get(b)) else { continue };
            if inside(0.5 * (*x_a + *x_b)) {
                match spring.scaled(stiffness, damping) {
                    Ok(spring) => self.links[link].spring = spring,
                    Err(source) => {
                        self.refuse(BodyError::Law { link, source });
                    }
                }
            }
        }
        for (m, x) in self.mass_kg.iter_mut().zip(&self.rest_m) {
            if inside(*x) {
                *m *= mass;
            }
        }
        if let Some(grid) = &mut self.grid {
            for (modulus, x) in grid.youngs_modulus_pa.iter_mut().zip(&self.rest_m) {
                if inside(*x) {
                    *modulus *= stiffness;
                }
            }
        }
        self
    }

    /// Gives every spring whose middle at rest (m) is `inside` the law `law` makes of its own.
    #[must_use]
    pub fn law_where(mut self, inside: impl Fn(DVec3) -> bool, law: impl Fn(ForceLaw) -> ForceLaw) -> Self {
        for link in 0..self.links.len() {
            let Link { a, b, spring } = self.links[link];
            let (Some(x_a), Some(x_b)) = (self.rest_m.get(a), self.rest_m.get(b)) else { continue };
            if inside(0.5 * (*x_a + *x_b)) {
                match Spring::new(law(spring.law()), spring.rest_length_m(), spring.damping_ns_per_m()) {
                    Ok(spring) => self.links[link].spring = spring,
                    Err(source) => {
                        self.refuse(BodyError::Law { link, source });
                    }
                }
            }
        }
        self
    }

    /// Lets parts be fixed to nothing, or not joined to each other.
    #[must_use]
    pub fn allow_unconstrained(mut self) -> Self {
        self.allow_free = true;
        self
    }

    /// The network.
    ///
    /// # Errors
    /// [`BodyError`]: the first step that made no sense; no node, or none that is free; a position that is not
    /// finite, a mass not above zero; a link that names a node which does not exist, joins a node with itself or two
    /// nodes at one place, or repeats another; and, unless [`NetworkBuilder::allow_free`] was said, a part that is
    /// fixed to nothing or not joined to the rest. Each names the index.
    pub fn build(mut self) -> Result<Network, BodyError> {
        match self.error.take() {
            Some(error) => Err(error),
            None => {
                let nodes = self.rest_m.len();
                let grid = self.grid.take().filter(|grid| grid.youngs_modulus_pa.len() == nodes);
                let Self { rest_m, mass_kg, fixed, links, cells, allow_free, .. } = self;
                let parts = NetworkParts { rest_m, mass_kg, fixed, links, cells, allow_free };
                let network = Network::assemble(parts)?;
                Ok(match grid {
                    Some(grid) => network.with_grid(grid),
                    None => network,
                })
            }
        }
    }

    /// Keeps the first error; the index of what would have been added.
    fn refuse(&mut self, error: BodyError) -> usize {
        self.error.get_or_insert(error);
        self.links.len()
    }
}
