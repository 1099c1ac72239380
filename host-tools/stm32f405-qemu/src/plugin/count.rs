//! Counts executed instructions: all of them, and those in functions with a label.
//!
//! # Design
//!
//! QEMU calls back before every instruction. The function of an instruction is looked up once, when QEMU
//! translates its block. There is one processor thread, so a counter is a plain load and store of an atomic.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::cycles::{CycleCount, Timed};
use super::handlers;
use crate::exchange::FunctionRange;
use crate::outcome::{Cycles, FunctionCount, Masked};

/// The labels that an instruction counts for.
#[derive(Debug, Default)]
pub(super) struct Site {
    labels: Vec<usize>,
    /// The labels for which it is the first instruction of a function.
    entered: Vec<usize>,
    /// `None` unless cycles are counted.
    timed: Option<Timed>,
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
    masks: Mutex<Masks>,
    timing: Option<Mutex<Timing>>,
}

/// Instructions, and their cycles if those are counted.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cost {
    pub(super) instructions: u64,
    pub(super) cycles: Option<Cycles>,
}

impl Cost {
    pub(super) fn since(self, before: Self) -> Self {
        Self {
            instructions: self.instructions - before.instructions,
            cycles: self.cycles.zip(before.cycles).map(|(now, before)| now - before),
        }
    }

    /// Sort key of stretches: cycles, then instructions.
    fn length(self) -> (u64, u64) {
        (self.cycles.unwrap_or_default().most, self.instructions)
    }
}

/// Cycles in total and of each label.
#[derive(Debug)]
struct Timing {
    count: CycleCount,
    labels: Vec<Cycles>,
    current: Option<&'static Site>,
}

/// Stretches without interrupts.
#[derive(Debug, Default)]
struct Masks {
    /// True while stretches are counted.
    watched: bool,
    /// Current depth of nested critical sections, with the cost and address at which the outermost began.
    depth: u32,
    since: Cost,
    from: u32,
    /// The longest stretch, and where it began.
    longest: Cost,
    longest_from: u32,
}

impl InstructionCounters {
    pub(super) fn new(labels: &[String], functions: Vec<FunctionRange>, count_cycles: bool) -> Self {
        let label = |name: &String| Label {
            name: name.clone(),
            ..Label::default()
        };
        let timing = || {
            Mutex::new(Timing {
                count: CycleCount::new(),
                labels: vec![Cycles::default(); labels.len()],
                current: None,
            })
        };
        Self {
            total: AtomicU64::new(0),
            labels: labels.iter().map(label).collect(),
            functions,
            masks: Mutex::default(),
            timing: count_cycles.then(timing),
        }
    }

    /// Returns `true` if cycles are counted.
    pub(super) fn times(&self) -> bool {
        self.timing.is_some()
    }

