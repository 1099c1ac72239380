//! Counts of the interrupts taken.
//!
//! # Design
//!
//! The vectors in the image give the start of each handler. Only the instruction there is counted, so
//! counting costs nothing elsewhere. A handler that several vectors share is left out: it is the default
//! handler for unexpected interrupts, which show up as a panic or a fault.

use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::machine::{INTERRUPTS, interrupt_name};
use crate::outcome::Interrupt;

/// Exceptions of the processor before the first interrupt line (ARMv7-M ARM, B1.5.2).
const EXCEPTIONS: usize = 16;
/// Vectors in the table.
pub(super) const VECTORS: usize = EXCEPTIONS + INTERRUPTS;
/// NMI, SVCall, PendSV and SysTick. Faults have a record of their own.
const NAMED: [(usize, &str); 4] = [(2, "NMI"), (11, "SVCall"), (14, "PendSV"), (15, "SysTick")];

static HANDLERS: OnceLock<HashMap<u32, Handler>> = OnceLock::new();
/// First addresses of all handlers, also of those that share one.
static ENTRIES: OnceLock<HashSet<u32>> = OnceLock::new();

struct Handler {
    vector: usize,
    taken: AtomicU64,
}

/// Records where the handlers begin.
pub(super) fn find(vectors: &[[u8; 4]]) {
    let at = |vector: usize| u32::from_le_bytes(vectors[vector]) & !1;
    let lines = (EXCEPTIONS..vectors.len()).chain(NAMED.map(|(vector, _)| vector));
    let alone = lines.filter(|vector| {
        let same = (0..vectors.len()).filter(|other| at(*other) == at(*vector));
        at(*vector) != 0 && same.count() == 1
    });
    let handlers = alone.map(|vector| {
        let taken = AtomicU64::new(0);
        (at(vector), Handler { vector, taken })
    });
    HANDLERS.get_or_init(|| handlers.collect());
    ENTRIES.get_or_init(|| (2..vectors.len()).map(at).collect());
}

/// Returns `true` if a handler begins at an address.
pub(super) fn begins_at(address: u32) -> bool {
    ENTRIES.get().is_some_and(|entries| entries.contains(&address))
}

/// The count of the handler that begins at an address.
pub(super) fn count_at(address: u32) -> Option<&'static AtomicU64> {
    Some(&HANDLERS.get()?.get(&address)?.taken)
}

/// Interrupts taken, in the order of their vectors.
pub(super) fn taken() -> Vec<Interrupt> {
    let handlers = HANDLERS.get().into_iter().flat_map(HashMap::values);
    let mut taken: Vec<_> = handlers
        .map(|handler| (handler.vector, handler.taken.load(Relaxed)))
        .collect();
    taken.retain(|(_, taken)| *taken > 0);
    taken.sort_unstable();
    let interrupt = |(exception, taken)| Interrupt {
        exception,
        name: name(exception),
        taken,
    };
    taken.into_iter().map(interrupt).collect()
}

fn name(vector: usize) -> String {
    let named = NAMED.iter().find(|(number, _)| *number == vector);
    match (named, vector.checked_sub(EXCEPTIONS)) {
        (Some((_, name)), _) => (*name).into(),
        (None, Some(line)) => interrupt_name(line).map_or_else(|| format!("line {line}"), str::to_owned),
        (None, None) => format!("exception {vector}"),
    }
}
