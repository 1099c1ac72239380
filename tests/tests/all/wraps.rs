//! Counters that grow while a bead is on, run past 2^32: hours and days take seconds.
//!
//! # Design
//! The image cannot begin a count elsewhere, so the emulator writes into its variables. Trying finds the word
//! of a variable that holds the number, since the layout is the compiler's. The word of today is tried first.

use std::fs;

use bead_bench::emulation::Emulation;
use bead_compare::replay::replay;
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_tests::{RunFrames, execute, paper_at, timed};
use bead_wire::{FaultCause, Status, StrikeFlags};
use object::{Object, ObjectSymbol};
use stm32f405_qemu::{Outcome, Poke};

/// Time at which the word is written, ns since power-up: the image samples, and nothing has struck it yet.
const RUNNING_NS: u64 = 60_000_000;
/// The same while the image waits for its supply: its variables have their first values, and the time has not
/// begun.
const STARTING_NS: u64 = 10_000_000;

/// A run with three strikes, the first 60 ms after the first scan.
fn run() -> Emulation {
    paper_at(timed(0.06, 3, 0.15), Some(1))
}

/// Address and size in bytes of the variable or function whose name holds all of these.
pub(crate) fn symbol(parts: &[&str]) -> (u32, u32) {
    let elf = fs::read(bead_tests::image()).expect("the image is built");
    let elf = object::File::parse(&*elf).expect("it is an ELF file");
    let is = |name: &str| parts.iter().all(|part| name.contains(part));
    let mut found = elf.symbols().filter(|symbol| symbol.name().is_ok_and(is));
    let symbol = found.next().expect("the image has it");
    assert!(found.next().is_none(), "{parts:?} are not enough to name it");
    (symbol.address() as u32, symbol.size() as u32)
}

/// Runs the image with `value` in the word of a variable that `shows` finds to be the right one. The word at
/// `today` is tried first.
fn written(
    parts: &[&str],
    today: u32,
    at_ns: u64,
    value: u32,
    shows: impl Fn(&RunFrames) -> bool,
) -> (Emulation, Outcome, RunFrames) {
    let (address, size) = symbol(parts);
    let words = (0..size / 4).map(|word| 4 * word);
    for offset in std::iter::once(today).chain(words.filter(|offset| *offset != today)) {
        let emulation = run();
        let mut machine = emulation.machine();
        machine.pokes = vec![Poke {
            at_ns,
            address: address + offset,
            bytes: value.to_le_bytes().to_vec(),
        }];
        let outcome = execute(&machine);
        let received = RunFrames::new(outcome.uart.clone());
        if outcome.resets.is_empty() && shows(&received) {
            println!("{parts:?}: the word at {offset}");
            return (emulation, outcome, received);
        }
    }
    panic!("no word of {parts:?} is the number");
}

/// Asserts that all three are measured as without the jump: no flag, the same bits in replay, A within 0.2 %.
fn assert_measured(emulation: &Emulation, strikes: &[RecordedStrike]) {
    assert_eq!(strikes.len(), 3);
    for strike in strikes {
        assert_eq!(replay(strike).first_difference, None);
        assert_eq!(strike.said.flags, StrikeFlags::NONE);
        let off = strike.said.absorbed_measured.joules() / emulation.truth.truth.absorbed - 1.0;
        assert!(off.abs() < 2e-3, "A off by {off}");
    }
}

#[test]
fn the_time_passes_2_to_the_32_ticks_and_nothing_is_missed() {
    // The driver counts times of 2^15 ticks of 10 µs: 0.33 s before 2^32 ticks.
    let (emulation, outcome, received) = written(
        &["time_driver", "DRIVER"],
        16,
        STARTING_NS,
        (1 << 17) - 1,
        |received| received.status().uptime_ms > 40_000_000,
    );
    assert!(
        received.status().uptime_ms > (1 << 32) / 100,
        "{:?}",
        received.status()
    );
    assert_eq!(received.causes(), []);
    assert_eq!(
        (
            received.status().overruns,
            received.counters.lost,
            outcome.overruns
        ),
        (0, 0, 0)
    );
    // A status at boot and each second.
    assert!((2..=3).contains(&received.all::<Status>().count()));
    assert_measured(&emulation, &assemble(received.frames, Some(emulation.settings)));
}

#[test]
fn samples_are_numbered_past_2_to_the_32() {
    const PAST: u64 = 1 << 32;
    // The high word of the tick at which the scans began: 2^32 ticks earlier.
    let (emulation, _, received) = written(&["acquire", "POOL"], 84, RUNNING_NS, u32::MAX, |received| {
        // To the end: a wrong index is found at the next block, and corrected.
        let last = received
            .frames
            .last()
            .map_or(0, |frame| frame.header.sample_index);
        (PAST..PAST + 1_000_000).contains(&last)
    });
    // The jump is a gap like any other: reported, in a new epoch, no strike of which is lost.
    assert_eq!(received.causes(), [FaultCause::AdcOverrun]);
    let starts = emulation.truth.starts.clone();
    let strikes = assemble(received.frames, Some(emulation.settings));
    assert_measured(&emulation, &strikes);
    for (strike, start) in strikes.iter().zip(starts) {
        let arrival = ((strike.said.trigger_index - PAST) as f64 - start) / 100e3;
        assert!(
            (1.3e-3..1.6e-3).contains(&arrival),
            "{arrival} s after the strike"
        );
    }
}
