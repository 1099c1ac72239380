//! Errors of the integration, measured against finer runs and by laws of scale.

use crate::common::{changed, close, elastic, near, of_radius, run};
use hertz_chain::{
    Accuracy, ContactForce, Material, Options, Scenario, Section, Solution, Wall, simulate_with,
};

/// The paper's strike, for the 4 ms that its figure shows.
fn paper() -> Scenario {
    changed(Scenario::paper(), |one| one.duration = 0.004)
}

fn with(options: &Options<'_>) -> Solution {
    simulate_with(&paper(), options).expect("the scenario runs")
}

/// Greatest differences of forces and of energies, at times where no step ends: as a part of the weakest
/// contact's peak, and of the striker's energy.
fn distance(one: &Solution, other: &Solution) -> (f64, f64) {
    let summary = other.summary();
    let forces = summary.peak_force.iter().map(|peak| peak.force);
    let weakest = forces.filter(|force| *force > 1.0).fold(1e9, f64::min);
    let (mut ours, mut theirs) = (one.sampler(), other.sampler());
    let (mut force, mut energy) = (0.0_f64, 0.0_f64);
    for i in 0..700 {
        let t = one.end() * (f64::from(i) + 0.37) / 700.0;
        let (a, b) = (ours.at(t), theirs.at(t));
        for contact in 1..=one.model().contacts() {
            force = force.max((a.force(contact) - b.force(contact)).abs() / weakest);
        }
        let (a, b) = (a.energies(), b.energies());
        for (a, b) in [
            (a.chain, b.chain),
            (a.striker, b.striker),
            (a.intruders, b.intruders),
            (a.dissipated_contacts, b.dissipated_contacts),
            (a.dissipated_intruders, b.dissipated_intruders),
        ] {
            energy = energy.max((a - b).abs() / summary.energy.striker_initial);
        }
    }
    (force, energy)
}

#[test]
fn motion_peaks_and_widths_agree_with_a_run_of_other_steps() {
    let clipped = changed(paper(), |one| one.chain.contact_force = ContactForce::Clipped);
    for (scenario, forces, energies) in [
        (paper(), 2e-12, 1e-13),
        (clipped, 2e-12, 1e-13),
        (elastic(38, 0.006), 3e-11, 2e-13),
    ] {
        let ours = run(&scenario);
        let accuracy = Accuracy::new(2e-14, 1.0 / 50.0);
        let finer = simulate_with(&scenario, &Options::with(accuracy)).expect("the scenario runs");
        let (force, energy) = distance(&ours, &finer);
        println!("forces {force:.1e}, energies {energy:.1e}");
        assert!(force < forces && energy < energies, "{force:e}, {energy:e}");
        let (ours, finer) = (ours.summary().peak_force, finer.summary().peak_force);
        let mut compared = 0;
        for (a, b) in ours.iter().zip(&finer) {
            assert_eq!(a.contact, b.contact);
            if let Some((width, finer_width)) = a.fwhm.zip(b.fwhm) {
                compared += 1;
                near(a.force, b.force, 1e-12);
                near(a.time, b.time, 1e-12);
                near(width, finer_width, 1e-11);
            }
        }
        assert!(compared >= 15);
    }
}

#[test]
fn the_draft_is_good_for_pictures() {
    let (force, energy) = distance(&with(&Options::with(Accuracy::DRAFT)), &run(&paper()));
    assert!(force < 3e-6 && energy < 3e-6, "{force:e}, {energy:e}");
}

/// Checks that peaks, widths and energies of two runs differ by factors for force, time and energy.
#[track_caller]
fn on_scale(one: &Scenario, other: &Scenario, [force, time, energy]: [f64; 3]) {
    let (one, other) = (run(one).summary(), run(other).summary());
    assert_eq!(one.peak_force.len(), other.peak_force.len());
    let mut worst = 0.0_f64;
    let mut see = |a: f64, b: f64, factor: f64| worst = worst.max((b / a / factor - 1.0).abs());
    for (a, b) in one.peak_force.iter().zip(&other.peak_force) {
        see(a.force, b.force, force);
        see(a.time, b.time, time);
        assert_eq!(a.fwhm.is_some(), b.fwhm.is_some());
        if let Some((a, b)) = a.fwhm.zip(b.fwhm) {
            see(a, b, time);
        }
    }
    let (a, b) = (&one.energy, &other.energy);
    see(a.chain_final, b.chain_final, energy);
    see(a.striker_final, b.striker_final, energy);
    if a.dissipated_contacts > 0.0 {
        see(a.dissipated_contacts, b.dissipated_contacts, energy);
    }
    for (a, b) in one.intruders.iter().zip(&other.intruders) {
        see(a.dissipated, b.dissipated, energy);
    }
    assert!(worst < 1e-11, "{worst:e}");
}

