//! Contacts of other powers and dampings: closed forms of two bodies, LAMMPS, and Hertz' law as one of them.

use std::f64::consts::PI;

use crate::common::{changed, close, elastic, near, numbers, run, struck_by_a_bead};
use hertz_chain::{Accuracy, ContactLaw, Damping, Model, PowerLaw, Run, Scenario, Solution, Wall, ensemble};

/// A law as stiff as the paper's contacts at an overlap of 2 µm.
fn law(exponent: f64) -> ContactLaw {
    ContactLaw::power(exponent, 3.6e8 * 2e-6_f64.powf(1.5 - exponent))
}

/// Two equal bodies that meet under a law.
fn pair(law: ContactLaw, speed: f64) -> Scenario {
    changed(struck_by_a_bead(1, 0.01), |scenario| {
        scenario.striker.velocity = speed;
        scenario.contact = Some(law);
    })
}

/// Time at which the first contact opens, s.
fn parting(solution: &Solution) -> f64 {
    let (mut closed, mut open) = (1e-9, solution.end());
    let mut sampler = solution.sampler();
    while open - closed > 1e-16 {
        let middle = 0.5 * (closed + open);
        if sampler.at(middle).overlap(1) > 0.0 {
            closed = middle;
        } else {
            open = middle;
        }
        if middle == closed && middle == open {
            break;
        }
        if open - closed <= 4.0 * f64::EPSILON * open {
            break;
        }
    }
    open
}

#[test]
fn contact_times_and_forces_are_those_of_the_closed_forms() {
    for exponent in [1.0, 1.25, 1.5, 2.0, 3.0] {
        let law = law(exponent);
        let reduced = Model::of(&pair(law.clone(), 1.0)).unwrap().mass(1) / 2.0;
        let expected = PowerLaw::new(exponent, law.stiffness.unwrap());
        for speed in [0.1, 1.0, 10.0] {
            let solution = run(&pair(law.clone(), speed));
            near(parting(&solution), expected.contact_time(reduced, speed), 1e-10);
            let force = solution.summary().peak_force[0].force;
            near(force, expected.greatest_force(reduced, speed), 1e-11);
            assert!(solution.summary().energy.balance_error < 1e-12);
        }
    }
}

/// A damped oscillator: with ω² = κ/μ and β = γ/2μ, the overlap is V/ω_d e^(-βt) sin ω_d t.
#[test]
fn a_spring_and_a_dashpot_are_the_damped_oscillator() {
    for damping in [1.0, 40.0, 200.0] {
        let law = law(1.0).damped(Damping::Linear, damping);
        let (speed, stiffness) = (0.45, law.stiffness.unwrap());
        let solution = run(&pair(law, speed));
        let reduced = solution.model().mass(1) / 2.0;
        let beta = 0.5 * damping / reduced;
        let omega = (stiffness / reduced - beta * beta).sqrt();
        near(parting(&solution), PI / omega, 1e-11);
        let part = (-beta * PI / omega).exp();
        let end = solution.at(solution.end());
        near(end.velocity(1) - end.velocity(0), part * speed, 1e-11);
        let t = 0.3 * PI / omega;
        let overlap = speed / omega * (-beta * t).exp() * (omega * t).sin();
        near(solution.at(t).overlap(1), overlap, 1e-11);
        let lost = 0.5 * reduced * speed * speed * (1.0 - part * part);
        near(solution.summary().energy.dissipated_contacts, lost, 1e-10);
    }
}

/// Tsuji's damping has no scale of speed.
#[test]
fn tsuji_restores_the_same_part_of_every_speed() {
    for exponent in [1.0, 1.5, 3.0] {
        let restored = |speed: f64| {
            let solution = run(&pair(law(exponent).damped(Damping::LammpsTsuji, 0.4), speed));
            let end = solution.at(solution.end());
            (end.velocity(1) - end.velocity(0)) / speed
        };
        let slow = restored(0.1);
        assert!(slow > 0.1 && slow < 0.9, "{slow}");
        near(restored(3.0), slow, 1e-10);
    }
}

/// Compares the velocities of seven beads under a law, the first of which came at 0.45 m/s, with others.
fn ends_with(law: ContactLaw, time: f64, velocities: &str, tolerance: f64) {
    let solution = run(&changed(struck_by_a_bead(6, time), |scenario| {
        scenario.contact = Some(law.clone());
    }));
    let end = solution.at(time);
    for (body, velocity) in numbers(velocities).into_iter().enumerate() {
        let error = (end.velocity(body) - velocity) / 0.45;
        assert!(error.abs() < tolerance, "{law:?}, body {body}: {error:e}");
    }
    assert!(solution.summary().energy.balance_error < 1e-11);
}

