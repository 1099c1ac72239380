//! Settings blocks of other versions: a block of yesterday is migrated, and others are refused by their
//! number.
#![allow(clippy::unwrap_used, reason = "in a test, an unwrap is an assertion")]

use bead_model::company::Company;
use bead_model::scale::Scale;
use bead_model::{Settings, SettingsError};
use crc::{CRC_32_ISO_HDLC, Crc};

/// The block of version 3 that `tests/data/README.md` tells of.
const YESTERDAY: &[u8] = include_bytes!("../../../../tests/data/settings-v3.bin");
/// A block of version 4: the built-in settings of its last day.
const VERSION_4: &[u8] = include_bytes!("../../../../tests/data/settings-v4.bin");
/// The same of version 5.
const VERSION_5: &[u8] = include_bytes!("../../../../tests/data/settings-v5.bin");
/// What version 6 added, of a bead that is alone.
const ALONE: [u8; 17] = [0; 17];
/// Bytes of a block before its body: magic, version, length.
const HEADER: usize = 8;

/// The block of yesterday with another version and another body.
fn block(version: u16, body: &[u8]) -> Vec<u8> {
    let mut block = YESTERDAY[..4].to_vec();
    block.extend(version.to_le_bytes());
    block.extend((body.len() as u16).to_le_bytes());
    block.extend(body);
    block.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&block).to_le_bytes());
    block
}

/// The body of the block of yesterday.
fn body() -> &'static [u8] {
    &YESTERDAY[HEADER..YESTERDAY.len() - 4]
}

#[test]
fn settings_of_version_3_are_migrated_with_address_0() {
    assert_eq!(YESTERDAY, block(3, body()));
    let settings = Settings::decode(YESTERDAY).unwrap();
    assert_eq!(settings.address, 0);
    // What the paper's bead was given then, by `bead settings show` of that day.
    assert_eq!(settings.sample_rate_hz, 100_000);
    assert_eq!(
        (settings.bead.intruder_mass, settings.bead.stiffness),
        (3.7e-3, 3.95e5)
    );
    assert_eq!((settings.window.history, settings.window.length), (160, 672));
    assert_eq!((settings.window.threshold, settings.window.lookback), (26, 50));
    // The ringing stood last.
    assert_eq!(settings.ringing.frequency.to_bits(), 110_409_876);
    assert_eq!(settings.ringing.decay_tolerance.to_bits(), 19_661);
    // Every bit is kept: written anew, it is the old body, the address, no powers of two, no company.
    let mut buffer = [0; bead_model::settings::BLOCK_MAX];
    let length = settings.encode(&mut buffer).unwrap();
    assert_eq!(buffer[..length], block(6, &[body(), &[0; 7], &ALONE].concat()));
}

#[test]
fn settings_of_version_4_are_migrated_without_powers_of_two() {
    let settings = Settings::decode(VERSION_4).unwrap();
    assert_eq!(settings.scale, Scale::default());
    let mut buffer = [0; bead_model::settings::BLOCK_MAX];
    let length = settings.encode(&mut buffer).unwrap();
    let body = &VERSION_4[HEADER..VERSION_4.len() - 4];
    assert_eq!(VERSION_4, block(4, body));
    assert_eq!(buffer[..length], block(6, &[body, &[0; 6], &ALONE].concat()));
}

#[test]
fn settings_of_version_5_are_migrated_as_of_a_bead_that_is_alone() {
    let settings = Settings::decode(VERSION_5).unwrap();
    assert_eq!(settings.company, Company::default());
    assert!(settings.company.is_alone());
    let mut buffer = [0; bead_model::settings::BLOCK_MAX];
    let length = settings.encode(&mut buffer).unwrap();
    let body = &VERSION_5[HEADER..VERSION_5.len() - 4];
    assert_eq!(VERSION_5, block(5, body));
    assert_eq!(buffer[..length], block(6, &[body, &ALONE].concat()));
}

#[test]
fn settings_of_an_older_or_a_later_version_are_refused_by_their_number() {
    for version in [0, 1, 2, 7, 0xFFFF] {
        let error = Settings::decode(&block(version, body())).unwrap_err();
        assert_eq!(error, SettingsError::Version(version));
        assert_eq!(
            error.to_string(),
            format!("settings block of version {version}, this program knows 3 to 6")
        );
    }
}

#[test]
fn a_body_that_is_not_its_versions_is_refused() {
    let (longer, shorter) = ([body(), &[5]].concat(), &body()[..body().len() - 1]);
    assert_eq!(Settings::decode(&block(3, &longer)), Err(SettingsError::Body));
    assert_eq!(Settings::decode(&block(3, shorter)), Err(SettingsError::Body));
    // The body of version 4 has an address, and 255 is none.
    assert_eq!(Settings::decode(&block(4, body())), Err(SettingsError::Body));
    assert_eq!(Settings::decode(&block(4, &longer)).unwrap().address, 5);
    assert_eq!(
        Settings::decode(&block(4, &[body(), &[255]].concat())),
        Err(SettingsError::Invalid("address 255 is every bead's"))
    );
}

/// The settings of yesterday with one number of the bead changed.
fn with(change: impl FnOnce(&mut Settings)) -> Result<(), SettingsError> {
    let mut settings = Settings::decode(YESTERDAY).unwrap();
    change(&mut settings);
    settings.validate()
}

#[test]
fn a_bead_whose_physics_is_not_finite_and_positive_is_refused_whichever_number_it_is() {
    type Number = fn(&mut Settings) -> &mut f32;
    let numbers: [Number; 7] = [
        |s| &mut s.bead.mass,
        |s| &mut s.bead.intruder_mass,
        |s| &mut s.bead.front_mass,
        |s| &mut s.bead.stiffness,
        |s| &mut s.bead.damping,
        |s| &mut s.bead.contact_stiffness,
        |s| &mut s.bead.relaxation,
    ];
    for (n, number) in numbers.into_iter().enumerate() {
        for value in [
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            -1.0,
            0.0,
            1e38,
            f32::MAX,
        ] {
            let refused = with(|settings| *number(settings) = value);
            // The sensor of this bead has nothing in front of it.
            let allowed = n == 2 && value == 0.0;
            assert_eq!(refused.is_ok(), allowed, "number {n} = {value}");
        }
    }
    assert_eq!(with(|_| ()), Ok(()));
}

#[test]
fn a_name_that_no_terminal_should_see_is_refused_where_the_block_is() {
    let mut buffer = [0; bead_model::settings::BLOCK_MAX];
    for name in [&b"a\x1b]52;c;"[..], b"\xff\xfe", b"bell\x07", b"a\0b"] {
        // Postcard writes the sixteen bytes of the name first.
        let mut bytes = body().to_vec();
        bytes[..16].fill(0);
        bytes[..name.len()].copy_from_slice(name);
        let refused = Settings::decode(&block(3, &bytes)).unwrap_err();
        assert_eq!(
            refused,
            SettingsError::Invalid("name is not UTF-8, or has a control character"),
            "{name:?}"
        );
    }
    let named = bead_model::settings::Name::new("Kügelchen").unwrap();
    let settings = Settings {
        name: named,
        ..Settings::decode(YESTERDAY).unwrap()
    };
    let length = settings.encode(&mut buffer).unwrap();
    assert_eq!(Settings::decode(&buffer[..length]), Ok(settings));
}
