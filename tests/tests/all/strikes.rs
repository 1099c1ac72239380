//! Strikes through the image: how many, how accurate, and the same on the host in every bit.

use bead_bench::emulation::Ran;
use bead_compare::replay::replay;
use bead_recording::strikes::assemble;
use bead_tests::{LEAD_IN, RunFrames, paper};
use bead_wire::StrikeFlags;

const RATE: f64 = 100e3;

#[test]
fn the_same_run_gives_the_same_bytes_twice() {
    let run = paper(1, 0.1, Some(1));
    let first = run.run().unwrap();
    let second = run.run().unwrap();
    assert!(first.stream == second.stream, "the streams differ");
    assert_eq!(first.report.log, second.report.log);
    assert_eq!(
        first.report.instructions_per_sample,
        second.report.instructions_per_sample
    );
    // Another noise must give other bytes, or the comparison would prove nothing.
    let other = paper(1, 0.1, Some(2)).run().unwrap().stream;
    assert!(first.stream != other);
}

#[test]
fn two_strikes_give_two_reports_each_accurate_and_replayed_bit_for_bit() {
    let run = paper(2, 0.05, Some(1));
    let Ran { stream, report, .. } = run.run().unwrap();
    let received = RunFrames::new(stream);
    let strikes = assemble(received.frames.clone(), None);
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

#[test]
fn a_quiet_chain_gives_no_report_and_a_running_sample_count() {
    let Ran { stream, report, .. } = paper(0, 0.1, Some(1)).run().unwrap();
    let received = RunFrames::new(stream);
    assert!(assemble(received.frames.clone(), None).is_empty());
    let status = received.status();
    assert_eq!((status.strikes, status.armed), (0, true));
    assert!(status.samples as f64 > LEAD_IN * RATE && status.samples <= report.scans + 1);
}

#[test]
fn a_second_without_strikes_leaves_the_core_asleep() {
    let report = paper(0, 0.1, None).run().unwrap().report;
    assert_eq!(report.instructions_per_sample.total, None);
    let run = report.instructions_per_sample.run;
    println!(
        "idle: {:.1} % of the core",
        run / report.instructions_available * 100.0
    );
    // The target of docs/budget.md, at any speed of the core, with the start-up in it.
    assert!(run < 80.0, "{run}");
}

#[test]
fn a_strike_leaves_a_quarter_of_the_core_free() {
    let report = paper(1, 0.1, Some(1)).run().unwrap().report;
    let per_sample = report.instructions_per_sample;
    println!("{per_sample:?} of {}", report.instructions_available);
    let (total, worst) = (per_sample.total.unwrap(), per_sample.worst_block.unwrap());
    assert!(total > per_sample.observer.unwrap() + per_sample.reduced_chain.unwrap());
    assert!(worst >= total);
    assert!(worst < 0.75 * report.instructions_available);
}
