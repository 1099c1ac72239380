//! Pulses, flow through contacts, and the energy of a wave at an intruder, against independent sums over the
//! motion.

use crate::common::{elastic, run};
use hertz_chain::{Intruder, Oscillator, PulseSearch, Scenario};

fn with_intruder(mut scenario: Scenario, beads: Vec<usize>, stiffness: f64) -> Scenario {
    let oscillator = Oscillator {
        stiffness,
        ..Oscillator::PAPER
    };
    scenario.intruders = vec![Intruder::new(beads, oscillator)];
    scenario
}

#[test]
fn what_passes_a_contact_is_what_the_beads_after_it_gain() {
    let mut lossy = with_intruder(elastic(16, 0.004), vec![8, 9], 1e5);
    lossy.chain.relaxation = 4.2e-6;
    let mut clipped = lossy.clone();
    clipped.chain.contact_force = hertz_chain::ContactForce::Clipped;
    for scenario in [lossy, clipped] {
        let solution = run(&scenario);
        let energy = solution.model().striker_energy();
        let flows: Vec<_> = (1..=16).map(|contact| solution.flow(contact)).collect();
        for t in [0.0007, 0.0016, 0.00203, 0.004] {
            for a in [1, 6, 8, 9, 12] {
                let gain = solution.at(t).region(a..=16).total();
                let lost: f64 = (a..=16)
                    .map(|contact| flows[contact - 1].between(0.0, t).lost)
                    .sum();
                let passed = flows[a - 1].between(0.0, t).energy;
                let error = (passed - lost - gain).abs() / energy;
                assert!(error < 2e-12, "contact {a}, {t} s: {error:e}");
            }
            let lost: f64 = flows.iter().map(|flow| flow.between(0.0, t).lost).sum();
            let known = solution.at(t).energies().dissipated_contacts;
            assert!((lost - known).abs() < 2e-12 * energy, "{lost} of {known}");
        }
    }
}

#[test]
fn the_impulse_through_a_contact_is_the_momentum_after_it() {
    let solution = run(&elastic(20, 0.003));
    let model = solution.model();
    let whole = model.mass(0) * model.striker_speed();
    for contact in [1, 5, 11] {
        for t in [0.0008, 0.0021, 0.003] {
            let snapshot = solution.at(t);
            let momentum: f64 = (contact..=20)
                .map(|body| model.mass(body) * snapshot.velocity(body))
                .sum();
            let impulse = solution.flow(contact).between(0.0, t).impulse;
            assert!((impulse - momentum).abs() < 1e-12 * whole, "{impulse} {momentum}");
        }
    }
}

#[test]
fn regions_add_up_to_the_energies_of_the_whole() {
    let solution = run(&with_intruder(elastic(16, 0.004), vec![5, 8], 3.95e5));
    for t in [0.0005, 0.0018, 0.0033] {
        let (snapshot, whole) = (solution.at(t), solution.at(t).energies());
        let parts = [0..=0, 1..=4, 5..=7, 8..=16].map(|beads| snapshot.region(beads));
        let close =
            |a: f64, b: f64| assert!((a - b).abs() < 1e-15 * whole.total().abs() + 1e-16 * b, "{a} {b}");
        close(parts[0].kinetic, whole.striker);
        close(
            parts[1..].iter().map(|part| part.as_printed()).sum(),
            whole.chain_as_printed,
        );
        close(
            parts[1..].iter().map(|part| part.kinetic + part.elastic).sum(),
            whole.chain,
        );
        close(
            parts
                .iter()
                .map(|part| part.intruder_kinetic + part.intruder_elastic)
                .sum(),
            whole.intruders,
        );
        close(
            parts.iter().map(|part| part.intruder_dissipated).sum(),
            whole.dissipated_intruders,
        );
    }
}

#[test]
fn a_light_striker_sends_one_pulse_and_the_summary_has_the_same() {
    let solution = run(&elastic(38, 0.009));
    for peak in &solution.summary().peak_force[4..30] {
        let pulses = solution.pulses(peak.contact, &PulseSearch::default());
        let pulse = pulses[0];
        assert!((pulse.force / peak.force - 1.0).abs() < 1e-13);
        assert!((pulse.time / peak.time - 1.0).abs() < 1e-13);
        let (width, known) = (pulse.fwhm.expect("it is over"), peak.fwhm.expect("it is over"));
        assert!((width / known - 1.0).abs() < 1e-12);
        // The end of the chain sends something back; nothing else follows.
        assert!(pulses.len() == 1 || pulses[1].time > 0.0079, "{pulses:?}");
    }
}

