//! The maximum sizes of the near fields of a body.

use palpate_body::Body;
use palpate_local::NearFieldCapacity;

/// Surface points for which there is capacity, for each node of S and in addition for the surface beyond S.
const POINTS_PER_NODE: usize = 8;
const POINTS_BEYOND_SUPPORT: usize = 128;

/// The capacity that near fields of `body` with support sets of up to `nodes` nodes and bases of up to `order` columns require.
pub(crate) fn capacity(body: &Body, nodes: usize, order: usize) -> NearFieldCapacity {
    let network = body.network();
    let degree = network.free().iter().map(|&node| network.incident_links(node).len()).max().unwrap_or(0);
    let springs = (nodes * degree).min(network.links().len());
    let elements = network.hexahedra();
    let incident = network.free().iter().map(|&node| elements.incident(node).len()).max().unwrap_or(0);
    let hexahedra = (nodes * incident).min(elements.len());
    let domains = network.tetrahedra().domains();
    let of_node = |node: usize| domains.incident(node);
    let size = |node: usize| of_node(node).iter().map(|index| domains.get(*index).nodes.len()).sum::<usize>();
    let incident = network.free().iter().map(|&node| of_node(node).len()).max().unwrap_or(0);
    let domain_nodes = network.free().iter().map(|&node| size(node)).max().unwrap_or(0);
    // A node has seven others in each of its elements.
    let ring = springs.saturating_add(7 * hexahedra);
    let neighbours = network.free().iter().map(|&node| network.neighbour_count(node)).max().unwrap_or(0);
    let ring = if domains.is_empty() { ring } else { nodes.saturating_mul(neighbours) };
    let surface = body.contact_surface();
    let points = surface.points().len().min(POINTS_PER_NODE * nodes + POINTS_BEYOND_SUPPORT);
    NearFieldCapacity {
        nodes,
        order: order.min(3 * network.free().len()),
        ring: ring.min(network.node_count()),
        springs,
        hexahedra,
        domains: (nodes * incident).min(domains.len()),
        domain_nodes: nodes.saturating_mul(domain_nodes),
        points,
        // A closed surface has twice as many triangles as points.
        triangles: surface.triangles().len().min(2 * points),
    }
}
