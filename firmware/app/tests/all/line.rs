//! The trigger line, and windows that a host asks for.

use bead_wire::{Outcome, Request, StrikeFlags};

use crate::bead::{TestBead, quiet, struck};

const CLOCKS: u32 = 840;

/// Count of the timer at a scan.
fn count_at(index: u64) -> u32 {
    (index as u32 - 1) * CLOCKS
}

/// Scans after the first of two strikes at which the bead lets the line fall; the second comes `apart` scans
/// later. Both begin `offset` scans after the start of a block.
fn falls(offset: u64, apart: u64) -> Vec<u64> {
    let mut bead = TestBead::with(|bead| bead.capture.length = bead.capture.history + 40e-5);
    let first = 1001 + offset;
    let start = move |index| first + if index < first + apart / 2 { 0 } else { apart };
    bead.running.signal = Box::new(move |index| struck(index, start(index)));
    bead.run(0.04);
    let strikes = bead.running.strikes();
    assert_eq!(strikes.len(), 2);
    let pulls = bead.running.hardware.line_pulls.borrow();
    pulls
        .iter()
        .map(|count| u64::from(count / CLOCKS) + 1 - strikes[0].trigger_index)
        .collect()
}

#[test]
fn the_line_falls_600_scans_after_a_strike_once_it_is_free() {
    for offset in [0, 100] {
        // The line is still high when the other strike is found, or low, or it is low when it would have to
        // fall again.
        for apart in [300, 500] {
            assert_eq!(falls(offset, apart), [600], "{offset} {apart}");
        }
        for apart in [650, 800] {
            let falls = falls(offset, apart);
            assert_eq!(falls.len(), 2, "{offset} {apart}");
            assert_eq!(falls[0], 600);
            assert!(falls[1].abs_diff(apart + 600) <= 1, "{falls:?}");
        }
    }
}

#[test]
fn a_fall_of_the_line_keeps_the_instant_that_it_tells_of_and_touch_does_not() {
    for (low_for, kept) in [(400, true), (5, false)] {
        let mut bead = TestBead::new();
        bead.run(0.02);
        let fell = bead.running.index + 31;
        let end = fell + low_for;
        let hardware = bead.running.hardware;
        bead.running.signal = Box::new(move |index| {
            if index == fell {
                hardware.line_edge.set(count_at(fell));
            }
            hardware.line_is_low.set((fell..end).contains(&index));
            quiet(index)
        });
        bead.run(0.04);
        let strikes = bead.running.strikes();
        assert_eq!(strikes.len(), usize::from(kept));
        if kept {
            assert_eq!(strikes[0].trigger_index, fell - 600);
            assert!(strikes[0].flags.has(StrikeFlags::TRIGGERED_BY_LINE));
        }
        assert_eq!(bead.running.causes(), []);
    }
}

#[test]
fn a_host_asks_for_the_window_around_a_scan_to_come() {
    let mut bead = TestBead::new();
    bead.run(0.02);
    let index = bead.running.index + 3123;
    assert_eq!(bead.outcome(&Request::Keep { index }), Outcome::Done);
    bead.run(0.06);
    let strikes = bead.running.strikes();
    assert_eq!((strikes.len(), strikes[0].trigger_index), (1, index));
    assert!(strikes[0].flags.has(StrikeFlags::TRIGGERED_ON_REQUEST));
}
