//! Start of the image: on a slow supply, and with a crystal that fails.

use std::fs;
use std::time::Duration;

use bead_recording::strikes::RecordedStrike;
use bead_testing::bodies;
use bead_tests::{Requests, RunFrames, execute, image, paper};
use bead_wire::{FaultCause, Health, Load, Outcome, Request, Standing};
use object::{Object, ObjectSymbol};
use stm32f405_qemu::{Fault, FaultKind, Poke, ResetCause, Run};

use crate::store::STORE_ADDRESS;

const MS: u64 = 1_000_000;
/// Time that the supply has to be good before anything is done, ns.
const GOOD: u64 = 20 * MS;

/// A run without a strike.
fn quiet() -> Requests {
    let mut requests = Requests::new(&paper(0, 0.1, Some(1)));
    requests.machine.count_instructions = false;
    requests
}

/// Runs three strikes with a fault. Returns the faults reported and, for each strike, the index of its first
/// scan less the row of the stimulus that this scan read, which must be the same for all.
fn indices(fault: Fault) -> (Vec<(FaultCause, String)>, Vec<u64>) {
    let mut machine = paper(3, 0.1, Some(1)).machine();
    machine.faults.push(fault);
    let received = RunFrames::new(execute(&machine).uart);
    let faults = received
        .all()
        .map(|fault: &bead_wire::Fault| (fault.cause, fault.detail.as_str().to_owned()));
    let offset = |strike: &RecordedStrike| {
        let first = strike.said.first_index;
        let same = |offset: &u64| {
            let rows = &machine.stimulus[(first - offset) as usize..];
            let codes = strike.scans.iter().map(|codes| codes.sensitive);
            rows.iter()
                .map(|[force, _, acceleration, _]| [*force, *acceleration])
                .zip(codes)
                .all(|(a, b)| a == b)
        };
        (0..10)
            .find(same)
            .expect("the scans of a strike are rows of the stimulus")
    };
    (faults.collect(), received.strikes().iter().map(offset).collect())
}

/// The index of a strike is that of the trigger that sampled its codes: row 0 belongs to the first trigger
/// that makes a scan. A trigger that is missed later ends the epoch.
#[test]
fn a_scan_more_or_less_than_there_are_triggers_is_told_and_every_strike_has_its_true_index() {
    let corrected = (
        FaultCause::IndexCorrected,
        "the start made more or fewer scans than there were triggers",
    );
    let ended = (
        FaultCause::AdcOverrun,
        "there were more or fewer scans than triggers",
    );
    for (fault, told, first) in [
        (Fault::after_power_up(0, FaultKind::ExtraScan), corrected, 1),
        (Fault::after_power_up(0, FaultKind::MissedTrigger), corrected, 2),
        (
            Fault::after_first_scan(60 * MS, FaultKind::MissedTrigger),
            ended,
            1,
        ),
    ] {
        let (faults, offsets) = indices(fault);
        assert_eq!(faults, [(told.0, told.1.to_owned())], "{fault:?}");
        assert_eq!(offsets, [first; 3], "{fault:?}");
    }
}

/// Bound on a stretch without interrupts, in cycles: 10 µs, the most that a block, an edge or a byte waits.
/// The longest stretch is a copy of the settings.
const MASKED: u64 = 1680;

