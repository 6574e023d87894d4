//! Eigenvalues and inverses of small symmetric matrices by Jacobi rotations: sums, products and roots in a fixed
//! order.

use nalgebra::{SMatrix, SVector};

/// Maximum number of sweeps: convergence is quadratic, and six usually suffice.
const SWEEPS: usize = 12;

/// Eigenvalues, and the eigenvectors as columns, in unspecified order.
pub(crate) fn symmetric<const N: usize>(of: &SMatrix<f64, N, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let (mut a, mut vectors) = (*of, SMatrix::<f64, N, N>::identity());
    for _ in 0..SWEEPS {
        let mut rest = 0.0;
        for p in 0..N {
            for q in p + 1..N {
                let off = a[(p, q)];
                rest += off.abs();
                if off == 0.0 {
                    continue;
                }
                let theta = 0.5 * (a[(q, q)] - a[(p, p)]) / off;
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..N {
                    let (x, y) = (a[(k, p)], a[(k, q)]);
                    (a[(k, p)], a[(k, q)]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..N {
                    let (x, y) = (a[(p, k)], a[(q, k)]);
                    (a[(p, k)], a[(q, k)]) = (c * x - s * y, s * x + c * y);
                    let (x, y) = (vectors[(k, p)], vectors[(k, q)]);
                    (vectors[(k, p)], vectors[(k, q)]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
        if rest == 0.0 {
            break;
        }
    }
    (a.diagonal(), vectors)
}

/// `V diag(values) Vᵀ`.
pub(crate) fn composed<const N: usize>(
    values: &SVector<f64, N>,
    vectors: &SMatrix<f64, N, N>,
) -> SMatrix<f64, N, N> {
    SMatrix::from_fn(|i, j| {
        let mut sum = 0.0;
        for k in 0..N {
            sum += vectors[(i, k)] * values[k] * vectors[(j, k)];
        }
        sum
    })
}

/// Solution of `a x = b` for a symmetric positive definite `a`; `None` if it is not positive definite.
pub(crate) fn solved<const N: usize>(a: &SMatrix<f64, N, N>, b: &SVector<f64, N>) -> Option<SVector<f64, N>> {
    let (mut a, mut x) = (*a, *b);
    for k in 0..N {
        let pivot = a[(k, k)];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        for i in k + 1..N {
            let times = a[(i, k)] / pivot;
            for j in k..N {
                a[(i, j)] -= times * a[(k, j)];
            }
            x[i] -= times * x[k];
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            x[k] -= a[(k, j)] * x[j];
        }
        x[k] /= a[(k, k)];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}
