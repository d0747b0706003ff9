//! Matrix products in single precision on one thread, with the widest vectors of the processor.

use gemm::{Parallelism, gemm};
use ndarray::{Array2, ArrayBase, Axis, Data, DataMut, Ix2};

/// Products that are summed in a row before they are added to what is there: longer sums round more, and shorter ones take longer.
const DEPTH: usize = 256;

/// Returns `a b`, in any layout of both.
///
/// The crate `gemm` takes a tenth less of the time in which a fit finds its bases than ndarray's product (docs/results/results.md).
///
/// # Panics
/// If `a` has another number of columns than `b` has rows.
pub fn product<A, B>(a: &ArrayBase<A, Ix2>, b: &ArrayBase<B, Ix2>) -> Array2<f32>
where
    A: Data<Elem = f32>,
    B: Data<Elem = f32>,
{
    let mut c = Array2::zeros((a.nrows(), b.ncols()));
    add_product(a, b, &mut c);
    c
}

/// Adds `a b` to `c`.
///
/// # Panics
/// If the sizes do not fit each other.
#[allow(
    unsafe_code,
    reason = "gemm takes pointers and strides; those of ndarray's arrays are of memory that they own or borrow"
)]
pub fn add_product<A, B, C>(a: &ArrayBase<A, Ix2>, b: &ArrayBase<B, Ix2>, c: &mut ArrayBase<C, Ix2>)
where
    A: Data<Elem = f32>,
    B: Data<Elem = f32>,
    C: DataMut<Elem = f32>,
{
    let ([m, k], [of_b, n]) = ([a.nrows(), a.ncols()], [b.nrows(), b.ncols()]);
    assert_eq!(k, of_b, "columns of a, rows of b");
    assert_eq!([m, n], [c.nrows(), c.ncols()], "rows of a and columns of b, size of c");
    if m == 0 || n == 0 {
        return;
    }
    let mut c = c.view_mut();
    for (a, b) in a.axis_chunks_iter(Axis(1), DEPTH).zip(b.axis_chunks_iter(Axis(0), DEPTH)) {
        let strides = |strides: &[isize]| (strides[0], strides[1]);
        let ((a_row, a_column), (b_row, b_column)) = (strides(a.strides()), strides(b.strides()));
        let (c_row, c_column) = strides(c.strides());
        let (to, left, right) = (c.as_mut_ptr(), a.as_ptr(), b.as_ptr());
        let (depth, none) = (a.ncols(), Parallelism::None);
        // SAFETY: the pointers and strides are those of arrays of m x depth, depth x n and m x n numbers, and `c` is borrowed alone.
        unsafe {
            gemm(
                m, n, depth, to, c_column, c_row, true, left, a_column, a_row, right, b_column, b_row, 1.0, 1.0, false,
                false, false, none,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::s;

    fn matrix(rows: usize, columns: usize, seed: usize) -> Array2<f32> {
        Array2::from_shape_fn((rows, columns), |(i, j)| ((i * 37 + j * 101 + seed * 13) % 199) as f32 / 199.0 - 0.4)
    }

    fn is_near(a: &Array2<f32>, b: &Array2<f32>) -> bool {
        a.dim() == b.dim() && a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-4)
    }

    #[test]
    fn products_are_ndarrays_in_every_layout_and_size() {
        for (m, k, n) in [(1, 1, 1), (3, 700, 5), (67, 33, 129), (130, 257, 64), (5, 0, 4), (0, 3, 2)] {
            let (a, b) = (matrix(m, k, 1), matrix(k, n, 2));
            let expected = a.dot(&b);
            assert!(is_near(&product(&a, &b), &expected), "{m} {k} {n}");
            // Columns beside each other, and every other one of a larger array from the last row to the first.
            let by_columns = a.t().as_standard_layout().into_owned();
            assert!(is_near(&product(&by_columns.t(), &b), &expected), "{m} {k} {n}");
            let mut larger = Array2::<f32>::from_elem((m, 2 * k), 9.0);
            larger.slice_mut(s![..;-1, ..;2]).assign(&a);
            assert!(is_near(&product(&larger.slice(s![..;-1, ..;2]), &b), &expected), "{m} {k} {n}");
            // The same of the right factor, and one row for all.
            let by_columns = b.t().as_standard_layout().into_owned();
            assert!(is_near(&product(&a, &by_columns.t()), &expected), "{m} {k} {n}");
            let mut larger = Array2::<f32>::from_elem((2 * k, n), 9.0);
            larger.slice_mut(s![..;2, ..;-1]).assign(&b);
            assert!(is_near(&product(&a, &larger.slice(s![..;2, ..;-1])), &expected), "{m} {k} {n}");
            let row = matrix(1, n, 3);
            let repeated = row.broadcast((k, n)).unwrap();
            assert!(is_near(&product(&a, &repeated), &a.dot(&repeated)), "{m} {k} {n}");
            // Added to a part of a larger array, of which nothing else changes.
            let mut sums = Array2::<f32>::from_elem((n, 3 * m), 7.0);
            add_product(&a, &b, &mut sums.slice_mut(s![.., ..;3]).reversed_axes());
            assert!(is_near(&sums.slice(s![.., ..;3]).t().to_owned(), &(7.0 + &expected)), "{m} {k} {n}");
            assert!(sums.iter().filter(|x| **x == 7.0).count() >= 2 * m * n);
        }
        // What is planted is seen.
        let (a, b) = (matrix(67, 33, 1), matrix(33, 129, 2));
        let mut wrong = b.clone();
        wrong[[32, 128]] += 0.01;
        assert!(!is_near(&product(&a, &wrong), &a.dot(&b)));
    }

    #[test]
    #[should_panic(expected = "columns of a")]
    fn sizes_that_do_not_fit_are_refused() {
        let _ = product(&matrix(3, 4, 1), &matrix(5, 2, 1));
    }
}
