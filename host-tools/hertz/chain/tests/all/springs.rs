//! Intruders on springs that harden or soften: F = k x + k₃ x³.

use std::f64::consts::FRAC_PI_2;

use crate::common::{close, elastic, run};
use hertz_chain::{
    Intruder, Oscillator, Run, Scenario, SimulateError, Start, Summariser, simulate, summarise,
};

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

/// A strike on two beads, and the results of `springs_by_scipy.py`.
struct SpringCase {
    name: &'static str,
    /// Bead, mass, k, k₃ and c.
    intruders: &'static [(usize, f64, f64, f64, f64)],
    /// Intruders that others carry, with the number of that one, both from 1.
    inside: &'static [(usize, usize)],
    places: &'static [f64],
    speeds: &'static [f64],
    velocities: &'static [f64],
    lost: &'static [f64],
}

impl SpringCase {
    fn scenario(&self) -> Scenario {
        let mut scenario = elastic(2, 1e-3);
        let intruder = |&(bead, mass, stiffness, cubic, damping): &(usize, f64, f64, f64, f64)| {
            let oscillator = Oscillator {
                mass,
                stiffness,
                damping,
            };
            let mut intruder = Intruder::new([bead], oscillator);
            intruder.cubic_stiffness = cubic;
            intruder
        };
        scenario.intruders = self.intruders.iter().map(intruder).collect();
        for (inner, carrier) in self.inside {
            scenario.intruders[inner - 1].inside = Some(*carrier);
        }
        scenario
    }
}

/// Printed by `python tests/springs_by_scipy.py` (SciPy 1.17.1): DOP853 at a relative tolerance of 1e-13, in
/// steps of up to 0.1 µs. Half as long steps change the velocities by up to 2e-11 of the striker's.
const CASES: [SpringCase; 6] = [
    SpringCase {
        name: "hardening",
        intruders: &[(2, 3.7e-3, 1e5, 2e16, 12.0)],
        inside: &[],
        places: &[1.3679766905763452e-06],
        speeds: &[-0.007729706512687354],
        velocities: &[-0.3994565424293486, 0.0008451371387295508, 0.050452400295028885],
        lost: &[1.686688144853361e-06],
    },
    SpringCase {
        name: "softening",
        intruders: &[(2, 3.7e-3, 3.95e5, -2e16, 12.0)],
        inside: &[],
        places: &[7.39115119498604e-08],
        speeds: &[-0.011579417014964732],
        velocities: &[-0.39945654278423254, 0.0006823655758734123, 0.050894479011711395],
        lost: &[1.2606634296345127e-06],
    },
    SpringCase {
        name: "both",
        intruders: &[(1, 2e-3, 2e5, 5e16, 5.0), (2, 3.7e-3, 3.95e5, -1e16, 12.0)],
        inside: &[],
        places: &[-6.4343929019107e-07, -4.0796408506773744e-07],
        speeds: &[-0.010273739083682764, -0.008124766588365057],
        velocities: &[-0.39779484771250395, 0.0012402765835146938, 0.05038958560970177],
        lost: &[2.746588718944504e-06, 1.1131931928238762e-06],
    },
    SpringCase {
        name: "several in a bead",
        intruders: &[
            (1, 2e-3, 2e5, 5e16, 5.0),
            (2, 3.7e-3, 3.95e5, 0.0, 12.0),
            (2, 1.5e-3, 9e5, 0.0, 3.0),
        ],
        inside: &[],
        places: &[
            -6.37200500942464e-07,
            -5.597480048508412e-07,
            -2.7840142877574522e-08,
        ],
        speeds: &[
            -0.010278571506752068,
            -0.005709000542823861,
            -0.00027540459478528345,
        ],
        velocities: &[-0.39779483255786185, 0.0011858262318698467, 0.0502770546251095],
        lost: &[
            2.7417862625811045e-06,
            1.0046908973862676e-06,
            5.552684421390595e-09,
        ],
    },
    SpringCase {
        name: "one in another",
        intruders: &[(2, 3.7e-3, 3.95e5, 0.0, 12.0), (2, 0.8e-3, 3e5, 2e16, 2.0)],
        inside: &[(2, 1)],
        places: &[-7.001403567246322e-08, -1.2538687443118903e-07],
        speeds: &[-0.013123418854058669, -0.0031843928277964506],
        velocities: &[-0.3994565348201596, 0.0008571294717943089, 0.05108755824816104],
        lost: &[1.5162451124511157e-06, 2.2921486892545483e-08],
    },
    SpringCase {
        name: "two and one in another",
        intruders: &[
            (1, 2e-3, 2e5, 5e16, 5.0),
            (2, 3.7e-3, 3.95e5, 0.0, 12.0),
            (2, 0.8e-3, 3e5, 0.0, 2.0),
            (2, 0.3e-3, 2e5, 1e16, 1.0),
            (2, 0.5e-3, 4e5, 0.0, 3.0),
        ],
        inside: &[(3, 2), (4, 3), (5, 2)],
        places: &[
            -6.598909622066255e-07,
            8.61314985790547e-07,
            1.1856972812587026e-07,
            4.0601581738430403e-08,
            5.1708335079362884e-08,
        ],
        speeds: &[
            -0.01024642273215603,
            -0.015437913843928452,
            -0.004981117476167595,
            -0.0021445203466163125,
            -0.0016777492589353238,
        ],
        velocities: &[-0.3977948297329075, 0.0017885025785173304, 0.05099173424842814],
        lost: &[
            2.75370581801085e-06,
            1.7218511702817684e-06,
            4.6443254883065434e-08,
            4.83963157035969e-09,
            4.056473985171458e-09,
        ],
    },
];

