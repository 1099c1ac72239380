//! What every model answers with.

use std::collections::BTreeSet;

/// There is no such register in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoRegister;

/// What the firmware asked of a peripheral that its model does not do.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Notes(BTreeSet<&'static str>);

impl Notes {
    /// Takes a note once.
    pub(crate) fn note_if(&mut self, asked: bool, what: &'static str) {
        if asked {
            self.0.insert(what);
        }
    }

    /// In alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.0.iter().copied()
    }
}
