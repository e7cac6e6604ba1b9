//! Every field of a local model, written and read concurrently at full speed with values that reveal tearing.

use crate::{LoopConfig, LoopSettings, haptic_loop};
use glam::{DMat3, DVec3};
use palpate_laws::{
    DomainMaterial, ElementMaterial, HexahedronShape, LameParameters, MAX_PATCHES, Neighbour, PATCH_ROWS,
    Patch, PatchScale, Spring, SurfacePlace, ToolShape, VirtualCoupling, VolumeBarrier,
};
use palpate_local::{
    Capacity, Cholesky, Contact, HandOverSettings, LocalModel, ModelId, NearContact, NearDomain, NearEnd,
    NearField, NearFieldCapacity, NearHexahedron, NearPatch, NearSpring, NearTetrahedron, NearTriangle,
    OtherToolForce, Scheme, SecondBody, Support, TickIntegrator,
};
use std::sync::atomic::{AtomicBool, Ordering};

const CAPACITY: Capacity = Capacity { order: 5, near: OF_BODY, second: OF_BODY };
const OF_BODY: NearFieldCapacity = NearFieldCapacity {
    nodes: 4,
    order: 6,
    ring: 8,
    springs: 12,
    hexahedra: 8,
    domains: 6,
    domain_nodes: 40,
    points: 5,
    triangles: 5,
};

/// Number of models to be received.
const RECEIVED: u64 = if cfg!(miri) { 20 } else { 10_000 };

/// Generator of numbers that all differ from one model to the next.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        1.0 + (self.0 >> 12) as f64 / (1_u64 << 52) as f64
    }
    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
    /// A size from 0 to `max`.
    fn size(&mut self, max: usize) -> usize {
        ((self.next() - 1.0) * (max + 1) as f64) as usize
    }
    fn is(&mut self) -> bool {
        self.size(1) == 1
    }
    fn fill(&mut self, list: &mut [f64]) {
        list.iter_mut().for_each(|v| *v = self.next());
    }
    fn factor(&mut self, factor: &mut Cholesky) {
        let n = factor.capacity();
        let diagonal: Vec<f64> =
            (0..n * n).map(|i| if i % (n + 1) == 0 { self.next() } else { 0.0 }).collect();
        factor.factorise(n, &diagonal).unwrap();
    }
}

/// Writes all fields of the model with number `number`, to the ends of its vectors. A new field does not compile until it is written
/// here, except in the linear reduced system.
fn write(number: u64, model: &mut LocalModel) {
    let n = &mut Numbers(number);
    let LocalModel {
        id,
        scheme,
        contact,
        force_n,
        position_m,
        velocity_m_per_s,
        stiffness_n_per_m,
        damping_ns_per_m,
        clamped,
        reduced,
        near,
        second: SecondBody { body: second_body, epoch: second_epoch, near: second_near },
    } = model;
    *id = ModelId { body: number + 1, epoch: number + 2, sequence: number };
    *scheme = Scheme::ALL[n.size(5)];
    *contact = if n.is() { Contact::Touching { normal: n.vector() } } else { Contact::Held };
    (*force_n, *position_m, *velocity_m_per_s) = (n.vector(), n.vector(), n.vector());
    *stiffness_n_per_m = DMat3::from_cols(n.vector(), n.vector(), n.vector());
    *damping_ns_per_m = DMat3::from_cols(n.vector(), n.vector(), n.vector());
    *clamped = n.is();
    (reduced.order, reduced.step_s) = (n.size(CAPACITY.order), n.next());
    for list in [
        &mut reduced.stiffness,
        &mut reduced.damping,
        &mut reduced.stiffness_rc,
        &mut reduced.damping_rc,
        &mut reduced.force,
        &mut reduced.velocity,
    ] {
        n.fill(list);
    }
    n.factor(&mut reduced.implicit);
    write_near(n, near);
    (*second_body, *second_epoch) = (number + 3, number + 4);
    write_near(n, second_near);
}

