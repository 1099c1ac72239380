//! Closed forms of collisions and solitary waves against the integration, and fits against data whose answer
//! is known.

use crate::common::{Draw, changed, close, elastic, near, run, softer};
use hertz_chain::solitary::{KINETIC_SHARE, SPEED_FROM_FORCE, SPEED_FROM_VELOCITY};
use hertz_chain::{Accuracy, Collision, Options, PulseSearch, TransmissionFit, simulate, simulate_with};

#[test]
fn a_collision_lasts_peaks_and_ends_as_the_closed_forms_say() {
    for mass in [0.003, 0.0509, 0.4] {
        let solution = run(&changed(elastic(1, 0.002), |one| one.striker.mass = Some(mass)));
        let collision = Collision::of_striker(solution.model());
        let pulse = solution.pulses(1, &PulseSearch::default())[0];
        near(pulse.force, collision.greatest_force(), 1e-12);
        // Ten digits of the constant are given.
        near(pulse.to, collision.duration(), 2e-10);
        // The contact is symmetric in time: it peaks half way.
        near(pulse.time, 0.5 * pulse.to, 1e-9);
        let deepest = solution.at(pulse.time).overlap(1);
        near(deepest, collision.greatest_overlap(), 1e-12);
        near(collision.transferred(), solution.injection().share, 1e-11);
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
        let light = of(ratio).transferred();
        close(light, of(1.0 / ratio).transferred(), 1e-15);
        assert!(light < 1.0);
    }
}

/// Ramírez et al. 1999: e = 1 - 1.15344 A + 0.79826 A² ..., with A = (3/2) α, α = τ (κ/μ)^(2/5) V^(1/5).
#[test]
fn the_rebound_of_viscoelastic_bodies_follows_the_series_to_its_fourth_term() {
    for alpha in [0.0025, 0.01, 0.04, 0.16] {
        let mut scenario = elastic(1, 0.0004);
        let collision = Collision::of_striker(run(&scenario).model());
        let parameter =
            (collision.stiffness / collision.reduced_mass()).powf(0.4) * collision.speed.powf(0.2);
        scenario.chain.relaxation = alpha / parameter;
        near(collision.viscosity(scenario.chain.relaxation), alpha, 1e-14);
        let end = run(&scenario).summary().final_state;
        let found = (end.velocity[1] - end.velocity[0]) / collision.speed;
        let series = collision.restitution(scenario.chain.relaxation);
        let known = 1.0 - 1.73016 * alpha + 1.79609 * alpha * alpha;
        close(series, known, 2.0 * alpha.powi(3) + 1e-7);
        // The digits of the constants, and the next term.
        close(found, series, 1e-7 * alpha.powi(3) + 2e-11 + 1.8 * alpha.powi(5));
    }
}

#[test]
fn a_pulse_has_the_invariants_of_the_solitary_wave() {
    let solution = run(&elastic(50, 0.011));
    let first = |contact| solution.pulses(contact, &PulseSearch::default())[0];
    let (early, late) = (first(30), first(36));
    let invariants = solution.solitary_invariants(&early, &late);
    close(invariants.speed_from_force, SPEED_FROM_FORCE, 1e-5);
    close(invariants.speed_from_velocity, SPEED_FROM_VELOCITY, 1e-5);
    close(invariants.kinetic_share, KINETIC_SHARE, 1e-6);
    // Seen the other way round, it goes back in time and in space alike.
    assert_eq!(solution.speed(&late, &early), solution.speed(&early, &late));
}

#[test]
fn a_striker_injects_most_at_the_mass_of_a_bead_and_keeps_nothing_above() {
    let mut scenario = elastic(30, 0.006);
    let ratios = [0.06, 0.2, 0.5, 1.0, 2.0];
    let bead = run(&scenario).model().mass(1);
    let curve = ratios.map(|ratio| {
        scenario.striker.mass = Some(ratio * bead);
        let injection = run(&scenario).injection();
        near(injection.mass_ratio, ratio, 1e-14);
        injection
    });
    // The formula of two bodies holds only for light strikers.
    near(curve[0].share, curve[0].binary_share, 0.01);
    assert!(curve[4].share - curve[4].binary_share > 0.05, "{:?}", curve[4]);
    assert!(curve[..4].is_sorted_by(|one, next| one.share < next.share));
    scenario.striker.mass = Some(-bead);
    let error = simulate(&scenario).expect_err("no mass is negative");
    assert!(error.to_string().starts_with("striker.mass: "), "{error}");
}

#[test]
fn an_exponential_is_fitted_exactly_and_nothing_else_is() {
    let points: Vec<_> = (0..12).map(|n| (n, 3.2e-5 * 0.9693_f64.powi(n as i32))).collect();
    let fit = TransmissionFit::of(&points).expect("enough points");
    near(fit.transmission, 0.9693, 1e-14);
    near(fit.initial, 3.2e-5, 1e-13);
    assert!(fit.residual < 1e-14 && fit.uncertainty < 1e-15, "{fit:?}");
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, 0.9)]), None);
    assert_eq!(TransmissionFit::of(&[(3, 1.0), (3, 0.9), (3, 0.8)]), None);
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, 0.9), (2, 0.0)]), None);
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, f64::NAN), (2, 0.5)]), None);
}

#[test]
fn the_uncertainty_of_a_fit_is_the_scatter_that_repeated_fits_have() {
    let (mut draw, repeats, noise) = (Draw(1), 2000, 0.01);
    let (mut pulls, mut residuals) = (0.0, 0.0);
    for _ in 0..repeats {
        let noisy = |n: usize| (n, 0.95_f64.powi(n as i32) * (noise * draw.normal()).exp());
        let points: Vec<_> = (0..21).map(noisy).collect();
        let fit = TransmissionFit::of(&points).expect("enough points");
        pulls += ((fit.transmission - 0.95) / fit.uncertainty).powi(2);
        residuals += fit.residual.powi(2);
    }
    // Student's t of 19 degrees of freedom has a variance of 19/17.
    close(pulls / f64::from(repeats) * 17.0 / 19.0, 1.0, 0.1);
    near((residuals / f64::from(repeats)).sqrt(), noise, 0.02);
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
            let energies = solution.at(0.0085).energies();
            let absorbed: f64 = solution.absorption(0.0085).iter().map(|one| one.dissipated).sum();
            close(absorbed, energies.dissipated_intruders, 1e-18);
            (n, energies.chain)
        })
        .collect();
    let fit = TransmissionFit::of(&points).expect("enough points");
    assert!(
        (fit.transmission - 0.969).abs() < 0.002 && fit.residual < 0.005,
        "{fit:?}"
    );
}
