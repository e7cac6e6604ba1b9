use super::*;

fn rejection(view: &View, part: Part) -> &str {
    view.rejected[part as usize].as_deref().unwrap_or("")
}

#[test]
fn value_out_of_range_is_rejected_with_the_error_of_its_type() {
    let mut view = View::default();
    let good = SafetySettings::default();
    let bad = SafetySettings { fade_s: -1.0, ..good };
    assert_eq!(view.accept(Part::Limits, &good, bad, SafetySettings::validate), None);
    let error = bad.validate().unwrap_err();
    assert_eq!(rejection(&view, Part::Limits), format!("{error}. The previous value is kept."));
    // Without a change the message stays until a value is accepted.
    assert_eq!(view.accept(Part::Limits, &good, good, SafetySettings::validate), None);
    assert!(!rejection(&view, Part::Limits).is_empty());
    let better = SafetySettings { fade_s: 0.2, ..good };
    assert_eq!(view.accept(Part::Limits, &good, better, SafetySettings::validate), Some(better));
    assert_eq!(rejection(&view, Part::Limits), "");
}

#[test]
fn tissues_out_of_range_are_rejected() {
    let good = Tissue::default();
    for bad in [
        Tissue { youngs_modulus_pa: 0.0, ..good },
        Tissue { youngs_modulus_pa: f64::NAN, ..good },
        Tissue { density_kg_per_m3: -5.0, ..good },
        Tissue { density_kg_per_m3: f64::INFINITY, ..good },
        Tissue { damping: Damping::Ratio(-0.1), ..good },
        Tissue { poissons_ratio: 0.5, ..good },
    ] {
        let mut view = View::default();
        assert_eq!(view.accept(Part::Material, &good, bad, check_tissue), None, "{bad:?}");
        assert!(matches!(check_tissue(&bad), Err(palpate_body::BodyError::Parameter { .. })), "{bad:?}");
        assert!(!rejection(&view, Part::Material).is_empty(), "{bad:?}");
    }
    assert!(check_tissue(&good).is_ok());
}

#[test]
fn rejected_tissue_is_reverted_to_the_last_valid_one() {
    let (body, other) = (Entity::from_bits(7), Entity::from_bits(8));
    let good = Tissue::default();
    let of = |youngs_modulus_pa| Tissue { youngs_modulus_pa, ..good };
    let mut view = View::default();
    // A dragged slider: two changes before the body has been built with the first.
    view.start_change(body, good, of(1e5));
    view.start_change(body, of(1e5), of(1e9));
    assert_eq!(view.revert_tissue(other, of(1e9), "no"), None);
    assert_eq!(view.revert_tissue(body, of(1e9), "too stiff"), Some(good));
    assert_eq!(rejection(&view, Part::Material), "too stiff. The previous material is restored.");
    assert_eq!(view.revert_tissue(body, good, "again"), None);
    // The tissue with which the body was built in between is the last valid one.
    view.start_change(body, good, of(1e5));
    view.confirm_tissue(|_| Some(good));
    assert!(view.pending.is_some(), "the body is not built with it yet");
    view.confirm_tissue(|_| Some(of(1e5)));
    assert_eq!(view.pending, None);
    view.start_change(body, of(1e5), of(1e9));
    // The app has set another tissue since, which the panel does not revert.
    assert_eq!(view.revert_tissue(body, of(2e5), "too stiff"), None);
}

#[test]
fn angles_and_rotations_convert_both_ways() {
    for degrees in [DVec3::ZERO, DVec3::new(10.0, -120.0, 35.0), DVec3::new(-89.0, 170.0, 1.0)] {
        let rotation = rotation_of(degrees);
        assert!((degrees_of(rotation) - degrees).length() < 1e-9, "{degrees}");
        assert!(DeviceFrame { rotation, ..DeviceFrame::default() }.validate().is_ok());
    }
    assert!((rotation_of(DVec3::X * 90.0) * DVec3::Y - DVec3::Z).length() < 1e-12);
}

/// Types `text` into the number of a slider, then Enter; returns the value afterwards.
fn typed(text: &str) -> f64 {
    let context = egui::Context::default();
    let mut value = 20e3;
    let key = |key| egui::Event::Key {
        key,
        physical_key: None,
        pressed: true,
        repeat: false,
        modifiers: egui::Modifiers::NONE,
    };
    let inputs = [
        vec![],
        // The slider, then its number.
        vec![key(egui::Key::Tab)],
        vec![key(egui::Key::Tab)],
        vec![],
        vec![egui::Event::Text(text.into())],
        vec![key(egui::Key::Enter)],
        vec![],
    ];
    for events in inputs {
        let input = egui::RawInput { events, ..egui::RawInput::default() };
        let mut output = context.run_ui(input, |ui| {
            NumberField::new("Young's modulus", "kPa", 1e3, 1.0..=200.0).log().show(ui, &mut value);
        });
        output.textures_delta.clear();
    }
    value
}

#[test]
fn typed_number_is_scaled_and_not_clamped() {
    assert_eq!(typed("35.5"), 35.5e3);
    assert_eq!(typed("-3"), -3e3);
    assert_eq!(typed("5000"), 5e6);
    assert_eq!(typed("words"), 20e3);
    assert!(!typed("inf").is_finite() || typed("inf") == 20e3);
}
