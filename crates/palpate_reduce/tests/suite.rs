//! Tests of local models, their builder, and the reduction of linear systems.

mod balanced;
mod bode;
mod build;
mod compressed;
mod contact;
mod elements;
mod linear;
mod presses;
mod properties;
mod report;
mod response;
