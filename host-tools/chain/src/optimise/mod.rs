//! Which intruders leave least energy in the chain.
//!
//! # Design
//!
//! What is made small is the share of the injected energy that the intruders have *not* dissipated ([`Remaining::share`]).
//! What an intruder still holds counts as remaining, as do a wave sent back and, on a viscoelastic chain, what the contacts
//! lost: none of it was absorbed. Since the dampers only take, the share can only fall the longer one waits; a wave whose
//! last part has passed the hosts decides it, and the scenario's duration says how long to wait for that. Energy that the
//! striker keeps or gets back is not injected.
//!
//! A design has three numbers a host. Stiffness and damping are searched as logarithms, masses as they are: so the bound on
//! their sum is linear, and no step between two designs that keep it breaks it. First all intruders are alike, on a grid,
//! whose best is improved; from there, and from stiffnesses that rise or fall along the hosts by [`RAMP`], each bead goes its
//! own way. Derivatives are differences of runs: at [`Accuracy::DRAFT`] a share is smooth to some 1e-8, which a step of
//! [`STEP`] makes 1e-5 of a derivative. The descent is Kraft's SLSQP.

mod descent;
mod find;
mod problem;
mod remaining;
mod search;

pub use find::{Optimum, optimise};
pub use remaining::{Remaining, remaining};
pub use search::{Aim, OptimiseError, Search};
