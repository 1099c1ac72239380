//! Motion against the solver, tangents against differences and closed forms.

use super::*;
use crate::scenario::{Section, Wall};
use crate::{Material, simulate};

const STEP: f64 = 2.5e-6;
const SENSORS: [Sensor; 3] = [
    sensor(SensorPlace::Force(8), 0.0, 0.0),
    sensor(SensorPlace::Acceleration(8), 0.0, 0.0),
    sensor(SensorPlace::Force(8), 40e3, 0.0),
];

const fn sensor(place: SensorPlace, pole: f64, front_mass: f64) -> Sensor {
    Sensor {
        place,
        pole,
        front_mass,
    }
}

/// The paper's chain, one with every feature, and one that is loaded.
fn scenarios() -> [Scenario; 3] {
    let paper = Scenario::paper();
    let mut rich = paper.clone();
    rich.sections = vec![Section {
        beads: vec![5, 10],
        young: Some(8e9),
        density: Some(2000.0),
        relaxation: Some(2e-6),
        ..Section::default()
    }];
    rich.wall = Some(Wall::flat(Material::STEEL));
    let mut loaded = paper.clone();
    loaded.chain.precompression = 2.0;
    [paper, rich, loaded]
}

#[test]
fn the_motion_is_that_of_the_solver() {
    for scenario in scenarios() {
        let solution = simulate(&scenario).unwrap();
        let run = tangents::<0>(&scenario, &[], &SENSORS, None, (scenario.duration, STEP)).unwrap();
        let scales = [0, 1].map(|sensor| {
            run.steps(sensor)
                .iter()
                .fold(0.0_f64, |most, signal| most.max(signal.value.abs()))
        });
        let mut worst = [0.0_f64; 2];
        for n in 0..(scenario.duration / 1e-5) as usize {
            let t = n as f64 * 1e-5 + 3e-6;
            let now = solution.at(t);
            let load = solution.model().contact(8).load;
            let exact = [now.force(8) - load, now.intruder_acceleration(8).unwrap()];
            for sensor in [0, 1] {
                let off = run.at(sensor, t).0.value - exact[sensor];
                worst[sensor] = worst[sensor].max(off.abs() / scales[sensor]);
            }
        }
        println!("{worst:?}");
        // The force of a viscous contact rises as the root of the time, which no cubic follows.
        assert!(worst[0] < 1e-4 && worst[1] < 1e-6, "{worst:?}");
    }
}

const ALL: [Parameter; 7] = [
    Parameter::Young,
    Parameter::Relaxation,
    Parameter::Density,
    Parameter::StrikerVelocity,
    Parameter::Stiffness(0),
    Parameter::Damping(0),
    Parameter::IntruderMass(0),
];

fn moved(scenario: &Scenario, parameter: Parameter, factor: f64) -> Scenario {
    let mut moved = scenario.clone();
    *match parameter {
        Parameter::Young => &mut moved.chain.young,
        Parameter::Relaxation => &mut moved.chain.relaxation,
        Parameter::Density => &mut moved.chain.density,
        Parameter::StrikerVelocity => &mut moved.striker.velocity,
        Parameter::Stiffness(_) => &mut moved.intruders[0].stiffness,
        Parameter::Damping(_) => &mut moved.intruders[0].damping,
        Parameter::IntruderMass(_) => &mut moved.intruders[0].mass,
        _ => unreachable!("not a value of a scenario"),
    } *= factor;
    moved
}

