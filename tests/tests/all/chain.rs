//! Beads of one chain under one strike, on a common time: what each absorbs, and when the wave came to it.

use std::path::Path;
use std::slice;
use std::sync::Arc;

use bead_bench::emulation::{Emulation, Placed, Ran};
use bead_bench::several::{self, Crystals};
use bead_compare::row::{BeadRow, RowChain, RowComparison, among, compare};
use bead_recording::clock::{self, ClockComparison, RecordedBoot};
use bead_recording::file::{About, Recording, RecordingOrigin, RecordingWriter, State};
use bead_tables::whole::Target;
use bead_tests::{place, solved, timed};
use hertz_chain::{Scenario, Solution};

/// Time within which the beads are switched on, s.
const START_SPREAD: f64 = 0.05;

/// The paper's row of ten absorbers, with intruders of another mass, kg, and another relaxation, s.
fn row(mass: f64, relaxation: f64) -> Scenario {
    let mut scenario = bead_tests::scenario("ten-intruders");
    scenario.intruders[0].mass = mass;
    scenario.chain.relaxation = relaxation;
    scenario
}

/// Hosts of the row.
const HOSTS: [usize; 10] = [7, 8, 9, 10, 11, 12, 13, 14, 15, 16];

fn placed() -> Vec<Placed> {
    let placed = several::placed(&HOSTS, &Crystals::Spread(100.0), START_SPREAD, 1, true);
    placed.unwrap_or_else(|failure| panic!("{failure}"))
}

/// Runs these beads with crystals up to 100 ppm off.
fn run(scenario: &Scenario, solution: &Solution, placed: &[Placed]) -> Vec<(Emulation, Ran)> {
    let timing = timed(0.02 + START_SPREAD, 1, 0.1);
    let prepare = |placed| {
        let mut run = place(scenario, solution, placed, timing);
        // In step with no clock.
        run.sync((1..).map(|n| 0.100_371_9 * f64::from(n)));
        Ok(run)
    };
    several::run(placed, prepare, |_| {}).unwrap_or_else(|failure| panic!("{failure}"))
}

/// Records them as `bead emulate` does.
fn record(path: &Path, ran: &[(Emulation, Ran)]) {
    let mut writer = RecordingWriter::create_for_several(&Target::new(path), &About::default())
        .unwrap_or_else(|error| panic!("{error}"));
    let lanes: Vec<_> = ran
        .iter()
        .map(|(emulation, ran)| {
            let origin = RecordingOrigin {
                address: emulation.settings.description().address,
                bead: Some(emulation.truth.bead),
                ..RecordingOrigin::default()
            };
            let lane = writer.join(&origin).unwrap_or_else(|error| panic!("{error}"));
            (lane, ran, emulation.truth.began)
        })
        .collect();
    several::write(&lanes, &mut writer).unwrap_or_else(|error| panic!("{error}"));
    writer.finish().unwrap_or_else(|error| panic!("{error}"));
}

/// Compares the recording as `bead compare` does.
fn compared(path: &Path, scenario: &Scenario, solution: &Solution) -> RowComparison {
    let received = Recording::open_named(path).unwrap_or_else(|error| panic!("{error}"));
    let chain = RowChain {
        scenario: scenario.clone(),
        solution: Arc::new(solution.clone()),
        hosts: scenario.hosts(),
    };
    let (places, notes) = among(&received, &chain, Some(""));
    let row = BeadRow::read(&received, &places, &chain, None).unwrap_or_else(|error| panic!("{error}"));
    compare(&row, &chain, notes).unwrap_or_else(|error| panic!("{error}"))
}

/// Asserts that the start of each bead and its highest force, on the clock of the first, are where they were
/// put.
fn assert_on_one_time(clocks: &ClockComparison, ran: &[(Emulation, Ran)], solution: &Solution) {
    let truth = |place: &RecordedBoot| {
        let is =
            |(emulation, _): &&(Emulation, Ran)| emulation.settings.description().address == place.address;
        &ran.iter().find(is).expect("it has an address of its own").0.truth
    };
    let first = truth(clocks.reference.as_ref().expect("they share edges"));
    let on_first = |seconds: f64| seconds * (1.0 + first.clock_ppm * 1e-6);
    let mut worst = [0.0_f64; 2];
    for alignment in &clocks.alignments {
        let began = on_first(truth(&alignment.place).began - first.began);
        worst[0] = worst[0].max((alignment.offset_s - began).abs());
    }
    let summary = solution.summary();
    let highest = |bead: usize| {
        let peak = summary.peak_force.iter().find(|peak| peak.contact == bead);
        peak.expect("the wave passes the bead").time
    };
    let arrival = |bead: usize| {
        let mut strikes = clocks.strikes.iter();
        let strike = strikes.find(|strike| truth(&strike.place).bead == bead);
        strike.expect("each bead has the strike").arrival_s
    };
    for bead in HOSTS {
        let took = on_first(highest(bead) - highest(first.bead));
        worst[1] = worst[1].max((arrival(bead) - arrival(first.bead) - took).abs());
    }
    println!(
        "starts within {:.3e} s, highest forces within {:.3e} s",
        worst[0], worst[1]
    );
    assert_eq!((clocks.alignments.len(), clocks.strikes.len()), (9, 10));
    // Starts are within two clocks of the timer that takes the edges, highest forces within the error of a
    // parabola through the samples.
    assert!(worst[0] < 2.0 / 84e6 && worst[1] < 5e-7, "{worst:?}");
}

