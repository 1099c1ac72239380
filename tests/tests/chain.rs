//! Beads of one chain on one strike, on one time: what each takes, and when the wave came to it.

use std::collections::BTreeMap;
use std::path::Path;

use bead::bench::emulation::{Emulation, Placed, Ran};
use bead::bench::front_end::FrontEnd;
use bead::bench::sensed::{Timing, load_scenario, simulate_with_ring_down};
use bead::bench::several::{self, Clocks};
use bead::comparison::replay::replay;
use bead::recording::clock;
use bead::recording::file::{About, Origin, Recording, State, Writer};
use bead::recording::received::Received;
use bead::recording::strikes::RecordedStrike;
use bead::recording::whole::Target;
use bead_tests::{image, workspace};
use hertz_chain::{Scenario, Solution};

/// Within which the beads are switched on, s.
const START_SPREAD: f64 = 0.05;

/// The paper's row of ten absorbers, with intruders of another mass, kg, and another relaxation, s.
fn row(mass: f64, relaxation: f64) -> Scenario {
    let file = workspace().join("docs/scenarios/ten-intruders.toml");
    let (mut scenario, _) = load_scenario(&file).unwrap_or_else(|failure| panic!("{failure}"));
    scenario.intruders[0].mass = mass;
    scenario.chain.relaxation = relaxation;
    scenario
}

/// Runs these beads with crystals up to 100 ppm off.
fn run(scenario: &Scenario, solution: &Solution, placed: &[Placed]) -> Vec<(Emulation, Ran)> {
    let timing = Timing {
        lead_in: 0.02 + START_SPREAD,
        strikes: 1,
        interval: 0.1,
    };
    let prepare = |placed| {
        let mut run = Emulation::place(scenario, solution, placed, &FrontEnd::default(), timing, &image())?;
        // In step with no clock.
        run.sync((1..).map(|n| 0.100_371_9 * f64::from(n)));
        Ok(run)
    };
    several::run(placed, prepare, |_| {}).unwrap_or_else(|failure| panic!("{failure}"))
}

/// Records them as `bead emulate` does.
fn record(path: &Path, ran: &[(Emulation, Ran)]) {
    let mut writer = Writer::create_for_several(&Target::new(path), &About::default())
        .unwrap_or_else(|error| panic!("{error}"));
    let lanes: Vec<_> = ran
        .iter()
        .map(|(emulation, ran)| {
            let origin = Origin {
                address: emulation.settings.address,
                bead: Some(emulation.truth.bead),
                ..Origin::default()
            };
            let lane = writer.join(&origin).unwrap_or_else(|error| panic!("{error}"));
            (lane, ran, emulation.truth.began)
        })
        .collect();
    several::write(&lanes, &mut writer).unwrap_or_else(|error| panic!("{error}"));
    writer.finish().unwrap_or_else(|error| panic!("{error}"));
}

/// Part of the energy that each bead lets through, by what each has taken, front to back. `first` is what came to the
/// first of them.
fn transmissions(first: f64, absorbed: &[f64]) -> Vec<f64> {
    let mut left = first;
    let through = |absorbed: &f64| {
        let before = left;
        left -= absorbed;
        left / before
    };
    absorbed.iter().map(through).collect()
}

/// When the force at a host rises through half of its height, s, in the simulation.
fn front(solution: &Solution, host: usize) -> f64 {
    let summary = solution.summary();
    let peak = summary.peak_force.iter().find(|peak| peak.contact == host);
    let peak = peak.unwrap_or_else(|| panic!("no force at {host}"));
    let (mut below, mut above) = (peak.time - 1e-3, peak.time);
    // To the nanosecond and below, by halves: the force only rises there.
    for _ in 0..30 {
        let middle = 0.5 * (below + above);
        match solution.at(middle).force(host) < 0.5 * peak.force {
            true => below = middle,
            false => above = middle,
        }
    }
    above
}