#[test]
fn a_pulse_of_the_chain_is_as_wide_and_as_fast_as_the_paper_finds() {
    let solution = run(&elastic(38, 0.009));
    let first = |contact| solution.pulses(contact, &PulseSearch::default())[0];
    let (early, late) = (first(22), first(26));
    // The discrete solitary wave, in beads a second: c = 0.90552 F^(1/6) in units of κ and M.
    let (kappa, mass) = (solution.model().contact(2).stiffness, solution.model().mass(1));
    let expected = 0.90552 * kappa.powf(1.0 / 3.0) / mass.sqrt() * late.force.powf(1.0 / 6.0);
    let beads = solution.speed(&early, &late) / 0.038;
    assert!((beads / expected - 1.0).abs() < 1e-5, "{beads} {expected}");
    // Seen the other way round, it goes back in time and in space alike.
    assert_eq!(solution.speed(&late, &early), solution.speed(&early, &late));
    // Its energy is then in the beads ahead.
    let ahead = solution.at(late.to).region(26..=38).total();
    assert!(
        (late.energy / ahead - 1.0).abs() < 1e-12,
        "{}",
        late.energy / ahead
    );
}

#[test]
fn a_heavy_striker_sends_a_train_that_falls_off() {
    let mut scenario = elastic(60, 0.012);
    scenario.striker.mass = Some(4.0 * 0.050_997);
    let solution = run(&scenario);
    let search = PulseSearch {
        height: 0.02,
        to: 0.011,
        ..PulseSearch::default()
    };
    let pulses = solution.pulses(40, &search);
    assert!(pulses.len() >= 4, "{}", pulses.len());
    for pair in pulses.windows(2) {
        assert!(
            pair[0].force > pair[1].force && pair[0].to <= pair[1].from,
            "{pair:?}"
        );
        // The higher ones go ahead and are narrower.
        assert!(pair[0].fwhm < pair[1].fwhm, "{pair:?}");
    }
    // Between its ends, a train carries as much as its pulses.
    let (from, to) = (pulses[0].from, pulses[pulses.len() - 1].to);
    let whole = solution.flow(40).between(from, to);
    let energy: f64 = pulses.iter().map(|pulse| pulse.energy).sum();
    let impulse: f64 = pulses.iter().map(|pulse| pulse.impulse).sum();
    assert!((energy / whole.energy - 1.0).abs() < 1e-12, "{energy} {whole:?}");
    assert!(
        (impulse / whole.impulse - 1.0).abs() < 1e-12,
        "{impulse} {whole:?}"
    );
    // A stricter search tells fewer pulses apart.
    let strict = PulseSearch {
        height: 0.3,
        ..search
    };
    assert!(solution.pulses(40, &strict).len() < pulses.len());
}

#[test]
fn at_an_intruder_the_incident_energy_is_shared_out_in_full() {
    let scenario = with_intruder(elastic(46, 0.012), vec![15], 1e5);
    let solution = run(&scenario);
    let search = PulseSearch {
        to: 0.0115,
        height: 1e-4,
        ..PulseSearch::default()
    };
    let split = solution.split(10, 25, &search).expect("the wave passes both");
    // The paper's setting (Fig. 4): the reference values of the digest of its numbers.
    assert!(
        (split.main.force / 7.691 - 1.0).abs() < 1e-4,
        "{}",
        split.main.force
    );
    assert!(
        (split.incident.force / 7.936 - 1.0).abs() < 3e-3,
        "{}",
        split.incident.force
    );
    // The same from what the regions hold at the end.
    let end = solution.at(search.to);
    let scale = split.incident.energy;
    let after = end.region(25..=46).total();
    let beyond = split.main.energy + split.secondary;
    assert!((after - beyond).abs() < 1e-9 * scale, "{after} {beyond}");
    let between = end.region(10..=24);
    assert!(
        (between.mechanical() - split.rest).abs() < 1e-9 * scale,
        "{between:?} {split:?}"
    );
    assert!((between.intruder_dissipated / split.absorbed - 1.0).abs() < 1e-12);
    let dissipated = solution.at(search.to).intruder_dissipated(15).expect("a host");
    assert_eq!(between.intruder_dissipated, dissipated);
    let before = end.region(0..=9).total();
    let back = solution.model().striker_energy() - split.incident.energy + split.reflected;
    assert!((before - back).abs() < 1e-9 * scale, "{before} {back}");
    // Some of it is reflected, more goes on as secondary waves, more is absorbed.
    assert!(
        split.reflected > 1e-4 * scale && split.secondary > 1e-4 * scale,
        "{split:?}"
    );
    assert!((0.03..0.06).contains(&(split.absorbed / scale)), "{split:?}");
}

#[test]
fn without_an_intruder_nothing_is_reflected() {
    let solution = run(&elastic(46, 0.012));
    let search = PulseSearch {
        to: 0.0115,
        ..PulseSearch::default()
    };
    let split = solution.split(10, 25, &search).expect("the wave passes both");
    let scale = split.incident.energy;
    assert!(
        (split.main.force / 7.936 - 1.0).abs() < 1e-4,
        "{}",
        split.main.force
    );
    assert!((split.main.energy / scale - 1.0).abs() < 1e-6, "{split:?}");
    assert!(split.reflected.abs() < 1e-9 * scale && split.secondary.abs() < 1e-9 * scale);
    assert_eq!(split.absorbed, 0.0);
}
