//! The H∞ norm of a linear system: its maximum gain over all frequencies.

use crate::{PoleResidue, ReduceError, StateSpace};
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, c64};

/// The H∞ norm of a system, and the frequency at which it is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HInf {
    /// sup over ω of the largest singular value of D + C (jω − A)⁻¹ B, N/m. The true value lies between this and
    /// (1 + 2 tolerance) times this.
    pub norm: f64,
    /// Frequency at which the norm is reached, rad/s; may be infinite.
    pub omega: f64,
    /// Number of Hamiltonian matrices whose eigenvalues were computed.
    pub iterations: usize,
}

/// Maximum number of iterations. Beyond it, rounding prevents the detection of imaginary eigenvalues.
const MAX_ITERATIONS: usize = 30;

impl HInf {
    /// Computes the H∞ norm of the proper part D + C (s − A)⁻¹ B of `system` to a relative `tolerance`. With E ≠ 0 the norm of the whole
    /// system is infinite.
    ///
    /// # Method
    ///
    /// γ exceeds the norm if and only if the Hamiltonian matrix
    ///
    /// ```text
    /// H(γ) = [F  γ B R⁻¹ Bᵀ; −γ Cᵀ S⁻¹ C  −Fᵀ],   F = A + B R⁻¹ Dᵀ C,  R = γ² − DᵀD,  S = γ² − DDᵀ
    /// ```
    ///
    /// has no eigenvalue on the imaginary axis (Boyd, Balakrishnan and Kabamba, Math. Control Signals Systems 2 (1989)
    /// 207). A grid of frequencies around the poles, refined at its peak, gives a lower bound. If H just above the bound
    /// has imaginary eigenvalues, the gain midway between them raises the bound, and so on until it has none (Bruinsma and
    /// Steinbuch, Systems & Control Letters 14 (1990) 287).
    ///
    /// # Errors
    /// [`ReduceError::Option`] for a tolerance outside 1e-9 to 0.1; [`ReduceError::Unstable`] for a system with a
    /// pole that is not in the open left half-plane; [`ReduceError::Eigenvalues`] when an iteration does not converge.
    pub fn new(system: &StateSpace, tolerance: f64) -> Result<Self, ReduceError> {
        if !(1e-9..=0.1).contains(&tolerance) {
            return Err(ReduceError::Option {
                what: "tolerance of the norm",
                value: tolerance,
                allowed: "1e-9 to 0.1",
            });
        }
        let fast = PoleResidue::new(system)?;
        if fast.poles().iter().any(|pole| pole.re >= 0.0) {
            return Err(ReduceError::Unstable);
        }
        let gain = |omega: f64| largest_singular_value(&(fast.at(c64::new(0.0, omega)) + real(&system.d)));
        let (mut omega, mut norm) = grid_peak(fast.poles(), &gain);
        let at_infinity = largest_singular_value(&real(&system.d));
        if at_infinity > norm {
            (omega, norm) = (f64::INFINITY, at_infinity);
        }
        for iterations in 1..=MAX_ITERATIONS {
            if norm == 0.0 {
                return Ok(Self { norm, omega: 0.0, iterations: 0 });
            }
            let crossings = imaginary_eigenvalues(system, norm * (1.0 + 2.0 * tolerance))?;
            let between = crossings.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
            let best = between.map(|omega| (gain(omega), omega)).max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((higher, at)) if higher > norm => (omega, norm) = (at, higher),
                // No crossing raises the bound by more than rounding.
                _ => return Self { norm, omega, iterations }.confirmed(system, &fast, tolerance),
            }
        }
        Err(ReduceError::Eigenvalues { order: 2 * system.order() })
    }
}

impl HInf {
    /// Checks the norm against a dense factorisation at its frequency: the pole-residue form loses accuracy for critically damped modes.
    fn confirmed(self, system: &StateSpace, fast: &PoleResidue, tolerance: f64) -> Result<Self, ReduceError> {
        if self.omega.is_infinite() {
            return Ok(self);
        }
        let s = c64::new(0.0, self.omega);
        let exact = largest_singular_value(&(&system.proper_response(&[s])[0] + real(&system.d)));
        // The gain of a difference of nearly equal systems is dominated by rounding of the terms that cancel.
        let rounding = 1e-10 * (fast.sum_of_norms(s) + largest_singular_value(&real(&system.d)));
        if (exact - self.norm).abs() <= tolerance * self.norm + rounding {
            Ok(Self { norm: exact, ..self })
        } else {
            Err(ReduceError::Eigenvalues { order: system.order() })
        }
    }
}

