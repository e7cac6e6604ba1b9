//! Validation and copies of near fields.

use super::*;

const CAPACITY: NearFieldCapacity = NearFieldCapacity {
    nodes: 3,
    order: 2,
    ring: 2,
    springs: 3,
    hexahedra: 2,
    domains: 2,
    domain_nodes: 6,
    points: 3,
    triangles: 1,
};

/// A near field with one triangle and three springs.
fn triangle() -> NearField {
    let mut field = NearField::with_capacity(CAPACITY);
    (field.nodes, field.order, field.ring) = (3, 2, 1);
    (field.springs, field.points, field.triangles) = (3, 3, 1);
    field.near[0].b = NearEnd::Ring(0);
    field.near[1].b = NearEnd::Support(2);
    field.point.copy_from_slice(&[0, 1, 2].map(NearPoint::node));
    field.triangle[0] = NearTriangle { points: [0, 1, 2], ..NearTriangle::default() };
    field.support = Support::Touched { shape: ToolShape::Sphere { radius_m: 0.01 }, friction: 0.3 };
    field.tick_s = 1e-3;
    field
}

#[test]
fn validate_rejects_invalid_masses_supports_tools_and_friction() {
    type Corrupt = fn(&mut NearField);
    let touched = |radius_m, friction| Support::Touched { shape: ToolShape::Sphere { radius_m }, friction };
    let cases: [(&str, Corrupt); 4] = [
        ("inverse mass, 1/kg", |f| f.node_per_kg[1] = -1.0),
        ("number of driven nodes", |f| f.support = Support::Driven),
        ("sum of squared weights of the held point", |f| f.support = Support::Held),
        // The only weight is on a fixed node.
        ("sum of squared weights of the held point", |f| (f.support, f.weight[0]) = (Support::Held, 1.0)),
    ];
    for (name, corrupt) in cases {
        let mut bad = triangle();
        corrupt(&mut bad);
        let error = bad.validate().unwrap_err();
        assert!(matches!(error, LocalModelError::Setting { what, .. } if what == name), "{error}");
    }
    for support in
        [touched(1e-300, 0.3), touched(f64::NAN, 0.3), touched(0.01, -0.1), touched(0.01, f64::NAN)]
    {
        let bad = NearField { support, ..triangle() };
        assert!(matches!(bad.validate(), Err(LocalModelError::Setting { .. })));
    }
}

#[test]
fn validate_rejects_non_finite_numbers_in_use() {
    assert_eq!(triangle().validate(), Ok(()));
    type Corrupt = fn(&mut NearField);
    let cases: [(&str, Corrupt); 15] = [
        ("weights", |f| f.weight[2] = f64::NAN),
        ("inverse masses", |f| f.node_per_kg[0] = f64::INFINITY),
        ("basis", |f| f.basis[5] = f64::NAN),
        ("far stiffness", |f| f.stiffness[3] = f64::NAN),
        ("far damping", |f| f.damping[0] = f64::NAN),
        ("far force", |f| f.force[10] = f64::NAN),
        ("near-field velocity", |f| f.velocity[0] = f64::NAN),
        ("positions of S", |f| f.node_m[1].x = f64::NAN),
        ("positions of the ring", |f| f.ring_m[0].y = f64::NAN),
        ("ends of near springs", |f| f.near[2].b = NearEnd::Fixed(DVec3::NAN)),
        ("weights of the surface", |f| f.point[1].nodes[0].1 = f64::NAN),
        ("materials of near hexahedra", |f| {
            (f.hexahedra, f.shapes) = (1, 1);
            f.hexahedron[0].material.parameters_j.mu = f64::NAN;
        }),
        ("materials of near domains", |f| (f.domains, f.domain[0].material.gradient_j) = (1, f64::NAN)),
        ("gradients of near domains", |f| {
            (f.domains, f.domain[0].entries) = (1, (0, 2));
            f.domain_gradient_per_m[1].z = f64::NAN;
        }),
        ("tick", |f| f.tick_s = 0.0),
    ];
    for (what, corrupt) in cases {
        let mut bad = triangle();
        corrupt(&mut bad);
        assert_eq!(bad.validate(), Err(LocalModelError::NotFinite { what }));
    }
    // Entries that are not in use are not checked.
    let mut unused = triangle();
    unused.basis[6] = f64::NAN;
    unused.tangent[0] = f64::NAN;
    assert_eq!(unused.validate(), Ok(()));
}

#[test]
fn validate_rejects_wrong_sizes_and_indices() {
    type Corrupt = fn(&mut NearField);
    let cases: [Corrupt; 21] = [
        |f| f.nodes = usize::MAX,
        |f| f.order = 3,
        |f| f.ring = 3,
        |f| f.springs = 4,
        |f| f.points = 4,
        |f| f.triangles = 2,
        |f| f.tetrahedra = 7,
        |f| f.hexahedra = 3,
        |f| f.shapes = 3,
        |f| f.domains = 3,
        |f| (f.domains, f.domain[0].entries) = (1, (1, 6)),
        |f| f.near[0].a = 3,
        |f| f.near[0].b = NearEnd::Ring(1),
        |f| f.point[2].nodes[0].0 = 4,
        |f| f.triangle[0].points[2] = 3,
        |f| (f.tetrahedra, f.tetrahedron[0].nodes) = (1, [0, 1, 2, 4]),
        |f| (f.hexahedra, f.shapes, f.hexahedron[0].nodes[7]) = (1, 1, 4),
        |f| f.hexahedra = 1,
        |f| (f.domains, f.domain[0].entries, f.domain_node[1]) = (1, (0, 2), 4),
        |f| (f.domains, f.domain[0].entries) = (2, (0, 5)),
        |f| f.integrator = TickIntegrator::Explicit { substeps: 65 },
    ];
    for (i, corrupt) in cases.into_iter().enumerate() {
        let mut bad = triangle();
        corrupt(&mut bad);
        let error = bad.validate().unwrap_err();
        match i {
            0..11 => assert!(matches!(error, LocalModelError::Capacity { .. }), "{error}"),
            11..20 => assert!(matches!(error, LocalModelError::Index { .. }), "{error}"),
            _ => assert!(matches!(error, LocalModelError::Setting { .. }), "{error}"),
        }
    }
    // An implicit tick requires a factor.
    let mut unfactored = triangle();
    unfactored.integrator = TickIntegrator::Implicit { substeps: 1 };
    assert!(matches!(unfactored.validate(), Err(LocalModelError::Size { what: "implicit factor", .. })));
}

#[test]
fn copy_is_complete_and_rejects_sizes_above_capacity() {
    let mut to = NearField::with_capacity(NearFieldCapacity { nodes: 5, order: 4, ..CAPACITY });
    let mut field = triangle();
    (field.tetrahedra, field.tetrahedron[0].nodes) = (1, [2, 1, 0, 3]);
    to.copy_from(&field).unwrap();
    assert_eq!((to.nodes, to.springs, to.near[1].b), (3, 3, NearEnd::Support(2)));
    assert_eq!((to.tetrahedra, to.tetrahedron[0].nodes), (1, [2, 1, 0, 3]));
    assert_eq!(to.validate(), Ok(()));
    let mut small = NearField::with_capacity(NearFieldCapacity { ring: 0, ..CAPACITY });
    let error = LocalModelError::Capacity { what: "nodes of the ring", found: 1, capacity: 0 };
    assert_eq!(small.copy_from(&triangle()), Err(error));
    assert_eq!(small.nodes, 0);
}
