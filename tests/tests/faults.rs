//! What goes wrong is survived, reported and counted, and a strike that comes later is measured.

use bead::frames::Message;
use bead::replay::replay;
use bead::strikes::assemble;
use bead_tests::{Heard, paper};
use bead_wire::{Arrival, FaultCause};
use stm32f405_qemu::{Fault, FaultKind, Outcome, Poke};

#[test]
fn a_hard_fault_leaves_a_trace_that_the_next_boot_reports_and_a_later_strike_is_measured() {
    let run = paper(1, 0.1, Some(1));
    let mut machine = run.machine();
    // The strike moves to 120 ms; at 50 ms the vector table's entry of the DMA stream that fills the ring is
    // overwritten, so that the next interrupt of the acquisition jumps out of memory. The reset loads the
    // image again.
    let quiet = machine.stimulus[0];
    machine.stimulus.splice(0..0, std::iter::repeat_n(quiet, 10_000));
    const DMA2_STREAM0: u32 = 0x0800_0000 + 4 * (16 + 56);
    machine.pokes = vec![Poke {
        at_ns: 50_000_000,
        address: DMA2_STREAM0,
        bytes: vec![0xf1, 0xff, 0xff, 0xef],
    }];
    let outcome = machine.execute().unwrap();
    assert_eq!(outcome.resets.len(), 1, "{:?}", outcome.log);

    let heard = Heard::new(outcome.uart);
    let boots: Vec<u32> = heard
        .frames
        .iter()
        .filter_map(|frame| match &frame.message {
            Message::Identity(identity) => Some(identity.boot),
            _ => None,
        })
        .collect();
    assert!(boots.contains(&0) && boots.contains(&1), "{boots:?}");
    let fault = heard
        .faults()
        .next()
        .expect("the second boot reports the fault of the first");
    assert_eq!((fault.cause, fault.boot), (FaultCause::HardFault, 0), "{fault:?}");
    assert!(
        heard
            .frames
            .iter()
            .any(|frame| matches!(frame.arrival, Arrival::Restart { .. }))
    );
    assert_eq!(assemble(&heard.frames, None).len(), 1);
}

/// Runs a quiet chain with a fault at 50 ms and a strike at 120 ms.
fn struck_after(fault: Fault) -> (Outcome, Heard) {
    let run = paper(1, 0.1, Some(1));
    let mut machine = run.machine();
    let quiet = machine.stimulus[0];
    machine.stimulus.splice(0..0, std::iter::repeat_n(quiet, 10_000));
    machine.faults = vec![fault];
    let outcome = machine.execute().unwrap_or_else(|error| panic!("{error}"));
    let heard = Heard::new(outcome.uart.clone());
    let strikes = assemble(&heard.frames, None);
    assert_eq!(strikes.len(), 1, "{:?}", outcome.log);
    assert_eq!(replay(&strikes[0]).first_difference, None);
    // The index goes on over the gap: the recorded codes are those injected at their indices.
    if outcome.resets.is_empty() {
        for (i, codes) in strikes[0].scans.iter().enumerate() {
            let row = strikes[0].said.first_index as usize + i - 1;
            assert_eq!(*codes, machine.stimulus[row], "row {row}");
        }
    }
    (outcome, heard)
}

#[test]
fn an_adc_overrun_costs_an_epoch_is_counted_and_a_later_strike_is_measured_at_its_true_index() {
    let (outcome, heard) = struck_after(Fault {
        at_ns: 50_000_000,
        kind: FaultKind::AdcOverrun,
    });
    assert_eq!((outcome.overruns, outcome.resets.len()), (1, 0));
    let status = heard.status();
    assert_eq!((status.overruns, status.epoch, status.strikes), (1, 1, 1));
    let faults: Vec<_> = heard.faults().map(|fault| fault.cause).collect();
    assert_eq!(faults, [FaultCause::AdcOverrun]);
}

#[test]
fn a_dma_error_ends_in_a_reset_that_is_reported_and_a_later_strike_is_measured() {
    let (outcome, heard) = struck_after(Fault {
        at_ns: 50_000_000,
        kind: FaultKind::AdcDmaError,
    });
    assert_eq!(outcome.resets.len(), 1);
    let faults: Vec<_> = heard.faults().map(|fault| (fault.cause, fault.boot)).collect();
    assert_eq!(faults, [(FaultCause::DmaError, 0)], "{:?}", outcome.log);
}