impl StateSpace {
    /// The difference `self` − `other`, the error system of a reduction. Both must have the same inputs.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when the numbers of inputs differ.
    pub fn minus(&self, other: &Self) -> Result<Self, ReduceError> {
        let m = self.b.ncols();
        if other.b.ncols() != m {
            let (what, value) = ("number of inputs of the system to be subtracted", other.b.ncols() as f64);
            return Err(ReduceError::Option { what, value, allowed: "that of the other system" });
        }
        let (n, r) = (self.order(), other.order());
        Ok(Self {
            a: Mat::from_fn(n + r, n + r, |i, j| match (i < n, j < n) {
                (true, true) => self.a[(i, j)],
                (false, false) => other.a[(i - n, j - n)],
                _ => 0.0,
            }),
            b: Mat::from_fn(n + r, m, |i, j| if i < n { self.b[(i, j)] } else { other.b[(i - n, j)] }),
            c: Mat::from_fn(m, n + r, |i, j| if j < n { self.c[(i, j)] } else { -other.c[(i, j - n)] }),
            d: &self.d - &other.d,
            e: &self.e - &other.e,
        })
    }
}

pub(crate) fn real(m: &Mat<f64>) -> Mat<c64> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0))
}

/// The largest singular value of a small matrix; zero for one that is not finite.
pub(crate) fn largest_singular_value(m: &Mat<c64>) -> f64 {
    m.singular_values().ok().and_then(|s| s.first().copied()).unwrap_or(0.0)
}

/// The peak of the gain on a grid of frequencies, refined by golden-section search: (ω, gain). The grid has zero, the absolute value and the
/// imaginary part of every pole, and a decade beyond them on either side.
fn grid_peak(poles: &[c64], gain: &impl Fn(f64) -> f64) -> (f64, f64) {
    let mut grid: Vec<f64> = poles.iter().flat_map(|p| [p.norm(), p.im.abs()]).collect();
    let fastest = grid.iter().copied().fold(0.0, f64::max);
    let slowest = poles.iter().map(|p| p.norm()).fold(f64::INFINITY, f64::min);
    grid.extend([0.0, 0.1 * slowest, 10.0 * fastest]);
    grid.extend((0..=200).map(|i| slowest * (fastest / slowest).powf(f64::from(i) / 200.0)));
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    let gains: Vec<f64> = grid.iter().map(|&omega| gain(omega)).collect();
    let peak = (0..grid.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b])).unwrap_or(0);
    let (mut low, mut high) = (grid[peak.saturating_sub(1)], grid[(peak + 1).min(grid.len() - 1)]);
    let mut best = (grid[peak], gains[peak]);
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..60 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        let (gain_a, gain_b) = (gain(a), gain(b));
        for (omega, gain) in [(a, gain_a), (b, gain_b)] {
            if gain > best.1 {
                best = (omega, gain);
            }
        }
        if gain_a < gain_b { low = a } else { high = b }
    }
    best
}

/// The nonnegative frequencies at which H(γ) has an imaginary eigenvalue, ascending, preceded by the mirror image of the first.
fn imaginary_eigenvalues(system: &StateSpace, gamma: f64) -> Result<Vec<f64>, ReduceError> {
    let h = hamiltonian(system, gamma);
    let order = h.nrows();
    let eigenvalues = h.eigenvalues().map_err(|_| ReduceError::Eigenvalues { order })?;
    let largest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
    let mut crossings: Vec<f64> = eigenvalues
        .iter()
        .filter(|l| l.re.abs() < 1e-10 * largest + 1e-8 * l.norm())
        .map(|l| l.im)
        .filter(|&omega| omega >= 0.0)
        .collect();
    crossings.sort_by(f64::total_cmp);
    // The gain is even in ω: the interval around zero is bounded by the first crossing and its mirror image.
    if !crossings.is_empty() {
        crossings.insert(0, -crossings[0]);
    }
    Ok(crossings)
}

fn hamiltonian(system: &StateSpace, gamma: f64) -> Mat<f64> {
    let (n, m) = (system.order(), system.b.ncols());
    let (a, b, c, d) = (&system.a, &system.b, &system.c, &system.d);
    let square = |product: Mat<f64>| {
        Mat::from_fn(m, m, |i, j| if i == j { gamma * gamma } else { 0.0 } - product[(i, j)])
    };
    let (r, s) = (square(d.transpose() * d), square(d * d.transpose()));
    let solve = |matrix: &Mat<f64>, rhs: MatRef<'_, f64>| matrix.partial_piv_lu().solve(rhs);
    let f = a + b * solve(&r, (d.transpose() * c).as_ref());
    let upper = b * solve(&r, b.transpose());
    let lower = c.transpose() * solve(&s, c.as_ref());
    Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (true, true) => f[(i, j)],
        (true, false) => gamma * upper[(i, j - n)],
        (false, true) => -gamma * lower[(i - n, j)],
        (false, false) => -f[(j - n, i - n)],
    })
}
