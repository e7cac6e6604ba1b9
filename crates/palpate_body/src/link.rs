//! A spring and damper between two nodes.

use palpate_laws::Spring;

/// A spring and damper e = (a, b) between two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Index of node a.
    pub a: usize,
    /// Index of node b.
    pub b: usize,
    /// Spring and damper.
    pub spring: Spring,
}
