//! Stress and strain of a body.

use super::Body;
use super::deformation::CellPlace;
use crate::BodyPoint;
use glam::{DMat3, DVec3};
use palpate_laws::StressState;
use std::io::{self, Write};

/// Margin of a box around a cell, relative to its size.
const TOLERANCE: f64 = 1e-9;

impl Body {
    /// The point of the body at `place_m`, m, in the present shape: the nodes around it with their weights. `None` outside of all cells and tetrahedra,
    /// and for a network without them.
    ///
    /// The cells of a body from a mesh extend beyond its surface by up to a cell.
    #[must_use]
    pub fn point_within(&self, place_m: DVec3) -> Option<BodyPoint> {
        self.points_within(&[place_m]).pop().flatten()
    }

    /// [`Body::point_within`] at each of `places_m`, faster than one by one.
    #[must_use]
    pub fn points_within(&self, places_m: &[DVec3]) -> Vec<Option<BodyPoint>> {
        let (cells, tetrahedra) = (self.network().cells(), self.network().tetrahedra());
        let bounds = |nodes: &[usize]| {
            let corners = nodes.iter().map(|node| self.positions_m()[*node]).map(|x| (x, x));
            corners.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or_default()
        };
        let of_cells = cells.iter().map(|nodes| bounds(nodes));
        let boxes: Vec<(DVec3, DVec3)> =
            of_cells.chain(tetrahedra.iter().map(|nodes| bounds(&nodes))).collect();
        let point_at = |place_m: DVec3| {
            let is_near = |(_, (low, high)): &(usize, &(DVec3, DVec3))| {
                let margin = DVec3::splat(TOLERANCE * (*high - *low).max_element());
                place_m.cmpge(*low - margin).all() && place_m.cmple(*high + margin).all()
            };
            boxes.iter().enumerate().filter(is_near).find_map(|(index, _)| {
                match index.checked_sub(cells.len()) {
                    None => self.point_at(self.place_in_cell(index, place_m)?),
                    Some(element) => {
                        let (nodes, weights) = self.weights_in_tetrahedron(element, place_m)?;
                        let weights = nodes.into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0);
                        BodyPoint::new(weights.collect()).ok()
                    }
                }
            })
        };
        places_m.iter().map(|place_m| point_at(*place_m)).collect()
    }

    /// Stress and strain at a point, from those of its nodes.
    #[must_use]
    pub fn stress_of(&self, point: &BodyPoint) -> StressState {
        let of_nodes = self.node_stresses();
        StressState::mean(point.nodes().iter().map(|&(node, weight)| (weight, of_nodes[node])))
    }

    /// Stress and strain at every node: the means over the cells, elements or domains around it, weighted by their volumes. Zero at nodes of springs
    /// without cells.
    ///
    /// The stress is the elastic one, less what has relaxed; the forces of dampers and of volume barriers are not in it. In an element it is that of the
    /// mean deformation gradient. In a cell of springs it is the virial stress Σ f ⊗ d / V of its springs, with the forces f and the vectors d between their
    /// ends.
    #[must_use]
    pub fn node_stresses(&self) -> Vec<StressState> {
        let network = self.network();
        let mut of_nodes: Vec<Vec<(f64, StressState)>> = vec![Vec::new(); network.node_count()];
        for (nodes, volume_m3, state) in self.spring_cell_stresses() {
            nodes.iter().for_each(|node| of_nodes[*node].push((volume_m3, state)));
        }
        let (hexahedra, domains) = network.split_relaxed(self.relaxed_stress_j());
        for (index, element) in network.hexahedra().iter().enumerate() {
            let state = network.hexahedra().stress_state(index, self.positions_m(), hexahedra);
            element.nodes.iter().for_each(|node| of_nodes[*node].push((element.filled_m3, state)));
        }
        for (node, volume_m3, state) in
            network.tetrahedra().domains().stress_states(self.positions_m(), domains)
        {
            of_nodes[node].push((volume_m3, state));
        }
        of_nodes.into_iter().map(|states| StressState::mean(states.into_iter())).collect()
    }

    /// Nodes, filled volume, m³, and stress and strain of each cell of springs.
    fn spring_cell_stresses(&self) -> Vec<([usize; 8], f64, StressState)> {
        let network = self.network();
        let (cells, count) = (network.cells(), network.barriers().with_barriers());
        let Some(grid) = network.grid().filter(|_| count > 0) else { return Vec::new() };
        let springs_of = |cell: &[usize; 8]| -> Vec<usize> {
            let of_node = |node: &usize| {
                let node = *node;
                let links = network.incident_links(node).iter().copied();
                links.filter(move |&link| {
                    let link = &network.links()[link];
                    link.a == node && cell.contains(&link.b)
                })
            };
            cell.iter().flat_map(of_node).collect()
        };
        let of_cells: Vec<Vec<usize>> = cells[..count].iter().map(springs_of).collect();
        let mut sharing = vec![0_u32; network.links().len()];
        of_cells.iter().flatten().for_each(|link| sharing[*link] += 1);
        let of_cell = |(cell, springs): (usize, Vec<usize>)| {
            let nodes = cells[cell];
            // Σ k ℓ² = 6 E V of an isotropic lattice; k ℓ² and f ⊗ d are shared equally by the cells of a spring.
            let (mut energy_j, mut virial_j) = (0.0, DMat3::ZERO);
            for index in springs {
                let link = &network.links()[index];
                let share = f64::from(sharing[index]).recip();
                let d = self.positions_m()[link.b] - self.positions_m()[link.a];
                let rest_m = network.rest_m()[link.a].distance(network.rest_m()[link.b]);
                let at_rest = link.spring.law().at(rest_m - link.spring.rest_length_m());
                energy_j += share * at_rest.stiffness_n_per_m * rest_m * rest_m / 6.0;
                let force = share * link.spring.force_on_a(d, DVec3::ZERO);
                virial_j += DMat3::from_cols(force * d.x, force * d.y, force * d.z);
            }
            let modulus_pa = nodes.iter().map(|node| grid.youngs_modulus_pa()[*node]).sum::<f64>() / 8.0;
            let volume_m3 = energy_j / modulus_pa;
            let f = self.deformation(CellPlace { cell, local: DVec3::splat(0.5) }).gradient;
            // P = J σ F⁻ᵀ, with V σ J the virial.
            let piola_pa = virial_j * volume_m3.recip() * f.inverse().transpose();
            (nodes, volume_m3, StressState::new(&f, &piola_pa))
        };
        of_cells.into_iter().enumerate().map(of_cell).collect()
    }

    /// Writes stress and strain of every node as CSV: index, position, m, von Mises stress, pressure and principal stresses, Pa, principal strains and
    /// the volume ratio.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write_stress_csv(&self, mut to: impl Write) -> io::Result<()> {
        writeln!(
            to,
            "node,x_m,y_m,z_m,von_mises_pa,pressure_pa,stress_1_pa,stress_2_pa,stress_3_pa,strain_1,strain_2,strain_3,volume_ratio"
        )?;
        for (node, (state, x)) in self.node_stresses().iter().zip(self.positions_m()).enumerate() {
            write!(to, "{node},{},{},{},{},{}", x.x, x.y, x.z, state.von_mises_pa(), state.pressure_pa())?;
            for value in state.principal_stresses_pa().into_iter().chain(state.principal_strains()) {
                write!(to, ",{value}")?;
            }
            writeln!(to, ",{}", state.volume_ratio)?;
        }
        Ok(())
    }
}
