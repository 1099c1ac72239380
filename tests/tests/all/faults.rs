//! A fault is survived, reported and counted, and a strike 50 ms later is measured.

use bead_bench::emulation::Emulation;
use bead_bench::faults::{self, KINDS, Planned};
use bead_compare::replay::replay;
use bead_compare::sensed::Timing;
use bead_recording::frames::Frame;
use bead_recording::strikes::RecordedStrike;
use bead_tests::{RunFrames, execute, faults_at, paper_at, planned, timed};
use bead_wire::{Energy, Fault, FaultCause, Guard, Health, Message, Standing, StrikeFlags};
use stm32f405_qemu::{Outcome, Poke, ResetCause};

use crate::wraps::symbol;

/// RCC_CSR bits 31..24 (RM0090 section 7.3.21): a reset by the firmware, and by the independent watchdog. A
/// reset from within pulls the pin as well.
const SOFTWARE: u8 = 1 << 4 | PIN;
const WATCHDOG: u8 = 1 << 5 | PIN;
const PIN: u8 = 1 << 2;

/// A run of the image with faults as their file has them.
struct Survived {
    run: Emulation,
    rows: Vec<[u16; 4]>,
    outcome: Outcome,
    received: RunFrames,
    strikes: Vec<RecordedStrike>,
}

impl Survived {
    fn new(timing: Timing, faults: Vec<Planned>) -> Self {
        Self::poked(timing, faults, Vec::new())
    }

    fn poked(timing: Timing, faults: Vec<Planned>, pokes: Vec<Poke>) -> Self {
        let mut run = paper_at(timing, Some(1));
        run.faults = faults;
        let mut machine = run.machine();
        machine.pokes = pokes;
        let outcome = execute(&machine);
        let received = RunFrames::new(outcome.uart.clone());
        let strikes = received.strikes();
        Self {
            run,
            rows: machine.stimulus,
            outcome,
            received,
            strikes,
        }
    }

    /// Number of changes of the light.
    fn light(&self) -> u64 {
        let pin = self.outcome.pins.iter().find(|pin| pin.name == "PC13");
        pin.map_or(0, |pin| pin.edges)
    }

    /// Asserts that the last strike is measured as any other: no flag, replayed bit for bit, of the samples
    /// that were put in, A and B within their usual error.
    fn assert_last_strike_is_measured(&self) {
        let strike = self
            .strikes
            .last()
            .expect("the strike after the fault is measured");
        assert_eq!(replay(strike).first_difference, None);
        assert_eq!(strike.said.flags, StrikeFlags::NONE);
        let absorbed = self.run.truth.truth.absorbed;
        let off = |energy: Energy| energy.joules() / absorbed - 1.0;
        let (a, b) = (
            off(strike.said.absorbed_measured),
            off(strike.said.absorbed_predicted),
        );
        println!("A {:+.3} %, B {:+.3} %", a * 100.0, b * 100.0);
        assert!(a.abs() < 2e-3, "A off by {a}");
        assert!(b.abs() < 5e-3, "B off by {b}");
        if self.outcome.resets.is_empty() {
            // The index goes on over a gap: the recorded codes are those put in at their indices.
            for (i, codes) in strike.scans.iter().enumerate() {
                let row = strike.said.first_index as usize + i - 1;
                let [force, force_wide, acceleration, acceleration_wide] = self.rows[row];
                assert_eq!(codes.sensitive, [force, acceleration], "row {row}");
                assert!(
                    codes
                        .wide
                        .is_none_or(|wide| wide == [force_wide, acceleration_wide]),
                    "row {row}"
                );
            }
            let start = self.run.truth.starts.last().expect("there was a strike");
            let arrival = (strike.said.trigger_index as f64 - start) / 100e3;
            assert!(
                (1.3e-3..1.6e-3).contains(&arrival),
                "{arrival} s after the strike"
            );
        }
    }

    /// Asserts that every frame that the bead made came, or was counted by it as dropped.
    fn assert_every_frame_is_accounted_for(&self) {
        let status = self.received.status();
        let dropped = status.frames_dropped_queue_full + status.frames_dropped_too_long;
        assert_eq!(self.received.counters.lost, u64::from(dropped));
        assert!(self.received.counters.rejected.total() <= self.outcome.resets.len() as u64);
        assert_eq!(self.outcome.unknown_registers, []);
    }
}

/// Health report of a bead whose sensors and supply are good.
fn sound() -> Health {
    Health {
        supply_mv: 3300,
        ..Health::default()
    }
}

/// Another instruction at the start of a function of the image, ns after power-up.
fn replaced(function: &str, at_ns: u64, instruction: [u8; 2]) -> Poke {
    // The lowest bit of the address stands for Thumb.
    let address = symbol(&[function]).0 & !1;
    let bytes = instruction.to_vec();
    Poke {
        at_ns,
        address,
        bytes,
    }
}

