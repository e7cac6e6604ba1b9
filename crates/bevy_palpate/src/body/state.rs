//! State of a body's build.

use bevy::prelude::*;

/// State of the body that [`DeformableBody`](crate::DeformableBody) and its partner components describe.
///
/// After [`BodyState::Ready`], a changed component makes a body of a mesh [`BodyState::Building`] again; the previous
/// [`SimulatedBody`](crate::SimulatedBody) stays simulated until the new one replaces it, or if the change is rejected.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::{BodyReady, BodyState};
/// # let mut app = App::new();
/// app.add_observer(|ready: On<BodyReady>| info!("{} can be touched", ready.body));
/// // Or, in a system:
/// fn waiting(bodies: Query<&BodyState>) -> usize {
///     bodies.iter().filter(|state| matches!(state, BodyState::Loading | BodyState::Building)).count()
/// }
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
#[component(immutable)]
pub enum BodyState {
    /// The mesh asset of the body is being loaded, or the body has just been spawned.
    #[default]
    Loading,
    /// A background task builds the body from its mesh.
    Building,
    /// The body is simulated.
    Ready,
    /// The components, the mesh or the transform were rejected, with the reason as one line; the same reason is written as a
    /// [`HapticFault`](crate::HapticFault). The body is built once they change.
    Rejected(String),
}

/// A body has been built, or built again, and is simulated: a message, and an event for observers of the body, which run at once.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct BodyReady {
    /// The body.
    #[event_target]
    pub body: Entity,
}
