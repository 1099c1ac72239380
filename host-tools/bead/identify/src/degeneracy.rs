//! Quantities that data can tell apart, and those that must be held.
//!
//! # Design
//! The eigenvalues of the information matrix, for logarithms of the quantities, are the squares of the
//! singular values of the whitened Jacobian. The least one belongs to the combination that is known worst.
//! While its standard error exceeds [`WORST`], one of its quantities is held: the one that a balance or a
//! certificate knows best.

use nalgebra::SymmetricEigen;

use crate::fit::part;
use crate::normal::Normal;
use crate::quantity::Quantity;

/// Greatest standard error of a combination of quantities, as a part.
pub const WORST: f64 = 0.1;
/// Least part of a quantity in a combination for it to count.
const COUNTS: f64 = 0.15;

/// A quantity that is held because the data cannot tell it from others.
#[derive(Debug, Clone, PartialEq)]
pub struct Degenerate {
    /// The quantity that is held.
    pub held: Quantity,
    /// All quantities that cannot be told apart, including the held one.
    pub together: Vec<Quantity>,
    /// Standard error of their combination, as a part; infinite if the data do not determine it.
    pub error: f64,
}

/// Singular values of the whitened Jacobian of these quantities, descending.
pub fn singular_values(normal: &Normal, of: &[Quantity]) -> Vec<f64> {
    let (information, _) = part(normal, of);
    let mut values: Vec<f64> = SymmetricEigen::new(information)
        .eigenvalues
        .iter()
        .map(|value| value.max(0.0).sqrt())
        .collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// The quantities of `wanted` that the data can separate, and those that have to be held, in order.
pub fn separable(normal: &Normal, wanted: &[Quantity]) -> (Vec<Quantity>, Vec<Degenerate>) {
    let (mut free, mut held) = (wanted.to_vec(), Vec::new());
    while !free.is_empty() {
        let (information, _) = part(normal, &free);
        let eigen = SymmetricEigen::new(information);
        let weakest = eigen.eigenvalues.imin();
        let value = eigen.eigenvalues[weakest];
        let greatest = eigen.eigenvalues.max();
        // Below this an eigenvalue is rounding.
        let error = if value > 1e-13 * greatest {
            value.sqrt().recip()
        } else {
            f64::INFINITY
        };
        if error <= WORST {
            break;
        }
        let vector = eigen.eigenvectors.column(weakest);
        let together: Vec<Quantity> = free
            .iter()
            .zip(vector.iter())
            .filter(|(_, part)| part.abs() >= COUNTS)
            .map(|(quantity, _)| *quantity)
            .collect();
        let Some(&first) = together.iter().min_by_key(|quantity| quantity.held_before()) else {
            break;
        };
        free.retain(|quantity| *quantity != first);
        held.push(Degenerate {
            held: first,
            together,
            error,
        });
    }
    (free, held)
}
