//! Products of dense matrices: the one place that calls `gemm`, with every length checked before.
//!
//! `gemm` adds up a number of the product in the order of the inner index, by fused multiplication, so that its bits depend on
//! no instruction set, but for two cases: where both operands lie along the inner index and the product is small or a vector,
//! it adds up as many terms side by side as the processor has lanes; and an inner size above 512 it splits by the size of the
//! cache.

use crate::math::arithmetic;
use crate::math::nn::Real;
use crate::math::nn::elementwise::{sum_of, vectorized};
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
pub(crate) fn product<T: Real>(left: Matrix<'_, T>, right: Matrix<'_, T>, out: &mut [T], target: Target) {
    assert_eq!(left.columns, right.rows, "inner sizes of a product");
    assert_eq!(out.len(), left.rows * right.columns, "numbers in the target of a product");
    if arithmetic::is_portable() {
        portably(left, right, out, target);
    } else {
        by_gemm(left, right, out, target, left.columns);
    }
}

/// The largest inner size that `gemm` never splits.
const UNSPLIT: usize = 512;

/// Of products with at most so many numbers `gemm` may add up the terms in lanes.
const SMALL: usize = 16 * 16;

/// The same bits whatever the processor has.
fn portably<T: Real>(left: Matrix<'_, T>, right: Matrix<'_, T>, out: &mut [T], target: Target) {
    let is_small = left.rows == 1 || right.columns == 1 || left.rows * right.columns <= SMALL;
    let are_along_inner = left.strides().1 == 1 && right.strides().0 == 1;
    if is_small && are_along_inner {
        by_dots(left, right, out, target);
    } else {
        by_gemm(left, right, out, target, UNSPLIT);
    }
}

/// Each number of the product as a sum in lanes, of which there are as many everywhere; both operands lie along the inner index.
fn by_dots<T: Real>(left: Matrix<'_, T>, right: Matrix<'_, T>, out: &mut [T], target: Target) {
    let (inner, columns) = (left.columns, right.columns);
    vectorized(
        #[inline(always)]
        || {
            for (place, out) in out.iter_mut().enumerate() {
                let a = &left.values[place / columns * inner..][..inner];
                let b = &right.values[place % columns * inner..][..inner];
                let sum = sum_of(
                    inner,
                    #[inline(always)]
                    |i| a[i] * b[i],
                );
                *out = if target == Target::Add { *out + sum } else { sum };
            }
        },
    );
}

/// By `gemm`, at most so many terms of each number at a time.
#[expect(
    unsafe_code,
    reason = "gemm takes pointers; all lengths are asserted by `product` and in Matrix::new"
)]
fn by_gemm<T: Real>(
    left: Matrix<'_, T>,
    right: Matrix<'_, T>,
    out: &mut [T],
    target: Target,
    at_a_time: usize,
) {
    let (left_row, left_column) = left.strides();
    let (right_row, right_column) = right.strides();
    let (inner, at_a_time) = (left.columns, at_a_time.max(1));
    // Of nothing the sum is 0, which has to be written too.
    for start in (0..inner.max(1)).step_by(at_a_time) {
        let terms = at_a_time.min(inner - start);
        // SAFETY: `Matrix` can only be made with as many values as rows × columns, and its strides visit each of them once, so
        // every element that gemm reads, from inner index `start` on and `terms` of them, lies in `left.values` or
        // `right.values`. `out` has left.rows × right.columns elements, visited once by strides (right.columns, 1), and being
        // `&mut` overlaps neither. `Real` is sealed to f32 and f64, both of which gemm supports.
        unsafe {
            gemm::gemm(
                left.rows,
                right.columns,
                terms,
                out.as_mut_ptr(),
                1,
                right.columns as isize,
                target == Target::Add || start > 0,
                left.values.as_ptr().offset(start as isize * left_column),
                left_column,
                left_row,
                right.values.as_ptr().offset(start as isize * right_row),
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

    /// Term by term, and of more than two by fused multiplication: those of a vector onto what is there, those of a matrix at most
    /// [`UNSPLIT`] at a time.
    fn in_order(left: &[f32], right: &[f32], [m, k, n]: [usize; 3]) -> Vec<f32> {
        let number = |row: usize, column: usize| {
            let of = |sum: f32, i: usize| left[row * k + i].mul_add(right[i * n + column], sum);
            if k <= 2 {
                return (0..k).map(|i| left[row * k + i] * right[i * n + column]).sum();
            }
            if m == 1 || n == 1 {
                return (0..k).fold(0.0, of);
            }
            let splits = (0..k).step_by(UNSPLIT).map(|start| start..k.min(start + UNSPLIT));
            splits.map(|terms| terms.fold(0.0, of)).fold(0.0, |sum, of_split| sum + of_split)
        };
        (0..m * n).map(|place| number(place / n, place % n)).collect()
    }

    /// In eight lanes, whose sums are added up in their order, and then what is left.
    fn in_lanes(left: &[f32], right: &[f32], [m, k, n]: [usize; 3]) -> Vec<f32> {
        let number = |row: usize, column: usize| {
            let term = |i: usize| left[row * k + i] * right[i * n + column];
            let whole = k / 8 * 8;
            let lane = |lane: usize| (lane..whole).step_by(8).map(term).fold(0.0, |sum, term| sum + term);
            let lanes: f32 = (0..8).map(lane).sum();
            lanes + (whole..k).map(term).sum::<f32>()
        };
        (0..m * n).map(|place| number(place / n, place % n)).collect()
    }

    /// The bits of portable products are those of a definition that knows of no processor, in every layout.
    #[test]
    fn portable_products_are_the_same_bits_everywhere() {
        let numbers = |len, name| random(len, name).into_iter().map(|x| x as f32).collect::<Vec<f32>>();
        let turned = |values: &[f32], rows: usize, columns: usize| -> Vec<f32> {
            (0..rows * columns).map(|at| values[(at % rows) * columns + at / rows]).collect()
        };
        let sizes = [
            [250, 100, 1],
            [1, 55, 64],
            [1, 64, 1],
            [20, 183, 64],
            [250, 64, 21],
            [4, 64, 30],
            [3, 9, 5],
            [64, 250, 64],
            [2, 1300, 3],
            [40, 1300, 30],
            [1, 700, 9],
            [9, 700, 1],
            [250, 1, 100],
            [30, 2, 30],
            [100, 250, 1],
        ];
        for sizes @ [m, k, n] in sizes {
            let (left, right) = (numbers(m * k, "left"), numbers(k * n, "right"));
            let (left_t, right_t) = (turned(&left, m, k), turned(&right, k, n));
            for left_is_turned in [false, true] {
                for right_is_turned in [false, true] {
                    let of_left = if left_is_turned {
                        Matrix::new(&left_t, k, m).transposed()
                    } else {
                        Matrix::new(&left, m, k)
                    };
                    let of_right = if right_is_turned {
                        Matrix::new(&right_t, n, k).transposed()
                    } else {
                        Matrix::new(&right, k, n)
                    };
                    let mut out = vec![f32::NAN; m * n];
                    portably(of_left, of_right, &mut out, Target::Overwrite);
                    let along = (!left_is_turned || m == 1) && (right_is_turned || n == 1);
                    let small = m == 1 || n == 1 || m * n <= 256;
                    let wanted = if along && small {
                        in_lanes(&left, &right, sizes)
                    } else {
                        in_order(&left, &right, sizes)
                    };
                    assert!(out == wanted, "{sizes:?} {left_is_turned} {right_is_turned}");
                }
            }
        }
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
