//! Boots that end in faults, and tasks that hang.

use std::panic::catch_unwind;

use bead_app::{BeadCounters, BootRecord, FramesWaiting, Progress};
use bead_wire::{FaultCause, LastFault};

use crate::bead::{StartState, TestBead};

/// Bits 31..24 of RCC_CSR (RM0090 section 7.3.21).
const POWER_ON: u8 = 1 << 3;
const SOFTWARE: u8 = 1 << 4;
const WATCHDOG: u8 = 1 << 5;

/// The record after boots with these ends: a fault, or `None` for a reset without one.
fn after(ends: &[Option<FaultCause>]) -> BootRecord {
    let (_, mut record) = BootRecord::begin(None, FramesWaiting::new(0), POWER_ON);
    for (boot, end) in (0..).zip(ends) {
        if let Some(cause) = end {
            record.end(boot, *cause, 0x0800_1234, "it failed");
        }
        (_, record) = BootRecord::begin(record.sealed().checked(), FramesWaiting::new(0), SOFTWARE);
    }
    record
}

fn started(record: BootRecord, reset_cause: u8) -> TestBead {
    TestBead::start(StartState {
        record: record.sealed().checked(),
        reset_cause,
        ..StartState::default()
    })
}

#[test]
fn a_fault_that_ends_a_boot_is_told_at_the_next_and_with_each_identity_after_it() {
    let (_, mut record) = BootRecord::begin(None, FramesWaiting::new(0), POWER_ON);
    record.end(0, FaultCause::HardFault, 0x0800_1234, "CFSR 0x00010000");
    let (boot, record) = BootRecord::begin(record.sealed().checked(), FramesWaiting::new(3), SOFTWARE);
    let ended = boot.ended_by.as_ref().expect("it is told");
    assert_eq!(
        (ended.cause, ended.boot, ended.pc),
        (FaultCause::HardFault, 0, 0x0800_1234)
    );
    assert_eq!(ended.detail.as_str(), "CFSR 0x00010000");
    assert_eq!(
        (boot.number, boot.faults, boot.failed, boot.frames_lost),
        (1, 1, 1, 3)
    );

    let mut bead = started(record, SOFTWARE);
    bead.run(2.1);
    assert_eq!(bead.running.causes(), [], "only at the next boot");
    let told = bead.running.all::<LastFault>();
    let told: Vec<_> = told.map(|last| (last.faults, last.boot, last.cause)).collect();
    assert_eq!(told, [(1, 0, FaultCause::HardFault); 3]);
}

#[test]
fn a_reset_by_the_watchdog_is_a_fault_and_one_by_power_forgets_all() {
    let (boot, _) = BootRecord::begin(after(&[]).checked(), FramesWaiting::new(0), WATCHDOG);
    assert_eq!(boot.ended_by.map(|ended| ended.cause), Some(FaultCause::Watchdog));
    // A boot that wrote its record before the watchdog reset it keeps its own cause.
    let mut record = after(&[]);
    record.end(0, FaultCause::Panic, 0, "it failed");
    let (boot, _) = BootRecord::begin(record.sealed().checked(), FramesWaiting::new(0), WATCHDOG);
    assert_eq!(boot.ended_by.map(|ended| ended.cause), Some(FaultCause::Panic));
    let (boot, _) = BootRecord::begin(record.sealed().checked(), FramesWaiting::new(2), POWER_ON);
    assert_eq!((boot.number, boot.faults, boot.frames_lost), (0, 0, 0));
    assert_eq!((boot.ended_by, boot.last_fault), (None, None));
    record.prove();
    assert!(
        record.checked().is_none(),
        "a record that changed needs a new checksum"
    );
}

#[test]
fn a_boot_that_is_proven_is_no_failed_one() {
    let fails = Some(FaultCause::HardFault);
    let mut record = after(&[fails; 4]);
    record.prove();
    record.end(4, FaultCause::HardFault, 0, "");
    let (boot, _) = BootRecord::begin(record.sealed().checked(), FramesWaiting::new(0), SOFTWARE);
    assert_eq!((boot.faults, boot.failed), (5, 1));
}

#[test]
fn a_task_that_hangs_is_named() {
    /// Adds the counts of a quarter of a second in which all tasks made progress.
    fn gone_on(c: &mut BeadCounters) {
        c.samples += 25_000;
        c.blocks_handed_on += 125;
        c.blocks_estimated += 125;
        c.frames_sent += 1;
    }
    type Change = fn(&mut BeadCounters);
    let estimates_nothing: Change = |c| {
        gone_on(c);
        c.blocks_estimated = 0;
    };
    let sends_nothing: Change = |c| {
        gone_on(c);
        c.frames_sent = 0;
    };
    let only_sends: Change = |c| {
        c.overruns += 1;
        c.frames_sent += 1;
    };
    let cases: [(Change, Option<&str>); 6] = [
        (gone_on, None),
        (|c| c.frames_sent += 1, Some("acquisition hangs")),
        (estimates_nothing, Some("estimation hangs")),
        (sends_nothing, Some("transmission hangs")),
        (only_sends, Some("no samples arrive")),
        (|c| c.overruns += 1, Some("no samples arrive")),
    ];
    for (change, hangs) in cases {
        let ended = catch_unwind(|| {
            let mut counters = BeadCounters::default();
            let mut progress = Progress::new(true, counters);
            for check in 0..5 {
                change(&mut counters);
                let fed = progress.check(counters);
                assert_eq!(fed, hangs.is_none(), "check {check}");
            }
        });
        let said = ended.err().map(|why| *why.downcast::<&str>().expect("a line"));
        assert_eq!(said, hangs);
    }
}