/// Ten beads at hosts 7 to 16: transmissions within 0.002 by A and 0.005 by B, arrivals to 0.2 µs rms, all
/// replays identical. Returns the runs and their comparison.
fn assert_tells(scenario: &Scenario, solution: &Solution) -> (Vec<(Emulation, Ran)>, RowComparison) {
    let ran = run(scenario, solution, &placed());
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let path = folder.path().join("chain.mcap");
    record(&path, &ran);
    let recording = Recording::open(&path).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((recording.state, recording.beads.len()), (State::Whole, 10));

    let clocks = clock::compare(slice::from_ref(&path)).unwrap_or_else(|error| panic!("{error}"));
    assert_on_one_time(&clocks, &ran, solution);

    let told = compared(&path, scenario, solution);
    assert_eq!((told.strikes, &told.notes[..]), (1, &[] as &[String]));
    assert!(told.beads.iter().map(|bead| bead.bead).eq(HOSTS));
    assert!(told.beads.iter().all(|bead| bead.replay_identical == Some(true)));
    let drifted = |flags: &[&str]| flags.contains(&"intruder_drifted");
    assert!(!told.beads.iter().any(|bead| drifted(&bead.flags)));

    let through = told.energy.after.iter().filter_map(|after| after.transmission);
    let through: Vec<[f64; 4]> = through
        .map(|sides| sides.each().map(|side| side.unwrap_or(f64::NAN)))
        .collect();
    assert_eq!(through.len(), 10);
    let off = |side: usize| {
        through
            .iter()
            .map(|sides| (sides[side] - sides[2]).abs())
            .fold(0.0, f64::max)
    };
    println!("T: by A within {:.5}, by B within {:.5}", off(0), off(1));
    assert!(off(0) < 0.002 && off(1) < 0.005, "{through:?}");
    let fit = told
        .energy
        .fit
        .each()
        .map(|fit| fit.map_or(f64::NAN, |fit| fit.transmission));
    assert!(
        (fit[0] - fit[2]).abs() < 0.002 && (fit[1] - fit[2]).abs() < 0.005,
        "{fit:?}"
    );

    let rms = told.arrivals.off_rms_s.unwrap_or(f64::NAN);
    println!("arrivals: {:.3} us rms", rms * 1e6);
    assert!(rms < 0.2e-6, "{:?}", told.arrivals);
    assert_eq!((told.arrivals.beads.len(), told.arrivals.speeds.len()), (10, 9));
    (ran, told)
}

#[test]
fn ten_beads_on_one_strike_tell_what_each_takes_and_when_it_came_on_any_number_of_cores() {
    let scenario = row(2.7e-3, 0.0);
    let solution = solved(&scenario);
    let (ran, told) = assert_tells(&scenario, &solution);
    // The intruders are light, and do not affect one another: the paper's E(n), of rows with n intruders
    // each, is that of the beads.
    for after in &told.energy.after {
        let left = after.left;
        assert!((left.by_a - left.rows_of_n).abs() < 0.003, "{after:?}");
    }
    let fit = told.energy.fit.by_a.zip(told.energy.fit.rows_of_n);
    let off = fit.map(|(by_a, rows)| (by_a.transmission - rows.transmission).abs());
    assert!(off.is_some_and(|off| off < 0.001), "{fit:?}");
    // One after another, and not all of them.
    let placed = placed();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let one = one.unwrap_or_else(|error| panic!("{error}"));
    let again = one.install(|| run(&scenario, &solution, &[placed[9], placed[0]]));
    for ((_, again), before) in again.iter().zip([&ran[9].1, &ran[0].1]) {
        assert_eq!((&again.stream, &again.sent_ns), (&before.stream, &before.sent_ns));
    }
}

#[test]
#[ignore = "thirty runs of the image: cargo test --release -p bead-tests --test all chain:: -- --ignored --nocapture"]
fn rows_of_heavier_intruders_and_of_spheres_that_lose_energy_tell_as_well() {
    for (mass, relaxation) in [(4.7e-3, 0.0), (4.7e-3, 4.2e-6), (12e-3, 4.2e-6)] {
        println!("{mass} kg, {relaxation} s");
        let scenario = row(mass, relaxation);
        let solution = solved(&scenario);
        assert_tells(&scenario, &solution);
    }
}
