//! Closed forms of collisions and solitary waves against the integration, and fits against data whose answer
//! is known.

use crate::common::{elastic, normal, run, softer};
use hertz_chain::solitary::{EqualSpheres, KINETIC_SHARE, SPEED_FROM_FORCE, SPEED_FROM_VELOCITY};
use hertz_chain::{Accuracy, Collision, Options, PulseSearch, TransmissionFit, simulate, simulate_with};

#[test]
fn a_collision_lasts_peaks_and_ends_as_the_closed_forms_say() {
    for mass in [0.003, 0.0509, 0.4] {
        let mut scenario = elastic(1, 0.002);
        scenario.striker.mass = Some(mass);
        let solution = run(&scenario);
        let collision = Collision::of_striker(solution.model());
        let pulse = solution.pulses(1, &PulseSearch::default())[0];
        let close = |name: &str, ours: f64, theirs: f64, within: f64| {
            assert!((ours / theirs - 1.0).abs() < within, "{name}: {ours} {theirs}");
        };
        close("force", collision.greatest_force(), pulse.force, 1e-12);
        // Ten digits of the constant are given.
        close("time", collision.duration(), pulse.to, 2e-10);
        close(
            "overlap",
            collision.greatest_overlap(),
            solution.at(pulse.time).overlap(1),
            1e-12,
        );
        let end = solution.summary().final_state;
        for (ours, theirs) in collision.speeds_after(1.0).into_iter().zip(end.velocity) {
            assert!((ours - theirs).abs() < 1e-12 * collision.speed, "{ours} {theirs}");
        }
        close(
            "share",
            collision.transferred(),
            solution.injection().share,
            1e-11,
        );
        assert!(solution.injection().parted);
    }
}

#[test]
fn bodies_of_equal_mass_hand_over_all_and_others_less() {
    let of = |ratio: f64| Collision {
        striker: 0.05 * ratio,
        target: 0.05,
        stiffness: 3.6e8,
        speed: 0.45,
    };
    assert_eq!(of(1.0).transferred(), 1.0);
    for ratio in [0.1, 0.5, 0.9] {
        let (light, heavy) = (of(ratio).transferred(), of(1.0 / ratio).transferred());
        assert!(light < 1.0 && (light - heavy).abs() < 1e-15, "{light} {heavy}");
    }
}

#[test]
fn the_rebound_of_viscoelastic_bodies_follows_the_series_to_its_fourth_term() {
    for alpha in [0.0025, 0.01, 0.04, 0.16] {
        let mut scenario = elastic(1, 0.0004);
        let collision = Collision::of_striker(run(&scenario).model());
        scenario.chain.relaxation = alpha / collision.viscosity(1.0);
        assert!((collision.viscosity(scenario.chain.relaxation) / alpha - 1.0).abs() < 1e-14);
        let end = run(&scenario).summary().final_state;
        let found = (end.velocity[1] - end.velocity[0]) / collision.speed;
        let series = collision.restitution(scenario.chain.relaxation);
        // What the constants' last digits leave, and the next term.
        let error = (found - series).abs();
        assert!(
            error < 1e-7 * alpha.powi(3) + 2e-11 + 1.8 * alpha.powi(5),
            "{alpha}: {found} {series}"
        );
        let speeds = collision.speeds_after(found);
        assert!((speeds[0] - end.velocity[0]).abs() < 1e-12 && (speeds[1] - end.velocity[1]).abs() < 1e-12);
    }
}

#[test]
fn a_pulse_has_the_invariants_of_the_solitary_wave() {
    let solution = run(&elastic(50, 0.011));
    let first = |contact| solution.pulses(contact, &PulseSearch::default())[0];
    let (early, late) = (first(30), first(36));
    let invariants = solution.solitary_invariants(&early, &late);
    assert!((invariants.speed_from_force - SPEED_FROM_FORCE).abs() < 1e-5);
    assert!((invariants.speed_from_velocity - SPEED_FROM_VELOCITY).abs() < 1e-5);
    assert!(
        (invariants.kinetic_share - KINETIC_SHARE).abs() < 1e-6,
        "{invariants:?}"
    );
    let spheres = EqualSpheres {
        stiffness: solution.model().contact(2).stiffness,
        mass: solution.model().mass(1),
        radius: solution.model().radius(1),
    };
    let speed = solution.speed(&early, &late);
    assert!((spheres.speed_from_force(late.force) / speed - 1.0).abs() < 1e-5);
    // The long-wave forms miss by the known parts.
    let velocity = speed / spheres.speed_from_velocity(1.0);
    let above = spheres.long_wave_speed_from_velocity(velocity.powi(5)) / speed - 1.0;
    let below = spheres.long_wave_speed_from_force(late.force) / speed - 1.0;
    assert!((above - 0.0079).abs() < 1e-4, "{above}");
    assert!((below + 0.0122).abs() < 1e-4, "{below}");
}

