//! Answers to the requests of a host.

use bead_wire::{Detail, Outcome};

/// The outcome of a request, and a line about it.
pub(crate) type Answer = (Outcome, Detail);

pub(crate) fn done() -> Answer {
    (Outcome::Done, Detail::default())
}

/// Returns the refusal of a flash write while the supply is low.
// Not inlined, to save flash: building an answer takes many instructions.
#[inline(never)]
pub(crate) fn supply_low() -> Answer {
    let why = "the supply is below 2.93 V: nothing was written; try again once it has recovered";
    (Outcome::FlashFailed, why.into())
}