#[test]
fn interrupts_are_never_masked_for_longer_than_is_said() {
    let run = paper(5, 0.03, Some(1));
    let block = bead_wire::Block::try_from(&run.block[..]).expect("a block fits");
    let mut requests = Requests::new(&run);
    requests.machine.count_cycles = true;
    // Settings that are stored and taken, a fetched strike, a raw stream, and a start of the converter anew.
    requests.request(0.02, &Request::WriteSettings { block });
    requests.request(0.08, &Request::Fetch { boot: 0, strike: 0 });
    requests.request(0.10, &Request::Raw { duration_ms: 20 });
    requests.request(0.15, &Request::Status);
    let overrun = Fault::after_first_scan(90 * MS, FaultKind::AdcOverrun);
    requests.machine.faults.push(overrun);
    let answered = requests.run();
    assert!((0..4).all(|number| answered.received.answer(number).0 == Outcome::Done));
    assert!(answered.received.causes().contains(&FaultCause::AdcOverrun));
    let instructions = answered.outcome.instructions.as_ref();
    let masked = instructions
        .and_then(|all| all.masked.as_ref())
        .expect("some are");
    println!("{masked:?}");
    let cycles = masked.cycles.expect("they are counted");
    assert!(cycles.cached < MASKED, "{masked:?}");
    // The bead has measured it too, by the time that the emulator takes for an instruction.
    let loads = bodies(answered.received.answered(3)).map(|load: &Load| load.masked_cycles);
    let by_bead: Vec<_> = loads.map(f64::from).collect();
    let expected = 168e6 * 8e-9 * masked.instructions as f64;
    println!("{by_bead:?} cycles by the bead, {expected} by the emulator");
    // It counts from inside its own section.
    assert!(matches!(by_bead[..], [one] if (0.95 * expected..=expected).contains(&one)));
}

#[test]
fn nothing_is_erased_before_a_slow_supply_has_been_good_for_a_while() {
    const RISE: u64 = 1000 * MS;
    /// When the supply passes the detector's upper threshold, 3.03 V.
    const RISEN: u64 = RISE * 3030 / 3300;
    let mut requests = quiet();
    // Two sectors of data that is not a block: a start has to erase both.
    requests
        .machine
        .flash
        .push((STORE_ADDRESS, vec![0x5A; 256 * 1024]));
    requests.machine.faults.extend(Fault::supply_ramp(0, 3300, RISE));
    requests.machine.sampling_deadline_ns = 10_000 * MS;
    let answered = requests.run();
    let erased_ns = answered.outcome.flash_operations[0].at_ns;
    assert!(erased_ns > RISEN + GOOD, "after {} ms", erased_ns / MS);
    assert_eq!(answered.received.causes(), [FaultCause::SettingsRefused]);
    assert!(answered.received.status().samples > 0);
}

#[test]
fn the_clock_stands_still_while_a_sector_is_erased() {
    let mut requests = quiet();
    // One sector is full of data that is not a block.
    requests
        .machine
        .flash
        .push((STORE_ADDRESS, vec![0x5A; 128 * 1024]));
    requests.machine.sampling_deadline_ns = 10_000 * MS;
    let answered = requests.run();
    let operations: Vec<_> = answered.outcome.flash_operations.iter().collect();
    // The other sector was blank.
    assert!(
        matches!(operations[..], [one] if (one.address, one.erase) == (STORE_ADDRESS, true)),
        "{operations:?}"
    );
    let refused = answered.received.details();
    assert_eq!(refused, ["the store held no complete block, and was erased"]);
    assert_eq!(
        answered.outcome.resets,
        [],
        "a start that takes seconds is no hang"
    );
    // At most two turns of the time driver's timer would be counted. The clock begins after the supply has
    // been good, with the processor at 16 MHz, and what sends the first status lags by a block.
    let first = answered.outcome.sampling.expect("it samples").first_ns;
    let status = answered.received.status();
    let missed = first / MS + status.samples / 100 - status.uptime_ms;
    println!("the clock has missed {missed} ms");
    assert!((2020..2030).contains(&missed), "{missed} ms");
}