/// One strike at `at`, s after the first scan.
fn strike_at(at: f64) -> Timing {
    timed(at, 1, 0.1)
}

/// A fault at 50 ms that ends in a reset, `took` seconds later at most, and one strike 50 ms after that.
fn crash(kind: &str, took: f64, flags: u8, cause: FaultCause, detail: &str) {
    let survived = Survived::new(strike_at(0.05 + took + 0.05), faults_at(&[(0.05, kind)]));
    assert_eq!(survived.outcome.resets.len(), 1, "{:?}", survived.outcome.log);
    let sampling = survived.outcome.sampling.expect("the image samples").first_ns;
    let reset = (survived.outcome.resets[0].at_ns - sampling) as f64 * 1e-9;
    assert!((0.05..0.05 + took).contains(&reset), "{reset} s");
    survived.assert_last_strike_is_measured();
    survived.assert_every_frame_is_accounted_for();
    assert_eq!(survived.strikes.len(), 1);
    let faults = survived.received.all::<Fault>();
    let told: Vec<_> = faults.map(|fault| (fault.cause, fault.boot)).collect();
    assert_eq!(told, [(cause, 0)], "{:?}", survived.outcome.log);
    assert!(
        survived.received.details()[0].starts_with(detail),
        "{:?}",
        survived.received.details()
    );
    let boots = survived.received.boots();
    assert_eq!(boots.len(), 2, "{boots:?}");
    assert_eq!(boots[1], (1, flags));
    assert_eq!(survived.received.last::<Health>(), sound());
}

#[test]
fn an_adc_overrun_costs_an_epoch_is_counted_and_a_later_strike_is_measured_at_its_true_index() {
    let survived = Survived::new(strike_at(0.112), faults_at(&[(0.05, "adc_overrun")]));
    survived.assert_last_strike_is_measured();
    survived.assert_every_frame_is_accounted_for();
    assert_eq!(survived.strikes.len(), 1);
    assert_eq!((survived.outcome.overruns, survived.outcome.resets.len()), (1, 0));
    let status = survived.received.status();
    assert_eq!((status.overruns, status.epoch, status.strikes), (1, 1, 1));
    assert_eq!(survived.received.causes(), [FaultCause::AdcOverrun]);
    assert_eq!(survived.received.last::<Health>(), sound());
    // Switched off at first; one flash at once, one at 1 s.
    assert_eq!(survived.light(), 1 + 2 * 2);
}

#[test]
fn a_boot_that_a_fault_ends_is_told_by_the_next_and_a_later_strike_is_measured() {
    use FaultCause::{DmaError, HardFault, Panic, StackOverflow, Watchdog};
    crash("adc_dma_error", 0.02, SOFTWARE, DmaError, "DMA: error");
    crash("hard_fault", 0.02, SOFTWARE, HardFault, "CFSR 0x");
    let no_handler = "interrupt 56 has no handler (trace.rs:";
    crash("panic", 0.02, SOFTWARE, Panic, no_handler);
    let reached = "the stack reached 0x1000";
    crash("stack_overflow", 0.02, SOFTWARE, StackOverflow, reached);
    crash("hang", 2.1, WATCHDOG, Watchdog, "");
}

#[test]
fn a_fault_inside_a_log_statement_leaves_its_record_and_a_later_strike_is_measured() {
    // The logger's own code becomes an undefined instruction, before the line of the first strike.
    let poke = replaced("_defmt_write", 70_000_000, [0x00, 0xDE]);
    let survived = Survived::poked(timed(0.05, 2, 0.1), vec![], vec![poke]);
    assert_eq!(survived.outcome.resets.len(), 1);
    survived.assert_last_strike_is_measured();
    assert_eq!(survived.received.causes(), [FaultCause::HardFault]);
    // UNDEFINSTR (PM0214 section 4.4.13).
    assert!(
        survived.received.details()[0].starts_with("CFSR 0x00010000"),
        "{:?}",
        survived.received.details()
    );
}

#[test]
fn a_power_cut_is_told_by_the_reset_cause_alone_and_a_later_strike_is_measured() {
    /// RCC_CSR bits 31..24 after power-up: brown-out, pin, power-on.
    const POWER_UP: u8 = 1 << 1 | PIN | 1 << 3;
    let survived = Survived::new(strike_at(0.1), faults_at(&[(0.05, "power_cut")]));
    let causes: Vec<_> = survived.outcome.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(causes, [ResetCause::PowerCut]);
    survived.assert_last_strike_is_measured();
    survived.assert_every_frame_is_accounted_for();
    // Random contents of RAM are not taken for a trace.
    assert_eq!(survived.received.causes(), []);
    // The first frame after a reset.
    let opening = |frame: &&Frame| frame.header.sequence == 0;
    let boots = survived.received.frames.iter().filter(opening);
    let boots = boots.map(|frame| match &frame.message {
        Message::Identity(identity) => (identity.boot, identity.reset_cause.bits()),
        other => panic!("{other:?} opens a boot"),
    });
    assert_eq!(boots.collect::<Vec<_>>(), [(0, POWER_UP); 2]);
}

