//! Derivatives by five parameters: their time over that of a plain run.

use std::time::Instant;

use hertz_chain::tangents::{Parameter, sensitivities};
use hertz_chain::{Options, Scenario, summarise};

use crate::report::{Aim, Measurements};

/// Parameters of the paper's strike: k, c, m, τ and the striker's speed.
const FIVE: [Parameter; 5] = [
    Parameter::Stiffness(0),
    Parameter::Damping(0),
    Parameter::IntruderMass(0),
    Parameter::Relaxation,
    Parameter::StrikerVelocity,
];

pub(crate) fn measure(report: &mut Measurements, quick: bool) {
    let (scenario, options) = (Scenario::paper(), Options::default());
    let (mut plain, mut five) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..if quick { 3 } else { 40 } {
        let clock = Instant::now();
        summarise(&scenario, &options).expect("it can be run");
        plain = plain.min(clock.elapsed().as_secs_f64());
        let clock = Instant::now();
        sensitivities::<5>(&scenario, &FIVE, &options).expect("it has derivatives");
        five = five.min(clock.elapsed().as_secs_f64());
    }
    let name = "derivatives by five parameters, over a plain run";
    report.goal(name, Some(five / plain), Aim::AtMost(3.0), "");
}
