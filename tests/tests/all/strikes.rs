//! Strikes through the image: how many, how accurate, and the same on the host in every bit.

use bead_bench::emulation::Ran;
use bead_compare::replay::replay;
use bead_tests::{RunFrames, paper};
use bead_wire::StrikeFlags;

const RATE: f64 = 100e3;

#[test]
fn two_strikes_give_two_reports_each_accurate_and_replayed_bit_for_bit() {
    let run = paper(2, 0.05, Some(1));
    let Ran { stream, report, .. } = run.run().unwrap();
    let received = RunFrames::new(stream);
    let strikes = received.strikes();
    assert_eq!(strikes.len(), 2);
    for (strike, start) in strikes.iter().zip(&run.truth.starts) {
        assert_eq!(replay(strike).first_difference, None);
        assert_eq!(strike.said.flags, StrikeFlags::NONE);
        // The pulse takes 1.3 to 1.6 ms to bead 8, where the trigger sees its foot.
        let arrival = (strike.said.trigger_index as f64 - start) / RATE;
        assert!(
            (1.3e-3..1.6e-3).contains(&arrival),
            "{arrival} s after the strike"
        );
        let off = |energy: bead_wire::Energy| energy.joules() / run.truth.truth.absorbed - 1.0;
        let (a, b) = (
            off(strike.said.absorbed_measured),
            off(strike.said.absorbed_predicted),
        );
        println!("A {:+.3} %, B {:+.3} %", a * 100.0, b * 100.0);
        assert!(a.abs() < 2e-3, "A off by {a}");
        assert!(b.abs() < 5e-3, "B off by {b}");
    }
    assert!(received.counters.from_start());
    assert_eq!(
        (received.counters.lost, received.counters.rejected.total()),
        (0, 0)
    );
    let status = received.status();
    assert_eq!(
        (status.strikes, status.overruns, status.blocks_dropped),
        (2, 0, 0)
    );
    assert_eq!((report.overruns, report.resets), (0, 0));
    assert_eq!(report.unknown_registers, [""; 0]);
}
