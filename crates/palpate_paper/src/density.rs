//! Section 5.2: how the stiffness of a block changes with the density of its mesh.

use crate::block_scaling::block_scaling;
use clap::Args;
use palpate_lab::error::{LabError, check, whole};
use palpate_lab::figure::{Curve, Panel, Scale, svg};
use palpate_lab::output::{Output, csv, write_files};
use palpate_lab::progress;
use serde::Serialize;
use std::collections::BTreeMap;

/// Section 5.2: how the stiffness of a block changes with the density of its mesh (Fig. 16)
///
/// A block of fixed size is meshed more and more finely, with the same springs; `scaling` is its stiffness relative to
/// that with one cell along each edge (Fig. 16).
///
/// Definition: the block is attached to its surroundings by its 2^dimension corners. Its stiffness matrix is that of all springs
/// condensed on the corners (forces over displacements of the corners, without forces on the other nodes), and the ratio compares
/// its largest singular value. In one dimension, springs in series, it is 1/density, the rule of section 5.1. The paper states no
/// definition; this one contains that case.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab density --json\n  palpate-lab density --dimension 1,2,3 --to 6 --out results"
)]
pub(crate) struct Density {
    /// Dimensions of the block: 1, 2, 3 or several of them
    #[arg(value_parser = whole, allow_hyphen_values = true, long, value_delimiter = ',', value_name = "N,...", default_value = "2,3")]
    dimension: Vec<usize>,
    /// Minimum density: cells along each edge
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 1)]
    from: usize,
    /// Maximum density
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 10)]
    to: usize,
}

/// Stiffness over density for a number of dimensions.
#[derive(Serialize)]
pub(crate) struct Scaling {
    pub(crate) density: Vec<usize>,
    pub(crate) scaling: Vec<f64>,
}

/// Maximum density in 1, 2 and 3 dimensions, limited by memory and time.
const MAX_DENSITY: [usize; 3] = [10_000, 200, 20];

impl Density {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let scalings = self.scalings()?;
        if let Some(folder) = output.folder() {
            let densities = (self.from..=self.to).map(|n| n as f64).collect();
            let mut columns = vec![("density".to_owned(), densities)];
            columns.extend(scalings.iter().map(|(d, s)| (format!("scaling_{d}d"), s.scaling.clone())));
            let files = [("density.csv", csv(&columns)), ("density.svg", figure(&scalings)?)];
            write_files(folder, &files)?;
        }
        output.print(&scalings, |out| {
            write!(out, "density")?;
            for dimension in scalings.keys() {
                write!(out, "{:>12}", format!("{dimension}-D"))?;
            }
            writeln!(out)?;
            for (i, density) in (self.from..=self.to).enumerate() {
                write!(out, "{density:>7}")?;
                for scaling in scalings.values() {
                    write!(out, "{:>12.6}", scaling.scaling[i])?;
                }
                writeln!(out)?;
            }
            Ok(())
        })
    }

    /// Scaling by number of dimensions.
    pub(crate) fn scalings(&self) -> Result<BTreeMap<usize, Scaling>, LabError> {
        if self.dimension.is_empty() {
            check("number of --dimension", 0.0, false, "at least 1")?;
        }
        check("--from", self.from as f64, self.from >= 1, "at least 1")?;
        let allowed = format!("at least --from, {}", self.from);
        check("--to", self.to as f64, self.to >= self.from, allowed)?;
        for &dimension in &self.dimension {
            check("--dimension", dimension as f64, (1..=3).contains(&dimension), "1, 2 or 3")?;
            let max = MAX_DENSITY[dimension - 1];
            check("--to", self.to as f64, self.to <= max, format!("at most {max} in dimension {dimension}"))?;
        }
        let bar = progress::bar(self.dimension.len() * (self.to - self.from + 1));
        let mut scalings = BTreeMap::new();
        for &dimension in &self.dimension {
            let density: Vec<usize> = (self.from..=self.to).collect();
            let mut scaling = Vec::with_capacity(density.len());
            for &n in &density {
                bar.set_message(format!("{n} cells along an edge in dimension {dimension}"));
                scaling.push(block_scaling(dimension, n)?);
                bar.inc(1);
            }
            scalings.insert(dimension, Scaling { density, scaling });
        }
        Ok(scalings)
    }
}

/// Fig. 16: stiffness over density.
pub(crate) fn figure(scalings: &BTreeMap<usize, Scaling>) -> Result<String, LabError> {
    let curves = scalings.iter().map(|(dimension, s)| {
        let points = s.density.iter().map(|&n| n as f64).zip(s.scaling.iter().copied());
        Curve::new(format!("{dimension}-D"), points)
    });
    let panel = Panel {
        title: "Stiffness of a block of fixed size".into(),
        x: "density of the mesh, cells along an edge",
        y: "relative to one cell",
        scale: Scale::Linear,
        curves: curves.collect(),
    };
    svg(&[panel], 1)
}
