//! Response of a body, and of the rigid bodies that it touches, to impulses on constraint rows.

use crate::obstacle_step::{ObstacleStep, RigidStep};
use crate::weights::Weights;
use glam::{DMat3, DVec3};
use palpate_laws::ImpulseResponse;

/// Points of a row: a weighted sum of nodes, minus a point of a rigid body.
pub(crate) struct ResponseRow {
    /// Nodes that respond to impulses.
    pub(crate) nodes: Weights,
    pub(crate) rigid: Option<RigidPoint>,
}

/// A point of a rigid body.
#[derive(Clone, Copy)]
pub(crate) struct RigidPoint {
    /// Index of the obstacle.
    pub(crate) obstacle: usize,
    /// The point relative to the centre of mass, m.
    pub(crate) arm_m: DVec3,
}

impl RigidPoint {
    fn of<'a>(&self, obstacles: &'a [ObstacleStep]) -> Option<&'a RigidStep> {
        obstacles.get(self.obstacle)?.rigid.as_ref()
    }

    /// Velocity of the point, m/s.
    pub(crate) fn velocity_m_per_s(&self, obstacles: &[ObstacleStep]) -> DVec3 {
        self.of(obstacles).map_or(DVec3::ZERO, |rigid| rigid.velocity.at(self.arm_m))
    }

    /// Applies `impulse_ns` to the body at the point.
    pub(crate) fn apply(&self, obstacles: &mut [ObstacleStep], impulse_ns: DVec3) {
        if let Some(rigid) = obstacles.get_mut(self.obstacle).and_then(|of| of.rigid.as_mut()) {
            let change = rigid.change(self.arm_m, impulse_ns);
            rigid.velocity.linear += change.linear;
            rigid.velocity.angular += change.angular;
        }
    }

    /// Velocity of the point per impulse at the point `other`, 1/kg: A + B S − R Bᵀ − R C S with the linear (A), coupling (B)
    /// and angular (C) response and the matrices R and S of the cross products with the arms. Zero for another body.
    pub(crate) fn per_kg(&self, other: &Self, obstacles: &[ObstacleStep]) -> DMat3 {
        let Some(rigid) = self.of(obstacles).filter(|_| self.obstacle == other.obstacle) else {
            return DMat3::ZERO;
        };
        let (arm, other_arm, response) =
            (cross_matrix(self.arm_m), cross_matrix(other.arm_m), &rigid.response);
        let turning = arm * response.angular * other_arm;
        if response.coupling == DMat3::ZERO {
            return response.linear - turning;
        }
        response.linear + response.coupling * other_arm - arm * response.coupling.transpose() - turning
    }
}

/// The matrix of v ↦ a × v.
fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

/// Response of the explicit step, A = M: impulses change only the nodes of their row, and its rigid body.
pub(crate) struct LumpedMassResponse<'a> {
    pub(crate) rows: &'a [ResponseRow],
    pub(crate) mass_kg: &'a [f64],
    /// Velocities of all nodes, m/s.
    pub(crate) v: &'a mut [DVec3],
    pub(crate) obstacles: &'a mut [ObstacleStep],
}

impl LumpedMassResponse<'_> {
    pub(crate) fn inv_effective_mass_per_kg(&self, row: usize) -> DMat3 {
        let ResponseRow { nodes, rigid } = &self.rows[row];
        let per_mass: f64 = nodes.iter().map(|&(node, w)| w * w / self.mass_kg[node]).sum();
        let of_nodes = DMat3::from_diagonal(DVec3::splat(per_mass));
        rigid.map_or(of_nodes, |rigid| of_nodes + rigid.per_kg(&rigid, self.obstacles))
    }
}

impl ImpulseResponse for LumpedMassResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        let ResponseRow { nodes, rigid } = &self.rows[row];
        let of_nodes: DVec3 = nodes.iter().map(|&(node, w)| w * self.v[node]).sum();
        rigid.map_or(of_nodes, |rigid| of_nodes - rigid.velocity_m_per_s(self.obstacles))
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let ResponseRow { nodes, rigid } = &self.rows[row];
        for &(node, w) in nodes {
            self.v[node] += w / self.mass_kg[node] * impulse_ns;
        }
        if let Some(rigid) = rigid {
            rigid.apply(self.obstacles, -impulse_ns);
        }
    }
}

