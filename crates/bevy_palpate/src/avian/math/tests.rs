use super::*;

fn body() -> (f64, DMat3, RigidResponse) {
    let inertia = DMat3::from_cols(
        DVec3::new(3e-3, 4e-4, -2e-4),
        DVec3::new(4e-4, 2e-3, 1e-4),
        DVec3::new(-2e-4, 1e-4, 4e-3),
    );
    let response = RigidResponse {
        linear: DMat3::from_diagonal(DVec3::splat(1.0 / 0.7)),
        coupling: DMat3::ZERO,
        angular: inertia.inverse(),
    };
    (0.7, inertia, response)
}

/// A body held at points moves along none of their rows, and its momentum is the free part of the impulse.
#[test]
fn held_body_moves_along_no_row() {
    let (mass, inertia, free) = body();
    let alone = HeldResponse::new(free);
    let points = [DVec3::new(0.1, -0.05, 0.02), DVec3::new(-0.08, -0.05, 0.07)];
    let rows: Vec<Wrench> =
        points.iter().flat_map(|arm| [DVec3::Y, DVec3::X].map(|n| Wrench::new(n, arm.cross(n)))).collect();
    let mut held = alone.clone();
    for row in rows.iter().chain(&rows) {
        held.hold(*row, row.dot(alone.velocity(*row)));
    }
    assert_eq!(held.rows.len(), 4, "equal rows are held once");
    let impulse = Wrench::new(DVec3::new(0.3, -0.2, 0.5), DVec3::new(0.01, 0.03, -0.02));
    let velocity = held.velocity(impulse);
    for row in &rows {
        assert!(row.dot(velocity).abs() < 1e-12, "{}", row.dot(velocity));
    }
    let part = held.free_part(impulse);
    assert!((part.linear - mass * velocity.linear).length() < 1e-12);
    assert!((part.angular - inertia * velocity.angular).length() < 1e-12);
    // The free part of the free part is itself.
    let again = held.free_part(part);
    assert!((again.linear - part.linear).length() + (again.angular - part.angular).length() < 1e-12);
    assert!(velocity.linear.length() > 0.01, "it moves along z");
}

#[test]
fn body_held_at_three_points_does_not_move() {
    let (.., free) = body();
    let alone = HeldResponse::new(free);
    let mut held = alone.clone();
    for arm in [DVec3::new(0.1, -0.05, 0.1), DVec3::new(-0.1, -0.05, 0.1), DVec3::new(0.0, -0.05, -0.1)] {
        for n in DVec3::AXES {
            let row = Wrench::new(n, arm.cross(n));
            held.hold(row, row.dot(alone.velocity(row)));
        }
    }
    assert_eq!(held.rows.len(), 6);
    let velocity = held.velocity(Wrench::new(DVec3::ONE, DVec3::ONE));
    assert!(velocity.linear.length() + velocity.angular.length() < 1e-9, "{velocity:?}");
}
