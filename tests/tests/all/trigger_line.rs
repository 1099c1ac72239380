//! The trigger line, and windows that a host asks for: beads that feel little keep what they felt.

use bead_bench::emulation::{Emulation, Placed, Ran};
use bead_bench::several::{self, Crystals};
use bead_compare::replay::replay;
use bead_recording::strikes::RecordedStrike;
use bead_testing::block;
use bead_tests::{RunFrames, paper, place, scenario, solved, timed};
use bead_wire::{FaultCause, StrikeFlags};

/// Threshold in codes: no force in this row rises by as much.
const DEAF: u16 = 4000;

/// A bead whose threshold nothing reaches.
fn deafen(emulation: &mut Emulation) {
    let settings = emulation
        .settings
        .with(|bead| bead.capture.threshold = f64::from(DEAF) * bead.force.per_code);
    emulation.settings = settings.unwrap_or_else(|error| panic!("{error}"));
    emulation.block = block(&emulation.settings);
}

fn strikes(ran: &Ran) -> Vec<RecordedStrike> {
    RunFrames::new(ran.stream.clone()).strikes()
}

#[test]
fn a_bead_below_its_threshold_keeps_the_window_around_the_strike_of_another() {
    let scenario = scenario("ten-intruders");
    let solution = solved(&scenario);
    let timing = timed(0.07, 2, 0.05);
    let prepare = |placed: Placed| {
        let mut run = place(&scenario, &solution, placed, timing);
        if placed.bead == 16 {
            deafen(&mut run);
        }
        run
    };
    let placed = several::placed(
        &[7, 8, 16],
        &Crystals::Each(vec![80.0, 0.0, -90.0]),
        0.05,
        1,
        true,
    );
    let placed = placed.unwrap_or_else(|failure| panic!("{failure}"));
    let ran = several::run(&placed, |placed| Ok(prepare(placed)), |_| {})
        .unwrap_or_else(|failure| panic!("{failure}"));

    let [near, middle, far] = [0, 1, 2].map(|n| strikes(&ran[n].1));
    assert_eq!([near.len(), middle.len(), far.len()], [2; 3]);
    for strike in near.iter().chain(&middle) {
        assert_eq!(strike.said.flags, StrikeFlags::NONE);
    }
    for (near, far) in near.iter().zip(&far) {
        assert!(
            far.said.flags.has(StrikeFlags::TRIGGERED_BY_LINE),
            "{:?}",
            far.said
        );
        assert_eq!(replay(far).first_difference, None);
        // Both report one instant, on their common time.
        let instant = |n: usize, strike: &RecordedStrike| {
            let truth = &ran[n].0.truth;
            let since = (strike.said.trigger_index as f64 - 1.0) / (100e3 * (1.0 + truth.clock_ppm * 1e-6));
            truth.began + since
        };
        let apart = instant(2, far) - instant(0, near);
        assert!(apart.abs() < 10e-6, "{apart} s");
        // The wave is in it: 2.2 ms later.
        let later = far.said.peak_index as f64 - far.said.trigger_index as f64;
        assert!((200.0..350.0).contains(&later), "{later} scans");
        let truth = ran[2].0.truth.truth;
        let force = far.said.peak_force.newtons() / truth.peak_force - 1.0;
        let absorbed = far.said.absorbed_measured.joules() / truth.absorbed - 1.0;
        println!(
            "far bead: force {:+.2} %, A {:+.2} %",
            force * 100.0,
            absorbed * 100.0
        );
        assert!(force.abs() < 0.02 && absorbed.abs() < 0.02, "{force} {absorbed}");
    }
    // The beads in front ran once, with no line: what they find by themselves goes first.
    assert!(ran[1].0.truth.line_low.is_empty() && !ran[2].0.truth.line_low.is_empty());
    // With the line they say the same.
    let mut again = prepare(placed[1]);
    again.truth.line_low = ran[0]
        .1
        .pulls_ns
        .iter()
        .map(|times| {
            times.map(|ns| {
                (ns as f64 - ran[0].1.first_scan_ns as f64) * 1e-9 + placed[0].began - placed[1].began
            })
        })
        .collect();
    let again = again.run().unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!(again.stream, ran[1].1.stream);
}

#[test]
fn touch_on_the_line_opens_no_window_and_one_that_is_held_low_is_told_once_and_costs_nothing() {
    let mut run = paper(2, 0.3, Some(1));
    let alone = run.run().unwrap_or_else(|error| panic!("{error}"));
    // 20 µs each; and low for good between the strikes.
    let touch = (0..20)
        .map(|n| 0.1 + 0.0017 * f64::from(n))
        .map(|at| [at, at + 20e-6]);
    run.truth.line_low = touch.chain([[0.2, 0.9]]).collect();
    let ran = run.run().unwrap_or_else(|error| panic!("{error}"));
    let received = RunFrames::new(ran.stream.clone());
    assert_eq!(received.causes(), [FaultCause::TriggerLineLow]);
    let said = |ran: &Ran| strikes(ran).iter().map(|strike| strike.said).collect::<Vec<_>>();
    // The fall is an edge like any other: it keeps a window at 0.2 s, and the line keeps none after that.
    let (said, alone) = (said(&ran), said(&alone));
    assert_eq!(said.len(), 3);
    assert!(said[1].flags.has(StrikeFlags::TRIGGERED_BY_LINE));
    for (with, without) in [(&said[0], &alone[0]), (&said[2], &alone[1])] {
        assert_eq!(with.first_index, without.first_index);
        assert_eq!(with.absorbed_measured, without.absorbed_measured);
        assert_eq!(with.absorbed_predicted, without.absorbed_predicted);
    }
}
