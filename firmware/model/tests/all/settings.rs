//! The settings block: what it holds, which blocks are refused, and which settings.

use crate::paper;
use bead_model::company::Company;
use bead_model::design::{Bead, Description, Followers, LEAST_WIDTH, Neighbours, SensorEnds, Supply};
use bead_model::name::Name;
use bead_model::quantity::SensedForce;
use bead_model::settings::BLOCK_MAX;
use bead_model::violation::{Bound, Coefficient, SettingKey as Key};
use bead_model::{Settings, SettingsError, Violation};
use crc::{CRC_32_ISO_HDLC, Crc};

/// The paper's bead behind the reference front end in a block of version 1, made from the description of the
/// format alone (`tests/data/README.md`).
const PAPER: &[u8] = include_bytes!("../../../../tests/data/settings-v1.bin");
/// Bytes of a block before its body: magic, version, length.
const HEADER: usize = 8;

fn block(version: u16, body: &[u8]) -> Vec<u8> {
    let mut block = PAPER[..4].to_vec();
    block.extend(version.to_le_bytes());
    block.extend((body.len() as u16).to_le_bytes());
    block.extend(body);
    block.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&block).to_le_bytes());
    block
}

fn body() -> &'static [u8] {
    &PAPER[HEADER..PAPER.len() - 4]
}

/// The paper's bead with the same intruder in two beads behind it.
fn in_company() -> Description {
    let bead = Bead::paper();
    Description {
        company: Neighbours::new([true, false, false, true, false, true], false, bead.intruder()),
        ..*paper().description()
    }
}

#[test]
fn the_block_of_version_1_is_the_papers_bead_to_the_bit_and_lacks_later_sections() {
    assert_eq!(Settings::decode(PAPER), Ok(paper()));
    let mut buffer = [0; BLOCK_MAX];
    let length = paper().encode(&mut buffer).unwrap();
    let (first, later) = buffer[HEADER..length - 4].split_at(body().len());
    assert_eq!(first, body());
    assert!(later.iter().all(|&absent| absent == 0), "{later:?}");
}

#[test]
fn a_block_needs_its_room_and_has_its_length() {
    let (settings, mut room) = (Settings::new(&in_company()).unwrap(), [0; BLOCK_MAX]);
    let length = settings.encode(&mut room).unwrap();
    for short in (0..length).step_by(if cfg!(miri) { 19 } else { 1 }) {
        let refused = settings.encode(&mut [0; BLOCK_MAX][..short]);
        assert_eq!(refused, Err(SettingsError::BufferTooSmall), "{short}");
        assert!(Settings::decode(&room[..short]).is_err(), "{short}");
    }
    assert_eq!(settings.encode(&mut [0; BLOCK_MAX][..length]), Ok(length));
    assert_eq!(Settings::decode(&room[..length]), Ok(settings));
    assert_eq!(Settings::block_length(&room), Some(length));
    assert_eq!(Settings::block_length(&room[..HEADER]), Some(length));
    assert_eq!(Settings::block_length(&room[..HEADER - 1]), None);
    for bit in (0..length * 8).step_by(if cfg!(miri) { 41 } else { 1 }) {
        let mut damaged = room;
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(Settings::decode(&damaged[..length]).is_err(), "bit {bit}");
    }
    room[0] = b'b';
    assert_eq!(Settings::block_length(&room), None);
    assert_eq!(Settings::decode(&room), Err(SettingsError::Magic));
    assert_eq!(Settings::decode(&[0xff; 64]), Err(SettingsError::Erased));
}

#[test]
fn the_longest_settings_have_room_in_a_block() {
    let mut longest = in_company();
    longest.name = Name::new("sixteen bytes ok").unwrap();
    longest.address = 254;
    longest.company = Neighbours::new([true; 6], true, longest.intruder);
    longest.followers = Some(Followers::like(&longest.physics()));
    longest.supply = Some(Supply { voltage: 3.3 });
    let mut buffer = [0; BLOCK_MAX];
    longest.sensor_end = Some(SensorEnds {
        force: Some(1e3),
        acceleration: Some(1e5),
    });
    let settings = Settings::new(&longest).unwrap();
    let length = settings.encode(&mut buffer).unwrap();
    // The sample rate has two more bytes at most.
    assert!(length + 2 <= BLOCK_MAX, "{length} bytes");
}

