//! Generates `src/grid_compliance/table.rs`, the surface compliance of the spring lattice on a half-space, and
//! `src/grid_compliance/hexahedra.rs`, that of cubic hexahedral elements.
//!
//! ```text
//! cargo run --release -p palpate_laws --example grid_compliance > crates/palpate_laws/src/grid_compliance/table.rs
//! cargo run --release -p palpate_laws --example grid_compliance hexahedra > crates/palpate_laws/src/grid_compliance/hexahedra.rs
//! ```
//!
//! # Method
//!
//! A discrete Fourier transform in the plane of the surface decouples the lattice. For each wave vector `k` the half-space is a
//! chain of layers, coupled to their neighbours by 3x3 blocks. Decimation (M. P. Lopez Sancho, J. M. Lopez Sancho, J. Rubio,
//! J. Phys. F 15, 1985, 851) doubles the thickness of a slab in each iteration until its faces are uncoupled; its top block
//! is then the surface stiffness `Z(k)`. Displacements normal to the surface carry a factor `i`, which makes all blocks real.
//!
//! The compliance is the integral of `Z⁻¹(k) exp(i k·r)` over the Brillouin zone, divided by `(2π)²`. `Z⁻¹` grows as `1/|k|`
//! towards `k = 0`. The zone is split into eight triangles with a corner there; with `k = (s, s t)` in each, the area element
//! `s ds dt` cancels the singularity and the integrand is analytic in `s` and `t`. Gauss-Legendre quadrature then converges
//! exponentially.
//!
//! # Accuracy
//!
//! The program compares two resolutions of the quadrature and fails if an entry differs by more than `1e-11`. Round-off in the
//! decimation is below that. The table has ten decimals; 160 x 120 points give the same ones.

use std::error::Error;
use std::f64::consts::{PI, SQRT_2};
use std::fmt::Write as _;
use std::io::Write as _;

use glam::{DMat3, DVec3};
use palpate_laws::{ElementMaterial, HexahedronBlocks, HexahedronShape, LameParameters, RelaxedStress};

/// Largest offset in the table, cells.
const REACH: usize = 8;
/// Quadrature points along `s` and `t`, coarse and fine.
const POINTS: [(usize, usize); 2] = [(56, 40), (72, 52)];
/// Largest difference allowed between the two resolutions.
const TOLERANCE: f64 = 1e-11;
/// Bound on the iterations of the decimation. Each one doubles the thickness of the slab.
const MAX_DOUBLINGS: usize = 60;

/// Poisson's ratios of the table of hexahedra.
const RATIOS: [f64; 10] = [0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.475, 0.49];

/// What the cells consist of.
enum Cells {
    Springs,
    /// Stiffness of an element over `E h`.
    Hexahedra(Box<HexahedronBlocks>),
}

impl Cells {
    fn hexahedra(poissons_ratio: f64) -> Result<Self, Box<dyn Error>> {
        let corners =
            std::array::from_fn(|c| DVec3::from_array([0, 1, 2].map(|axis| (c >> axis & 1) as f64)));
        let parameters_j = LameParameters::new(1.0, poissons_ratio)?;
        let material = ElementMaterial { parameters_j, ..ElementMaterial::default() };
        let shape = HexahedronShape::new(&corners).ok_or("a cube is flat")?;
        Ok(Self::Hexahedra(Box::new(shape.stiffness_n_per_m(
            &corners,
            &material,
            &RelaxedStress::default(),
            false,
        ))))
    }
}

/// Stiffness of a spring inside of the lattice over `E h`, by the number of axes along which it extends.
fn stiffness(axes: i32) -> f64 {
    match axes {
        1 => 8.0 / 15.0,
        2 => 4.0 / 15.0,
        _ => 0.1,
    }
}

/// A slab of the lattice at one wave vector, reduced to its two faces.
#[derive(Clone, Copy)]
struct Slab {
    top: DMat3,
    bottom: DMat3,
    /// Force on the top face for a unit displacement of the bottom face.
    coupling: DMat3,
}

impl Slab {
    /// One layer of cells.
    fn layer(cells: &Cells, kx: f64, ky: f64) -> Self {
        match cells {
            Cells::Springs => Self::of_springs(kx, ky),
            Cells::Hexahedra(blocks) => Self::of_hexahedra(blocks, kx, ky),
        }
    }

