//! Soft bodies and rigid bodies of avian3d in headless apps, in lock step.

mod app;
mod events;
mod momentum;
mod obstacles;
mod resting;