#[test]
fn blocks_of_other_versions_are_refused_by_their_number() {
    for version in [0, 2, 3, 6, 8, 0xFFFF] {
        let error = Settings::decode(&block(version, body())).unwrap_err();
        let (expected, advice) = if matches!(version, 2..=6) {
            (
                SettingsError::Unreleased(version),
                ", unreleased: `bead settings make` remakes it from its bead.toml",
            )
        } else {
            (
                SettingsError::Version(version),
                ", but this program reads version 7",
            )
        };
        assert_eq!(error, expected);
        let line = format!("settings block of version {version}{advice}");
        assert_eq!(error.to_string(), line);
    }
}

#[test]
fn a_body_of_another_length_or_with_a_name_that_no_terminal_should_show_is_refused() {
    let longer = [body(), &[5]].concat();
    for body in [&longer[..], &body()[..body().len() - 1]] {
        assert_eq!(Settings::decode(&block(1, body)), Err(SettingsError::Body));
    }
    for name in [&b"a\x1b]52;c;"[..], b"\xff\xfe", b"bell\x07", b"a\0b"] {
        // Postcard writes the sixteen bytes of the name first.
        let body = [name, &body()[name.len()..]].concat();
        let expected = SettingsError::Invalid(Violation {
            key: Key::Name,
            bound: Bound::Text,
        });
        let found = Settings::decode(&block(1, &body));
        assert_eq!(found, Err(expected), "{name:?}");
    }
}

/// Key and bound that the paper's bead in company violates after a change.
fn refused(change: impl FnOnce(&mut Description)) -> (Key, Bound) {
    let mut description = in_company();
    change(&mut description);
    let Violation { key, bound } = Settings::new(&description).unwrap_err();
    (key, bound)
}

/// Key and bound that it violates with another number.
fn refused_number(key: Key, value: f64) -> (Key, Bound) {
    refused(|one| *number(one, key) = value)
}

/// Every number of a description that is above 0.
const POSITIVE: [Key; 13] = [
    Key::BeadMass,
    Key::IntruderMass,
    Key::IntruderStiffness,
    Key::IntruderDamping,
    Key::ContactStiffness,
    Key::ForcePerCode,
    Key::WideForcePerCode,
    Key::AccelerationPerCode,
    Key::WideAccelerationPerCode,
    Key::Threshold,
    Key::CompanyMass,
    Key::CompanyStiffness,
    Key::CompanyDamping,
];
/// Every number that is 0 or more.
const NOT_NEGATIVE: [Key; 8] = [
    Key::ContactRelaxation,
    Key::ForcePole,
    Key::WideForcePole,
    Key::AccelerationPole,
    Key::WideAccelerationPole,
    Key::Lookback,
    Key::History,
    Key::Length,
];

/// The number of a description that has this key.
fn number(one: &mut Description, key: Key) -> &mut f64 {
    match key {
        Key::BeadMass => &mut one.bead.mass,
        Key::FrontMass => &mut one.bead.front_mass,
        Key::IntruderMass => &mut one.intruder.mass,
        Key::IntruderStiffness => &mut one.intruder.stiffness,
        Key::IntruderDamping => &mut one.intruder.damping,
        Key::ContactStiffness => &mut one.contact.stiffness,
        Key::ContactRelaxation => &mut one.contact.relaxation,
        Key::ForcePerCode => &mut one.force.per_code,
        Key::WideForcePerCode => &mut one.force.wide_per_code,
        Key::ForcePole => &mut one.force.pole,
        Key::WideForcePole => &mut one.force.wide_pole,
        Key::ForceNoise => &mut one.force.noise,
        Key::AccelerationPerCode => &mut one.acceleration.per_code,
        Key::WideAccelerationPerCode => &mut one.acceleration.wide_per_code,
        Key::AccelerationPole => &mut one.acceleration.pole,
        Key::WideAccelerationPole => &mut one.acceleration.wide_pole,
        Key::AccelerationNoise => &mut one.acceleration.noise,
        Key::Threshold => &mut one.capture.threshold,
        Key::Lookback => &mut one.capture.lookback,
        Key::History => &mut one.capture.history,
        Key::Length => &mut one.capture.length,
        Key::Disagreement => &mut one.capture.disagreement,
        Key::RingFrequencyTolerance => &mut one.capture.ring_frequency_tolerance,
        Key::RingDecayTolerance => &mut one.capture.ring_decay_tolerance,
        Key::CompanyMass => &mut one.company.mass,
        Key::CompanyStiffness => &mut one.company.stiffness,
        Key::CompanyDamping => &mut one.company.damping,
        _ => panic!("{key:?} is no f64"),
    }
}

