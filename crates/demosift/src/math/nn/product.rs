//! Products of dense matrices: the one place that calls `gemm`, with every length checked before.

use crate::math::nn::Real;
use gemm::Parallelism;

/// A row-major matrix, or the transpose of one.
#[derive(Clone, Copy)]
pub(crate) struct Matrix<'a, T> {
    values: &'a [T],
    rows: usize,
    columns: usize,
    transposed: bool,
}

impl<'a, T: Real> Matrix<'a, T> {
    /// The matrix `[rows, columns]` over flat row-major values.
    pub(crate) fn new(values: &'a [T], rows: usize, columns: usize) -> Self {
        assert_eq!(values.len(), rows * columns, "numbers in a {rows} by {columns} matrix");
        Self { values, rows, columns, transposed: false }
    }

    /// Rows and columns exchanged; nothing moves.
    pub(crate) fn transposed(self) -> Self {
        Self { rows: self.columns, columns: self.rows, transposed: !self.transposed, ..self }
    }

    /// Steps between neighboring rows and columns in the flat values.
    fn strides(&self) -> (isize, isize) {
        if self.transposed { (1, self.rows as isize) } else { (self.columns as isize, 1) }
    }
}

/// What happens to the numbers that the target of a product holds.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    /// They are replaced.
    Overwrite,
    /// The product is added to them.
    Add,
}

/// `out = left · right`, or `out += left · right`; `out` is row-major `[left rows, right columns]`.
#[expect(unsafe_code, reason = "gemm takes pointers; all lengths are asserted here and in Matrix::new")]
pub(crate) fn product<T: Real>(left: Matrix<'_, T>, right: Matrix<'_, T>, out: &mut [T], target: Target) {
    assert_eq!(left.columns, right.rows, "inner sizes of a product");
    assert_eq!(out.len(), left.rows * right.columns, "numbers in the target of a product");
    let (left_row, left_column) = left.strides();
    let (right_row, right_column) = right.strides();
    // SAFETY: `Matrix` can only be made with as many values as rows × columns, and its strides visit each of them
    // once, so every element that gemm reads lies in `left.values` or `right.values`. `out` has left.rows ×
    // right.columns elements, visited once by strides (right.columns, 1), and being `&mut` overlaps neither.
    // `Real` is sealed to f32 and f64, both of which gemm supports.
    unsafe {
        gemm::gemm(
            left.rows,
            right.columns,
            left.columns,
            out.as_mut_ptr(),
            1,
            right.columns as isize,
            target == Target::Add,
            left.values.as_ptr(),
            left_column,
            left_row,
            right.values.as_ptr(),
            right_column,
            right_row,
            T::ONE,
            T::ONE,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use rand::Rng as _;

    fn random(len: usize, name: &str) -> Vec<f64> {
        let mut rng = Seed::new(3).of(name).into_rng();
        (0..len).map(|_| f64::from(rng.next_u32()) / f64::from(u32::MAX) - 0.5).collect()
    }

    /// The definition of the product, element by element.
    fn plain(left: &[f64], right: &[f64], [m, k, n]: [usize; 3]) -> Vec<f64> {
        let mut out = vec![0.0; m * n];
        for (row, column, inner) in indices(m, n, k) {
            out[row * n + column] += left[row * k + inner] * right[inner * n + column];
        }
        out
    }

    fn indices(m: usize, n: usize, k: usize) -> impl Iterator<Item = (usize, usize, usize)> {
        (0..m)
            .flat_map(move |row| (0..n).flat_map(move |column| (0..k).map(move |inner| (row, column, inner))))
    }

    fn transpose(values: &[f64], rows: usize, columns: usize) -> Vec<f64> {
        (0..rows * columns).map(|at| values[(at % rows) * columns + at / rows]).collect()
    }

    #[test]
    fn equals_the_definition_in_all_four_layouts() {
        for sizes @ [m, k, n] in [[1, 1, 1], [1, 55, 64], [7, 3, 21], [250, 64, 21], [33, 250, 5], [2, 9, 1]]
        {
            let (left, right) = (random(m * k, "left"), random(k * n, "right"));
            let wanted = plain(&left, &right, sizes);
            let (left_t, right_t) = (transpose(&left, m, k), transpose(&right, k, n));
            for left in [Matrix::new(&left, m, k), Matrix::new(&left_t, k, m).transposed()] {
                for right in [Matrix::new(&right, k, n), Matrix::new(&right_t, n, k).transposed()] {
                    let mut out = vec![f64::NAN; m * n];
                    product(left, right, &mut out, Target::Overwrite);
                    product(left, right, &mut out, Target::Add);
                    for (found, wanted) in out.iter().zip(&wanted) {
                        assert!((found - 2.0 * wanted).abs() < 1e-12, "{sizes:?}: {found} {wanted}");
                    }
                }
            }
        }
    }
}
