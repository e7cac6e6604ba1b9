//! Closed loops of body and local model.

mod embedded;
mod fidelity;
mod near_field;
mod near_touch;
mod replayed_thread;
mod resting;
mod two_bodies;
mod two_tools;
