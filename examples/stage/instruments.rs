//! Panel and gizmos of a scene.

use crate::StageOptions;
use bevy::prelude::*;

/// Adds the panel (key P) and the gizmos (key G), as far as the features are enabled.
pub(crate) fn add(app: &mut App, options: &StageOptions) {
    #[cfg(feature = "panel")]
    app.add_plugins(bevy_palpate::HapticPanelPlugin {
        open: options.panel,
        key: Some(KeyCode::KeyP),
        ..default()
    });
    #[cfg(not(feature = "panel"))]
    {
        if options.panel {
            crate::scene::print_error("this program has no panel: build it with --features panel,gizmos");
        }
    }
    #[cfg(feature = "gizmos")]
    app.add_plugins(bevy_palpate::HapticGizmosPlugin)
        .insert_resource(gizmos::View(options.gizmos))
        .add_systems(
            Update,
            (
                gizmos::press.run_if(
                    resource_exists::<ButtonInput<KeyCode>>.and_then(not(crate::keys::keys_are_elsewhere)),
                ),
                gizmos::show.run_if(resource_changed::<gizmos::View>),
            )
                .chain(),
        );
    #[cfg(not(any(feature = "panel", feature = "gizmos")))]
    let _ = app;
}

#[cfg(feature = "gizmos")]
mod gizmos {
    use bevy::prelude::*;
    use bevy_palpate::HapticGizmos;

    /// Number of views: none, contact and force, near field, strained lattice, basis.
    const VIEWS: usize = 5;

    /// Index of the present view.
    #[derive(Resource)]
    pub struct View(pub usize);

    pub fn press(keys: Res<ButtonInput<KeyCode>>, mut view: ResMut<View>) {
        if keys.just_pressed(KeyCode::KeyG) {
            view.0 = (view.0 + 1) % VIEWS;
        }
    }

    pub fn show(mut store: ResMut<GizmoConfigStore>, view: Res<View>, stage: Res<crate::Stage>) {
        let (config, parts) = store.config_mut::<HapticGizmos>();
        let view = view.0;
        config.enabled = view > 0;
        *parts = HapticGizmos {
            near_field: view == 2,
            lattice: view == 3,
            fixed: view >= 3,
            basis: (view == 4).then_some(0),
            force_m_per_n: stage.magnified() * HapticGizmos::default().force_m_per_n,
            ..default()
        };
    }
}
