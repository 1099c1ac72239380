//! Counts executed instructions: all of them, and those in functions with a label.
//!
//! # Design
//!
//! QEMU calls back before every instruction. The function of an instruction is looked up once, when QEMU
//! translates its block. There is one processor thread, so a counter is a plain load and store of an atomic.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

use crate::exchange::FunctionRange;
use crate::outcome::{FunctionCount, Masked};

/// The labels that an instruction counts for.
#[derive(Debug, Default)]
pub(super) struct Site {
    labels: Vec<usize>,
    /// The labels for which it is the first instruction of a function.
    entered: Vec<usize>,
}

#[derive(Debug, Default)]
struct Label {
    name: String,
    instructions: AtomicU64,
    calls: AtomicU64,
}

#[derive(Debug)]
pub(super) struct InstructionCounters {
    total: AtomicU64,
    labels: Vec<Label>,
    functions: Vec<FunctionRange>,
    masks: Masks,
}

/// Stretches without interrupts.
#[derive(Debug, Default)]
struct Masks {
    /// True if they count now.
    watched: AtomicBool,
    /// Depth of nested masks of interrupts now, with the instruction count and address at which masking
    /// began.
    depth: AtomicU32,
    since: AtomicU64,
    from: AtomicU32,
    /// The longest: instructions, and where it began.
    longest: AtomicU64,
    longest_from: AtomicU32,
}

impl InstructionCounters {
    pub(super) fn new(labels: &[String], functions: Vec<FunctionRange>) -> Self {
        let label = |name: &String| Label {
            name: name.clone(),
            ..Label::default()
        };
        Self {
            total: AtomicU64::new(0),
            labels: labels.iter().map(label).collect(),
            functions,
            masks: Masks::default(),
        }
    }

    pub(super) fn masked(&self, address: u32) {
        if self.masks.depth.fetch_add(1, Relaxed) == 0 {
            self.masks.since.store(self.total(), Relaxed);
            self.masks.from.store(address, Relaxed);
        }
    }

    /// PRIMASK is what it was before it was set last: so a critical section in another ends. To know this
    /// needs no register, and reading one for each section would take long.
    pub(super) fn mask_restored(&self) {
        match self.masks.depth.load(Relaxed) {
            0 => {}
            1 => self.unmasked(),
            depth => self.masks.depth.store(depth - 1, Relaxed),
        }
    }

    /// Interrupts are let through.
    pub(super) fn unmasked(&self) {
        let masks = &self.masks;
        let masked = masks.depth.swap(0, Relaxed) > 0 && masks.watched.load(Relaxed);
        let length = self.total() - masks.since.load(Relaxed);
        if masked && length > masks.longest.load(Relaxed) {
            masks.longest.store(length, Relaxed);
            masks.longest_from.store(masks.from.load(Relaxed), Relaxed);
        }
    }

    /// Stretches without interrupts count from now on, or no longer. After a reset none is masked.
    pub(super) fn watch_masks(&self, watched: bool) {
        if self.masks.watched.swap(watched, Relaxed) != watched && !watched {
            self.masks.depth.store(0, Relaxed);
        }
    }

    pub(super) fn longest_masked(&self) -> Option<Masked> {
        let instructions = Some(self.masks.longest.load(Relaxed)).filter(|longest| *longest > 0)?;
        let from = self.masks.longest_from.load(Relaxed).into();
        Some(Masked { instructions, from })
    }

    /// Returns the counter of the instruction at an address, `None` if it counts for the total alone.
    pub(super) fn site(&self, address: u32) -> Option<Site> {
        let mut site = Site::default();
        let around = |f: &&FunctionRange| (f.start..f.end).contains(&address);
        for f in self.functions.iter().filter(around) {
            if !site.labels.contains(&f.label) {
                site.labels.push(f.label);
            }
            if f.start == address {
                site.entered.push(f.label);
            }
        }
        (!site.labels.is_empty()).then_some(site)
    }

    pub(super) fn executed(&self, site: Option<&Site>) {
        add_one(&self.total);
        if let Some(site) = site {
            site.labels
                .iter()
                .for_each(|l| add_one(&self.labels[*l].instructions));
            site.entered.iter().for_each(|l| add_one(&self.labels[*l].calls));
        }
    }

    pub(super) fn total(&self) -> u64 {
        self.total.load(Relaxed)
    }

    /// Instructions in functions with one of these labels. This grows if and only if one of them runs.
    pub(super) fn labelled(&self, labels: &[usize]) -> u64 {
        let counts = labels.iter().map(|l| self.labels[*l].instructions.load(Relaxed));
        counts.sum()
    }

    pub(super) fn functions(&self) -> Vec<FunctionCount> {
        let count = |(n, label): (usize, &Label)| FunctionCount {
            label: label.name.clone(),
            instructions: label.instructions.load(Relaxed),
            calls: label.calls.load(Relaxed),
            symbols: self.functions.iter().filter(|f| f.label == n).count(),
        };
        self.labels.iter().enumerate().map(count).collect()
    }
}

fn add_one(counter: &AtomicU64) {
    counter.store(counter.load(Relaxed) + 1, Relaxed);
}

/// Sites by address. They are kept for the life of QEMU, since a block may be translated many times.
#[derive(Debug, Default)]
pub(super) struct Sites(HashMap<u32, Option<&'static Site>>);

impl Sites {
    pub(super) fn get(&mut self, address: u32, counters: &InstructionCounters) -> Option<&'static Site> {
        *self
            .0
            .entry(address)
            .or_insert_with(|| counters.site(address).map(|site| &*Box::leak(Box::new(site))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_stretch_without_interrupts_is_found_and_none_outside_the_watch() {
        let counters = InstructionCounters::new(&[], Vec::new());
        let stretch = |from, length| {
            counters.masked(from);
            // A critical section in another masks once more, and lets nothing through.
            counters.masked(from + 2);
            (0..length).for_each(|_| counters.executed(None));
            counters.mask_restored();
            counters.executed(None);
            counters.mask_restored();
        };
        stretch(100, 50);
        assert_eq!(counters.longest_masked(), None);
        counters.watch_masks(true);
        for (from, length) in [(200, 7), (300, 9), (400, 8)] {
            stretch(from, length);
            counters.mask_restored();
            counters.unmasked();
        }
        counters.watch_masks(false);
        stretch(500, 90);
        let longest = counters.longest_masked().unwrap();
        assert_eq!((longest.instructions, longest.from.address), (10, 300));
    }

    #[test]
    fn an_instruction_counts_for_its_labels_and_the_first_of_a_function_for_a_call() {
        let range = |label, start, end| FunctionRange { label, start, end };
        let ranges = vec![range(0, 100, 110), range(0, 200, 210), range(1, 100, 110)];
        let counters = InstructionCounters::new(&["a".into(), "b".into()], ranges);
        for address in [98, 100, 102, 200, 108, 110] {
            counters.executed(counters.site(address).as_ref());
        }
        assert_eq!(counters.total(), 6);
        let labelled = [&[0][..], &[1], &[0, 1], &[]].map(|labels| counters.labelled(labels));
        assert_eq!(labelled, [4, 3, 7, 0]);
        let counts = counters.functions().into_iter();
        let counts: Vec<_> = counts
            .map(|f| (f.label, f.instructions, f.calls, f.symbols))
            .collect();
        assert_eq!(counts, [("a".into(), 4, 2, 2), ("b".into(), 3, 1, 1)]);
    }
}