/// Lengths times l, densities times r, moduli times y: times go as l √(r/y), forces as y l², energies as y
/// l³, whatever else is in the chain.
#[test]
fn a_chain_of_other_size_and_material_is_the_same_on_another_scale() {
    let mut small = paper();
    small.chain.precompression = 0.3;
    let mut wall = Wall::flat(Material::STEEL);
    wall.radius = Some(0.05);
    small.wall = Some(wall);
    small.sections = vec![of_radius([4, 5], 0.012)];
    for (l, r, y) in [
        (3.0, 1.0, 1.0),
        (1.0, 4.4, 1.0),
        (1.0, 1.0, 45.0),
        (0.2, 1.7, 0.03),
    ] {
        let mut large = small.clone();
        let time = l * f64::sqrt(r / y);
        large.duration *= time;
        for radius in [&mut large.chain.radius, &mut large.striker.radius] {
            *radius *= l;
        }
        for density in [&mut large.chain.density, &mut large.striker.density] {
            *density *= r;
        }
        for young in [&mut large.chain.young, &mut large.striker.young] {
            *young *= y;
        }
        let wall = large.wall.as_mut().expect("it has one");
        wall.young *= y;
        wall.radius = wall.radius.map(|radius| radius * l);
        large.sections[0].radius = large.sections[0].radius.map(|radius| radius * l);
        large.chain.relaxation *= time;
        large.chain.precompression *= y * l * l;
        large.striker.velocity *= f64::sqrt(y / r);
        large.intruders[0].mass *= r * l.powi(3);
        large.intruders[0].stiffness *= y * l;
        large.intruders[0].damping *= l * l * f64::sqrt(r * y);
        on_scale(&small, &large, [y * l * l, time, y * l.powi(3)]);
    }
}

#[test]
fn a_run_longer_or_shorter_than_its_scenario_is_summed_up_to_the_earlier_end() {
    let plain = run(&paper());
    let longer = with(&Options::default().with_duration(0.006));
    assert_eq!(longer.end(), 0.006);
    assert_eq!(longer.summary().peak_force, plain.summary().peak_force);
    assert_eq!(longer.summary().final_state, plain.summary().final_state);
    assert!(longer.at(0.0041).force(16) > 1.0);
    let shorter = with(&Options::default().with_duration(0.001));
    let end = shorter.summary().final_state;
    assert_eq!((shorter.end(), end.time), (0.001, 0.001));
    near(end.displacement[1], plain.at(0.001).displacement(1), 1e-11);
}

#[test]
#[should_panic = "0.0041 s is not within the run, 0 to 0.004 s"]
fn a_time_after_the_end_is_refused() {
    run(&paper()).at(0.0041).force(1);
}

#[test]
fn sections_and_strikers_have_properties_of_their_own() {
    let mut scenario = paper();
    let mut thin = Section::of([3, 4]);
    (thin.radius, thin.relaxation) = (Some(0.0095), Some(0.0));
    scenario.sections = vec![thin];
    let solution = run(&scenario);
    let model = solution.model();
    close(model.mass(3) / model.mass(2), 0.125, 1e-15);
    assert_eq!(model.mass(2), model.mass(5));
    // κ goes with 1/√(1/Ra + 1/Rb): 1/2R among the small ones, 3/2 of the large ones' curvature at the step.
    let plain = model.contact(2).stiffness;
    close(model.contact(3).stiffness / plain, (2.0_f64 / 3.0).sqrt(), 1e-14);
    close(model.contact(4).stiffness / plain, 0.5_f64.sqrt(), 1e-14);
    let relaxation: Vec<f64> = (1..=6).map(|contact| model.contact(contact).relaxation).collect();
    assert_eq!(relaxation, [4.2e-6, 4.2e-6, 2.1e-6, 0.0, 2.1e-6, 4.2e-6]);
    assert!(solution.summary().energy.balance_error < 1e-12);

    (scenario.striker.mass, scenario.striker.relaxation) = (Some(3.0e-3), Some(0.0));
    let solution = run(&scenario);
    assert_eq!(solution.model().mass(0), 3.0e-3);
    // Two Kelvin-Voigt halves in series: steel takes 2.5 % of the overlap.
    near(solution.model().contact(1).relaxation, 4.096e-6, 1e-4);
    assert_eq!(solution.model().contact(2).relaxation, 4.2e-6);
}

#[test]
fn progress_is_reported() {
    let last = std::sync::Mutex::new(0.0);
    let progress = |part: f64| {
        let mut last = last.lock().expect("no panic");
        assert!(part > *last && part <= 1.0);
        *last = part;
    };
    with(&Options::default().with_progress(&progress));
    assert_eq!(*last.lock().expect("no panic"), 1.0);
}

#[test]
fn a_contact_that_nothing_reached_is_not_among_the_peaks() {
    let summary = run(&elastic(38, 0.002)).summary();
    let contacts: Vec<usize> = summary.peak_force.iter().map(|peak| peak.contact).collect();
    assert_eq!(contacts, (1..=contacts.len()).collect::<Vec<_>>());
    assert!(contacts.len() < 15, "{contacts:?}");
    let last = summary.peak_force.last().expect("some");
    assert_eq!((last.time, last.fwhm), (0.002, None));
}
