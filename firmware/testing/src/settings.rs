//! Settings of the paper's bead, at random, and as blocks.

use bead_model::Settings;
use bead_model::design::{
    Bead, Capture, Day, Description, Followers, FrontEnd, Intruder, Neighbours, Relative, SensorEnds,
    Surroundings, Uncertainty, derive,
};
use bead_model::name::Name;
use bead_model::settings::BLOCK_MAX;
use bead_wire::Block;

/// Settings of the paper's bead behind the reference front end.
///
/// # Panics
/// Never: the coefficients of this bead are in range.
pub fn paper_settings() -> Settings {
    let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default());
    settings.expect("settings of the paper's bead")
}

/// The message with a settings block.
pub fn block_of(settings: &Settings) -> bead_wire::Settings {
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).expect("a block fits BLOCK_MAX bytes");
    let block = Block::try_from(&block[..length]).expect("a block fits a frame");
    bead_wire::Settings { block }
}

/// The block of settings, as flash has it.
pub fn block(settings: &Settings) -> Vec<u8> {
    block_of(settings).block.bytes().to_vec()
}

/// Settings of the paper's bead at another sample rate: the same numbers of samples, and consistent in
/// themselves.
///
/// # Panics
/// There are none at that rate.
pub fn settings_at(rate: u32) -> Settings {
    let slower = 100_000.0 / f64::from(rate);
    let settings = paper_settings().with(|bead| {
        bead.capture.sample_rate_hz = rate;
        bead.capture.history *= slower;
        bead.capture.length *= slower;
    });
    settings.expect("settings at this rate")
}

/// Settings at random that a bead must take: every number that can be chosen, at the corners of its range and
/// within it. `random` returns random bits.
///
/// # Panics
/// A thousand drawn settings are all refused: the ranges here are not those of the check.
pub fn any_settings(random: &mut dyn FnMut() -> u64) -> Settings {
    let drawn = std::iter::repeat_with(|| draw_description(random)).take(1000);
    let mut valid = drawn.filter_map(|description| Settings::new(&description).ok());
    valid.next().expect("one of a thousand drawn settings is valid")
}

/// Uncertainties of settings, each stated or not. Any three correlations up to 0.4 are possible together.
fn any_uncertainty(random: &mut dyn FnMut() -> u64) -> Uncertainty {
    let mut part = |most: u64| Relative::new((random() % most + 10) as f64 * 1e-7);
    let correlations = [part(4_000_000), part(4_000_000), part(4_000_000)];
    let mut stated = || Some(part(4_000_000)).filter(|part| part.part() < 0.3);
    Uncertainty {
        calibration: Name::new("a record of 2026").expect("16 bytes"),
        calibrated: Day::parse("2026-11-24"),
        valid_until: Day::parse("2199-01-01"),
        force_gain: stated(),
        force_gain_ratio: stated(),
        force_flatness: stated(),
        acceleration_gain: stated(),
        acceleration_gain_ratio: stated(),
        acceleration_flatness: stated(),
        supply: stated(),
        bead_mass: stated(),
        front_mass: stated(),
        intruder_mass: stated(),
        stiffness: stated(),
        damping: stated(),
        contact_stiffness: stated(),
        relaxation: stated(),
        stiffness_with_damping: correlations[0],
        stiffness_with_mass: correlations[1],
        damping_with_mass: correlations[2],
    }
}

/// Beads behind that are heavier than any intruder drawn here.
fn unlike_followers(bead: &Bead, random: &mut dyn FnMut() -> u64) -> Followers {
    let like = Followers::like(bead);
    let mut times = |least: u64| (least + random() % 16) as f32 / 8.0;
    Followers {
        mass: like.mass.map(|mass| mass * times(2)),
        stiffness: like.stiffness.map(|stiffness| stiffness * times(0)),
        relaxation: like.relaxation.map(|relaxation| relaxation * times(0)),
        load: times(0),
        wall: (random() % 16).saturating_sub(9) as u8,
    }
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
    let around = Surroundings {
        intruders: neighbours,
        followers: (random() & 3 == 0).then(|| unlike_followers(&bead, random)),
    };
    let mut description = Description::new(&bead, &around, &front_end, &Capture::default());
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
    description.sensor_end = random().is_multiple_of(2).then(|| SensorEnds {
        force: Some(corner(random, 1, 40_000) as f32),
        acceleration: Some(corner(random, 1, 1_000_000) as f32),
    });
    description.uncertainty = random().is_multiple_of(2).then(|| any_uncertainty(random));
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

/// Codes of a bead at [`paper_settings`] that a pulse of 6 N strikes at scan 400 of 1200, and of its
/// intruder, which rings.
pub fn struck_codes() -> impl Iterator<Item = [u16; 4]> {
    (0..1200).map(|sample: i32| {
        let at = f64::from(sample) - 400.0;
        let force = 6.0 * (-(at / 20.0).powi(2)).exp();
        let ring = 100.0 * (at / 9.0).sin() * (-at / 80.0).exp();
        let acceleration = if at > 0.0 { ring } else { 0.0 };
        let code = |value: f64, per_code: f64, zero: f64| {
            (zero + value / per_code).round().clamp(0.0, 4095.0) as u16
        };
        [
            code(force, 16.0 / 4096.0, 128.0) + (sample % 2) as u16,
            code(force, 256.0 / 4096.0, 128.0),
            code(acceleration, 500.0 / 4096.0, 2048.0),
            code(acceleration, 8000.0 / 4096.0, 2048.0),
        ]
    })
}
