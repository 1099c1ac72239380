//! Levels that are put on pins from outside.

use std::collections::VecDeque;

use crate::given::PinInput;

/// A change of the level on a pin, `at_ns` after the first scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub(super) at_ns: u64,
    pub(super) port: usize,
    pub(super) pin: usize,
    pub(super) high: bool,
}

/// All changes of level in order of time.
///
/// # Panics
/// There is no such pin.
pub(super) fn levels(inputs: &[PinInput]) -> VecDeque<Level> {
    let mut levels = Vec::new();
    for input in inputs {
        let (port, pin) = input
            .place()
            .unwrap_or_else(|| panic!("there is no pin {:?}", input.pin));
        let changes = input.changes_ns.iter().enumerate();
        levels.extend(changes.map(|(n, at_ns)| Level {
            at_ns: *at_ns,
            port,
            pin,
            high: n % 2 == 0,
        }));
    }
    levels.sort_by_key(|level| level.at_ns);
    levels.into()
}