#[test]
fn a_supply_that_stays_low_is_told_and_flash_stays_as_it_is() {
    let mut requests = quiet();
    let content = vec![0x5A; 256 * 1024];
    requests.machine.flash.push((STORE_ADDRESS, content.clone()));
    let low = FaultKind::Supply { millivolts: 2800 };
    requests.machine.faults.push(Fault::after_power_up(0, low));
    requests.machine.sampling_deadline_ns = 10_000 * MS;
    requests.machine.timeout = Duration::from_secs(300);
    let block = paper(0, 0.1, None).block.clone();
    let block = bead_wire::Block::try_from(&block[..]).expect("a block fits");
    requests.request(5.05, &Request::WriteSettings { block });
    requests.request(5.06, &Request::EraseSettings);
    let answered = requests.run();
    assert_eq!(answered.outcome.flash_operations, []);
    assert_eq!(answered.store(), content);
    for request in [0, 1] {
        let (outcome, detail) = answered.received.answer(request);
        assert_eq!(outcome, Outcome::FlashFailed);
        assert!(detail.contains("supply is below 2.93 V"), "{detail}");
    }
    assert!(answered.received.causes().contains(&FaultCause::SupplyLow));
    assert_eq!(answered.received.last::<Health>().standing, Standing::SUPPLY_LOW);
    assert!(
        answered.received.status().uptime_ms < 5000,
        "the wait is before the clock starts"
    );
}

#[test]
fn with_each_crystal_that_boards_have_a_strike_is_measured_alike() {
    let strike = paper(1, 0.1, Some(1));
    let measured = |mhz: u32| {
        let mut machine = strike.machine();
        machine.count_instructions = false;
        machine.hse_hz = mhz * 1_000_000;
        let outcome = execute(&machine);
        // The emulator notes caches and prefetch that are off at this clock.
        assert_eq!((outcome.unmodelled, outcome.overruns), (vec![], 0), "{mhz} MHz");
        let received = RunFrames::new(outcome.uart);
        assert_eq!(received.causes(), [], "{mhz} MHz");
        let [strike] = &received.strikes()[..] else {
            panic!("one strike, with {mhz} MHz")
        };
        (strike.said, strike.scans.clone())
    };
    let by_8_mhz = measured(8);
    for mhz in [12, 16, 25] {
        assert_eq!(measured(mhz), by_8_mhz, "{mhz} MHz");
    }
}