#[test]
fn each_number_that_is_not_finite_or_has_the_wrong_sign_is_refused_by_its_key() {
    for key in POSITIVE {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let (found, bound) = refused_number(key, value);
            assert_eq!(found, key, "{value}");
            assert!(matches!(bound, Bound::Positive | Bound::NotNegative), "{bound:?}");
        }
    }
    for key in NOT_NEGATIVE {
        for value in [-1e-9, f64::NAN, f64::INFINITY] {
            assert_eq!(refused_number(key, value), (key, Bound::NotNegative));
        }
    }
    for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let ends = |force, acceleration| Some(SensorEnds { force, acceleration });
        for (key, ends) in [
            (Key::ForceEnd, ends(Some(value), None)),
            (Key::AccelerationEnd, ends(None, Some(value))),
        ] {
            assert_eq!(refused(|one| one.sensor_end = ends), (key, Bound::Positive));
        }
    }
    let found = paper().with(|one| one.capture.sample_rate_hz = 0).unwrap_err();
    assert_eq!((found.key, found.bound), (Key::SampleRate, Bound::Positive));
    assert_eq!(found.to_string(), "capture.sample_rate must be above 0");
}

#[test]
fn numbers_too_great_for_any_format_are_refused_and_break_nothing() {
    for key in POSITIVE.into_iter().chain(NOT_NEGATIVE) {
        for value in [1e300, 1e-300, 1e38, 1e18] {
            let mut description = in_company();
            *number(&mut description, key) = value;
            let found = Settings::new(&description);
            // Filters may be as fast as one likes, and a relaxation of 0 is elastic.
            let fast = value > 1.0 && key.path().ends_with("pole");
            assert_eq!(found.is_ok(), fast, "{key:?} = {value}: {found:?}");
        }
    }
}

#[test]
fn masses_address_places_flag_and_noise_have_their_limits() {
    let mass = in_company().bead.mass;
    let host = mass - in_company().intruder.mass;
    let limits = [
        (Key::IntruderMass, mass, Bound::BelowBead),
        (Key::CompanyMass, mass, Bound::BelowBead),
        (Key::FrontMass, -1e-9, Bound::BelowHost),
        (Key::FrontMass, host, Bound::BelowHost),
        (Key::Threshold, 0.4 * in_company().force.per_code, Bound::Codes),
    ];
    for (key, value, bound) in limits {
        assert_eq!(refused_number(key, value), (key, bound));
    }
    assert_eq!(refused(|one| one.address = 255), (Key::Address, Bound::OneBead));
    assert_eq!(
        refused(|one| one.company.behind = 17),
        (Key::Behind, Bound::Places)
    );
    assert_eq!(
        refused(|one| one.company.elsewhere = 2),
        (Key::Elsewhere, Bound::Flag)
    );
    let (least, most) = (1.8, 3.6);
    for voltage in [0.0, 5.0, f64::NAN] {
        let found = refused(|one| one.supply = Some(Supply { voltage }));
        assert_eq!(found, (Key::SupplyVoltage, Bound::Range { least, most }));
    }
    let allowed = paper().with(|one| {
        (one.bead.front_mass, one.address, one.company.elsewhere) = (0.5 * host, 254, 1);
    });
    assert!(allowed.is_ok());
    for key in [Key::ForceNoise, Key::AccelerationNoise] {
        for noise in [-1e-3, 1.1e4, f64::INFINITY, f64::NAN] {
            assert_eq!(refused_number(key, noise).0, key);
        }
    }
    // Its ring-down would have coefficients that are infinite.
    for stiffness in [4e-317, 9e-7, 2e15] {
        assert_eq!(
            refused_number(Key::IntruderStiffness, stiffness).0,
            Key::IntruderStiffness
        );
    }
}

