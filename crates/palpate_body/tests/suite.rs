//! Tests of the full body.

mod closest;
mod coupling;
mod elasticity;
mod facing;
mod indentation;
mod inversion;
mod mesh;
mod motion;
mod network;
mod obstacles;
mod patch;
mod physics;
mod ties;
mod touch;
mod two_tools;