    /// One layer of elements, whose corners 4 to 7 are on top.
    fn of_hexahedra(blocks: &HexahedronBlocks, kx: f64, ky: f64) -> Self {
        let sum = |rows: [usize; 4], columns: [usize; 4]| {
            let mut sum = DMat3::ZERO;
            for (row, column) in rows.into_iter().flat_map(|row| columns.map(|column| (row, column))) {
                let offset = |axis: usize| (column >> axis & 1) as f64 - (row >> axis & 1) as f64;
                let (sin, cos) = (kx * offset(0) + ky * offset(1)).sin_cos();
                let block = blocks[row][column];
                let (even, odd) = (block * cos, block * sin);
                // As for springs: a factor i on the normal displacement.
                sum += DMat3::from_cols(
                    DVec3::new(even.x_axis.x, even.x_axis.y, odd.x_axis.z),
                    DVec3::new(even.y_axis.x, even.y_axis.y, odd.y_axis.z),
                    DVec3::new(-odd.z_axis.x, -odd.z_axis.y, even.z_axis.z),
                );
            }
            sum
        };
        let (bottom, top) = ([0, 1, 2, 3], [4, 5, 6, 7]);
        Self { top: sum(top, top), bottom: sum(bottom, bottom), coupling: -sum(top, bottom) }
    }

    /// One layer of springs. In-plane springs of its faces have half their stiffness: the next layer has the other half.
    fn of_springs(kx: f64, ky: f64) -> Self {
        let (mut face, mut coupling) = (DMat3::ZERO, DMat3::ZERO);
        for x in -1_i32..=1 {
            for y in -1_i32..=1 {
                let phase = kx * f64::from(x) + ky * f64::from(y);
                if (x, y) != (0, 0) {
                    let axis = DVec3::new(f64::from(x), f64::from(y), 0.0).normalize();
                    // Half the stiffness times 1 - cos(phase), without cancellation.
                    face += outer(axis) * (stiffness(x.abs() + y.abs()) * (0.5 * phase).sin().powi(2));
                }
                let axis = DVec3::new(f64::from(x), f64::from(y), -1.0).normalize();
                let spring = outer(axis) * stiffness(x.abs() + y.abs() + 1);
                face += spring;
                let (even, odd) = (spring * phase.cos(), spring * phase.sin());
                // With a factor i on the normal displacement, i sin(k·d) becomes -sin in the last column and +sin in the last row.
                coupling += DMat3::from_cols(
                    DVec3::new(even.x_axis.x, even.x_axis.y, odd.x_axis.z),
                    DVec3::new(even.y_axis.x, even.y_axis.y, odd.y_axis.z),
                    DVec3::new(-odd.z_axis.x, -odd.z_axis.y, even.z_axis.z),
                );
            }
        }
        Self { top: face, bottom: face, coupling }
    }

    /// Two of these slabs, one on the other, without the nodes between them.
    fn doubled(self) -> Self {
        let inner = (self.bottom + self.top).inverse();
        let transposed = self.coupling.transpose();
        Self {
            top: self.top - self.coupling * inner * transposed,
            bottom: self.bottom - transposed * inner * self.coupling,
            coupling: self.coupling * inner * self.coupling,
        }
    }
}

/// The matrix `a aᵀ`.
fn outer(a: DVec3) -> DMat3 {
    DMat3::from_cols(a * a.x, a * a.y, a * a.z)
}

/// Compliance of the surface of the half-space at one wave vector, real with a factor `i` on the normal displacement.
fn surface_compliance(cells: &Cells, kx: f64, ky: f64) -> DMat3 {
    let mut slab = Slab::layer(cells, kx, ky);
    for _ in 0..MAX_DOUBLINGS {
        if slab.coupling.to_cols_array().iter().all(|entry| entry.abs() < 1e-18) {
            break;
        }
        slab = slab.doubled();
    }
    let compliance = slab.top.inverse();
    (compliance + compliance.transpose()) * 0.5
}