#[test]
fn a_sensor_that_is_stuck_to_the_end_stands_in_the_health_frame_and_flags_strikes() {
    let timing = timed(0.01, 2, 0.4);
    let survived = Survived::new(timing, faults_at(&[(0.05, "acceleration_stuck")]));
    assert_eq!(survived.received.causes(), [FaultCause::AccelerationStuck]);
    let flags: Vec<StrikeFlags> = survived.strikes.iter().map(|strike| strike.said.flags).collect();
    // A stuck accelerometer measures no absorbed energy.
    let after = StrikeFlags::SENSOR_FAULT.with(StrikeFlags::ESTIMATES_DIFFER);
    assert_eq!(
        flags,
        [StrikeFlags::NONE, after],
        "before it was stuck, and after"
    );
    assert_eq!(
        survived.received.last::<Health>().standing,
        Standing::ACCELERATION_STUCK
    );
    // Switched off at first; one flash at once, three at 1 s.
    assert_eq!(survived.light(), 1 + 2 * (1 + 3));
}

#[test]
fn a_supply_that_moves_is_told_with_each_strike_whose_energies_it_moves_and_costs_no_sample() {
    // Supply, V, for half a second with a strike in the middle.
    let supplies = [3.3, 3.27, 3.2, 3.1, 3.0, 3.3];
    let fault = |(n, volts): (u32, &f64)| {
        let at = 0.5 * f64::from(n);
        format!("[[fault]]\nat = {at}\nkind = \"supply\"\nvolts = {volts}\nduration = 0.5\n")
    };
    let faults: String = (0..).zip(&supplies).map(fault).collect();
    let survived = Survived::new(timed(0.25, 6, 0.5), planned(&faults));
    survived.assert_last_strike_is_measured();
    survived.assert_every_frame_is_accounted_for();
    assert_eq!(survived.strikes.len(), supplies.len());
    // The detector's threshold is 2.93 V.
    assert_eq!(survived.received.causes(), []);
    let status = survived.received.status();
    assert_eq!((status.epoch, status.overruns, status.blocks_dropped), (0, 0, 0));
    let absorbed = survived.run.truth.truth.absorbed;
    for (strike, supply) in survived.strikes.iter().zip(supplies) {
        assert_eq!(replay(strike).first_difference, None);
        let conditions = strike.shape.and_then(|shape| shape.conditions);
        let conditions = conditions.expect("measured in the first 6 ms");
        let measured = conditions.supply.volts();
        // Half a code of 1502.
        assert!((measured / supply - 1.0).abs() < 4e-4, "{measured} of {supply} V");
        // The emulated die has 25 °C.
        let temperature = conditions.die_temperature.degrees_celsius();
        assert!((temperature - 25.0).abs() < 0.5, "{temperature} °C");
        let is_off = (supply / 3.3 - 1.0).abs() > 3e-3;
        let flags = StrikeFlags::NONE.with_if(is_off, StrikeFlags::SUPPLY_OFF);
        // The law of the contacts is not linear: gains that are 6 % off show in the wave form as well.
        let found = strike.said.flags.without(StrikeFlags::MODEL_DIFFERS);
        assert_eq!(found, flags, "{supply} V");
        // Both energies go with the square of the gains, near enough.
        let expected = (3.3 / supply).powi(2) - 1.0;
        for (which, energy, apart) in [
            ("A", strike.said.absorbed_measured, 3e-3),
            ("B", strike.said.absorbed_predicted, 2e-2),
        ] {
            let off = energy.joules() / absorbed - 1.0;
            println!(
                "{supply} V, measured {measured:.4} V: {which} {:+.2} %",
                off * 100.0
            );
            assert!((off - expected).abs() < apart, "{which} {off} at {supply} V");
        }
    }
}

#[test]
fn a_port_that_stalls_costs_whole_strikes_that_are_counted_and_no_sample_and_a_later_one_is_measured() {
    // Eight strikes during the stall, more than there is room for; the ninth comes 10 ms after its end, the
    // tenth 60 ms.
    let timing = timed(0.06, 10, 0.05);
    let faults = "[[fault]]\nat = 0.05\nkind = \"uart_stall\"\nduration = 0.4\n";
    let survived = Survived::new(timing, planned(faults));
    survived.assert_last_strike_is_measured();
    survived.assert_every_frame_is_accounted_for();
    assert_eq!(
        (survived.received.causes(), survived.outcome.resets.len()),
        (vec![], 0)
    );
    let status = survived.received.status();
    assert_eq!(
        (status.strikes, status.overruns, status.blocks_dropped),
        (10, 0, 0)
    );
    // A strike is there with all of its frames, or it was passed over.
    let passed_over = survived.received.last::<Guard>().strikes_passed_over as usize;
    assert_eq!(status.frames_dropped_queue_full, 0);
    assert!(passed_over > 0);
    assert_eq!(survived.strikes.len() + passed_over, 10);
    let is_whole = |strike: &RecordedStrike| strike.scans.len() == usize::from(strike.said.samples);
    assert!(survived.strikes.iter().all(is_whole));
}

