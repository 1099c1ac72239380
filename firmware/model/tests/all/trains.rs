//! Strikers that are heavy beside a bead make trains of waves:
//! `cargo test --release -p bead-model trains -- --nocapture` prints the errors.

use crate::sensed::HOST;
use crate::spheres::errors;
use bead_model::StrikeFlags;
use bead_model::design::{Bead, Neighbours, Surroundings};
use bead_model::reduced_chain::FOLLOWERS;
use hertz_chain::{Scenario, simulate};

/// Where there are intruders: at the host only, or in a row of ten from the bead before it on.
#[derive(Clone, Copy, PartialEq)]
enum Held {
    Alone,
    Row,
}
use Held::{Alone, Row};

/// Errors of A and B in per cent, and the flags, of a strike by a sphere of steel of this radius (mm) and
/// speed (m/s) on the paper's chain with this relaxation (s). The intruder has this mass (kg).
fn strike([radius, speed]: [f64; 2], relaxation: f64, held: Held, mass: f64) -> (f64, f64, StrikeFlags) {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 60;
    scenario.chain.relaxation = relaxation;
    scenario.striker.radius = 1e-3 * radius;
    scenario.striker.mass = None;
    scenario.striker.velocity = speed;
    scenario.duration = 0.010;
    let mut bead = Bead {
        relaxation,
        ..Bead::paper()
    };
    bead.intruder_mass = mass;
    let mut around = Surroundings::default();
    if held == Row {
        bead.stiffness = 1e5;
        around = Neighbours::new([true; FOLLOWERS], true, bead.intruder()).into();
        scenario.intruders[0].beads = (HOST - 1..HOST + 9).collect();
    }
    let intruder = &mut scenario.intruders[0];
    (intruder.mass, intruder.stiffness) = (bead.intruder_mass, bead.stiffness);
    errors(&simulate(&scenario).unwrap(), &bead, &around).unwrap()
}

#[test]
fn b_holds_for_trains_with_right_settings() {
    const BAKELITE: f64 = 4.2e-6;
    // Relaxation, hosts, mass of the intruder (kg), bound of B (%), and strikers: radius (mm), speed (m/s).
    let strikers = [
        [1.0, 5.0],
        [4.5, 0.1],
        [4.5, 5.0],
        [9.8, 0.6],
        [15.5, 0.9],
        [19.0, 0.1],
        [19.0, 0.5],
        [19.0, 0.6],
        [12.0, 5.0],
        [22.0, 0.35],
        [25.0, 0.4],
        [30.0, 0.1],
        [30.0, 0.4],
        [30.0, 2.0],
        [40.0, 0.1],
        [40.0, 0.2],
        [40.0, 1.0],
        [40.0, 2.0],
    ];
    let mut worst = 0.0_f64;
    for (relaxation, held, mass, bound) in [
        (BAKELITE, Alone, 3.7e-3, 0.5),
        (0.0, Alone, 3.7e-3, 2.0),
        (BAKELITE, Row, 3.7e-3, 1.5),
        (BAKELITE, Alone, 12e-3, 2.0),
        (BAKELITE, Row, 12e-3, 6.0),
        (0.0, Row, 12e-3, 6.0),
    ] {
        for striker in strikers {
            let (a, b, flags) = strike(striker, relaxation, held, mass);
            println!("{striker:?}, {relaxation:e} s, {mass} kg: A {a:+.3} %, B {b:+.3} %, {flags:?}");
            worst = worst.max(b.abs() / bound);
            assert!(b.abs() < 3.0 || flags != StrikeFlags::NONE);
        }
    }
    assert!(worst < 1.0, "{worst}");
}