/// Ten beads at hosts 7 to 16: transmissions within 0.002 by A and 0.005 by B, arrivals to 0.2 µs rms, all replays
/// identical. Gives the runs.
fn assert_tells(scenario: &Scenario, solution: &Solution) -> Vec<(Emulation, Ran)> {
    let hosts: Vec<usize> = (7..=16).collect();
    let placed = several::placed(&hosts, &Clocks::Spread(100.0), START_SPREAD, 1, true)
        .unwrap_or_else(|failure| panic!("{failure}"));
    let ran = run(scenario, solution, &placed);
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let path = folder.path().join("chain.mcap");
    record(&path, &ran);
    let recording = Recording::open(&path).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((recording.state, recording.beads.len()), (State::Whole, 10));

    let received = Received::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let strikes: BTreeMap<usize, RecordedStrike> = received
        .strikes()
        .unwrap_or_else(|error| panic!("{error}"))
        .map(|strike| (strike.address.into(), strike))
        .collect();
    assert_eq!(strikes.keys().copied().collect::<Vec<_>>(), hosts);
    assert!(strikes.values().all(|strike| replay(strike).identical()));

    let first = &strikes[&7].said;
    let peak = ran[0].0.truth.truth.peak_force;
    let incident = first.incident_energy.joules();
    // The law of the bead's own figure: energy by the peak's power 5/3.
    let incident_true = incident * (peak / first.peak_force.newtons()).powf(5.0 / 3.0);
    let absorbed = |of: &dyn Fn(usize) -> f64| (0..10).map(of).collect::<Vec<_>>();
    let truth = transmissions(incident_true, &absorbed(&|n| ran[n].0.truth.truth.absorbed));
    let said = |n: usize| &strikes[&(n + 7)].said;
    let by_a = transmissions(incident, &absorbed(&|n| said(n).absorbed_measured.joules()));
    let by_b = transmissions(incident, &absorbed(&|n| said(n).absorbed_predicted.joules()));
    let off = |by: &[f64]| {
        by.iter()
            .zip(&truth)
            .map(|(by, truth)| (by - truth).abs())
            .fold(0.0, f64::max)
    };
    println!(
        "T {truth:.4?}: by A within {:.5}, by B within {:.5}",
        off(&by_a),
        off(&by_b)
    );
    assert!(off(&by_a) < 0.002, "{truth:?} {by_a:?}");
    assert!(off(&by_b) < 0.005, "{truth:?} {by_b:?}");

    let clocks = clock::compare(&[path]).unwrap_or_else(|error| panic!("{error}"));
    let mut late = Vec::new();
    for arrival in &clocks.strikes {
        let host = usize::from(arrival.place.address);
        let rise = arrival.rise_s.expect("its samples were received");
        late.push(rise - front(solution, host));
    }
    assert_eq!(late.len(), 10);
    let mean = late.iter().sum::<f64>() / 10.0;
    let rms = (late.iter().map(|late| (late - mean).powi(2)).sum::<f64>() / 10.0).sqrt();
    println!("arrivals: {:.3} us rms", rms * 1e6);
    assert!(rms < 0.2e-6, "{rms} s: {late:?}");
    ran
}

#[test]
fn ten_beads_on_one_strike_tell_what_each_takes_and_when_it_came_on_any_number_of_cores() {
    let scenario = row(2.7e-3, 0.0);
    let solution = simulate_with_ring_down(&scenario).unwrap_or_else(|failure| panic!("{failure}"));
    let ran = assert_tells(&scenario, &solution);
    // One after another, and not all of them.
    let hosts: Vec<usize> = (7..=16).collect();
    let placed = several::placed(&hosts, &Clocks::Spread(100.0), START_SPREAD, 1, true)
        .unwrap_or_else(|failure| panic!("{failure}"));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let one = one.unwrap_or_else(|error| panic!("{error}"));
    let again = one.install(|| run(&scenario, &solution, &[placed[9], placed[0]]));
    for ((_, again), before) in again.iter().zip([&ran[9].1, &ran[0].1]) {
        assert_eq!((&again.stream, &again.sent_ns), (&before.stream, &before.sent_ns));
    }
}

#[test]
#[ignore = "thirty runs of the image: cargo test --release -p bead-tests --test chain -- --ignored --nocapture"]
fn rows_of_heavier_intruders_and_of_spheres_that_lose_energy_tell_as_well() {
    for (mass, relaxation) in [(4.7e-3, 0.0), (4.7e-3, 4.2e-6), (12e-3, 4.2e-6)] {
        println!("{mass} kg, {relaxation} s");
        let scenario = row(mass, relaxation);
        let solution = simulate_with_ring_down(&scenario).unwrap_or_else(|failure| panic!("{failure}"));
        assert_tells(&scenario, &solution);
    }
}
