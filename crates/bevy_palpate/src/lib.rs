//! Touch deformable bodies through a force-feedback device, in Bevy.