    fn timing(&self) -> Option<MutexGuard<'_, Timing>> {
        Some(locked(self.timing.as_ref()?))
    }

    /// Cost of the run so far.
    pub(super) fn cost(&self) -> Cost {
        Cost {
            instructions: self.total(),
            cycles: self.timing().map(|timing| timing.count.now()),
        }
    }

    /// Records a data access of the current instruction.
    pub(super) fn accessed(&self, address: u32, bytes: u32) {
        if let Some(mut timing) = self.timing() {
            timing.count.accesses(address, bytes);
        }
    }

    pub(super) fn masked(&self, address: u32) {
        let mut masks = locked(&self.masks);
        if masks.depth == 0 {
            (masks.since, masks.from) = (self.cost(), address);
        }
        masks.depth += 1;
    }

    /// Ends the innermost critical section: PRIMASK is back at its value from before. The depth is counted,
    /// since reading a register for each section would take long.
    pub(super) fn mask_restored(&self) {
        let mut masks = locked(&self.masks);
        if masks.depth > 1 {
            masks.depth -= 1;
            return;
        }
        drop(masks);
        self.unmasked();
    }

    /// Ends all critical sections: interrupts are enabled.
    pub(super) fn unmasked(&self) {
        let mut masks = locked(&self.masks);
        let masked = std::mem::take(&mut masks.depth) > 0 && masks.watched;
        let cost = self.cost().since(masks.since);
        if masked && cost.length() > masks.longest.length() {
            (masks.longest, masks.longest_from) = (cost, masks.from);
        }
    }

    /// Starts or stops counting stretches without interrupts. After a reset interrupts are enabled.
    pub(super) fn watch_masks(&self, watched: bool) {
        let mut masks = locked(&self.masks);
        if std::mem::replace(&mut masks.watched, watched) != watched && !watched {
            masks.depth = 0;
        }
    }

    pub(super) fn longest_masked(&self) -> Option<Masked> {
        let masks = locked(&self.masks);
        let Cost { instructions, cycles } = Some(masks.longest).filter(|longest| longest.instructions > 0)?;
        let from = masks.longest_from.into();
        Some(Masked {
            instructions,
            cycles,
            from,
        })
    }

    /// Returns the counter of the instruction at an address, `None` if it counts only for the total. `word`
    /// is its halfword, or its two with the first in the low half.
    pub(super) fn site(&self, address: u32, word: Option<u32>) -> Option<Site> {
        let begins_handler = handlers::count_at(address).is_some();
        let timed = word.filter(|_| self.times());
        let mut site = Site {
            timed: timed.map(|word| Timed::new(address, word, begins_handler)),
            ..Site::default()
        };
        let around = |f: &&FunctionRange| (f.start..f.end).contains(&address);
        for f in self.functions.iter().filter(around) {
            if !site.labels.contains(&f.label) {
                site.labels.push(f.label);
            }
            if f.start == address {
                site.entered.push(f.label);
            }
        }
        (!site.labels.is_empty() || site.timed.is_some()).then_some(site)
    }

    pub(super) fn executed(&self, site: Option<&'static Site>) {
        self.executed_times(site, 1);
        if let Some(site) = site
            && let (Some(mut timing), Some(timed)) = (self.timing(), &site.timed)
        {
            let took = timing.count.executes(timed);
            for label in timing.current.replace(site).map_or(&[][..], |site| &site.labels) {
                timing.labels[*label] = timing.labels[*label] + took;
            }
        }
    }

    /// Adds `times` executions of an instruction, by the site of its address.
    pub(super) fn executed_times(&self, site: Option<&Site>, times: u64) {
        add(&self.total, times);
        if let Some(site) = site {
            site.labels
                .iter()
                .for_each(|l| add(&self.labels[*l].instructions, times));
            site.entered
                .iter()
                .for_each(|l| add(&self.labels[*l].calls, times));
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
            cycles: self.timing().map(|timing| timing.labels[n]),
            calls: label.calls.load(Relaxed),
            symbols: self.functions.iter().filter(|f| f.label == n).count(),
        };
        self.labels.iter().enumerate().map(count).collect()
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn add(counter: &AtomicU64, n: u64) {
    counter.store(counter.load(Relaxed) + n, Relaxed);
}

/// Sites by address. They are kept for the life of QEMU, since a block may be translated many times.
#[derive(Debug, Default)]
pub(super) struct Sites(HashMap<u32, Option<&'static Site>>);

impl Sites {
    pub(super) fn get(
        &mut self,
        address: u32,
        counters: &InstructionCounters,
        word: Option<u32>,
    ) -> Option<&'static Site> {
        let site = || {
            counters
                .site(address, word)
                .map(|site| &*Box::leak(Box::new(site)))
        };
        *self.0.entry(address).or_insert_with(site)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_stretch_without_interrupts_is_found_and_none_outside_the_watch() {
        let counters = InstructionCounters::new(&[], Vec::new(), false);
        let stretch = |from, length| {
            counters.masked(from);
            // A nested critical section masks once more, and its end unmasks nothing.
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
        let counters = InstructionCounters::new(&["a".into(), "b".into()], ranges, false);
        let mut sites = Sites::default();
        for address in [98, 100, 102, 200, 108, 110] {
            counters.executed(sites.get(address, &counters, None));
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
