//! Searches for the intruders that leave the least energy in the chain.
//!
//! # Design
//!
//! The search minimises the share of the injected energy that the intruders have *not* dissipated
//! ([`Remaining::share`]). Energy that an intruder still holds counts as remaining, as do a reflected wave
//! and, in a viscoelastic chain, the loss in contacts. Dampers only dissipate, so the share never rises with
//! time. It is decided once the last of the wave has passed the hosts; the scenario's duration states how
//! long to wait for that. Energy that the striker keeps or gets back is not injected.
//!
//! A design has three numbers for each host, and a radius for each bead of [`Sizes`]. Stiffness, damping and
//! radius are searched as logarithms and masses as they are, which makes the bound on their sum linear. First
//! all intruders are alike, and the best design of a grid is improved. Then each intruder varies by itself,
//! starting from there, from stiffnesses that rise or fall along the hosts by `RAMP`, and from fresh starts
//! about the best, until six in succession find nothing better. A descent is Kraft's SLSQP. It ends when ten
//! gradients gain next to nothing, or too little to come below the best.
//!
//! All derivatives of a value come from one run of a group and its backward pass (`slopes.rs`), which
//! together take as long as [`Search::GRADIENT_RUNS`] single runs. Two-sided differences in thirty variables
//! take 61 runs, eight at once. They are used for strokes, and for chains that do not run in groups. Shares
//! are smooth to some 1e-7: over two steps of `STEP` this is 3e-5 of a derivative.
//!
//! Limits on strokes are constraints of the descents, on the logarithm of each stroke over its limit. A
//! design that breaks one is worse than any that breaks none. Choices of springs and hosts are exchanged one
//! by one, each with descents of its own.
//!
//! A robust design is one whose worst value over the corners of a [`Spread`] is least. Its search begins at
//! the optimum without the spread, too, and does not end above the worst value of that unless it is stopped.

mod bounds;
mod catalogue;
mod descent;
mod design;
mod error;
mod find;
mod hosts;
mod objective;
mod problem;
mod remaining;
mod search;
mod slopes;
mod spread;
mod springs;
mod variables;

pub use catalogue::{Catalogue, CatalogueSpring};
pub use design::{BeadRadius, Sizes};
pub use error::OptimiseError;
pub use find::{Optimum, Robustness, optimise};
pub use objective::Objective;
pub use problem::{SearchObserver, SearchProgress};
pub use remaining::{Remaining, remaining};
pub use search::{Aim, Search};
pub use spread::Spread;
pub use springs::SpringChoice;