#[test]
fn a_striker_injects_most_at_the_mass_of_a_bead_and_keeps_nothing_above() {
    let mut scenario = elastic(30, 0.006);
    let ratios = [0.06, 0.2, 0.5, 1.0, 2.0];
    let bead = run(&scenario).model().mass(1);
    let curve = ratios.map(|ratio| {
        scenario.striker.mass = Some(ratio * bead);
        run(&scenario).injection()
    });
    for (injection, ratio) in curve.iter().zip(ratios) {
        assert!((injection.mass_ratio / ratio - 1.0).abs() < 1e-14);
    }
    // The formula of two bodies holds only for light strikers.
    assert!(
        (curve[0].share / curve[0].binary_share - 1.0).abs() < 0.01,
        "{:?}",
        curve[0]
    );
    assert!(curve[4].share - curve[4].binary_share > 0.05, "{:?}", curve[4]);
    for pair in curve[..4].windows(2) {
        assert!(pair[0].share < pair[1].share);
    }
    scenario.striker.mass = Some(-bead);
    let error = simulate(&scenario).expect_err("no mass is negative");
    assert!(error.to_string().starts_with("striker.mass: "), "{error}");
}

#[test]
fn an_exponential_is_fitted_exactly() {
    let points: Vec<_> = (0..12).map(|n| (n, 3.2e-5 * 0.9693_f64.powi(n as i32))).collect();
    let fit = TransmissionFit::of(&points).expect("enough points");
    assert!((fit.transmission / 0.9693 - 1.0).abs() < 1e-14, "{fit:?}");
    assert!((fit.initial / 3.2e-5 - 1.0).abs() < 1e-13, "{fit:?}");
    assert!(fit.residual < 1e-14 && fit.uncertainty < 1e-15, "{fit:?}");
}

#[test]
fn the_uncertainty_of_a_fit_is_the_scatter_that_repeated_fits_have() {
    let (mut state, repeats, noise) = (1, 2000, 0.01);
    let (mut pulls, mut residuals) = (0.0, 0.0);
    for _ in 0..repeats {
        let points: Vec<_> = (0..21)
            .map(|n| (n, 0.95_f64.powi(n as i32) * (noise * normal(&mut state)).exp()))
            .collect();
        let fit = TransmissionFit::of(&points).expect("enough points");
        pulls += ((fit.transmission - 0.95) / fit.uncertainty).powi(2);
        residuals += fit.residual.powi(2);
    }
    // Student's t of 19 degrees of freedom has a variance of 19/17.
    let spread = pulls / f64::from(repeats) * 17.0 / 19.0;
    assert!((spread - 1.0).abs() < 0.1, "{spread}");
    let residual = (residuals / f64::from(repeats)).sqrt();
    assert!((residual / noise - 1.0).abs() < 0.02, "{residual}");
}

#[test]
fn what_is_no_exponential_at_all_is_not_fitted() {
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, 0.9)]), None);
    assert_eq!(TransmissionFit::of(&[(3, 1.0), (3, 0.9), (3, 0.8)]), None);
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, 0.9), (2, 0.0)]), None);
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, f64::NAN), (2, 0.5)]), None);
}

/// Fig. 5 of the paper: k = 1e5 N/m, hosts from bead 7, light intruders.
#[test]
fn each_light_intruder_of_the_paper_lets_97_percent_pass() {
    let draft = Options::with(Accuracy::DRAFT);
    let points: Vec<_> = (0..=10)
        .map(|n| {
            let mut scenario = elastic(40, 0.0085);
            if n > 0 {
                scenario.intruders = vec![softer(7..7 + n)];
                scenario.intruders[0].mass = 2.7e-3;
            }
            let solution = simulate_with(&scenario, &draft).expect("runs");
            let absorbed: f64 = solution.absorption(0.0085).iter().map(|one| one.dissipated).sum();
            assert!((absorbed - solution.at(0.0085).energies().dissipated_intruders).abs() < 1e-18);
            (n, solution.at(0.0085).energies().chain)
        })
        .collect();
    let fit = TransmissionFit::of(&points).expect("enough points");
    assert!((fit.transmission - 0.969).abs() < 0.002, "{fit:?}");
    assert!(fit.residual < 0.005, "{fit:?}");
}
