//! Random chains of every kind, compared with an integration by another method and other code: Dormand and
//! Prince's 8(5,3) on the model's own equations, with steps that shrink where contacts open and close.

use std::ops::Range;
use std::sync::Arc;

use super::dop853::{Dop853, Interpolant, System};
use super::{Lanes, Stepper};
use crate::bisection::bisect;
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{Chain, ContactForce, Intruder, Material, Scenario, Section, Start, Striker, Wall};

/// Random numbers from 0 to 1, equal in every run (Marsaglia's xorshift).
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn decades(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.next())
    }

    fn bead(&mut self, beads: usize) -> usize {
        1 + (self.next() * beads as f64) as usize
    }

    fn scenario(&mut self) -> Scenario {
        let beads = 1 + (self.next() * 24.0) as usize;
        let relaxation = if self.next() < 0.3 {
            0.0
        } else {
            1e-5 * self.next()
        };
        let clipped = self.next() < 0.3;
        let load = if self.next() < 0.3 {
            self.decades(1e-3, 1e3)
        } else {
            0.0
        };
        let mut scenario = Scenario {
            title: String::new(),
            duration: 0.004,
            chain: Chain {
                beads,
                relaxation,
                contact_force: if clipped {
                    ContactForce::Clipped
                } else {
                    ContactForce::Printed
                },
                precompression: load,
                ..Chain::PAPER
            },
            striker: Striker {
                radius: self.decades(0.003, 0.03),
                young: self.decades(1e9, 2e11),
                velocity: self.decades(0.05, 5.0),
                ..Striker::PAPER
            },
            wall: (self.next() < 0.3).then(|| Wall::flat(Material::STEEL)),
            intruders: Vec::new(),
            sections: Vec::new(),
            starts: Vec::new(),
        };
        for bead in 1..=beads {
            if self.next() < 0.2 {
                let oscillator = Oscillator {
                    mass: self.decades(1e-4, 5e-3),
                    stiffness: self.decades(1e3, 1e6),
                    damping: self.decades(0.1, 30.0),
                };
                scenario.intruders.push(Intruder::new([bead], oscillator));
            }
        }
        if self.next() < 0.4 {
            scenario.sections.push(Section {
                beads: vec![self.bead(beads)],
                radius: Some(self.decades(0.014, 0.03)),
                young: Some(self.decades(1e9, 1e11)),
                ..Section::default()
            });
        }
        if load == 0.0 && self.next() < 0.3 {
            let mut start = Start::apart([self.bead(beads)], self.decades(1e-8, 1e-4));
            start.velocity = scenario.striker.velocity * (self.next() - 0.5);
            scenario.starts.push(start);
        }
        scenario
    }
}

impl System for Model {
    fn rate(&self, y: &[f64], rate: &mut [f64]) {
        Model::rate(self, y, rate);
    }
}

/// The state at the end of a run by Dormand and Prince's method.
pub(super) fn other(model: &Model, end: f64) -> Vec<f64> {
    let floor = model.scales().into_iter().map(|scale| 1e-15 * scale).collect();
    let longest = model.shortest_contact() / 24.0;
    let mut stepper = Dop853::new(model, model.initial(), 1e-13, floor, longest);
    while stepper.time < end {
        let (from, state) = (stepper.time, stepper.state.clone());
        stepper.advance(model, end).expect("it goes on");
        if !model.clipped {
            continue;
        }
        let (to, after) = (stepper.time, stepper.state.clone());
        let turns = |j: &usize| model.limited(&state, *j) != model.limited(&after, *j);
        let turning: Vec<usize> = (1..=model.contacts()).filter(turns).collect();
        if turning.is_empty() {
            continue;
        }
        let inside_step = Interpolant::new(model, (from, &state), (to, &after));
        let mut inside = state.clone();
        let kinks = turning.iter().map(|&j| {
            bisect(from, to, |t| {
                inside_step.at(t, &mut inside);
                model.limited(&inside, j)
            })
        });
        let kink = kinks.fold(to, f64::min);
        let part = (kink - from) / (to - from);
        if part > 1e-6 && part < 1.0 - 1e-6 {
            stepper.return_to(model, from, &state);
            stepper.advance(model, kink).expect("it goes on");
        }
    }
    stepper.state
}

