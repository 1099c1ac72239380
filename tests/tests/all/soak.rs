//! Hours of sparse strikes in one run: counts, memory and time are right at the end.

use std::time::Duration;

use bead_bench::bridge::Bridge;
use bead_compare::replay::replay;
use bead_recording::frames::{FrameReader, Item};
use bead_recording::strikes::Strikes;
use bead_tests::{paper_at, timed};
use bead_wire::{Message, Status, StrikeFlags};

/// Length of the soak, s of the bead's time.
const HOURS: f64 = 5.0 * 3600.0;

/// Stack of an interrupt, with the registers of the floating-point unit and the handler's own, bytes.
const INTERRUPT: u32 = 256;

#[test]
#[ignore = "five hours of the bead's time: BEAD_SOAK=600 takes ten minutes of it"]
fn after_five_hours_of_sparse_strikes_all_counts_are_as_they_should_be() {
    let given = std::env::var("BEAD_SOAK")
        .ok()
        .and_then(|seconds| seconds.parse().ok());
    let seconds: f64 = given.unwrap_or(HOURS);
    // Two strikes, 4 s apart, again and again: the codes are a ring.
    let emulation = paper_at(timed(0.5, 2, 4.0), Some(1));
    let ring = emulation.seconds();
    let settings = emulation.settings;
    let mut bridge = Bridge::new(&emulation, None).unwrap_or_else(|error| panic!("{error}"));
    let (mut reader, mut strikes) = (FrameReader::default(), 0_u64);
    let (mut first, mut last): (Option<Status>, Option<(u64, Status)>) = (None, None);
    let mut pending = Vec::new();
    while bridge.now().as_secs_f64() < seconds {
        let said = bridge
            .pass(&[], Duration::from_secs(1))
            .unwrap_or_else(|error| panic!("{error}"));
        reader.feed(&said, None, |item| match item {
            Item::Frame(frame) => {
                match frame.message {
                    Message::Status(status) => {
                        first = first.or(Some(status).filter(|status| status.uptime_ms > 20_000));
                        last = Some((frame.header.sample_index, status));
                    }
                    Message::Fault(ref fault) => panic!("{fault:?}"),
                    _ => {}
                }
                pending.push(frame);
            }
            Item::Rejected(reject) => panic!("{reject:?}"),
        });
        // Strikes are whole once a second is over; what is read is forgotten, as `bead record` does.
        for strike in Strikes::new(std::mem::take(&mut pending), [(None, settings)].into()) {
            let said = &strike.said;
            assert_eq!(said.flags, StrikeFlags::NONE, "strike {strikes}");
            assert_eq!(u64::from(said.strike), strikes);
            // Equal codes give equal bits, after a minute and after hours: those of the host.
            assert_eq!(replay(&strike).first_difference, None, "strike {strikes}");
            strikes += 1;
        }
    }
    let (index, last) = last.expect("it tells its status");
    let first = first.expect("the run is longer than 20 s");
    println!("{:.0} s, {strikes} strikes, {last:?}", seconds);
    assert_eq!(reader.counters().lost, 0);
    assert_eq!((last.overruns, last.blocks_dropped, last.epoch), (0, 0, 0));
    assert_eq!(
        (last.frames_dropped_queue_full, last.frames_dropped_too_long),
        (0, 0)
    );
    // The index is the time: a scan every 10 µs since the first one, within a block of 2 ms.
    let ran = last.samples as f64 * 1e-5;
    assert!((last.uptime_ms as f64 * 1e-3 - ran).abs() < 0.05, "{last:?}");
    assert!(index.abs_diff(last.samples) <= 400, "{index}, {last:?}");
    // No strike is missing, and nothing grows on the stack.
    let expected = 2.0 * (ran / ring).floor();
    assert!(
        (expected..=expected + 2.0).contains(&(strikes as f64)),
        "{strikes} of {expected}"
    );
    // An interrupt that comes at the deepest moment makes the mark a frame deeper, once. A word that each
    // strike left would take 25 KB in five hours.
    let deeper = first.stack_free_min - last.stack_free_min;
    assert!(deeper <= INTERRUPT, "{first:?} {last:?}");
}