#[test]
fn a_crystal_that_never_starts_or_is_another_one_or_another_part_leaves_a_bead_that_answers() {
    type Case = (fn(&mut Run), FaultCause, Standing, &'static str);
    let cases: [Case; 5] = [
        (
            |run| run.faults.push(Fault::after_power_up(0, FaultKind::CrystalStops)),
            FaultCause::CrystalFailed,
            Standing::CRYSTAL_FAILED,
            "the crystal does not start: ",
        ),
        (
            |run| run.hse_hz = 10_000_000,
            FaultCause::CrystalWrong,
            Standing::CRYSTAL_FAILED,
            "the crystal has ",
        ),
        // Nearest to one that boards have.
        (
            |run| run.hse_hz = 24_000_000,
            FaultCause::CrystalWrong,
            Standing::CRYSTAL_FAILED,
            "the crystal has ",
        ),
        (
            |run| run.hse_hz = 26_000_000,
            FaultCause::CrystalWrong,
            Standing::CRYSTAL_FAILED,
            "the crystal has ",
        ),
        (
            |run| run.dev_id = Some(0x419),
            FaultCause::PartWrong,
            Standing::PART_WRONG,
            "the part is 0x419, ",
        ),
    ];
    for (change, cause, standing, said) in cases {
        let mut requests = quiet();
        change(&mut requests.machine);
        without_samples(requests, cause, standing, said);
    }
}

fn without_samples(mut requests: Requests, cause: FaultCause, standing: Standing, said: &str) {
    requests.machine.sampling_deadline_ns = 4_000 * MS;
    let crystal_hz = f64::from(requests.machine.hse_hz);
    let block = paper(0, 0.1, None).block.clone();
    let block = bead_wire::Block::try_from(&block[..]).expect("a block fits");
    requests.request(0.5, &Request::Status);
    requests.request(1.5, &Request::WriteSettings { block });
    let answered = requests.run();
    assert_eq!(
        (answered.outcome.sampling, answered.outcome.resets.len()),
        (None, 0)
    );
    assert_eq!(answered.received.causes(), [cause]);
    let detail = &answered.received.details()[0];
    assert!(detail.starts_with(said), "{detail}");
    assert!(
        detail.ends_with("the bead answers, and takes no samples"),
        "{detail}"
    );
    if cause == FaultCause::CrystalWrong {
        let khz: f64 = detail
            .split(' ')
            .nth(3)
            .and_then(|word| word.parse().ok())
            .expect("a frequency");
        assert!((khz * 1000.0 / crystal_hz - 1.0).abs() < 0.01, "{detail}");
    }
    assert_eq!(answered.received.answer(0).0, Outcome::Done);
    assert_eq!(answered.received.answer(1).0, Outcome::Done);
    assert_eq!(answered.received.last::<Health>().standing, standing);
    let status = answered.received.status();
    assert_eq!((status.samples, status.armed), (0, false));
    // The bead reports it once a second, and the watchdog does not reset it.
    assert!(status.uptime_ms >= 3000, "{} ms", status.uptime_ms);
}

#[test]
fn a_crystal_that_stops_ends_the_boot_with_a_record_and_the_next_one_answers() {
    let mut requests = quiet();
    let stops = Fault::after_first_scan(20 * MS, FaultKind::CrystalStops);
    requests.machine.faults.push(stops);
    let answered = requests.run();
    let resets: Vec<_> = answered.outcome.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(resets, [ResetCause::Software]);
    let faults = answered.received.all::<bead_wire::Fault>();
    let faults: Vec<_> = faults.map(|fault| (fault.cause, fault.boot)).collect();
    assert_eq!(
        faults,
        [(FaultCause::CrystalFailed, 0), (FaultCause::CrystalFailed, 1)]
    );
}

#[test]
fn a_crystal_that_swings_again_is_taken_up_after_two_seconds_of_it() {
    let mut requests = quiet();
    requests.machine.sampling_deadline_ns = 6_000 * MS;
    for (at, kind) in [
        (0, FaultKind::CrystalStops),
        (1_000 * MS, FaultKind::CrystalStarts),
        // Too short an oscillation does not count.
        (2_000 * MS, FaultKind::CrystalStops),
        (2_200 * MS, FaultKind::CrystalStarts),
    ] {
        requests.machine.faults.push(Fault::after_power_up(at, kind));
    }
    let answered = requests.run();
    let [reset] = &answered.outcome.resets[..] else {
        panic!("{:?}", answered.outcome.resets);
    };
    assert_eq!(reset.cause, ResetCause::Software);
    assert!((4_200 * MS..4_500 * MS).contains(&reset.at_ns), "{reset:?}");
    assert_eq!(answered.received.causes(), [FaultCause::CrystalFailed; 2]);
    assert!(answered.received.status().samples > 0);
}

#[test]
fn a_start_that_hangs_is_ended_by_the_watchdog() {
    let mut requests = quiet();
    // All functions of the store become `b .` while the start waits for the supply.
    let elf = fs::read(image()).unwrap();
    let elf = object::File::parse(&*elf).unwrap();
    let symbols = elf.symbols().filter(|symbol| symbol.size() > 0);
    let hangs = symbols.filter(|symbol| symbol.name().is_ok_and(|name| name.contains("bead_store")));
    let hangs: Vec<_> = hangs
        .map(|symbol| Poke {
            at_ns: 5 * MS,
            address: symbol.address() as u32 & !1,
            bytes: vec![0xFE, 0xE7],
        })
        .collect();
    assert!(!hangs.is_empty());
    requests.machine.pokes = hangs;
    // The longest virtual time for an instruction, as the run waits for half a minute.
    requests.machine.shift = Some(10);
    requests.machine.sampling_deadline_ns = 40_000 * MS;
    let outcome = execute(&requests.machine);
    let resets: Vec<_> = outcome
        .resets
        .iter()
        .map(|reset| (reset.cause, reset.at_ns / (1000 * MS)))
        .collect();
    assert_eq!(resets.first(), Some(&(ResetCause::Watchdog, 32)));
}