/// Points and weights of the Gauss-Legendre quadrature on `0..1`.
fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let order = count as f64;
    (0..count)
        .map(|at| {
            let mut x = (PI * (at as f64 + 0.75) / (order + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (mut before, mut value) = (1.0, x);
                for n in 2..=count {
                    let n = n as f64;
                    (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
                }
                slope = order * (x * value - before) / (x * x - 1.0);
                x -= value / slope;
            }
            (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// The entries `xx, xy, xz, yy, yz, zz` for every offset `0 <= j <= i <= REACH`, in the order of the table.
fn table(cells: &Cells, points: (usize, usize)) -> Vec<[f64; 6]> {
    let offsets: Vec<(f64, f64)> =
        (0..=REACH).flat_map(|i| (0..=i).map(move |j| (i as f64, j as f64))).collect();
    let mut sums = vec![[0.0; 6]; offsets.len()];
    for (s, s_weight) in gauss_legendre(points.0) {
        let s = s * PI;
        for &(t, t_weight) in &gauss_legendre(points.1) {
            let (kx, ky) = (s, s * t);
            // Twice: k and -k give the same.
            let weight = 2.0 * (PI * s_weight) * t_weight * s / (4.0 * PI * PI);
            let c = surface_compliance(cells, kx, ky) * weight;
            let (xx, xy, xz) = (c.x_axis.x, c.y_axis.x, c.z_axis.x);
            let (yy, yz, zz) = (c.y_axis.y, c.z_axis.y, c.z_axis.z);
            // Images of the triangle under the symmetry of the square.
            let images = [
                (kx, ky, [xx, xy, xz, yy, yz, zz]),
                (kx, -ky, [xx, -xy, xz, yy, -yz, zz]),
                (ky, kx, [yy, xy, yz, xx, xz, zz]),
                (-ky, kx, [yy, -xy, -yz, xx, xz, zz]),
            ];
            for (sum, &(i, j)) in sums.iter_mut().zip(&offsets) {
                for (kx, ky, [xx, xy, xz, yy, yz, zz]) in images {
                    let (sin, cos) = (kx * i + ky * j).sin_cos();
                    let terms = [xx * cos, xy * cos, xz * sin, yy * cos, yz * sin, zz * cos];
                    for (sum, term) in sum.iter_mut().zip(terms) {
                        *sum += term;
                    }
                }
            }
        }
    }
    sums
}

/// Normal and mean tangential compliance of the continuum at a distance of one cell (`nu = 1/4`).
const NORMAL_FAR: f64 = 15.0 / (16.0 * PI);
const TANGENTIAL_FAR: f64 = 35.0 / (32.0 * PI);
/// Compliances of an offset in the table and of its images under the symmetry of the square.
struct Sample {
    distance: f64,
    compliance: f64,
    images: f64,
}

/// Distance from which the radial interpolations equal the continuum, cells.
const FAR: f64 = 10.0;

/// Knots of a radial interpolation: distance, reciprocal of the compliance, slope of the reciprocal.
///
/// The reciprocal is nearly linear in the distance. The knots are at 0, 1 and √2, then at whole distances up to `REACH`: there
/// the mean of compliance times distance over all offsets that are less than half a cell nearer or farther. Slopes are those
/// of a monotone cubic (F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300).
fn knots(samples: &[Sample], far: f64) -> Vec<[f64; 3]> {
    // The first offset is (0, 0).
    let own = samples.first().map_or(f64::NAN, |sample| sample.compliance);
    let mean = |near: f64, beyond: f64| {
        let shell = samples.iter().filter(|sample| (near..beyond).contains(&sample.distance));
        let (sum, count) = shell.fold((0.0, 0.0), |(sum, count), sample| {
            (sum + sample.images * sample.compliance * sample.distance, count + sample.images)
        });
        sum / count
    };
    let mut knots = vec![[0.0, own.recip(), 0.0], [1.0, mean(0.9, 1.1).recip(), 0.0]];
    knots.push([SQRT_2, SQRT_2 / mean(1.4, 1.5), 0.0]);
    for n in 2..=REACH {
        let distance = n as f64;
        knots.push([distance, distance / mean(distance - 0.5, distance + 0.5), 0.0]);
    }
    knots.push([FAR, FAR / far, far.recip()]);
    let slopes: Vec<f64> = knots
        .windows(3)
        .map(|w| {
            let (before, after) = (w[1][0] - w[0][0], w[2][0] - w[1][0]);
            let (rise_before, rise_after) = ((w[1][1] - w[0][1]) / before, (w[2][1] - w[1][1]) / after);
            let share = (before + 2.0 * after) / (3.0 * (before + after));
            rise_before * rise_after / (share * rise_after + (1.0 - share) * rise_before)
        })
        .collect();
    for (knot, slope) in knots.iter_mut().skip(1).zip(slopes) {
        knot[2] = slope;
    }
    knots
}

/// The table with ten decimals, if two resolutions of the quadrature agree.
fn checked_table(cells: &Cells) -> Result<Vec<[f64; 6]>, Box<dyn Error>> {
    let [coarse, mut fine] = POINTS.map(|points| table(cells, points));
    let pairs = coarse.iter().flatten().zip(fine.iter().flatten());
    let error = pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    if error > TOLERANCE {
        return Err(format!(
            "two resolutions of the quadrature differ by {error:e}; at most {TOLERANCE:e} is allowed"
        )
        .into());
    }
    // The radial interpolations follow the printed table, not digits that round-off decides.
    for entry in fine.iter_mut().flatten() {
        *entry = (*entry * 1e10).round() / 1e10;
    }
    Ok(fine)
}

/// The compliances of a table along the normal or across it, by distance.
fn samples(fine: &[[f64; 6]], value: fn(&[f64; 6]) -> f64) -> Vec<Sample> {
    let offsets = (0..=REACH).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let sample = |((i, j), row): ((usize, usize), &[f64; 6])| {
        let images = if j == 0 || i == j { 4.0 } else { 8.0 };
        Sample { distance: ((i * i + j * j) as f64).sqrt(), compliance: value(row), images }
    };
    offsets.zip(fine).map(sample).collect()
}

/// The generated file of hexahedra.
pub fn file_of_hexahedra() -> Result<String, Box<dyn Error>> {
    let mut text = String::new();
    writeln!(text, "//! Generated by `examples/grid_compliance.rs`; do not edit.\n")?;
    writeln!(text, "/// Largest offset in the table, cells.")?;
    writeln!(text, "pub(super) const REACH: u32 = {REACH};\n")?;
    writeln!(
        text,
        "/// Poisson's ratio, and the entries `zz` of the compliance for the offsets (0, 0), (1, 0), (1, 1), (2, 0),"
    )?;
    writeln!(text, "/// (2, 1), (2, 2), (3, 0) and so on.")?;
    writeln!(text, "#[rustfmt::skip]")?;
    let entries = (REACH + 1) * (REACH + 2) / 2;
    writeln!(text, "pub(super) const NORMAL: [(f64, [f64; {entries}]); {}] = [", RATIOS.len())?;
    for ratio in RATIOS {
        let fine = checked_table(&Cells::hexahedra(ratio)?)?;
        writeln!(text, "    ({ratio:?}, [")?;
        let normal: Vec<f64> = fine.iter().map(|[_, _, _, _, _, zz]| *zz).collect();
        for row in normal.chunks(REACH + 1) {
            writeln!(text, "        {},", numbers(row))?;
        }
        writeln!(text, "    ]),")?;
    }
    writeln!(text, "];")?;
    Ok(text)
}

/// The generated file of springs.
pub fn file() -> Result<String, Box<dyn Error>> {
    let fine = checked_table(&Cells::Springs)?;
    let mut text = String::new();
    writeln!(text, "//! Generated by `examples/grid_compliance.rs`; do not edit.\n")?;
    writeln!(text, "use std::f64::consts::SQRT_2;\n")?;
    writeln!(text, "/// Largest offset in the table, cells.")?;
    writeln!(text, "pub(super) const REACH: u32 = {REACH};\n")?;
    writeln!(
        text,
        "/// The entries `xx, xy, xz, yy, yz, zz` of the compliance for the offsets (0, 0), (1, 0), (1, 1), (2, 0),"
    )?;
    writeln!(text, "/// (2, 1), (2, 2), (3, 0) and so on.")?;
    writeln!(text, "#[rustfmt::skip]")?;
    writeln!(text, "pub(super) const COMPLIANCE: [[f64; 6]; {}] = [", fine.len())?;
    for row in &fine {
        writeln!(text, "    [{}],", numbers(row))?;
    }
    writeln!(text, "];")?;
    let normal = knots(&samples(&fine, |[_, _, _, _, _, zz]| *zz), NORMAL_FAR);
    let tangential = knots(&samples(&fine, |[xx, _, _, yy, _, _]| 0.5 * (xx + yy)), TANGENTIAL_FAR);
    for (name, what, knots) in [("NORMAL", "normal", normal), ("TANGENTIAL", "tangential", tangential)] {
        writeln!(
            text,
            "\n/// Distance in cells, reciprocal of the mean {what} compliance there, slope of the reciprocal."
        )?;
        writeln!(text, "#[rustfmt::skip]")?;
        writeln!(text, "pub(super) const {name}: [[f64; 3]; {}] = [", knots.len())?;
        for knot in &knots {
            writeln!(text, "    [{}],", numbers(knot))?;
        }
        writeln!(text, "];")?;
    }
    Ok(text)
}

/// Numbers with ten decimals. Zero has no sign; √2 has its name.
fn numbers(values: &[f64]) -> String {
    let number = |value: &f64| match *value {
        SQRT_2 => "SQRT_2".to_owned(),
        value if value.abs() < 5e-11 => "0.0000000000".to_owned(),
        value => format!("{value:.10}"),
    };
    values.iter().map(number).collect::<Vec<_>>().join(", ")
}

fn main() -> Result<(), Box<dyn Error>> {
    let text =
        if std::env::args().nth(1).as_deref() == Some("hexahedra") { file_of_hexahedra()? } else { file()? };
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