#[test]
fn each_time_and_the_threshold_are_allowed_up_to_their_limits_and_not_beyond() {
    // The paper's window has 160 scans of history and 672 in all.
    for (key, least, most) in [
        (Key::History, 128, 256),
        (Key::Length, 161, 1024),
        (Key::Lookback, 1, 159),
    ] {
        for samples in [0, least - 1, least, most, most + 1, 70_000] {
            let found = paper().with(|one| *number(one, key) = f64::from(samples) * 1e-5);
            let expected = (least..=most).contains(&samples);
            assert_eq!(found.is_ok(), expected, "{key:?}: {samples}");
            assert!(expected || found.unwrap_err().key == key, "{key:?}: {samples}");
        }
    }
    for codes in [1, 4095, 4096, 70_000] {
        let found = paper().with(|one| {
            one.force.noise = 0.0;
            one.capture.threshold = f64::from(codes) * one.force.per_code;
        });
        assert_eq!(found.is_ok(), (2..=4095).contains(&codes), "{codes}");
    }
}

#[test]
fn the_trigger_is_at_least_twice_the_gate() {
    let with_noise = |noise: f64| {
        paper().with(|one| {
            one.capture.threshold = 26.0 * one.force.per_code;
            one.force.noise = noise;
        })
    };
    // 26 codes of 1/256 N are six standard deviations of 16.927 mN, of which rounding is 1.128 mN.
    let most = (26.0 / 256.0 / 6.0_f64).powi(2) - (1.0 / 256.0_f64).powi(2) / 12.0;
    assert!(with_noise(0.999 * most.sqrt()).is_ok());
    let found = with_noise(1.001 * most.sqrt()).unwrap_err();
    assert_eq!((found.key, found.bound), (Key::Threshold, Bound::AboveNoise));
}

#[test]
fn the_noise_of_the_front_end_makes_the_gate() {
    let settings = paper().with(|one| {
        (one.force.noise, one.force.per_code) = (3e-3, 4e-3 * 12_f64.sqrt());
    });
    // Three times the root of the squares of 3 and 4 mN.
    let gate = settings.unwrap().chain.gate;
    assert!((gate.to_num::<f64>() - 0.015).abs() < 2.0 * SensedForce::DELTA.to_num::<f64>());
}

#[test]
fn poles_and_units_have_their_limits() {
    for (pole, unit) in [
        (Key::ForcePole, Key::ForcePerCode),
        (Key::WideForcePole, Key::WideForcePerCode),
        (Key::AccelerationPole, Key::AccelerationPerCode),
        (Key::WideAccelerationPole, Key::WideAccelerationPerCode),
    ] {
        // The slope is as great as the unit at a lag of two samples: f_s/4π.
        let is_wide = pole.path().ends_with("wide_pole");
        let delay = if is_wide { 27.0 / 21e6 } else { 0.0 };
        let slowest = 1.0 / (std::f64::consts::TAU * (2e-5 + delay));
        let faster = paper().with(|one| *number(one, pole) = 1.0001 * slowest);
        assert!(faster.is_ok(), "{pole:?}");
        for pole_hz in [0.9999 * slowest, 1e-300] {
            assert_eq!(refused_number(pole, pole_hz), (pole, Bound::Pole));
        }
        // The codes of both channels, with their slopes, stay below the range of the sums.
        let is_force = matches!(unit, Key::ForcePerCode | Key::WideForcePerCode);
        let (found, bound) = refused_number(unit, if is_force { 2.0 } else { 32.0 });
        assert!(matches!(bound, Bound::Unit { .. }), "{bound:?}");
        assert_eq!(found, unit);
        if !is_force {
            assert_eq!(refused_number(unit, 16.1), (unit, Bound::Reach));
        }
    }
    // A small bead has less room for its force.
    let small = |newtons: f64| {
        paper().with(|one| {
            one.bead.mass *= 0.01;
            one.intruder.mass *= 0.01;
            one.intruder.stiffness *= 0.01;
            one.intruder.damping *= 0.01;
            one.force.wide_per_code = newtons / 4095.0;
            one.force.wide_pole = 0.0;
        })
    };
    let powers = small(1.0).unwrap().scale.incoming;
    assert!(powers > 2, "{powers}");
    // Without a pole, slope and curve take out the delay δ of 9/70 samples: the weights above 0 are 1 - δ² of
    // the middle code and (δ + δ²)/2 of the oldest.
    let delay = 9.0_f64 / 70.0;
    let most = f64::from(1 << (15 - powers)) / (1.0 + 0.5 * (delay - delay * delay));
    assert!(small(0.999 * most).is_ok());
    let found = small(1.001 * most).unwrap_err();
    assert_eq!((found.key, found.bound), (Key::WideForcePerCode, Bound::Reach));
}

