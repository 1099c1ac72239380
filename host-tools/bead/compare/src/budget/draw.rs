//! A draw of the inputs from the distributions that a calibration states.

use bead_model::design::{Description, Uncertainty};
use bead_model::violation::SettingKey;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::budget::input::scale;

/// A bead whose parameters are drawn from the distributions that `stated` gives around those of
/// `description`. An input whose uncertainty is unknown keeps its value.
pub fn drawn_settings(description: &Description, stated: &Uncertainty, random: &mut impl Rng) -> Description {
    let root = root(stated.correlations());
    let mut drawn = *description;
    let normals: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(random));
    for (key, relative) in stated.stated() {
        // The order of `root`.
        let of_ring = match key {
            SettingKey::UStiffness => Some(0),
            SettingKey::UDamping => Some(1),
            SettingKey::UIntruderMass => Some(2),
            _ => None,
        };
        let deviation: f64 = match of_ring {
            Some(row) => (0..3).map(|i| root[row][i] * normals[i]).sum(),
            None => StandardNormal.sample(random),
        };
        if let Some(relative) = relative {
            scale(&mut drawn, key, 1.0 + relative.part() * deviation);
        }
    }
    drawn
}

/// Cholesky's root of the correlations of k, c and m.
fn root([k_c, k_m, c_m]: [f64; 3]) -> [[f64; 3]; 3] {
    let second = (1.0 - k_c * k_c).max(0.0).sqrt();
    // Where k and c are fully correlated, their correlations with m are equal up to the sign.
    let crossed = if second > 0.0 {
        (c_m - k_c * k_m) / second
    } else {
        0.0
    };
    let third = (1.0 - k_m * k_m - crossed * crossed).max(0.0).sqrt();
    [[1.0, 0.0, 0.0], [k_c, second, 0.0], [k_m, crossed, third]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_of_correlations_gives_them_back() {
        for correlations in [[0.0; 3], [0.5, -0.25, 0.5], [1.0, 0.3, 0.3], [-1.0, 1.0, -1.0]] {
            let root = root(correlations);
            let product = |a: usize, b: usize| (0..3).map(|i| root[a][i] * root[b][i]).sum::<f64>();
            let found = [product(0, 1), product(0, 2), product(1, 2)];
            for (found, expected) in found.into_iter().zip(correlations) {
                assert!((found - expected).abs() < 1e-12, "{correlations:?}");
            }
            assert!((0..3).all(|row| (product(row, row) - 1.0).abs() < 1e-12));
        }
    }
}