#[test]
fn struck_intruders_on_any_springs_and_in_others_move_as_an_independent_program_says() {
    for case in CASES {
        let solution = run(&case.scenario());
        let (end, summary) = (solution.at(1e-3), solution.summary());
        for (body, velocity) in case.velocities.iter().enumerate() {
            close(end.velocity(body), *velocity, 1e-10 * 0.45);
        }
        for (number, &(bead, ..)) in case.intruders.iter().enumerate() {
            println!("{}, bead {bead}", case.name);
            // Strokes are of the order of 1 µm.
            let motion = end.motion_of(number);
            close(motion.displacement, case.places[number], 3e-10 * 1e-6);
            close(motion.velocity, case.speeds[number], 1e-10);
            let lost = case.lost[number];
            close(summary.intruders[number].dissipated, lost, 1e-10 * lost);
        }
        close(summary.energy.balance_error, 0.0, 1e-12);
    }
}

#[test]
fn a_spring_that_softens_until_it_lets_go_ends_the_run_in_one_line() {
    let mut scenario = CASES[1].scenario();
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

#[test]
fn the_parts_of_a_hardening_chains_energy_add_up_at_any_time() {
    let mut scenario = CASES[2].scenario();
    scenario.chain.relaxation = 4.2e-6;
    let mut run = Run::new(&scenario, hertz_chain::Accuracy::REFERENCE).unwrap();
    let mut summariser = Summariser::new(&mut run);
    let mut worst = 0.0_f64;
    run.watch(1e-3, |step| summariser.observe(step)).unwrap();
    let solution = simulate(&scenario).unwrap();
    let whole = solution.model().initial_energy();
    for n in 1..=100 {
        let at = solution.at(1e-5 * f64::from(n));
        worst = worst.max((at.energies().total() / whole - 1.0).abs());
        let region = at.region(1..=2);
        close(
            region.intruder_kinetic + region.intruder_elastic,
            at.energies().intruders,
            1e-15 * whole,
        );
    }
    close(worst, 0.0, 1e-11);
    assert_eq!(
        summariser.summary(&mut run).intruders,
        solution.summary().intruders
    );
}

#[test]
fn what_no_spring_does_is_refused() {
    let refusal = |change: fn(&mut Scenario)| {
        let mut scenario = let_go(UNDAMPED, -1e17, 1e-6);
        change(&mut scenario);
        scenario.check().expect_err("no spring does that").to_string()
    };
    let itself = refusal(|one| one.intruders[0].inside = Some(1));
    assert!(
        itself.starts_with("intruder[1].inside: intruder[1] does not come before intruder[1]"),
        "{itself}"
    );
    let empty = refusal(|one| {
        one.chain.beads = 2;
        one.intruders.push(Intruder::new([2], UNDAMPED));
        one.intruders[1].inside = Some(1);
    });
    assert!(
        empty.starts_with("intruder[2].inside: bead 2 holds no intruder[1]"),
        "{empty}"
    );
    let infinite = refusal(|one| one.intruders[0].cubic_stiffness = f64::INFINITY);
    assert!(
        infinite.starts_with("intruder[1].cubic_stiffness: inf is no cubic stiffness"),
        "{infinite}"
    );
    let far = refusal(|one| one.starts[0].intruder_displacement = -2e-6);
    assert!(
        far.starts_with("start[1].intruder_displacement: at -0.000002 m"),
        "{far}"
    );
    let hanging = refusal(|one| one.chain.gravity = 9.81);
    assert!(
        hanging.starts_with("intruder[1].cubic_stiffness: a spring that is not linear"),
        "{hanging}"
    );
}
