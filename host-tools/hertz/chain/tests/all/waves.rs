//! Pulses, flow through contacts, and energy at an intruder, against independent sums over the motion.

use crate::common::{close, elastic, from_height, near, run, softer};
use hertz_chain::{Intruder, Oscillator, Pulse, PulseSearch};

#[test]
fn regions_add_up_to_the_energies_of_the_whole() {
    let mut scenario = elastic(16, 0.004);
    scenario.intruders = vec![Intruder::new([5, 8], Oscillator::PAPER)];
    let solution = run(&scenario);
    for t in [0.0005, 0.0018, 0.0033] {
        let (snapshot, whole) = (solution.at(t), solution.at(t).energies());
        let striker = snapshot.region(0..=0);
        let parts = [1..=4, 5..=7, 8..=16].map(|beads| snapshot.region(beads));
        let sum = |of: fn(&hertz_chain::RegionEnergies) -> f64| parts.iter().map(of).sum::<f64>();
        let same = |a: f64, b: f64| close(a, b, 1e-15 * whole.total().abs() + 1e-16 * b);
        same(striker.kinetic, whole.striker);
        same(sum(|part| part.as_printed()), whole.chain_as_printed);
        same(sum(|part| part.kinetic + part.elastic), whole.chain);
        let intruders = sum(|part| part.intruder_kinetic + part.intruder_elastic);
        same(intruders, whole.intruders);
        same(sum(|part| part.intruder_dissipated), whole.dissipated_intruders);
    }
}

#[test]
fn a_light_striker_sends_one_pulse_and_the_summary_has_the_same() {
    let solution = run(&elastic(38, 0.009));
    for peak in &solution.summary().peak_force[4..30] {
        let pulses = solution.pulses(peak.contact, &PulseSearch::default());
        let pulse = pulses[0];
        near(pulse.force, peak.force, 1e-13);
        near(pulse.time, peak.time, 1e-13);
        let widths = [pulse.fwhm, peak.fwhm].map(|width| width.expect("it is over"));
        near(widths[0], widths[1], 1e-12);
        // The end of the chain sends something back; nothing else follows.
        assert!(pulses.len() == 1 || pulses[1].time > 0.0079, "{pulses:?}");
    }
    // The energy of a pulse is then in the beads ahead.
    let late = solution.pulses(26, &PulseSearch::default())[0];
    near(late.energy, solution.at(late.to).region(26..=38).total(), 1e-12);
}

#[test]
fn a_heavy_striker_sends_a_train_that_falls_off() {
    let mut scenario = elastic(60, 0.012);
    scenario.striker.mass = Some(4.0 * 0.050_997);
    let solution = run(&scenario);
    let mut search = from_height(0.02);
    search.to = 0.011;
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
    let sum = |of: fn(&Pulse) -> f64| pulses.iter().map(of).sum();
    near(sum(|pulse| pulse.energy), whole.energy, 1e-12);
    near(sum(|pulse| pulse.impulse), whole.impulse, 1e-12);
    // A stricter search tells fewer pulses apart.
    search.height = 0.3;
    assert!(solution.pulses(40, &search).len() < pulses.len());
}

#[test]
fn at_an_intruder_the_incident_energy_is_shared_out_in_full_and_without_one_all_passes() {
    let mut scenario = elastic(46, 0.012);
    let mut search = from_height(1e-4);
    search.to = 0.0115;
    let bare = run(&scenario)
        .split(10, 25, &search)
        .expect("the wave passes both");
    let scale = bare.incident.energy;
    near(bare.main.force, 7.936, 1e-4);
    near(bare.main.energy, scale, 1e-6);
    assert!(bare.reflected.abs() < 1e-9 * scale && bare.secondary.abs() < 1e-9 * scale);
    assert_eq!(bare.absorbed, 0.0);

    scenario.intruders = vec![softer([15])];
    let solution = run(&scenario);
    let split = solution.split(10, 25, &search).expect("the wave passes both");
    // The paper's setting (Fig. 4): the reference values of the digest of its numbers.
    near(split.main.force, 7.691, 1e-4);
    near(split.incident.force, 7.936, 3e-3);
    // The regions at the end hold the same.
    let end = solution.at(search.to);
    let scale = split.incident.energy;
    let passed = split.main.energy + split.secondary;
    close(end.region(25..=46).total(), passed, 1e-9 * scale);
    let between = end.region(10..=24);
    close(between.mechanical(), split.rest, 1e-9 * scale);
    near(between.intruder_dissipated, split.absorbed, 1e-12);
    assert_eq!(Some(between.intruder_dissipated), end.intruder_dissipated(15));
    let back = solution.model().striker_energy() - split.incident.energy + split.reflected;
    close(end.region(0..=9).total(), back, 1e-9 * scale);
    // Some of it is reflected, more goes on as secondary waves, more is absorbed.
    assert!(split.reflected.min(split.secondary) > 1e-4 * scale, "{split:?}");
    assert!((0.03..0.06).contains(&(split.absorbed / scale)), "{split:?}");
}
