//! Time: edges at the sync input to the clock, and beads whose clocks differ on one time base.

use std::path::{Path, PathBuf};

use bead_bench::emulation::{Emulation, Placed};
use bead_compare::front_end::AnalogFrontEnd;
use bead_recording::clock::compare;
use bead_recording::file::{About, RecordingWriter};
use bead_recording::strikes::assemble;
use bead_tables::whole::Target;
use bead_tests::{RunFrames, image, paper_at, scenario, solved, timed};
use bead_wire::{Message, Sync};
use hertz_chain::{Scenario, Solution};

/// Clocks of the sample timer in a second.
const CLOCKS: f64 = 84e6;
/// Clocks in a sample period.
const PERIOD: u64 = 840;

fn edges(received: &RunFrames) -> Vec<Sync> {
    let edges = received.frames.iter().filter_map(|frame| match frame.message {
        Message::Sync(sync) => Some(sync),
        _ => None,
    });
    edges.collect()
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
    // Each that is told is one that came.
    for edge in &edges {
        let at = (clocks(edge) - PERIOD) as f64 / CLOCKS;
        let nearest = storm.iter().map(|edge| (at - edge).abs()).fold(1.0, f64::min);
        assert!(nearest < 1.1 / CLOCKS, "{at} s: {nearest}");
    }
    // The strike is measured the same in every bit, and nothing was lost.
    let strikes = |received: &RunFrames| {
        assemble(received.frames.clone(), None)
            .iter()
            .map(|s| s.said)
            .collect::<Vec<_>>()
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
    let edges = edges(&RunFrames::new(machine.execute().unwrap().uart));
    let expected: Vec<u64> = at
        .iter()
        .map(|at| (at * CLOCKS).round() as u64 + PERIOD)
        .collect();
    assert_eq!(edges.iter().map(clocks).collect::<Vec<_>>(), expected);
}

/// A run of bead `bead`, its crystal fast by `ppm`, which was started `early` seconds before time 0; strikes
/// and edges come at the same true times for all. Recorded into `folder`.
fn recorded(
    folder: &Path,
    scenario: &Scenario,
    solution: &Solution,
    bead: usize,
    ppm: f64,
    early: f64,
) -> PathBuf {
    let timing = timed(early + 0.1, 4, 1.0);
    let placed = Placed {
        clock_ppm: ppm,
        ..Placed::alone(bead, Some(bead as u64))
    };
    let front_end = AnalogFrontEnd::default();
    let mut run = Emulation::place(scenario, solution, placed, &front_end, timing, &image())
        .unwrap_or_else(|failure| panic!("{failure}"));
    // In step with neither clock.
    run.sync((1..16).map(|n| early + 0.250_371_9 * f64::from(n)));
    let ran = run.run().unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!((ran.report.overruns, ran.report.resets), (0, 0));
    assert_eq!(ran.report.unmodelled, [""; 0]);
    let path = folder.join(format!("bead-{bead}.mcap"));
    let mut writer =
        RecordingWriter::create(&Target::new(&path), &About::default()).expect("the folder is ours");
    let zero = 1_700_000_000_000_000_000 - (early * 1e9) as u64;
    ran.write(&mut writer, zero).expect("the disk has room");
    writer.finish().expect("the disk has room");
    path
}

#[test]
fn two_beads_with_clocks_that_differ_tell_when_one_strike_reached_each() {
    let scenario = scenario("ten-intruders");
    let solution = solved(&scenario);
    let folder = tempfile::tempdir().unwrap();
    // Beads 7 and 10, 90 ppm apart: 0.3 ms over the run, three times what the wave takes from one to the
    // other.
    let beads = [(7, 60.125, 0.05), (10, -29.875, 0.013)];
    let paths =
        beads.map(|(bead, ppm, early)| recorded(folder.path(), &scenario, &solution, bead, ppm, early));
    let report = compare(&paths).unwrap_or_else(|failure| panic!("{failure}"));

    // Against the host, whose clock is true here.
    for (clock, (_, ppm, _)) in report.clocks.iter().zip(beads) {
        let within = clock.drift_uncertainty_ppm.unwrap();
        println!(
            "{ppm} ppm: found {:?} ± {within}, residual {} s, delay {} s",
            clock.drift_ppm, clock.residual_s, clock.delay_s
        );
        assert!(
            (clock.drift_ppm.unwrap() - ppm).abs() < within.max(1e-3),
            "{clock:?}"
        );
        assert!(within < 10.0, "{within}");
    }

    // Against one another, by fifteen edges.
    let [alignment] = &report.alignments[..] else {
        panic!("one other bead: {:?}", report.alignments)
    };
    println!("{alignment:?}");
    assert_eq!(alignment.edges_in_common, 15);
    let apart = ((1.0 - 29.875e-6) / (1.0 + 60.125e-6) - 1.0) * 1e6;
    let within = alignment.alignment.drift_uncertainty_ppm.unwrap();
    assert!(
        (alignment.alignment.drift_ppm - apart).abs() < within.max(5e-3),
        "{} for {apart}",
        alignment.alignment.drift_ppm
    );
    assert!(
        alignment.alignment.residual_max_s < 2.0 / CLOCKS,
        "{}",
        alignment.alignment.residual_max_s
    );
    // Index 0 of each is a sample period before its first triggered scan.
    let started = |early: f64, ppm: f64| -early - 1e-5 / (1.0 + ppm * 1e-6);
    let offset = (started(0.013, -29.875) - started(0.05, 60.125)) * (1.0 + 60.125e-6);
    assert!(
        (alignment.offset_s - offset).abs() < 2.0 / CLOCKS,
        "{} for {offset}",
        alignment.offset_s
    );

    // The chain says when the force at each bead is highest.
    let summary = solution.summary();
    let highest = |bead: usize| {
        let peak = summary.peak_force.iter().find(|peak| peak.contact == bead);
        peak.expect("the wave passes the bead").time
    };
    let took = highest(10) - highest(7);
    let arrivals = |bead: usize| -> Vec<f64> {
        let path = &paths[usize::from(bead == 10)];
        let of = report
            .strikes
            .iter()
            .filter(|strike| strike.place.recording == *path);
        of.map(|strike| strike.arrival_s).collect()
    };
    let (here, there) = (arrivals(7), arrivals(10));
    assert_eq!((here.len(), there.len()), (4, 4));
    for (here, there) in here.iter().zip(there) {
        let off = (there - here) / (1.0 + 60.125e-6) - took;
        println!(
            "{:.3} us for {:.3} us: off by {:.0} ns",
            (there - here) * 1e6,
            took * 1e6,
            off * 1e9
        );
        assert!(off.abs() < 1e-6, "{off}");
    }
}
