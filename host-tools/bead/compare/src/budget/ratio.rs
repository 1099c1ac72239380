//! The ratio of the energies of two beads. Errors that both share cancel in its uncertainty.

use serde::Serialize;

use crate::budget::combined::{Combined, Contribution, Correlated};
use crate::budget::input::is_shared;
use crate::budget::strike::{BudgetInput, StrikeBudget, correlated};

/// The energies of one bead over those of another.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct BeadRatio {
    /// Addresses of both beads.
    pub beads: [u8; 2],
    /// Numbers of the strikes, one of each.
    pub strikes: [u32; 2],
    /// True if both name the same calibration: gains, flatness, supply and contacts then cancel where both
    /// depend on them alike.
    pub shares_calibration: bool,
    /// Of A.
    pub measured: Combined,
    /// Of B.
    pub predicted: Combined,
}

/// Each bead's energies over those of the first.
pub fn ratios(budgets: &[StrikeBudget]) -> Vec<BeadRatio> {
    let Some((first, others)) = budgets.split_first() else {
        return Vec::new();
    };
    others.iter().map(|other| BeadRatio::of(other, first)).collect()
}

impl BeadRatio {
    fn of(over: &StrikeBudget, under: &StrikeBudget) -> Self {
        let is_named = over.calibration.is_some() && over.calibration == under.calibration;
        let shares_calibration = is_named && over.stated.calibrated == under.stated.calibrated;
        let ratio = |result: usize| ratio([over, under], result, shares_calibration);
        Self {
            beads: [over.bead, under.bead],
            strikes: [over.strike, under.strike],
            shares_calibration,
            measured: ratio(0),
            predicted: ratio(1),
        }
    }
}

/// The ratio of one result, 0 for A and 1 for B.
fn ratio(budgets: [&StrikeBudget; 2], result: usize, shares: bool) -> Combined {
    let energies = budgets.map(|budget| [budget.measured, budget.predicted][result].value);
    let value = energies[0] / energies[1];
    // ln(E₁/E₂) has the relative contributions, those of the second with the opposite sign.
    let amount = |bead: usize, input: &BudgetInput| Contribution {
        amount: value * [1.0, -1.0][bead] * input.contributions()[result].amount / energies[bead],
        free: input.degrees_of_freedom,
    };
    let mut contributions = Vec::new();
    let mut pairs: Vec<Correlated> = Vec::new();
    for bead in [0, 1] {
        let offset = contributions.len();
        let inputs = &budgets[bead].inputs;
        contributions.extend(inputs.iter().map(|input| amount(bead, input)));
        let of_bead = correlated(&budgets[bead].stated, inputs);
        pairs.extend(
            of_bead
                .into_iter()
                .map(|(one, other, r)| (offset + one, offset + other, r)),
        );
    }
    let [over, under] = budgets.map(|budget| &budget.inputs);
    if shares {
        for (place, input) in over.iter().enumerate() {
            let is_shared = input.key.is_some_and(is_shared);
            let other = under.iter().position(|other| is_shared && other.key == input.key);
            // Correlation 1: one is the other.
            pairs.extend(other.map(|other| (place, over.len() + other, 1.0)));
        }
    }
    Combined::of(value, &contributions, &pairs)
}
