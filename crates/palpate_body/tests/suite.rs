//! Tests of the full body.

mod closest;
mod coupled_obstacles;
mod coupling;
mod elasticity;
mod element_bodies;
mod elements;
mod facing;
mod indentation;
mod inversion;
mod mesh;
mod motion;
mod moved_mount;
mod moved_obstacles;
mod network;
mod obstacle_shapes;
mod obstacles;
mod patch;
mod physics;
mod random_obstacles;
mod rest;
mod rigid_obstacles;
mod tetrahedra;
mod ties;
mod touch;
mod two_bodies;
mod two_tools;
