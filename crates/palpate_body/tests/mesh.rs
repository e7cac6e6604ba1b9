//! Closed meshes and the bodies made of them.

mod arbitrary_input;
mod automatic_cells;
mod closed;
mod composite;
mod enclosed;
mod lattice;
mod limits;
mod motion;
pub mod ripple;
mod shapes;
mod skin;
mod soups;
mod volumes;