#[test]
fn a_wave_that_is_too_short_is_refused_with_its_width() {
    // A pulse has to be at least 2.5 samples wide. Its width goes with M/κ to the power 2/5.
    let stiffer = |width: f64| {
        let now = Bead::paper().pulse_width(1.0) * 1e5;
        paper().with(|one| one.contact.stiffness *= (now / width).powf(2.5))
    };
    assert!(stiffer(1.0004 * LEAST_WIDTH).is_ok());
    let Bound::Width { samples } = stiffer(0.9996 * LEAST_WIDTH).unwrap_err().bound else {
        panic!("too short a wave");
    };
    assert!((samples - 0.9996 * LEAST_WIDTH).abs() < 1e-6, "{samples}");
}

#[test]
fn a_coefficient_outside_its_format_blames_the_setting_that_it_follows_from() {
    let almost_all = 0.999_99 * Bead::paper().mass;
    for (key, value, expected) in [
        (Key::IntruderStiffness, 1e12, Coefficient::Stiffness),
        (Key::ContactRelaxation, 1e-12, Coefficient::Relaxation),
        (Key::CompanyStiffness, 1e12, Coefficient::CompanyStiffness),
        (Key::CompanyDamping, 1e9, Coefficient::CompanyDamping),
        (Key::CompanyMass, almost_all, Coefficient::CompanyRatio),
    ] {
        let (found, bound) = refused_number(key, value);
        let Bound::Format { coefficient, .. } = bound else {
            panic!("{bound:?}");
        };
        assert_eq!((found, coefficient), (key, expected));
    }
}

#[test]
fn a_limit_is_the_nearest_number_of_its_format_and_none_that_means_nothing() {
    for key in [
        Key::Disagreement,
        Key::RingFrequencyTolerance,
        Key::RingDecayTolerance,
    ] {
        for (value, bits) in [(0.001, 66), (0.015, 983), (0.3, 19_661), (1e4, 655_360_000)] {
            let settings = paper().with(|one| *number(one, key) = value).unwrap();
            let found = match key {
                Key::Disagreement => settings.disagreement,
                Key::RingDecayTolerance => settings.ringing.decay_tolerance,
                _ => settings.ringing.frequency_tolerance,
            };
            assert_eq!(found.to_bits(), bits, "{key:?} {value}");
        }
        for value in [0.0, -0.25, 9e-4, 2e4, f64::INFINITY, f64::NAN] {
            let (least, most) = (1e-3, 1e4);
            let found = refused_number(key, value);
            assert_eq!(found, (key, Bound::Range { least, most }), "{value}");
        }
    }
}

#[test]
fn those_behind_stand_in_their_bits_with_their_numbers() {
    let settings = Settings::new(&in_company()).unwrap();
    let company = settings.company;
    assert_eq!((company.behind, company.elsewhere), (0b101001, false));
    assert_eq!(company.stiffness, settings.chain.stiffness);
    assert_eq!(company.damping, settings.chain.damping);
    // Where none is behind, the numbers of its intruder do not matter.
    let mut alone = in_company();
    (alone.company.behind, alone.company.elsewhere) = (0, 1);
    let expected = Company {
        elsewhere: true,
        ..paper().company
    };
    assert_eq!(Settings::new(&alone).unwrap().company, expected);
}