impl Draw {
    /// A chain so long that a wave leaves most of it behind.
    fn long_viscous(&mut self) -> Scenario {
        let mut scenario = self.scenario();
        let beads = 220 + (self.next() * 100.0) as usize;
        scenario.chain.beads = beads;
        scenario.chain.relaxation = self.decades(1e-6, 2e-5);
        scenario.chain.precompression = 0.0;
        scenario.duration = 0.05;
        scenario.sections.clear();
        scenario.starts.clear();
        scenario.intruders = vec![Intruder::new([self.bead(beads)], Oscillator::PAPER)];
        scenario.striker = Striker {
            velocity: self.decades(0.2, 2.0),
            ..Striker::PAPER
        };
        scenario
    }
}

/// Difference of places or velocities of all bodies across a contact. A wall stands still at 0.
pub(super) fn across(bodies: &[f64], contact: usize) -> f64 {
    bodies[contact - 1] - bodies.get(contact).copied().unwrap_or(0.0)
}

/// Greatest distance of two states, as a part of their values or of the scales.
pub(super) fn distance(model: &Model, ours: &[f64], theirs: &[f64]) -> f64 {
    let pairs = ours.iter().zip(theirs).zip(model.scales());
    let errors = pairs.map(|((a, b), scale)| (a - b).abs() / scale.max(b.abs()));
    errors.fold(0.0, f64::max)
}

/// The state at the end of a run at a tolerance, and the part of the bodies computed in a step.
fn ours(model: &Model, end: f64, tolerance: f64) -> (Vec<f64>, f64) {
    let (lanes, layout) = (Arc::new(Lanes::new(model)), model.layout());
    let longest = model.shortest_contact() / 8.0;
    let mut stepper = Stepper::new(lanes, layout, (0.0, &model.initial()), tolerance, longest);
    let mut computed = 0;
    while stepper.time < end {
        stepper.advance(end).expect("it goes on");
        computed += stepper.computed();
    }
    let mut state = model.initial();
    stepper.state(&mut state);
    let all = stepper.steps as f64 * model.bodies() as f64;
    (state, computed as f64 / all)
}

#[test]
fn random_long_viscous_chains_move_as_another_method_says() {
    let mut draw = Draw(0x2545_f491_4f6c_dd1d);
    for number in 0..4 {
        let scenario = draw.long_viscous();
        let model = Model::new(&scenario);
        let (ours, part) = ours(&model, scenario.duration, 1e-11);
        let error = distance(&model, &ours, &other(&model, scenario.duration));
        println!("scenario {number}: {error:.1e}, {part:.2} of the bodies in a step");
        assert!(
            error < 1e-9,
            "scenario {number}: {error:e}\n{}",
            scenario.to_toml()
        );
    }
}

/// Compares scenarios of these numbers in a sequence that is equal in every run.
fn compare(numbers: Range<usize>) {
    let mut draw = Draw(0x9e37_79b9_7f4a_7c15);
    let mut worst = 0.0_f64;
    for (number, scenario) in (0..numbers.end).map(|number| (number, draw.scenario())) {
        if number < numbers.start {
            continue;
        }
        let model = Model::new(&scenario);
        let (ours, _) = ours(&model, scenario.duration, 1e-14);
        let error = distance(&model, &ours, &other(&model, scenario.duration));
        assert!(
            error < 1e-9,
            "scenario {number}: {error:e}\n{}",
            scenario.to_toml()
        );
        worst = worst.max(error);
    }
    println!("worst of {numbers:?}: {worst:.1e}");
}

/// The first of the two hundred: a general fault is noticed at once.
#[test]
fn a_dozen_random_scenarios_move_as_another_method_says() {
    compare(0..12);
}

#[test]
fn two_hundred_random_scenarios_move_as_another_method_says() {
    compare(12..200);
}
