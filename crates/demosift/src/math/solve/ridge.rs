//! Ridge regression by the normal equations in f64.

use crate::basics::error::{Error, Result};
use crate::math::nn::product::{Matrix, Target, product};
use crate::math::rows::Rows;

/// How often the ridge is made ten times larger before giving up (a habit of cbfinn/maml_rl).
const ATTEMPTS: usize = 10;

/// The least pivot of the factorization, as a share of its diagonal element, that keeps four digits of the solution.
const SAFE_PIVOT: f64 = 1e-12;

/// Rows that are widened to f64 at a time, so that they stay in the cache.
const BLOCK: usize = 250;

/// The weights w `[width]` that solve (XᵀX + λI) w = Xᵀy for features X `[len, width]` and targets y `[len]`.
///
/// λ is `ridge`; where the matrix is too close to singular it is made ten times larger, at most ten times.
/// Columns may be constant or alike.
///
/// # Errors
/// Bad configuration if `ridge` is not a positive number; divergence if no λ helps, as when a feature is not finite.
///
/// # Panics
/// If there are not as many targets as rows: a bug of the caller.
pub fn ridge(features: &Rows, targets: &[f32], ridge: f64) -> Result<Vec<f64>> {
    let targets = Rows::from_flat(targets.to_vec(), 1)?;
    Ok(ridge_columns(features, &targets, ridge)?.remove(0))
}

/// The same for targets of several columns `[len, columns]`: the weights of each, `[columns][width]`.
///
/// # Errors
/// As [`ridge`]; λ is the same for all columns.
///
/// # Panics
/// If there are not as many rows of targets as of features: a bug of the caller.
pub(crate) fn ridge_columns(features: &Rows, targets: &Rows, ridge: f64) -> Result<Vec<Vec<f64>>> {
    assert_eq!(features.len(), targets.len(), "a target for each row");
    if !(ridge > 0.0 && ridge.is_finite()) {
        return Err(Error::bad_config(format!("the ridge must be a positive number, got {ridge}")));
    }
    NormalEquations::of(features, targets).weights(ridge)
}

/// What a linear regression knows of its rows: XᵀX and XᵀY. It can be added up over tables, and a table taken out again.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    rows: usize,
    /// XᵀX, `[width, width]`.
    gram: Vec<f64>,
    /// XᵀY, `[width, columns]`.
    moments: Vec<f64>,
    columns: usize,
}

impl NormalEquations {
    /// Of no rows at all, with so many features and columns of targets.
    pub(crate) fn empty(width: usize, columns: usize) -> Self {
        Self { rows: 0, gram: vec![0.0; width * width], moments: vec![0.0; width * columns], columns }
    }

    /// Of features `[len, width]` and targets `[len, columns]`.
    pub(crate) fn of(features: &Rows, targets: &Rows) -> Self {
        let mut equations = Self::empty(features.width(), targets.width());
        equations.add_rows(features, targets);
        equations
    }

    /// How many rows there are.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Adds further rows.
    pub(crate) fn add_rows(&mut self, features: &Rows, targets: &Rows) {
        let (width, columns) = (features.width(), targets.width());
        let (mut x, mut y) = (Vec::new(), Vec::new());
        let blocks =
            features.flat().chunks(BLOCK * width.max(1)).zip(targets.flat().chunks(BLOCK * columns.max(1)));
        for (features, targets) in blocks {
            x.clear();
            x.extend(features.iter().map(|value| f64::from(*value)));
            y.clear();
            y.extend(targets.iter().map(|value| f64::from(*value)));
            let len = y.len() / columns;
            let rows = Matrix::new(&x, len, width);
            product(rows.transposed(), rows, &mut self.gram, Target::Add);
            product(rows.transposed(), Matrix::new(&y, len, columns), &mut self.moments, Target::Add);
        }
        self.rows += features.len();
    }

    /// Adds the rows of another, which has as many features and columns.
    pub(crate) fn add(&mut self, other: &Self) {
        self.rows += other.rows;
        self.gram.iter_mut().zip(&other.gram).for_each(|(sum, value)| *sum += value);
        self.moments.iter_mut().zip(&other.moments).for_each(|(sum, value)| *sum += value);
    }

    /// What is left when the rows of another are taken out, which are among these.
    pub(crate) fn without(&self, other: &Self) -> Self {
        let less = |all: &[f64], part: &[f64]| all.iter().zip(part).map(|(all, part)| all - part).collect();
        Self {
            rows: self.rows - other.rows,
            gram: less(&self.gram, &other.gram),
            moments: less(&self.moments, &other.moments),
            columns: self.columns,
        }
    }

    /// The weights of each column, `[columns][width]`, as [`ridge`] finds them.
    ///
    /// # Errors
    /// Divergence if no λ helps.
    pub(crate) fn weights(&self, ridge: f64) -> Result<Vec<Vec<f64>>> {
        let width = self.moments.len() / self.columns.max(1);
        let column =
            |column: usize| self.moments.iter().skip(column).step_by(self.columns).copied().collect();
        let moments: Vec<Vec<f64>> = (0..self.columns).map(column).collect();
        let mut lambda = ridge;
        for _ in 0..=ATTEMPTS {
            let factor = factor(self.gram.clone(), width, lambda);
            let columns = moments.iter().map(|moments| substituted(factor.as_ref()?, moments));
            if let Some(weights) = columns.collect() {
                return Ok(weights);
            }
            lambda *= 10.0;
        }
        Err(Error::diverged(format!(
            "the linear regression on {} rows of {width} features has no finite solution, even with a ridge of {lambda:e}",
            self.rows
        )))
    }
}

