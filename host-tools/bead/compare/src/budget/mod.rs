//! The uncertainty of a strike's energies: a budget as the GUM has it (JCGM 100), its check by draws (JCGM
//! 101), and the ratio between beads.
//!
//! # Design
//! The bead's own code is the measurement function: settings are derived again with one input moved, and the
//! recorded codes run through the estimators again. The sensitivities are therefore those of this strike.

mod combined;
mod draw;
mod input;
mod monte_carlo;
mod noise;
mod ratio;
mod report;
mod run;
mod strike;

pub use combined::{Combined, Contribution, Correlated};
pub use draw::drawn_settings;
pub(crate) use noise::expanded_noise;
pub use ratio::{BeadRatio, ratios};
pub use report::{BudgetTables, significant};
pub(crate) use run::measured_again;
pub use strike::{BudgetInput, StrikeBudget};