fn write_near(n: &mut Numbers, near: &mut NearField) {
    let NearField {
        nodes,
        order,
        ring,
        springs,
        tetrahedra,
        hexahedra,
        shapes,
        domains,
        points,
        triangles,
        support,
        weight,
        node_m,
        node_per_kg,
        drag_ns_per_m,
        ring_m,
        basis,
        near,
        tetrahedron,
        hexahedron,
        shape: shapes_at_rest,
        domain,
        domain_node,
        domain_gradient_per_m,
        point,
        triangle,
        contact,
        compliance,
        stiffness,
        damping,
        force,
        velocity,
        tick_s,
        integrator,
        tangent,
        factor,
        impulse_response,
        other,
        other_influence,
        energy_j,
        start_m,
        coupling,
        proxy_m,
        is_cut,
    } = near;
    let capacity = CAPACITY.near;
    for (size, max) in [
        (nodes, capacity.nodes),
        (order, capacity.order),
        (ring, capacity.ring),
        (springs, capacity.springs),
        (tetrahedra, 2 * capacity.springs),
        (hexahedra, capacity.hexahedra),
        (shapes, capacity.hexahedra),
        (domains, capacity.domains),
        (points, capacity.points),
        (triangles, capacity.triangles),
    ] {
        *size = n.size(max);
    }
    let shape = ToolShape::Sphere { radius_m: n.next() };
    *support = if n.is() { Support::Touched { shape, friction: n.next() } } else { Support::Held };
    for list in [
        weight,
        node_per_kg,
        drag_ns_per_m,
        basis,
        stiffness,
        damping,
        force,
        velocity,
        tangent,
        impulse_response,
        compliance,
        other_influence,
    ] {
        n.fill(list);
    }
    for list in [node_m, ring_m] {
        list.iter_mut().for_each(|v| *v = n.vector());
    }
    for spring in near {
        let (a, at, ring) = (n.size(3), n.vector(), n.size(7));
        let b = if n.is() { NearEnd::Fixed(at) } else { NearEnd::Ring(ring) };
        *spring = NearSpring { a, b, spring: Spring::linear(n.next(), n.next(), n.next()).unwrap() };
    }
    for tetrahedron in tetrahedron {
        let edges = [DVec3::X * n.next(), DVec3::Y, DVec3::Z];
        let barrier = VolumeBarrier::new(edges, n.next()).unwrap();
        *tetrahedron = NearTetrahedron { nodes: [n.size(3), n.size(3), n.size(7), n.size(7)], barrier };
    }
    for element in hexahedron {
        let mut of = || LameParameters { mu: n.next(), lambda: n.next() };
        let material = ElementMaterial { parameters_j: of(), viscous_js: of(), ..ElementMaterial::default() };
        let nodes = [0; 8].map(|_| n.size(7) as u16);
        let relaxed = [[n.next(); 6], [n.next(); 6], [n.next(); 6]];
        *element = NearHexahedron { nodes, shape: n.size(7), material, relaxed };
    }
    for domain in domain {
        let mut of = || LameParameters { mu: n.next(), lambda: n.next() };
        let material = ElementMaterial { parameters_j: of(), viscous_js: of(), ..ElementMaterial::default() };
        let material = DomainMaterial { material, gradient_j: n.next() };
        let relaxed = [[n.next(); 6], [n.next(); 6], [n.next(); 6]];
        *domain = NearDomain { entries: (n.size(20), n.size(20)), material, relaxed };
    }
    domain_node.iter_mut().for_each(|node| *node = n.size(7) as u16);
    domain_gradient_per_m.iter_mut().for_each(|v| *v = n.vector());
    for shape in shapes_at_rest {
        let size_m = DVec3::new(n.next(), n.next(), n.next());
        let corner = |c: usize| size_m * DVec3::from_array([0, 1, 2].map(|axis| (c >> axis & 1) as f64));
        *shape = HexahedronShape::new(&std::array::from_fn(corner)).unwrap();
    }
    for point in point {
        point.nodes.iter_mut().for_each(|carrier| *carrier = (n.size(3), n.next()));
        (point.fixed_m, point.modulus_pa) = (n.vector(), n.next());
    }
    for triangle in triangle {
        let points = [n.size(3), n.size(3), n.size(3)];
        let neighbours =
            [0; 3].map(|_| Neighbour { triangle: n.is().then(|| n.size(4) as u32), is_crease: n.is() });
        *triangle = NearTriangle { points, neighbours, rest_normal: n.vector(), is_reachable: n.is() };
    }
    let axes = [n.vector(), n.vector(), n.vector()];
    let patches = [(); MAX_PATCHES].map(|()| NearPatch {
        patch: Patch {
            foot: SurfacePlace { triangle: n.size(4), weights: [n.next(), n.next(), n.next()] },
            normal: n.vector(),
            axis: n.vector(),
            tip_m: n.vector(),
            averaged_n: n.next(),
        },
        rest_normal: n.vector(),
        row_n: [(); PATCH_ROWS].map(|()| n.next()),
        force_n: [(); PATCH_ROWS].map(|()| n.vector()),
    });
    *contact = NearContact {
        scale: PatchScale { cell_m: n.next(), spread_m: n.next(), axes, softens: n.is() },
        poissons_ratio: n.next(),
        adds_compliance: n.is(),
        patches,
        count: n.size(MAX_PATCHES),
    };
    (*tick_s, *energy_j, *start_m, *proxy_m, *is_cut) = (n.next(), n.next(), n.vector(), n.vector(), n.is());
    let substeps = 1 + n.size(7) as u32;
    *integrator =
        if n.is() { TickIntegrator::Explicit { substeps } } else { TickIntegrator::Implicit { substeps } };
    n.factor(factor);
    *other = OtherToolForce { tool: n.size(1000) as u64, body: n.size(1000) as u64, force_n: n.vector() };
    let (stiffness_n_per_m, max_force_n) = (n.next(), n.next());
    *coupling = n.is().then_some(VirtualCoupling { stiffness_n_per_m, max_force_n });
}

#[test]
fn every_field_of_a_local_model_crosses_without_tearing() {
    let hand_over = HandOverSettings { capacity: CAPACITY, ..HandOverSettings::default() };
    let config = LoopConfig { hand_over, ..LoopConfig::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, LoopSettings::default()).unwrap();
    let mut models = haptic_loop.channels.models;
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut number = 0;
            while !is_done.load(Ordering::Acquire) {
                write(number, handle.model_slot());
                handle.publish_model();
                number += 1;
            }
        });
        let mut expected = LocalModel::empty(CAPACITY);
        let (mut received, mut last) = (0, None);
        while received < RECEIVED {
            if !models.update() {
                std::thread::yield_now();
                continue;
            }
            let model = models.output_buffer();
            let number = model.id.sequence;
            write(number, &mut expected);
            let whole = *model == expected;
            // The writer must end before this thread unwinds, or the scope never ends.
            if !whole || last.is_some_and(|last| last >= number) {
                is_done.store(true, Ordering::Release);
            }
            assert!(whole, "the model {number} is torn:\n{model:?}\ninstead of\n{expected:?}");
            assert!(last.is_none_or(|last| last < number), "{number} after {last:?}");
            last = Some(number);
            received += 1;
        }
        is_done.store(true, Ordering::Release);
    });
}