/// L with L Lᵀ = gram + λI by Cholesky's factorization; `None` where that is not safely positive definite.
fn factor(mut gram: Vec<f64>, width: usize, lambda: f64) -> Option<Vec<f64>> {
    (0..width).for_each(|i| gram[i * width + i] += lambda);
    factorize(&mut gram, width)?;
    Some(gram)
}

/// (L Lᵀ)⁻¹ moments; `None` where that is not finite.
fn substituted(factor: &[f64], moments: &[f64]) -> Option<Vec<f64>> {
    let width = moments.len();
    let mut weights = moments.to_vec();
    for i in 0..width {
        let known: f64 = (0..i).map(|k| factor[i * width + k] * weights[k]).sum();
        weights[i] = (weights[i] - known) / factor[i * width + i];
    }
    for i in (0..width).rev() {
        let known: f64 = (i + 1..width).map(|k| factor[k * width + i] * weights[k]).sum();
        weights[i] = (weights[i] - known) / factor[i * width + i];
    }
    weights.iter().all(|weight| weight.is_finite()).then_some(weights)
}

/// L with L Lᵀ = matrix, into the lower triangle.
fn factorize(matrix: &mut [f64], width: usize) -> Option<()> {
    for i in 0..width {
        let (above, rest) = matrix.split_at_mut(i * width);
        let row = &mut rest[..width];
        for j in 0..i {
            let known: f64 = above[j * width..j * width + j].iter().zip(&row[..j]).map(|(a, b)| a * b).sum();
            row[j] = (row[j] - known) / above[j * width + j];
        }
        let pivot = row[i] - row[..i].iter().map(|value| value * value).sum::<f64>();
        // So near zero, beside its diagonal element, a pivot is mostly rounding; NaN fails the comparison too.
        let noise = SAFE_PIVOT * row[i];
        if !(pivot > noise && pivot.is_finite()) {
            return None;
        }
        row[i] = pivot.sqrt();
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use rand::Rng as _;

    fn random(len: usize, name: &str) -> Vec<f32> {
        let mut rng = Seed::new(9).of(name).into_rng();
        (0..len).map(|_| rng.next_u32() as f32 / 2f32.powi(32) - 0.5).collect()
    }

    /// The largest element of Xᵀ(y − X w) − λ w, which is zero at the solution.
    fn residual(features: &Rows, targets: &[f32], weights: &[f64], lambda: f64) -> f64 {
        let mut sums: Vec<f64> = weights.iter().map(|weight| -lambda * weight).collect();
        for (row, y) in features.iter().zip(targets) {
            let guess: f64 = row.iter().zip(weights).map(|(x, w)| f64::from(*x) * w).sum();
            let error = f64::from(*y) - guess;
            sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += f64::from(*x) * error);
        }
        sums.into_iter().map(f64::abs).fold(0.0, f64::max)
    }

    #[test]
    fn several_columns_are_each_column_by_itself() {
        let features = Rows::from_flat(random(700 * 9, "features"), 9).unwrap();
        let targets = Rows::from_flat(random(700 * 3, "targets"), 3).unwrap();
        let together = ridge_columns(&features, &targets, 0.1).unwrap();
        for (column, together) in together.iter().enumerate() {
            let alone: Vec<f32> = targets.iter().map(|row| row[column]).collect();
            let alone = ridge(&features, &alone, 0.1).unwrap();
            assert!(alone.iter().zip(together).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn residual_of_the_normal_equations_vanishes() {
        let features = Rows::from_flat(random(2000 * 115, "features"), 115).unwrap();
        let targets = random(2000, "targets");
        for lambda in [1e-5, 1.0] {
            let weights = ridge(&features, &targets, lambda).unwrap();
            assert!(residual(&features, &targets, &weights, lambda) < 1e-9);
        }
    }

    #[test]
    fn finds_planted_weights_and_spares_constant_columns() {
        let mut values = Vec::new();
        let random = random(600, "x");
        random.chunks_exact(2).for_each(|x| values.extend([x[0], 0.0, x[1], 1.0, 0.0]));
        let features = Rows::from_flat(values, 5).unwrap();
        let targets: Vec<f32> = features.iter().map(|row| 2.0 * row[0] - row[2] + 0.5).collect();
        let weights = ridge(&features, &targets, 1e-8).unwrap();
        for (found, planted) in weights.iter().zip([2.0, 0.0, -1.0, 0.5, 0.0]) {
            assert!((found - planted).abs() < 1e-6, "{weights:?}");
        }
    }

    #[test]
    fn columns_that_are_alike_get_a_larger_ridge() {
        let features: Vec<f32> = random(300, "x").iter().flat_map(|x| [1e4 * x, 1e4 * x]).collect();
        let features = Rows::from_flat(features, 2).unwrap();
        let targets: Vec<f32> = features.iter().map(|row| row[0] * 4e-4).collect();
        let weights = ridge(&features, &targets, 1e-6).unwrap();
        assert!((weights[0] - 2e-4).abs() < 1e-7 && (weights[1] - 2e-4).abs() < 1e-7, "{weights:?}");
    }

    #[test]
    fn says_what_is_wrong() {
        let features = Rows::from_flat(vec![1.0, f32::NAN], 1).unwrap();
        assert!(ridge(&features, &[1.0, 2.0], 1e-5).unwrap_err().is_diverged());
        for lambda in [0.0, -1.0, f64::NAN] {
            assert!(ridge(&features, &[1.0, 2.0], lambda).unwrap_err().is_bad_config());
        }
    }
}
