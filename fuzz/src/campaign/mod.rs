//! The image under faults drawn at random: each script runs in QEMU and is checked against the invariants
//! that hold whatever fails.
//!
//! # Design
//! A [`Script`] is a file of faults with the strikes that come meanwhile. It is drawn from one number, so a
//! campaign can be repeated. [`check`] runs it. A script that fails is made [smaller](shrunk) while it still
//! fails, and is written to a file that may join those in `fuzz/scripts`, which the tests replay.

mod check;
mod script;

pub use check::{CampaignBench, check};
pub use script::Script;

/// The smallest script made of this one, by leaving out and rounding, that `fails`.
pub fn shrunk(script: &Script, fails: impl Fn(&Script) -> bool) -> Script {
    let mut smallest = script.clone();
    while let Some(smaller) = smallest.smaller().into_iter().find(|smaller| fails(smaller)) {
        smallest = smaller;
    }
    smallest
}