/// Velocities of seven beads, the first at 0.45 m/s, after 1.5 ms, by LAMMPS (22 July 2025, pair style
/// granular) in steps of 1 ns. Steps four times as long change them by up to 8.2e-7 of 0.45 m/s. `tsuji` was
/// given a restitution of 0.8, from which LAMMPS makes its coefficient.
#[test]
fn dampings_are_those_of_lammps() {
    let material = |damping, coefficient| ContactLaw::default().damped(damping, coefficient);
    for (law, velocities) in [
        (
            material(Damping::LammpsMaterial, 2e5),
            "-0.029709400717309827 -0.01180856988992666 -0.005495766364197756 -0.0024494179245956554
             0.0008496974312462711 0.06706000455090506 0.43155345291391234",
        ),
        (
            material(Damping::LammpsTsuji, 0.11270417920000053),
            "-0.012015056522660182 9.433380337179334e-05 0.0031052891057501723 0.004810327009023748
             0.017485062538173238 0.09154742821251785 0.3449726158538457",
        ),
        (
            material(Damping::Linear, 20.0),
            "-0.013398951247540118 -0.0006654984898419085 0.0028799283692916705 0.004484756718665828
             0.015128604638128193 0.08873444406242142 0.35283671594883137",
        ),
        (
            ContactLaw::power(1.0, 2e6).damped(Damping::Linear, 20.0),
            "-0.04230626904475644 -0.02151639260708811 -0.014363562641500072 -0.009124101979666184
             0.026873567002483955 0.16719499298215054 0.3432417662884446",
        ),
    ] {
        ends_with(law, 1.5e-3, velocities, 1e-6);
    }
}

/// Velocities of seven beads, the first at 0.45 m/s, by SciPy's DOP853 in steps of 0.1 µs. Steps of twice the
/// length change them by up to 6e-12 of 0.45 m/s.
#[test]
fn chains_that_rub_move_as_another_program_says() {
    let hertz = ContactLaw::default().rubbing(0.05, 0.01);
    let velocities = "-0.02448608118164133 -0.006690687994390827 -0.0007285356584233515 0.0018792797874839578
                      0.008924299711329919 0.0802052756108261 0.3908964497248157";
    ends_with(hertz, 1.5e-3, velocities, 1e-10);
    let cone = ContactLaw::power(2.0, 256399716370.72583).rubbing(0.03, 0.002);
    let velocities = "-0.011732348770929173 0.0008602863327723312 0.0038927150752088775 0.004783416083479528
                      0.006895574025961432 0.03180839820006796 0.4134919590534388";
    ends_with(cone, 1.2e-3, velocities, 1e-10);
}

/// On the way in, a full friction takes f of the elastic work, and on the way out f of what comes back. What
/// remains of the speed is √((1 - f)/(1 + f)) for any exponent and speed.
#[test]
fn friction_restores_the_same_part_of_every_speed() {
    for (exponent, friction) in [(1.0, 0.3), (1.5, 0.03), (3.0, 0.1)] {
        for speed in [0.1, 3.0] {
            let rubs = law(exponent).rubbing(friction, 1e-6 * speed);
            let solution = run(&pair(rubs, speed));
            let end = solution.at(solution.end());
            let part = (end.velocity(1) - end.velocity(0)) / speed;
            let expected = ((1.0 - friction) / (1.0 + friction)).sqrt();
            near(part, expected, 1e-8);
        }
    }
}

#[test]
fn hertz_law_said_in_full_has_the_bits_of_none() {
    let plain = Scenario::paper();
    let said = changed(plain.clone(), |scenario| {
        scenario.contact = Some(ContactLaw::default())
    });
    let [plain, said] = [plain, said].map(|scenario| run(&scenario).summary());
    assert_eq!((plain.peak_force, plain.energy), (said.peak_force, said.energy));
    // Exponents so near to Hertz' that the motion is the same, but the solver for other powers computes it.
    let near_hertz = |exponent: f64| {
        let mut scenario = elastic(12, 2e-3);
        let stiffness = Model::of(&scenario).unwrap().contact(2).stiffness;
        scenario.striker.radius = scenario.chain.radius;
        scenario.contact = Some(ContactLaw::power(
            exponent,
            stiffness * 2e-6_f64.powf(1.5 - exponent),
        ));
        run(&scenario).at(2e-3).velocity(8)
    };
    let (below, at, above) = (near_hertz(1.5 - 1e-6), near_hertz(1.5), near_hertz(1.5 + 1e-6));
    close(0.5 * (below + above), at, 1e-9);
    assert!((above - below).abs() > 1e-8);
}

#[test]
fn a_snapshot_goes_on_and_samples_are_those_of_steps() {
    let scenario = changed(struck_by_a_bead(10, 3e-3), |scenario| {
        scenario.contact = Some(law(1.0).damped(Damping::Linear, 30.0));
        scenario.wall = Some(Wall::flat(scenario.chain.material()));
    });
    let solution = run(&scenario);
    let mut whole = Run::new(&scenario, Accuracy::REFERENCE).unwrap();
    whole.to(1.1e-3).unwrap();
    let sampled = solution.at(1.1e-3);
    let mut again = whole.snapshot().resume(Accuracy::REFERENCE).unwrap();
    for body in 0..=10 {
        close(sampled.velocity(body), whole.snapshot().velocity(body), 1e-11);
    }
    again.to(3e-3).unwrap();
    for body in 0..=10 {
        close(
            solution.at(3e-3).velocity(body),
            again.snapshot().velocity(body),
            1e-10,
        );
    }
    let moved = solution.at(2.7e-3);
    close(
        moved.momentum() + moved.wall_impulse(),
        solution.at(0.0).momentum(),
        1e-12,
    );
    let alone = ensemble(&[scenario], &hertz_chain::EnsembleOptions::default());
    let (one, other) = (alone[0].as_ref().unwrap(), solution.at(3e-3));
    close(one.end().velocity(10), other.velocity(10), 1e-6);
}
