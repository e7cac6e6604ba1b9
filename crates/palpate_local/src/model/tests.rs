//! Tests of local models as data.

use super::*;

fn model(order: usize) -> LocalModel {
    let mut model = LocalModel::empty(Capacity::of_order(order));
    model.scheme = Scheme::Neighbourhood;
    model.contact = Contact::Held;
    model.reduced.order = order;
    model.reduced.step_s = 1e-3;
    let identity: Vec<f64> = (0..order * order).map(|i| f64::from(u8::from(i % (order + 1) == 0))).collect();
    model.reduced.implicit.factorise(order, &identity).unwrap();
    model
}

#[test]
fn validate_rejects_non_finite_numbers() {
    let good = model(3);
    assert_eq!(good.validate(), Ok(()));
    type Corrupt = fn(&mut LocalModel);
    let cases: [(&str, Corrupt); 8] = [
        ("force", |m| m.force_n.y = f64::NAN),
        ("position", |m| m.position_m.x = f64::INFINITY),
        ("velocity", |m| m.velocity_m_per_s.z = f64::NAN),
        ("normal", |m| m.contact = Contact::Touching { normal: DVec3::NAN }),
        ("stiffness", |m| m.stiffness_n_per_m.y_axis.z = f64::NAN),
        ("damping", |m| m.damping_ns_per_m.x_axis.x = f64::NAN),
        ("reduced stiffness", |m| m.reduced.stiffness[8] = f64::NAN),
        ("reduced velocity", |m| m.reduced.velocity[0] = f64::NEG_INFINITY),
    ];
    for (what, corrupt) in cases {
        let mut bad = good.clone();
        corrupt(&mut bad);
        assert_eq!(bad.validate(), Err(LocalModelError::NotFinite { what }));
    }
}

#[test]
fn scheme_names_parse_to_the_scheme() {
    for scheme in Scheme::ALL {
        assert_eq!(scheme.to_string().parse(), Ok(scheme));
    }
    assert_eq!(" low-pass".parse(), Ok(Scheme::LowPass));
    assert_eq!("linear".parse::<Scheme>(), Err(LocalModelError::UnknownScheme));
}

#[test]
fn validate_rejects_parts_of_wrong_size() {
    let mut short = model(3);
    short.reduced.damping_rc.truncate(8);
    let (what, found) = ("coupling damping", 8);
    assert_eq!(short.validate(), Err(LocalModelError::Size { what, found, needed: 9, order: 3 }));
    let mut unfactored = model(3);
    unfactored.reduced.order = 2;
    assert!(matches!(unfactored.validate(), Err(LocalModelError::Size { what: "implicit factor", .. })));
}

#[test]
fn validate_rejects_excessive_order_without_overflow() {
    for order in [4, usize::MAX] {
        let mut vast = model(3);
        vast.reduced.order = order;
        assert_eq!(vast.validate(), Err(LocalModelError::Order { order, capacity: 3 }));
    }
}

#[test]
fn copy_is_complete_and_rejects_order_above_capacity() {
    let from = model(3);
    let mut to = model(5);
    to.copy_from(&from).unwrap();
    assert_eq!((to.id, to.scheme, to.reduced.order), (from.id, from.scheme, 3));
    assert_eq!(to.validate(), Ok(()));
    let mut small = LocalModel::empty(Capacity::of_order(2));
    assert_eq!(small.copy_from(&from), Err(LocalModelError::Order { order: 3, capacity: 2 }));
    assert_eq!(small, LocalModel::empty(Capacity::of_order(2)));
}
