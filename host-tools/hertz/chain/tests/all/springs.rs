//! Intruders on springs that harden or soften: F = k x + k₃ x³.

use std::f64::consts::FRAC_PI_2;

use crate::common::{close, elastic, numbers, run};
use hertz_chain::{Intruder, Oscillator, Scenario, SimulateError, Start, simulate, summarise};

/// One free bead, its intruder let go at a distance from its place, m.
fn let_go(oscillator: Oscillator, cubic_stiffness: f64, distance: f64) -> Scenario {
    let mut scenario = elastic(1, 4e-3);
    scenario.striker.velocity = 0.0;
    let mut intruder = Intruder::new([1], oscillator);
    intruder.cubic_stiffness = cubic_stiffness;
    scenario.intruders = vec![intruder];
    scenario.starts = vec![Start::apart([1], 1.0)];
    scenario.starts[0].intruder_displacement = distance;
    scenario
}

const UNDAMPED: Oscillator = Oscillator {
    damping: 0.0,
    ..Oscillator::PAPER
};

/// Jacobi's sn, cn and dn of u with the parameter m, and the quarter period K, by the arithmetic-geometric
/// mean (Abramowitz and Stegun, 16.4 and 17.6).
fn jacobi(u: f64, m: f64) -> ([f64; 3], f64) {
    let (mut a, mut b, mut c) = (vec![1.0], (1.0 - m).sqrt(), vec![m.sqrt()]);
    // It converges quadratically.
    for _ in 0..7 {
        let last = a[a.len() - 1];
        a.push(0.5 * (last + b));
        c.push(0.5 * (last - b));
        b = (last * b).sqrt();
    }
    let n = a.len() - 1;
    let mut phase = f64::from(1 << n) * a[n] * u;
    for level in (1..=n).rev() {
        phase = 0.5 * (phase + (c[level] / a[level] * phase.sin()).asin());
    }
    let (sn, cn) = phase.sin_cos();
    let dn = (1.0 - m * sn * sn).sqrt();
    ([sn, cn, dn], FRAC_PI_2 / a[n])
}

/// Duffing's oscillator, μ x'' = -k x - k₃ x³ from rest at X. With a = k₃ X²: x = X cn(Ω t, a/2(k + a)), Ω² =
/// (k + a)/μ, if it hardens, and x = X cd(Ω t, -a/(2k + a)), Ω² = (k + a/2)/μ, if it softens. The period is
/// 4K/Ω.
#[test]
fn an_intruder_that_is_let_go_moves_as_duffings_oscillator() {
    let distance = 2e-6;
    for part in [5.0, 1.0, 0.05, -0.05, -0.5, -0.95] {
        let k = UNDAMPED.stiffness;
        let a = part * k;
        let scenario = let_go(UNDAMPED, a / (distance * distance), distance);
        let solution = run(&scenario);
        let (whole, mass) = (solution.model().mass(1), UNDAMPED.mass);
        let reduced = mass * (whole - mass) / whole;
        let (parameter, stiff) = if a > 0.0 {
            (0.5 * a / (k + a), k + a)
        } else {
            (-a / (2.0 * k + a), k + 0.5 * a)
        };
        let omega = (stiff / reduced).sqrt();
        let (_, quarter) = jacobi(0.0, parameter);
        let mut worst = 0.0_f64;
        for n in 1..=400 {
            let t = 1e-5 * f64::from(n);
            // Within one period, where rounding of the phase does not grow.
            let u = (omega * t) % (4.0 * quarter);
            let ([_, cn, dn], _) = jacobi(u, parameter);
            let x = distance * if a > 0.0 { cn } else { cn / dn };
            let at = solution.at(t);
            let off = at.intruder_displacement(1).unwrap() - x;
            worst = worst.max((off / distance).abs());
            let pull = k * x + a / (distance * distance) * x * x * x;
            let acceleration = at.intruder_acceleration(1).unwrap() + pull / mass;
            worst = worst.max((acceleration * mass / (stiff * distance)).abs());
        }
        println!("{part}: {worst:.1e}");
        assert!(worst < 1e-11, "{part}: {worst:e}");
        let summary = solution.summary();
        close(summary.energy.balance_error, 0.0, 1e-12);
        close(
            summary.intruders[0].relative_displacement_max,
            distance,
            1e-9 * distance,
        );
        let greatest = (k + a) * distance / mass;
        // A spring that softens much pulls most at X/√3 of its reach, not at the end of its stroke.
        let top = (k / (3.0 * -a)).sqrt();
        let greatest = if a < 0.0 && top < 1.0 {
            2.0 / 3.0 * k * top * distance / mass
        } else {
            greatest
        };
        close(summary.intruders[0].acceleration_max / greatest, 1.0, 1e-10);
    }
}

/// Printed by `python tests/springs_by_scipy.py` (SciPy 1.17.1): DOP853 at a relative tolerance of 1e-13, in
/// steps of up to 0.1 µs. Steps half as long change the velocities by up to 2e-11 of the striker's.
///
/// Of each strike on two beads, the velocities of the bodies. Below, of each intruder: its bead, m, k, k₃, c,
/// and the number of its carrier or 0; then x, x' and the energy that it has dissipated.
const CASES: &str = "\
hardening -0.3994565424293486 0.0008451371387295508 0.050452400295028885
    2 3.7e-3 1e5 2e16 12.0 0 1.3679766905763452e-06 -0.007729706512687354 1.686688144853361e-06
