//! Closed meshes and the bodies made of them.

mod closed;
mod garbage;
mod lattice;
mod limits;
mod motion;
mod shapes;
mod skin;
