//! An image that crashes says so after it has come up again.

use bead::frames::Message;
use bead_tests::{Heard, paper};
use bead_wire::{Arrival, FaultCause};
use stm32f405_qemu::Poke;

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
        .frames
        .iter()
        .find_map(|frame| match &frame.message {
            Message::Fault(fault) => Some(fault),
            _ => None,
        })
        .expect("the second boot reports the fault of the first");
    assert_eq!((fault.cause, fault.boot), (FaultCause::HardFault, 0), "{fault:?}");
    assert!(
        heard
            .frames
            .iter()
            .any(|frame| matches!(frame.arrival, Arrival::Restart { .. }))
    );
    assert_eq!(bead::strikes::assemble(&heard.frames, None).len(), 1);
}