softening -0.39945654278423254 0.0006823655758734123 0.050894479011711395
    2 3.7e-3 3.95e5 -2e16 12.0 0 7.39115119498604e-08 -0.011579417014964732 1.2606634296345127e-06
both -0.39779484771250395 0.0012402765835146938 0.05038958560970177
    1 2e-3 2e5 5e16 5.0 0 -6.4343929019107e-07 -0.010273739083682764 2.746588718944504e-06
    2 3.7e-3 3.95e5 -1e16 12.0 0 -4.0796408506773744e-07 -0.008124766588365057 1.1131931928238762e-06
several-in-a-bead -0.39779483255786185 0.0011858262318698467 0.0502770546251095
    1 2e-3 2e5 5e16 5.0 0 -6.37200500942464e-07 -0.010278571506752068 2.7417862625811045e-06
    2 3.7e-3 3.95e5 0.0 12.0 0 -5.597480048508412e-07 -0.005709000542823861 1.0046908973862676e-06
    2 1.5e-3 9e5 0.0 3.0 0 -2.7840142877574522e-08 -0.00027540459478528345 5.552684421390595e-09
one-in-another -0.3994565348201596 0.0008571294717943089 0.05108755824816104
    2 3.7e-3 3.95e5 0.0 12.0 0 -7.001403567246322e-08 -0.013123418854058669 1.5162451124511157e-06
    2 0.8e-3 3e5 2e16 2.0 1 -1.2538687443118903e-07 -0.0031843928277964506 2.2921486892545483e-08
two-and-one-in-another -0.3977948297329075 0.0017885025785173304 0.05099173424842814
    1 2e-3 2e5 5e16 5.0 0 -6.598909622066255e-07 -0.01024642273215603 2.75370581801085e-06
    2 3.7e-3 3.95e5 0.0 12.0 0 8.61314985790547e-07 -0.015437913843928452 1.7218511702817684e-06
    2 0.8e-3 3e5 0.0 2.0 2 1.1856972812587026e-07 -0.004981117476167595 4.6443254883065434e-08
    2 0.3e-3 2e5 1e16 1.0 3 4.0601581738430403e-08 -0.0021445203466163125 4.83963157035969e-09
    2 0.5e-3 4e5 0.0 3.0 2 5.1708335079362884e-08 -0.0016777492589353238 4.056473985171458e-09";

/// The velocities of the bodies and the rows of the intruders of a case.
fn case(name: &str) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut rows = CASES
        .lines()
        .skip_while(|row| row.split(' ').next() != Some(name));
    let head = rows.next().and_then(|row| row.split_once(' '));
    let (_, velocities) = head.expect("the case is there");
    let intruders = rows.map_while(|row| row.strip_prefix("    ")).map(numbers);
    (numbers(velocities), intruders.collect())
}

/// The strike of a case.
fn strike(name: &str) -> Scenario {
    let mut scenario = elastic(2, 1e-3);
    let intruder = |row: &Vec<f64>| {
        let oscillator = Oscillator::new(row[1], row[2], row[4]);
        let mut intruder = Intruder::new([row[0] as usize], oscillator);
        intruder.cubic_stiffness = row[3];
        intruder.inside = Some(row[5] as usize).filter(|carrier| *carrier > 0);
        intruder
    };
    scenario.intruders = case(name).1.iter().map(intruder).collect();
    scenario
}

#[test]
fn struck_intruders_on_any_springs_and_in_others_move_as_an_independent_program_says() {
    let names = CASES.lines().filter(|row| !row.starts_with(' '));
    for name in names.filter_map(|row| row.split(' ').next()) {
        let (velocities, intruders) = case(name);
        let solution = run(&strike(name));
        let (end, summary) = (solution.at(1e-3), solution.summary());
        for (body, velocity) in velocities.into_iter().enumerate() {
            close(end.velocity(body), velocity, 1e-10 * 0.45);
        }
        for (number, row) in intruders.iter().enumerate() {
            println!("{name}, intruder {number}");
            // Strokes are of the order of 1 µm.
            let motion = end.motion_of(number);
            close(motion.displacement, row[6], 3e-10 * 1e-6);
            close(motion.velocity, row[7], 1e-10);
            close(summary.intruders[number].dissipated, row[8], 1e-10 * row[8]);
        }
        close(summary.energy.balance_error, 0.0, 1e-12);
    }
}

#[test]
fn a_spring_that_softens_until_it_lets_go_ends_the_run_in_one_line() {
    let mut scenario = strike("softening");
    scenario.intruders[0].cubic_stiffness = -2e18;
    let error = simulate(&scenario).expect_err("it lets go");
    let SimulateError::SpringGivesWay { bead, time, reach } = error else {
        panic!("{error}");
    };
    assert_eq!(bead, 2);
    close(reach, (3.95e5_f64 / 2e18).sqrt(), 1e-18);
    assert!(time > 1e-4 && time < 4e-4, "{time}");
    assert_eq!(summarise(&scenario, &hertz_chain::Options::default()), Err(error));
}
