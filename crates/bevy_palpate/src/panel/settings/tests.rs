use super::*;

fn refused(view: &View, part: Part) -> &str {
    view.refused[part as usize].as_deref().unwrap_or("")
}

#[test]
fn nonsense_is_refused_in_the_words_of_its_type_and_what_was_stays() {
    let mut view = View::default();
    let good = SafetySettings::default();
    let bad = SafetySettings { fade_s: -1.0, ..good };
    assert_eq!(view.accept(Part::Limits, &good, bad, SafetySettings::validate), None);
    assert_eq!(
        refused(&view, Part::Limits),
        "fade, s is -1; it must be finite and at least 0. It stays as it was."
    );
    // Nothing changed: the word stays until something is taken.
    assert_eq!(view.accept(Part::Limits, &good, good, SafetySettings::validate), None);
    assert!(!refused(&view, Part::Limits).is_empty());
    let better = SafetySettings { fade_s: 0.2, ..good };
    assert_eq!(view.accept(Part::Limits, &good, better, SafetySettings::validate), Some(better));
    assert_eq!(refused(&view, Part::Limits), "");
}

#[test]
fn materials_that_are_none_are_refused() {
    let good = Tissue::default();
    for bad in [
        Tissue { youngs_modulus_pa: 0.0, ..good },
        Tissue { youngs_modulus_pa: f64::NAN, ..good },
        Tissue { density_kg_per_m3: -5.0, ..good },
        Tissue { density_kg_per_m3: f64::INFINITY, ..good },
        Tissue { damping_ratio: -0.1, ..good },
    ] {
        let mut view = View::default();
        assert_eq!(view.accept(Part::Material, &good, bad, check_tissue), None, "{bad:?}");
        assert!(refused(&view, Part::Material).contains("must be"), "{}", refused(&view, Part::Material));
    }
    assert!(check_tissue(&good).is_ok());
}

#[test]
fn a_material_that_the_body_refuses_gives_way_to_the_last_good_one() {
    let (body, other) = (Entity::from_bits(7), Entity::from_bits(8));
    let good = Tissue::default();
    let of = |youngs_modulus_pa| Tissue { youngs_modulus_pa, ..good };
    let mut view = View::default();
    // Dragged: two changes before the body has been made of the first.
    view.try_tissue(body, good, of(1e5));
    view.try_tissue(body, of(1e5), of(1e9));
    assert_eq!(view.revert_tissue(other, of(1e9), "no"), None);
    assert_eq!(view.revert_tissue(body, of(1e9), "too stiff"), Some(good));
    assert_eq!(refused(&view, Part::Material), "too stiff. The material before is back.");
    assert_eq!(view.revert_tissue(body, good, "again"), None);
    // What the body was made of in between is the last good one.
    view.try_tissue(body, good, of(1e5));
    view.confirm_tissue(|_| Some(good));
    assert!(view.trial.is_some(), "it is not made of that yet");
    view.confirm_tissue(|_| Some(of(1e5)));
    assert_eq!(view.trial, None);
    view.try_tissue(body, of(1e5), of(1e9));
    // The app has set another one meanwhile: that is not the panel's to take back.
    assert_eq!(view.revert_tissue(body, of(2e5), "too stiff"), None);
}

#[test]
fn angles_and_rotations_are_the_same_turn() {
    for degrees in [DVec3::ZERO, DVec3::new(10.0, -120.0, 35.0), DVec3::new(-89.0, 170.0, 1.0)] {
        let rotation = rotation_of(degrees);
        assert!((degrees_of(rotation) - degrees).length() < 1e-9, "{degrees}");
        assert!(DeviceFrame { rotation, ..DeviceFrame::default() }.validate().is_ok());
    }
    assert!((rotation_of(DVec3::X * 90.0) * DVec3::Y - DVec3::Z).length() < 1e-12);
}

/// Types `text` into the number of a slider, then Enter; the value afterwards.
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
fn what_is_typed_comes_through_in_its_unit_and_unclamped() {
    assert_eq!(typed("35.5"), 35.5e3);
    assert_eq!(typed("-3"), -3e3);
    assert_eq!(typed("5000"), 5e6);
    assert_eq!(typed("words"), 20e3);
    assert!(!typed("inf").is_finite() || typed("inf") == 20e3);
}
