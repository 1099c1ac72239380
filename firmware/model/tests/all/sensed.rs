//! Codes of simulated strikes, made in the simplest way: 12-bit rounding and no filter, so that the errors of
//! a result are those of the fixed-point estimators.

use std::f64::consts::TAU;

use bead_model::Scan;
use bead_model::converter::CONVERSION;
use bead_model::design::FrontEnd;
use hertz_chain::Solution;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Bead with the intruder in the paper's chain.
pub(crate) const HOST: usize = 8;
/// A pole whose lag is the delay of the wide channel: that channel then has no slope.
const UNDELAYED: f64 = 1.0 / (TAU * CONVERSION);

/// Sensors with these spans of force (N) and acceleration (m/s², both signs together) and no noise. The low
/// gain does not widen them.
pub(crate) fn front_end(spans: [f64; 2]) -> FrontEnd {
    let mut front_end = FrontEnd::reference();
    for (sensor, span) in [&mut front_end.force, &mut front_end.acceleration]
        .into_iter()
        .zip(spans)
    {
        (sensor.per_code, sensor.pole, sensor.noise) = (span / 4096.0, 0.0, 0.0);
        (sensor.wide_per_code, sensor.wide_pole) = (sensor.per_code, UNDELAYED);
    }
    front_end
}

/// Codes of a force (N) and an acceleration (m/s²) over zeros of 128.3 and 2048.2.
pub(crate) fn scan(front_end: &FrontEnd, [force, acceleration]: [f64; 2]) -> Scan {
    let code = |code: f64| code.round().clamp(0.0, 4095.0) as u16;
    let force = code(force / front_end.force.per_code + 128.3);
    let acceleration = code(acceleration / front_end.acceleration.per_code + 2048.2);
    Scan::new([force, force, acceleration, acceleration])
}

/// Force (N) at the incoming contact of a `host`, and acceleration (m/s²) of its intruder two conversions
/// later, as a scan has them; zeros before the strike.
pub(crate) fn felt(solution: &Solution, host: usize, time: f64) -> [f64; 2] {
    let at = |time: f64| (time >= 0.0).then(|| solution.at(time.min(solution.end())));
    let force = at(time).map_or(0.0, |now| now.force(host));
    let acceleration = at(time + 2.0 * CONVERSION).map(|now| now.intruder_acceleration(host).unwrap());
    [force, acceleration.unwrap_or(0.0)]
}

/// Numbers of a standard normal distribution, for a seed the same in every run.
pub(crate) fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move || StandardNormal.sample(&mut random)
}
