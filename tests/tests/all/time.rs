//! Time: edges at the sync input to the clock. `chain.rs` has beads whose clocks differ on one time base.

use bead_bench::emulation::Emulation;
use bead_tests::{RunFrames, execute, paper_at, timed};
use bead_wire::Sync;

/// Clocks of the sample timer in a second.
const CLOCKS: f64 = 84e6;
/// Clocks in a sample period.
const PERIOD: u64 = 840;

fn edges(received: &RunFrames) -> Vec<Sync> {
    received.all().copied().collect()
}

/// Clocks since sample index 0.
fn clocks(sync: &Sync) -> u64 {
    sync.index * PERIOD + u64::from(sync.clocks)
}

/// A quiet bead for `seconds`, with edges at these times in s since the first triggered scan.
fn quiet(seconds: f64, at: &[f64]) -> Emulation {
    let mut run = paper_at(timed(seconds, 0, 1.0), Some(1));
    run.sync(at.to_vec());
    run
}

fn received(run: &Emulation) -> RunFrames {
    RunFrames::new(run.run().unwrap_or_else(|failure| panic!("{failure}")).stream)
}

#[test]
fn an_edge_is_told_to_the_clock_of_the_sample_timer() {
    // A whole sample after the first scan, just before and just after one, and anywhere. The emulator counts
    // their times from the first scan, which is not at the same phase of the timer's clock in every image.
    let at = [
        0.010_000_000,
        0.123_456_789,
        0.399_999_995,
        0.600_010_005,
        0.987_654_325,
    ];
    let edges = edges(&received(&quiet(0.1, &at)));
    assert_eq!(edges.len(), at.len());
    let (mut least, mut most) = (f64::MAX, f64::MIN);
    for ((edge, at), number) in edges.iter().zip(at).zip(0..) {
        // The first triggered scan has the index 1.
        let expected = at * CLOCKS + PERIOD as f64;
        let off = clocks(edge) as f64 - expected;
        assert!(
            off.abs() < 1.0,
            "the edge at {at} s is off by {off} clocks: {edge:?}"
        );
        (least, most) = (least.min(off), most.max(off));
        assert_eq!((edge.edge, edge.missed), (number, 0));
        assert_eq!(u64::from(edge.clocks_per_sample), PERIOD);
    }
    // The phase is the same for all edges: they differ by what a whole number of clocks leaves, and by 1 ns.
    assert!(most - least < 1.09, "{least} to {most} clocks");
}

#[test]
fn edges_too_close_are_counted_and_a_later_one_is_told() {
    // Three within 10 ms of one another, and one after.
    let edges = edges(&received(&quiet(0.1, &[0.1, 0.102, 0.104, 0.3])));
    let told: Vec<_> = edges
        .iter()
        .map(|edge| (edge.edge, edge.index, edge.missed))
        .collect();
    assert_eq!(told, [(0, 10_001, 0), (1, 30_001, 1)]);
}

#[test]
fn a_pin_that_floats_costs_no_sample_and_a_hundred_frames_a_second() {
    // 100 kHz for a second, not in step with the samples.
    let storm: Vec<f64> = (0..100_000).map(|n| 0.05 + f64::from(n) * 1.000_7e-5).collect();
    let mut run = paper_at(timed(0.2, 1, 0.1), Some(1));
    let calm = run.run().unwrap();
    run.sync(storm.clone());
    let busy = run.run().unwrap();
    let (quiet, noisy) = (RunFrames::new(calm.stream), RunFrames::new(busy.stream));
    let edges = edges(&noisy);
    assert!((90..=101).contains(&edges.len()), "{}", edges.len());
    assert!(edges.last().unwrap().missed as usize >= edges.len() - 2);
    // Each reported edge is one that came.
    for edge in &edges {
        let at = (clocks(edge) - PERIOD) as f64 / CLOCKS;
        let nearest = storm.iter().map(|edge| (at - edge).abs()).fold(1.0, f64::min);
        assert!(nearest < 1.1 / CLOCKS, "{at} s: {nearest}");
    }
    // The strike is measured the same in every bit, and nothing was lost.
    let strikes = |received: &RunFrames| {
        let strikes = received.strikes();
        strikes.iter().map(|strike| strike.said).collect::<Vec<_>>()
    };
    assert_eq!(strikes(&quiet).len(), 1);
    assert_eq!(strikes(&quiet), strikes(&noisy));
    assert_eq!((busy.report.overruns, noisy.counters.lost), (0, 0));
    let status = noisy.status();
    assert_eq!((status.overruns, status.blocks_dropped, status.epoch), (0, 0, 0));
    let cost = busy.report.instructions_per_sample.run - calm.report.instructions_per_sample.run;
    println!("{cost:.1} instructions a sample for the storm");
    assert!(cost < 20.0, "{cost}");
}

#[test]
fn the_count_goes_on_where_32_bits_of_it_end() {
    // 2^32 clocks are 51.13 s.
    let at = [1.0, 51.1, 51.2];
    let run = quiet(50.5, &at);
    let mut machine = run.machine();
    machine.count_instructions = false;
    let edges = edges(&RunFrames::new(execute(&machine).uart));
    let expected: Vec<u64> = at
        .iter()
        .map(|at| (at * CLOCKS).round() as u64 + PERIOD)
        .collect();
    assert_eq!(edges.iter().map(clocks).collect::<Vec<_>>(), expected);
}