/// Differences of fourth order of a run that is integrated with small steps; the signals are those behind a
/// pole, since without one a force has no derivative where its contact closes.
#[test]
fn tangents_are_the_differences_of_runs_across_openings_and_closings() {
    let places = [SensorPlace::Force(8), SensorPlace::Acceleration(8)];
    let sensors = places.map(|place| sensor(place, 40e3, 1e-3));
    for scenario in scenarios() {
        let span = (5e-3, 2.0 * STEP);
        let run = tangents::<8>(&scenario, &ALL, &sensors, None, span).unwrap();
        for (direction, parameter) in ALL.into_iter().enumerate() {
            let part = 1e-4;
            let runs = [-2.0, -1.0, 1.0, 2.0].map(|steps| {
                let moved = moved(&scenario, parameter, 1.0 + steps * part);
                tangents::<0>(&moved, &[], &sensors, None, span).unwrap()
            });
            let value = parameter.value(&scenario).unwrap();
            for sensor in [0, 1] {
                let (mut worst, mut most) = (0.0_f64, 0.0_f64);
                for (step, tangent) in run.steps(sensor).iter().enumerate() {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|run| runs[run].steps(sensor)[step].value);
                    let difference = (a - 8.0 * b + 8.0 * c - d) / (12.0 * part);
                    let ours = tangent.by[direction] * value;
                    worst = worst.max((ours - difference).abs());
                    most = most.max(difference.abs());
                }
                println!("{parameter:?}, sensor {sensor}: {:.1e}", worst / most);
                assert!(
                    worst < 1e-5 * most,
                    "{parameter:?}, sensor {sensor}: {:e}",
                    worst / most
                );
            }
        }
    }
}

/// An elastic chain has no speed of its own: F ~ V^(6/5), t ~ V^(-1/5), so V dF/dV = (6/5) F + (1/5) t dF/dt.
#[test]
fn tangents_along_the_speed_obey_the_scaling_of_elastic_chains() {
    let mut scenario = Scenario::paper();
    scenario.chain.relaxation = 0.0;
    scenario.intruders.clear();
    let run = tangents::<1>(
        &scenario,
        &[Parameter::StrikerVelocity],
        &SENSORS[..1],
        None,
        (3e-3, 1e-6),
    )
    .unwrap();
    for n in 150..280 {
        let t = n as f64 * 1e-5;
        let (force, rate) = run.at(0, t);
        let off = scenario.striker.velocity * force.by[0] - 1.2 * force.value - 0.2 * t * rate;
        // Steps do not scale with the motion: a part of 1e-4 of the greatest tangent, which is 10 N.
        assert!(off.abs() < 1e-3, "{t}: {off:e} of {force:?}");
    }
}

/// The motion of a bead and all behind it follows from the force in front of it.
#[test]
fn a_push_by_the_force_of_a_contact_moves_the_bead_as_the_chain_did() {
    let scenario = Scenario::paper();
    let whole = tangents::<0>(&scenario, &[], &SENSORS, None, (6e-3, STEP)).unwrap();
    let push = Push {
        bead: 8,
        start: 0.0,
        rate: 1.0 / STEP,
        force: whole.steps(0).iter().map(|force| force.value).collect(),
    };
    let driven = tangents::<1>(
        &scenario,
        &[Parameter::PushGain],
        &SENSORS[1..2],
        Some(&push),
        (6e-3, STEP),
    )
    .unwrap();
    let pairs = whole.steps(1).iter().zip(driven.steps(0));
    let worst = pairs.fold(0.0_f64, |most, (whole, driven)| {
        most.max((whole.value - driven.value).abs())
    });
    assert!(worst < 5e-3, "{worst} of 194 m/s²");
    assert!(driven.steps(0).iter().any(|signal| signal.by[0].abs() > 100.0));
}

#[test]
fn what_has_no_tangents_is_refused() {
    let paper = Scenario::paper();
    let refused = |sensors: &[Sensor], span| {
        let found = tangents::<1>(&paper, &ALL[..1], sensors, None, span);
        found.unwrap_err().to_string()
    };
    let nowhere = sensor(SensorPlace::Force(90), 0.0, 0.0);
    assert!(refused(&[nowhere], (1e-3, STEP)).contains("no contact or bead 90"));
    assert!(refused(&SENSORS, (1.0, 1e-9)).contains("ten million"));
}