/// Response of one body.
pub(crate) enum BodyResponse<'a> {
    LumpedMasses(LumpedMassResponse<'a>),
    Implicit(DelassusMatrix),
}

impl BodyResponse<'_> {
    pub(crate) fn inv_effective_mass_per_kg(&self, row: usize) -> DMat3 {
        match self {
            Self::LumpedMasses(response) => response.inv_effective_mass_per_kg(row),
            Self::Implicit(response) => response.inv_effective_mass_per_kg(row),
        }
    }
}

impl ImpulseResponse for BodyResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        match self {
            Self::LumpedMasses(response) => response.velocity_m_per_s(row),
            Self::Implicit(response) => response.velocity_m_per_s(row),
        }
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        match self {
            Self::LumpedMasses(response) => response.apply_impulse(row, impulse_ns),
            Self::Implicit(response) => response.apply_impulse(row, impulse_ns),
        }
    }
}

/// Response of several bodies, whose rows follow each other: block diagonal, because an impulse moves only the body of its row.
pub(crate) struct JointResponse<'a> {
    bodies: Vec<BodyResponse<'a>>,
    /// Body of every row, and index of the row there.
    rows: Vec<(usize, usize)>,
}

impl<'a> JointResponse<'a> {
    /// Joins `bodies` with the given numbers of rows.
    pub(crate) fn new(bodies: Vec<BodyResponse<'a>>, counts: impl Iterator<Item = usize>) -> Self {
        let rows = counts.enumerate().flat_map(|(body, count)| (0..count).map(move |row| (body, row)));
        Self { rows: rows.collect(), bodies }
    }
}

impl ImpulseResponse for JointResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        let (body, row) = self.rows[row];
        self.bodies[body].velocity_m_per_s(row)
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let (body, row) = self.rows[row];
        self.bodies[body].apply_impulse(row, impulse_ns);
    }
}

/// Response of the implicit step, A = M + hB + h²K: the Delassus matrix H A⁻¹ Hᵀ couples all rows.
pub(crate) struct DelassusMatrix {
    /// Blocks in row-major order, 1/kg.
    delassus: Vec<DMat3>,
    /// Velocity of each row, m/s.
    u: Vec<DVec3>,
}

impl DelassusMatrix {
    /// Creates the matrix for `rows`. `v` holds the velocities of the nodes without impulses, `obstacles` those of the
    /// rigid bodies; `block(nodes, j)` is the velocity of the weighted sum of `nodes` per impulse on row j.
    pub(crate) fn new(
        rows: &[ResponseRow],
        v: &[DVec3],
        obstacles: &[ObstacleStep],
        block: impl Fn(&[(usize, f64)], usize) -> DMat3,
    ) -> Self {
        let mut delassus = Vec::with_capacity(rows.len() * rows.len());
        for row in rows {
            for (column, other) in rows.iter().enumerate() {
                let of_nodes = block(&row.nodes, column);
                delassus.push(match (&row.rigid, &other.rigid) {
                    (Some(rigid), Some(other)) => of_nodes + rigid.per_kg(other, obstacles),
                    _ => of_nodes,
                });
            }
        }
        let velocity = |row: &ResponseRow| {
            let of_nodes: DVec3 = row.nodes.iter().map(|&(node, w)| w * v[node]).sum();
            row.rigid.map_or(of_nodes, |rigid| of_nodes - rigid.velocity_m_per_s(obstacles))
        };
        Self { delassus, u: rows.iter().map(velocity).collect() }
    }

    pub(crate) fn inv_effective_mass_per_kg(&self, row: usize) -> DMat3 {
        self.block(row, row)
    }

    /// Velocity of `row` per impulse on the row `other`, 1/kg.
    pub(crate) fn block(&self, row: usize, other: usize) -> DMat3 {
        self.delassus[row * self.u.len() + other]
    }
}

impl ImpulseResponse for DelassusMatrix {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        self.u[row]
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let rows = self.u.len();
        for (other, u) in self.u.iter_mut().enumerate() {
            *u += self.delassus[other * rows + row] * impulse_ns;
        }
    }
}
