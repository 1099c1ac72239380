//! Flash at the end of its endurance: what was acknowledged is kept, and what is not kept is refused.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::ops::Range;

use bead_store::{Store, StoreError};
use bead_testing::{FlashFailure, PowerCutFlash};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

const SECTOR: usize = 1024;
const SIZE: usize = 2 * SECTOR;
const RANGE: Range<u32> = 0..SIZE as u32;
/// Flashes that wear out, each in its own way; under Miri, which is slow, fewer.
const FLASHES: u32 = if cfg!(miri) { 2 } else { 200 };
/// Writes to each. A sector holds four, so each is erased more than ten times.
const WRITES: usize = if cfg!(miri) { 3 } else { 120 };

/// Failure of a bit that has been erased too often.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Weakness {
    /// It no longer rises: erased flash is not blank.
    StaysLow,
    /// It no longer falls: a word is not what was written.
    StaysHigh,
    /// It falls, and rises again by itself before the next operation.
    RisesAgain,
    /// Like `StaysHigh`, and the controller reports it.
    Told,
}

const WEAKNESSES: [Weakness; 4] = [
    Weakness::StaysLow,
    Weakness::StaysHigh,
    Weakness::RisesAgain,
    Weakness::Told,
];

/// Flash whose sectors bear a number of erases. Each further one makes a word of it fail.
#[derive(Clone)]
struct Worn {
    flash: PowerCutFlash<SECTOR>,
    /// Erases that each sector still bears.
    left: [u32; 2],
    weakness: Weakness,
    /// Bits that have failed.
    failed: Vec<u8>,
    /// State of the generator that draws the bits that fail (xorshift32, Marsaglia 2003).
    random: u32,
}

impl ErrorType for Worn {
    type Error = FlashFailure;
}

impl Worn {
    fn new(number: u32) -> Self {
        let mut flash = Self {
            flash: PowerCutFlash::blank(2),
            left: [0; 2],
            weakness: WEAKNESSES[number as usize % WEAKNESSES.len()],
            failed: vec![0; SIZE],
            random: number + 1,
        };
        flash.left = [flash.draw() % 12, flash.draw() % 12];
        flash
    }

    fn draw(&mut self) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        self.random
    }
}

impl ReadNorFlash for Worn {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailure> {
        self.flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for Worn {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailure> {
        for start in (from as usize..to as usize).step_by(SECTOR) {
            let left = &mut self.left[start / SECTOR];
            if *left > 0 {
                *left -= 1;
            } else {
                // Near the start of a sector as often as anywhere: there the library keeps its mark and
                // writes first.
                let span = [32, SECTOR as u32][self.draw() as usize % 2];
                let place = (self.draw() % span) as usize;
                self.failed[start + place] |= 1 << (self.draw() % 8);
            }
            for at in start..start + SECTOR {
                let low = self.weakness == Weakness::StaysLow;
                self.flash.bytes[at] = if low { !self.failed[at] } else { 0xFF };
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailure> {
        assert!(offset.is_multiple_of(4) && bytes.len().is_multiple_of(4));
        for (at, &byte) in (offset as usize..).zip(bytes) {
            let meant = self.flash.bytes[at] & byte;
            let low = self.weakness == Weakness::StaysLow;
            self.flash.bytes[at] = if low { meant } else { meant | self.failed[at] };
            if self.weakness == Weakness::Told && self.flash.bytes[at] != meant {
                return Err(FlashFailure);
            }
        }
        Ok(())
    }
}

/// Block number `n`.
fn block(n: usize) -> Vec<u8> {
    (0..180 + 7 * (n % 5)).map(|i| (i * 31 + n * 17) as u8).collect()
}

#[test]
fn a_store_that_wears_out_keeps_what_it_acknowledged_and_refuses_the_rest() {
    let (mut refused, mut kept) = (0, 0);
    for number in 0..FLASHES {
        let mut flash = Worn::new(number);
        let weakness = flash.weakness;
        // The block that was acknowledged last, and those that were refused since. As after a power cut, one
        // of these may be there all the same.
        let mut holds: Vec<Option<usize>> = vec![None];
        for n in 0..WRITES {
            let (mut store, _) = Store::open(flash, RANGE);
            let mut written = store.write(&block(n));
            if written == Err(StoreError::Full) {
                // As a bead that restarts to make room.
                store = Store::open(store.into_flash(), RANGE).0;
                written = store.write(&block(n));
            }
            flash = store.into_flash();
            match written {
                Ok(()) => {
                    holds = vec![Some(n)];
                    kept += 1;
                }
                Err(_) => {
                    holds.push(Some(n));
                    refused += 1;
                }
            }
            let mut store = Store::open(flash.clone(), RANGE).0;
            let held = store.read().ok().flatten().map(<[u8]>::to_vec);
            let which = (0..=n).rev().find(|n| held.as_ref() == Some(&block(*n)));
            assert!(
                holds.contains(&which),
                "flash {number}, {weakness:?}, write {n} ({written:?}): it holds block {which:?} of {holds:?}"
            );
        }
    }
    println!("{FLASHES} flashes, {kept} writes kept, {refused} refused");
    assert!(refused > FLASHES && kept > 10 * FLASHES || cfg!(miri));
}
