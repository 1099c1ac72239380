//! Random chains of every kind, compared with the referee of the tests.

use std::ops::Range;

use super::testing::{distance, hosting, plain, referee, start};
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{
    ContactForce, ContactLaw, Damping, Drive, DriveQuantity, Intruder, Material, Scenario, Section, Start,
    Striker, Wall,
};

/// Random numbers from 0 to 1, equal in every run (Marsaglia's xorshift).
struct ScenarioDraw(u64);

impl ScenarioDraw {
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
        let mut scenario = plain(beads, 0.0, 0.004);
        let chain = &mut scenario.chain;
        if self.next() > 0.3 {
            chain.relaxation = 1e-5 * self.next();
        }
        if self.next() < 0.3 {
            chain.contact_force = ContactForce::Clipped;
        }
        if self.next() < 0.3 {
            chain.precompression = self.decades(1e-3, 1e3);
        }
        scenario.striker = Striker {
            radius: self.decades(0.003, 0.03),
            young: self.decades(1e9, 2e11),
            velocity: self.decades(0.05, 5.0),
            ..Striker::PAPER
        };
        scenario.wall = (self.next() < 0.3).then(|| Wall::flat(Material::STEEL));
        for bead in 1..=beads {
            if self.next() < 0.2 {
                let (mass, stiffness) = (self.decades(1e-4, 5e-3), self.decades(1e3, 1e6));
                let oscillator = Oscillator::new(mass, stiffness, self.decades(0.1, 30.0));
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
        if scenario.chain.precompression == 0.0 && self.next() < 0.3 {
            let mut start = Start::apart([self.bead(beads)], self.decades(1e-8, 1e-4));
            start.velocity = scenario.striker.velocity * (self.next() - 0.5);
            scenario.starts.push(start);
        }
        scenario
    }

    /// A chain so long that a wave leaves most of it behind.
    fn long_viscous(&mut self) -> Scenario {
        let beads = 220 + (self.next() * 100.0) as usize;
        let long = plain(beads, self.decades(1e-6, 2e-5), 0.05);
        let mut scenario = hosting(long, [self.bead(beads)]);
        scenario.striker.velocity = self.decades(0.2, 2.0);
        scenario
    }
}

fn compare(number: usize, scenario: &Scenario, tolerance: f64) {
    scenario.check().expect("it can be simulated");
    let model = Model::new(scenario);
    let mut run = start(&model, (0.0, &model.initial()), tolerance, 0.125);
    run.run_to(scenario.duration);
    let error = distance(&model, &run.present(&model), &referee(&model, scenario.duration));
    println!("scenario {number}: {error:.1e}");
    assert!(
        error < 1e-9,
        "scenario {number}: {error:e}\n{}",
        scenario.to_toml()
    );
}

/// Compares the scenarios of these numbers in a sequence that is equal in every run. Of those drawn, the
/// sequence leaves out the ones that are `None`.
fn compare_all(
    seed: u64,
    numbers: Range<usize>,
    tolerance: f64,
    mut next: impl FnMut(&mut ScenarioDraw) -> Option<Scenario>,
) {
    let mut draw = ScenarioDraw(seed);
    let all = std::iter::from_fn(|| Some(next(&mut draw))).flatten();
    for (number, scenario) in all.enumerate().take(numbers.end).skip(numbers.start) {
        compare(number, &scenario, tolerance);
    }
}

#[test]
fn random_long_viscous_chains_move_as_another_method_says() {
    compare_all(0x2545_f491_4f6c_dd1d, 0..4, 1e-11, |draw| {
        Some(draw.long_viscous())
    });
}

const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// The first of the two hundred: a general fault is noticed at once.
#[test]
fn a_dozen_random_scenarios_move_as_another_method_says() {
    compare_all(SEED, 0..12, 1e-14, |draw| Some(draw.scenario()));
}

#[test]
fn two_hundred_random_scenarios_move_as_another_method_says() {
    compare_all(SEED, 12..200, 1e-14, |draw| Some(draw.scenario()));
}

/// A chain with a drive, gravity or displaced beads.
fn driven(draw: &mut ScenarioDraw) -> Scenario {
    let beads = 1 + (draw.next() * 18.0) as usize;
    let mut scenario = plain(beads, 0.0, 0.003);
    if draw.next() > 0.4 {
        scenario.chain.relaxation = 1e-5 * draw.next();
    }
    scenario.wall = (draw.next() < 0.5).then(|| Wall::flat(Material::STEEL));
    if draw.next() < 0.4 {
        scenario.chain.precompression = draw.decades(1e-2, 1e2);
    }
    if scenario.wall.is_some() && draw.next() < 0.4 {
        scenario.chain.gravity = draw.decades(1.0, 30.0);
    }
    for bead in 1..=beads {
        if draw.next() < 0.2 {
            scenario.intruders.push(Intruder::new([bead], Oscillator::PAPER));
            let mut start = Start::moving([bead], 0.2 * (draw.next() - 0.5));
            start.displacement = 1e-6 * (draw.next() - 0.5);
            start.intruder_displacement = 1e-6 * (draw.next() - 0.5);
            start.intruder_velocity = 0.1 * (draw.next() - 0.5);
            scenario.starts.push(start);
        }
    }
    if draw.next() < 0.2 {
        return scenario;
    }
    let (quantity, amplitude) = if draw.next() < 0.5 {
        (DriveQuantity::Displacement, draw.decades(1e-7, 2e-5))
    } else {
        (DriveQuantity::Force, draw.decades(0.1, 20.0))
    };
    scenario.striker.velocity = 0.0;
    let mut drive = Drive::sine(quantity, amplitude, draw.decades(300.0, 5000.0));
    if draw.next() < 0.5 {
        drive.ramp = 2e-3 * draw.next();
    }
    if draw.next() < 0.5 {
        drive.frequency_end = Some(draw.decades(300.0, 5000.0));
        drive.sweep = Some(0.004 * draw.next());
    }
    if draw.next() < 0.3 {
        let samples = (0..=40).map(|n| [1e-4 * f64::from(n), draw.next() - 0.5]);
        drive = Drive::record(quantity, samples.collect());
        drive.amplitude = amplitude;
    }
    scenario.drive = Some(drive);
    scenario
}

#[test]
fn sixty_driven_chains_move_as_another_method_says() {
    compare_all(0x1405_7b7e_f767_814f, 0..60, 1e-14, |draw| Some(driven(draw)));
}

/// Puts the intruders on springs that harden or soften. They move no further than the greatest speed over
/// their own angular frequency takes them.
fn on_cubic_springs(draw: &mut ScenarioDraw, scenario: &mut Scenario) {
    let speed = Model::new(scenario).speed_scale();
    for intruder in &mut scenario.intruders {
        let stroke = speed * (intruder.mass / intruder.stiffness).sqrt();
        let part = if draw.next() < 0.7 {
            draw.decades(0.1, 100.0)
        } else {
            -0.05 * draw.next()
        };
        intruder.cubic_stiffness = part * intruder.stiffness / (stroke * stroke);
    }
}

/// Puts further intruders into the intruders, and into these.
fn nest(draw: &mut ScenarioDraw, scenario: &mut Scenario) {
    let outer = scenario.intruders.len();
    let mut carrier = 0;
    while carrier < scenario.intruders.len() && scenario.intruders.len() < 3 * outer {
        let Intruder {
            ref beads,
            mass,
            stiffness,
            damping,
            ..
        } = scenario.intruders[carrier];
        let beads = beads.clone();
        carrier += 1;
        while draw.next() < 0.6 {
            let mut inner = Intruder::new(beads.iter().copied(), Oscillator::PAPER);
            inner.inside = Some(carrier);
            inner.mass = mass * draw.decades(0.02, 0.3);
            inner.stiffness = stiffness * draw.decades(0.03, 1.0);
            inner.damping = damping * draw.decades(0.01, 0.3);
            scenario.intruders.push(inner);
        }
    }
}

/// A chain that is driven in this part of all cases.
fn driven_or_not(draw: &mut ScenarioDraw, part: f64) -> Scenario {
    if draw.next() < part {
        driven(draw)
    } else {
        draw.scenario()
    }
}

#[test]
fn forty_chains_with_intruders_in_others_move_as_another_method_says() {
    compare_all(0x0fed_cba9_8765_4321, 0..40, 1e-14, |draw| {
        let mut scenario = driven_or_not(draw, 0.3);
        nest(draw, &mut scenario);
        let nests = scenario.intruders.iter().any(|one| one.inside.is_some());
        (nests && scenario.check().is_ok()).then_some(scenario)
    });
}

#[test]
fn forty_chains_on_a_ground_that_drags_move_as_another_method_says() {
    compare_all(0x3141_5926_5358_9793, 0..40, 1e-14, |draw| {
        let mut scenario = driven_or_not(draw, 0.5);
        if draw.next() < 0.3 {
            nest(draw, &mut scenario);
        }
        scenario.chain.drag_time = Some(draw.decades(1e-5, 1e-1));
        scenario.check().is_ok().then_some(scenario)
    });
}

#[test]
fn forty_chains_with_cubic_springs_move_as_another_method_says() {
    compare_all(0x1234_5678_9abc_def1, 0..40, 1e-14, |draw| {
        let mut scenario = draw.scenario();
        if draw.next() < 0.4 {
            scenario = driven(draw);
            scenario.chain.gravity = 0.0;
        }
        if scenario.intruders.is_empty() {
            return None;
        }
        on_cubic_springs(draw, &mut scenario);
        Some(scenario)
    });
}

/// A law of contacts with other powers. A dashpot's force jumps, which the referee cannot follow.
fn law(draw: &mut ScenarioDraw) -> ContactLaw {
    let exponents = [1.0, 1.25, 2.0, 2.7, 3.0];
    let exponent = exponents[(draw.next() * 5.0) as usize];
    // As stiff as the paper's contacts at their depth of 2 µm.
    let depth = 2e-6_f64;
    let stiffness = draw.decades(0.2, 2.0) * 3.6e8 * depth.powf(1.5 - exponent);
    let law = ContactLaw::power(exponent, stiffness);
    let choice = draw.next();
    if choice < 0.4 && exponent > 1.0 {
        return law;
    }
    if choice < 0.7 && exponent > 1.0 {
        return law.damped(Damping::LammpsTsuji, 0.5 * draw.next());
    }
    let power = 0.5 + draw.next();
    let mut law = law.damped(Damping::Power, 20.0 * draw.next() * depth.powf(-power));
    law.damping_exponent = Some(power);
    law
}

#[test]
fn forty_chains_of_other_contacts_move_as_another_method_says() {
    compare_all(0x9216_d5d9_8979_fb1b, 0..40, 1e-13, |draw| {
        let mut scenario = driven(draw);
        let mut law = law(draw);
        if draw.next() < 0.4 {
            law = law.rubbing(0.3 * draw.next(), draw.decades(0.02, 1.0));
        }
        scenario.contact = Some(law);
        scenario.chain.precompression = scenario.chain.precompression.min(5.0);
        Some(scenario)
    });
}
