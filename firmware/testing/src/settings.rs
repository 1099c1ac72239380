//! Settings at random.

use bead_model::Settings;
use bead_model::design::{Bead, Capture, Description, FrontEnd, Intruder, Neighbours};

/// Settings at random that a bead must take: every number that can be chosen, at the corners of its range and
/// within it. `random` gives random bits.
///
/// # Panics
/// A thousand drawn settings are all refused: the ranges here are not those of the check.
pub fn any_settings(random: &mut dyn FnMut() -> u64) -> Settings {
    let drawn = std::iter::repeat_with(|| draw_description(random)).take(1000);
    let mut valid = drawn.filter_map(|description| Settings::new(&description).ok());
    valid.next().expect("one of a thousand drawn settings is valid")
}

fn draw_description(random: &mut dyn FnMut() -> u64) -> Description {
    /// An end of the range, one beside it, or any of it.
    fn corner(random: &mut dyn FnMut() -> u64, least: u64, most: u64) -> f64 {
        let whole = match random() % 6 {
            0 => least,
            1 => (least + 1).min(most),
            2 => most.saturating_sub(1).max(least),
            3 => most,
            _ => least + random() % (most - least + 1),
        };
        whole as f64
    }
    let (bead, front_end) = (Bead::paper(), FrontEnd::reference());
    let places = random();
    let intruder = Intruder {
        mass: corner(random, 1, 12) * 1e-3,
        stiffness: corner(random, 50, 400) * 1e3,
        damping: corner(random, 1, 40),
    };
    let neighbours = Neighbours::new(
        std::array::from_fn(|follower| places >> follower & 1 == 1),
        places >> 8 & 1 == 1,
        intruder,
    );
    let mut description = Description::new(&bead, &neighbours, &front_end, &Capture::default());
    // Units over the range of their formats: 32 kN and 65 km/s² over 4095 codes, with the slope.
    for (sensor, last, most) in [
        (&mut description.force, 30, (1 << 31) - 1),
        (&mut description.acceleration, 26, 1 << 30),
    ] {
        for (per_code, pole) in [
            (&mut sensor.per_code, &mut sensor.pole),
            (&mut sensor.wide_per_code, &mut sensor.wide_pole),
        ] {
            if random().is_multiple_of(2) {
                continue;
            }
            *per_code = corner(random, 5000, most) * 0.5_f64.powi(last);
            *pole = match random() % 3 {
                0 => 0.0,
                _ => corner(random, 8000, 200_000),
            };
        }
    }
    description.force.noise = match random() % 3 {
        0 => 0.0,
        1 => corner(random, 0, 30) * 1e-3,
        _ => corner(random, 0, 10_000),
    };
    let history = corner(random, 128, 256);
    let capture = &mut description.capture;
    capture.history = history * 1e-5;
    capture.length = corner(random, history as u64 + 1, 1024) * 1e-5;
    capture.lookback = corner(random, 1, history as u64 - 1) * 1e-5;
    let rise = match random() % 3 {
        0 => 1.0 + (random() % 12) as f64,
        _ => corner(random, 1, 4095),
    };
    capture.threshold = rise * description.force.per_code;
    capture.disagreement = corner(random, 1, 10_000_000) * 1e-3;
    capture.ring_frequency_tolerance = corner(random, 1, 10_000_000) * 1e-3;
    capture.ring_decay_tolerance = corner(random, 1, 10_000_000) * 1e-3;
    description.address = corner(random, 0, 254) as u8;
    description
}
