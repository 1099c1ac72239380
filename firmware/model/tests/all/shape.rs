//! The shape of a strike against the f64 chain: `cargo test -p bead-model shape -- --nocapture` prints
//! the errors.

use crate::replayed;
use crate::sensed::{HOST, felt, front_end, normal, scan};
use bead_model::design::{Bead, Capture, derive};
use hertz_chain::{PulseSearch, Scenario, simulate};

const RATE: f64 = 100e3;
/// From the window's first sample to the strike, samples.
const LEAD: f64 = 200.0;
const LENGTH: u32 = 700;

/// Errors of a strike's shape: arrival in samples; width, impulse, frequency and decay in per cent. The
/// striker has `speed` (m/s), and the springs of the intruder a `stiffness` (N/m). The sensors reach `range`
/// times 16 N and ±250 m/s², with noise of `noise` codes rms.
fn errors(speed: f64, stiffness: f64, range: f64, noise: f64) -> [f64; 5] {
    let mut scenario = Scenario::paper();
    scenario.duration = 0.008;
    scenario.chain.beads = 16;
    scenario.striker.velocity = speed;
    scenario.intruders[0].stiffness = stiffness;
    let solution = simulate(&scenario).unwrap();

    let front_end = front_end([16.0 * range, 500.0 * range]);
    let settings = derive(&Bead::paper(), &front_end, &Capture::default()).unwrap();
    let mut normal = normal(1);
    let scans = (0..LENGTH).map(|n| {
        let [force, acceleration] = felt(&solution, HOST, (f64::from(n) - LEAD) / RATE);
        let mut noise = |per_code: f64| per_code * noise * normal();
        scan(
            &front_end,
            [
                force + noise(front_end.force.per_code),
                acceleration + noise(front_end.acceleration.per_code),
            ],
        )
    });
    let (window, record) = replayed(&settings, 0, &scans.collect::<Vec<_>>());
    let shape = window.report(&settings, &record).1;

    let pulses = solution.pulses(HOST, &PulseSearch::default());
    let pulse = pulses
        .into_iter()
        .max_by(|a, b| a.force.total_cmp(&b.force))
        .unwrap();
    let end = (f64::from(LENGTH) - 1.0 - LEAD) / RATE;
    let impulse = solution.flow(HOST).between(0.0, end).impulse;
    let (host_mass, intruder) = (solution.model().mass(HOST), Bead::paper().intruder());
    let reduced = intruder.mass * (host_mass - intruder.mass) / host_mass;
    let decay = 0.5 * intruder.damping / reduced;
    let frequency = (stiffness / reduced - decay * decay).sqrt() / std::f64::consts::TAU;
    let percent = |value: f64, truth: f64| 100.0 * (value / truth - 1.0);
    [
        shape.arrival.samples() - LEAD - pulse.time * RATE,
        percent(shape.width.samples(), pulse.fwhm.unwrap() * RATE),
        percent(shape.impulse.newton_samples() / RATE, impulse),
        percent(shape.ring_frequency.hertz(), frequency),
        percent(shape.ring_decay.per_second(), decay),
    ]
}

/// Each bound is about twice the error seen.
#[test]
fn the_shape_of_a_strike_is_that_of_the_chain_whatever_its_speed_and_its_spring() {
    for (speed, stiffness, range, noise, bounds) in [
        (0.45, 3.95e5, 1.0, 0.0, [0.1, 0.25, 0.5, 0.6, 1.5]),
        (0.45, 3.95e5, 1.0, 1.3, [0.1, 0.25, 0.5, 0.6, 1.5]),
        // A changed spring shows in the ringing.
        (0.45, 3.6e5, 1.0, 1.3, [0.1, 0.25, 0.5, 0.6, 2.5]),
        (0.45, 4.3e5, 1.0, 1.3, [0.1, 0.25, 0.5, 0.6, 2.5]),
        (0.1, 3.95e5, 0.25, 1.3, [0.15, 0.3, 0.7, 2.0, 10.0]),
        (2.0, 3.95e5, 6.0, 1.3, [0.15, 0.3, 0.7, 2.0, 10.0]),
        (5.0, 3.95e5, 16.0, 1.3, [0.15, 0.3, 0.7, 2.0, 10.0]),
    ] {
        let errors = errors(speed, stiffness, range, noise);
        println!("{speed} m/s, k = {stiffness} N/m, {noise} codes of noise: {errors:.3?}");
        let holds = |(error, bound): (f64, f64)| error.abs() < bound;
        let all = errors.into_iter().zip(bounds).all(holds);
        assert!(all, "{errors:?}, not below {bounds:?}");
    }
}