#[test]
fn a_port_that_never_comes_back_is_given_up_by_the_bead_itself_which_says_so() {
    let faults = "[[fault]]\nat = 0.05\nkind = \"uart_stall\"\nduration = 1.5\n";
    let survived = Survived::new(strike_at(1.6), planned(faults));
    survived.assert_last_strike_is_measured();
    assert_eq!(survived.outcome.resets.len(), 1);
    assert_eq!(survived.received.causes(), [FaultCause::Panic]);
    assert!(
        survived.received.details()[0].starts_with("transmission hangs (progress.rs:"),
        "{:?}",
        survived.received.details()
    );
    assert_eq!(survived.received.boots()[1], (1, SOFTWARE));
    // Frames made at 1 s, which could not leave: identity, board, settings, status, health, link, guard.
    assert_eq!(survived.received.last::<Health>().frames_lost_by_reset, 7);
}

#[test]
fn a_converter_that_never_recovers_is_given_up_by_the_bead_itself_which_says_so() {
    // An overrun every 1 ms: no block of 2 ms is ever complete. The last comes at 1.6 s, after the reset.
    let faults = (0..1550).map(|n| (0.05 + 0.001 * f64::from(n), "adc_overrun"));
    let survived = Survived::new(strike_at(1.65), faults_at(&Vec::from_iter(faults)));
    survived.assert_last_strike_is_measured();
    assert_eq!(survived.outcome.resets.len(), 1);
    let reported = survived
        .received
        .all::<Fault>()
        .find(|fault| fault.cause == FaultCause::Panic);
    let detail = &reported.expect("the panic is reported").detail;
    assert!(
        detail.as_str().starts_with("no samples arrive (progress.rs:"),
        "{detail}"
    );
}

#[test]
fn a_bead_whose_blocks_are_all_lost_gives_itself_up_though_samples_arrive() {
    // From 50 ms on no block is given back: the function for it becomes `bx lr`.
    let poke = replaced("8handover9give_back", 100_000_000, [0x70, 0x47]);
    let survived = Survived::poked(strike_at(1.8), vec![], vec![poke]);
    survived.assert_last_strike_is_measured();
    let resets: Vec<_> = survived.outcome.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(resets, [ResetCause::Software]);
    assert_eq!(
        survived.received.causes(),
        [FaultCause::BlockLost, FaultCause::Panic]
    );
    let detail = survived.received.details()[1];
    assert!(detail.starts_with("no samples arrive (progress.rs:"), "{detail}");
}

#[test]
fn the_stack_that_was_never_used_is_counted_to_the_word() {
    /// The stack's highest address, one past the region STACK of `memory.x`.
    const START: u32 = 0x1000_8800;
    let free = |pokes: Vec<Poke>| {
        let survived = Survived::poked(strike_at(0.02), vec![], pokes);
        survived.received.status().stack_free_min
    };
    // Writes words that the stack does not use at that time, down to this one and less than a fence apart, as
    // if the stack had been there.
    let down_to = |address: u32| -> Vec<Poke> {
        let way = (address..START - 5_000).step_by(1_000);
        way.map(|address| Poke {
            at_ns: 500_000_000,
            address,
            bytes: vec![1, 2, 3, 4],
        })
        .collect()
    };
    let untouched = free(Vec::new());
    let deep = START - 20_000;
    let left = free(down_to(deep));
    let bottom = deep - left;
    assert!(bottom.is_multiple_of(1024), "{bottom:#x}: the end of the fence");
    assert_eq!(free(down_to(bottom + 100)), 100);
    // Taking settings uses some 17 kB, for their block and what follows from it, while a strike is measured.
    let used = START - bottom - untouched;
    println!("{used} bytes of stack used, {untouched} never");
    assert!((2000..19_000).contains(&used), "{used}");
}

#[test]
fn the_file_of_the_documentation_has_every_kind_of_fault() {
    let file = bead_tests::workspace().join("docs/scenarios/faults.toml");
    let planned = faults::load(&file).unwrap_or_else(|error| panic!("{error}"));
    let has = |kind| planned.iter().any(|fault| fault.kind == kind);
    assert!(KINDS.iter().all(|(_, kind)| has(*kind)));
}
