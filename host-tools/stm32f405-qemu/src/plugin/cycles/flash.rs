//! Access times of the flash (RM0090 sections 3.4 and 3.5).
//!
//! A read fetches a line of 16 bytes, and takes five wait states at 168 MHz. The accelerator keeps 64 lines
//! of instructions and 8 of constants, and prefetches the line after the one in use. It is not documented
//! which line is evicted: here it is the least recently used.

use std::collections::VecDeque;

/// Wait states at 168 MHz and 2.7 to 3.6 V (table 10).
pub(super) const WAITS: u64 = 5;
const INSTRUCTION_LINES: usize = 64;
const DATA_LINES: usize = 8;

/// The line of an address.
pub(super) fn line(address: u32) -> u32 {
    address >> 4
}

/// Lines in a cache, the most recently used first.
#[derive(Debug, Default)]
struct Lines(VecDeque<u32>);

impl Lines {
    /// Returns `true` if the line is in the cache, and marks it as most recently used.
    fn uses(&mut self, line: u32) -> bool {
        let found = self.0.iter().position(|kept| *kept == line);
        if let Some(at) = found {
            self.0.remove(at);
            self.0.push_front(line);
        }
        found.is_some()
    }

    fn put(&mut self, line: u32, room: usize) {
        self.0.push_front(line);
        self.0.truncate(room);
    }
}

/// The flash and its accelerator.
#[derive(Debug, Default)]
pub(super) struct Flash {
    /// True if caches and prefetch are on.
    accelerated: bool,
    /// Time at which the memory has completed its last read.
    free: u64,
    /// The line in use by instructions.
    current: Option<u32>,
    /// The prefetched line, and the time at which it is ready.
    ahead: Option<(u32, u64)>,
    instructions: Lines,
    constants: Lines,
}

impl Flash {
    pub(super) fn new(accelerated: bool) -> Self {
        Self {
            accelerated,
            ..Self::default()
        }
    }

    /// Time at which a read requested now has its line.
    fn reads(&mut self, now: u64) -> u64 {
        self.free = self.free.max(now) + 1 + WAITS;
        self.free
    }

    /// Time at which a word of instructions requested now is ready.
    pub(super) fn fetch(&mut self, address: u32, now: u64) -> u64 {
        let line = line(address);
        if self.current.replace(line) == Some(line) {
            return now + 1;
        }
        if !self.accelerated {
            return self.reads(now);
        }
        let there = match self.ahead {
            _ if self.instructions.uses(line) => now + 1,
            Some((ahead, ready)) if ahead == line => {
                self.instructions.put(line, INSTRUCTION_LINES);
                ready.max(now + 1)
            }
            _ => {
                self.instructions.put(line, INSTRUCTION_LINES);
                self.reads(now)
            }
        };
        let next = line + 1;
        let is_there =
            self.instructions.0.contains(&next) || self.ahead.is_some_and(|(ahead, _)| ahead == next);
        if !is_there {
            self.ahead = Some((next, self.reads(there)));
        }
        there
    }

    /// Wait cycles of a read of constants at this address.
    pub(super) fn read(&mut self, address: u32, now: u64) -> u64 {
        let line = line(address);
        if self.accelerated && self.constants.uses(line) {
            return 0;
        }
        self.constants.put(line, DATA_LINES);
        self.reads(now) - now - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: u32 = 0x10;

    #[test]
    fn without_the_accelerator_each_new_line_waits_and_the_current_one_does_not() {
        let mut flash = Flash::new(false);
        assert_eq!(flash.fetch(0, 0), 6);
        assert_eq!(flash.fetch(0xc, 6), 7);
        assert_eq!(flash.fetch(LINE, 7), 13);
        assert_eq!(flash.fetch(0, 20), 26);
        // A constant, and one requested while that is read.
        assert_eq!([flash.read(0x400, 30), flash.read(0x400, 32)], [5, 9]);
    }

    #[test]
    fn the_accelerator_reads_ahead_and_keeps_64_lines_of_instructions_and_8_of_constants() {
        let mut flash = Flash::new(true);
        assert_eq!(flash.fetch(0, 0), 6);
        // Read from 6 to 12; requested in time, and too early.
        assert_eq!(flash.fetch(LINE, 10), 12);
        assert_eq!(flash.fetch(2 * LINE, 100), 101);
        let mut now = 1000;
        let mut wait = |flash: &mut Flash, line: u32| {
            now += 100;
            flash.fetch(line * LINE, now) - now
        };
        // Every other line, so that none was read ahead.
        let first: Vec<u64> = (0..64).map(|n| wait(&mut flash, 100 + 2 * n)).collect();
        assert!(first.iter().all(|wait| *wait == 6));
        assert_eq!([wait(&mut flash, 100), wait(&mut flash, 400)], [1, 6]);
        assert_eq!([wait(&mut flash, 100), wait(&mut flash, 102)], [1, 6]);
        let constants: Vec<u64> = (0..9)
            .map(|n| flash.read(n * LINE, 100_000 + u64::from(n) * 10))
            .collect();
        assert_eq!(constants, [5; 9]);
        assert_eq!(
            [1, 0].map(|n| flash.read(n * LINE, 200_000 + u64::from(n))),
            [0, 5]
        );
    }
}
