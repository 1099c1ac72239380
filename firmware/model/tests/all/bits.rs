//! Every bit of the results of windows that are made up: on any machine, and in any later version.
//!
//! A recording replays bit for bit. A version that changes a bit of an earlier result therefore says so
//! (CHANGELOG), and so does a replay of the earlier recording. The windows go where the arithmetic branches:
//! both gains, rails, noise, powers of two, intruders behind. Their codes are made by sums and products
//! alone, which are the same everywhere.

use bead_model::design::{Bead, Capture, Description, FrontEnd, Intruder, Neighbours};
use bead_model::{Meter, Scan, Settings};
use bead_testing::Collector;
use bead_wire::{Message, Packed, Waveform};
use crc::{CRC_32_ISO_HDLC, Crc};

/// Factors over the paper's bead: of the mass, the contact stiffness and, last, the damping of the intruder.
/// The third number is the mass of the intruder as a part of the bead's.
type Likeness = [f64; 4];
/// Force (N), width (scans), acceleration (m/s²) and gain of the wide channels, as [`strikes`] takes them.
type PulseForm = [f64; 4];

const PAPER: Likeness = [1.0, 1.0, 0.0726, 1.0];
const UNDAMPED: Likeness = [1.0, 1.0, 0.0726, 0.1];
const DAMPED: Likeness = [1.0, 1.0, 0.0726, 3.0];
const SMALL: Likeness = [0.003, 0.1, 0.3, 1.0];
const LIGHT: Likeness = [0.003, 0.1, 0.01, 1.0];
const HEAVY: Likeness = [0.5, 8.0, 0.5, 1.0];
const LARGE: Likeness = [40.0, 50.0, 0.4, 1.0];
const TINY: Likeness = [0.02, 0.1, 0.4, 1.0];
const FAINT: PulseForm = [0.3, 50.0, 2.0, 1.0];
const SOFT: PulseForm = [12.0, 60.0, 150.0, 1.0];
const NARROW: PulseForm = [30.0, 7.0, 300.0, 1.0];
const MIDDLE: PulseForm = [30.0, 50.0, 300.0, 1.0];
const SHORT: PulseForm = [10.0, 30.0, 800.0, 1.0];
const HARD: PulseForm = [30.0, 30.0, 800.0, 1.0];
const FIRM: PulseForm = [80.0, 45.0, 900.0, 1.0];
const LONG: PulseForm = [150.0, 90.0, 900.0, 1.0];
const LOUD: PulseForm = [120.0, 45.0, 1500.0, 1.0];
const AMPLIFIED: PulseForm = [100.0, 45.0, 1500.0, 1.05];
const RAILED: PulseForm = [300.0, 40.0, 6000.0, 1.0];
const VIOLENT: PulseForm = [200.0, 60.0, 5000.0, 1.0];

/// Settings of a bead with intruders behind it where a bit of `behind` is 1.
fn settings([mass, stiff, part, damped]: Likeness, behind: u8) -> Settings {
    let paper = Bead::paper();
    let mut bead = Bead {
        mass: mass * paper.mass,
        contact_stiffness: stiff * paper.contact_stiffness,
        ..paper
    };
    // The intruder rings and decays in as many widths of the wave as the paper's.
    let time = bead.pulse_width(1.0) / paper.pulse_width(1.0);
    bead.intruder_mass = part * bead.mass;
    bead.stiffness *= bead.intruder_mass / paper.intruder_mass / (time * time);
    bead.damping *= damped * bead.intruder_mass / paper.intruder_mass / time;
    let intruder = Intruder {
        mass: 1.1 * bead.intruder_mass,
        stiffness: 0.9 * bead.stiffness,
        damping: 1.2 * bead.damping,
    };
    let neighbours = Neighbours::new(core::array::from_fn(|n| behind >> n & 1 == 1), false, intruder);
    let front_end = FrontEnd::reference();
    let capture = Capture::of(&bead, &front_end);
    Settings::new(&Description::new(&bead, &neighbours.into(), &front_end, &capture)).unwrap()
}

/// Scans of two strikes: a pulse of the force from the scans 400 and 1900 on, `width` scans wide at its foot
/// and `force` N high, and an acceleration of `ringing` m/s² that rings and decays. The gain of the wide
/// channels is `more` times what the settings say, and the noise is up to `noise` codes.
fn strikes([force, width, ringing, more]: PulseForm, noise: u64, samples: usize) -> Vec<Scan> {
    let mut state = 1_u64;
    let mut drawn = |most: u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % (2 * most + 1)) as f64 - most as f64
    };
    // A resonator of 1.7 kHz at 100 kHz that loses 1.7 % of its amplitude a sample, driven by the pulse.
    let [mut last, mut before] = [0.0; 2];
    (0..samples)
        .map(|n| {
            let x = ((n % 1500) as f64 - 400.0) / width;
            let inside = n < 3000 && (0.0..1.0).contains(&x);
            let pulse = if inside {
                16.0 * (x * (1.0 - x)) * (x * (1.0 - x))
            } else {
                0.0
            };
            let now = 1.954_9 * last - 0.966_6 * before + 0.05 * pulse;
            (last, before) = (now, last);
            let (newtons, acceleration) = (force * pulse, ringing * now);
            let mut code = |value: f64, most: u64| (value + drawn(most)).round().clamp(0.0, 4095.0) as u16;
            Scan::new([
                code(128.3 + newtons * 256.0, noise),
                code(128.4 + newtons * 16.0 * more, noise / 4),
                code(2047.8 + acceleration * 8.192, noise),
                code(2048.3 + acceleration * 0.512 * more, noise / 4),
            ])
        })
        .collect()
}

/// Checksum over the bodies of all frames of the strikes in these scans, which come in calls of `call`.
fn metered(settings: &Settings, scans: &[Scan], call: usize) -> u32 {
    let (mut meter, mut heard) = (Meter::new(), Collector::default());
    for (n, some) in scans.chunks(call).enumerate() {
        meter.process(settings, (n * call) as u64, some.iter().copied(), &mut heard);
    }
    assert_eq!(heard.reports.len(), 2, "both strikes are measured");
    let pieces = heard.chunks.iter().map(|chunk| Waveform::from(chunk).into());
    let results = heard.reports.into_iter().map(Message::from);
    let shapes = heard.shapes.into_iter().map(Message::from);
    let (crc, mut packed) = (Crc::<u32>::new(&CRC_32_ISO_HDLC), Packed::new());
    let mut digest = crc.digest();
    for message in pieces.chain(results).chain(shapes) {
        packed.pack(0, 0, &message).unwrap();
        digest.update(packed.content().1);
    }
    digest.finalize()
}

#[test]
fn a_strike_has_the_same_bits_whenever_wherever_and_in_whatever_calls_it_is_measured() {
    // The bead and the intruders behind it, the pulse, codes of noise, the checksum.
    type Case = (&'static str, Likeness, u8, PulseForm, u64, u32);
    let cases: [Case; 20] = [
        ("within the sensitive range", PAPER, 0, SOFT, 1, 0x33a4_8672),
        ("no noise", PAPER, 0, SOFT, 0, 0x66b6_bb68),
        ("much noise", PAPER, 0, SOFT, 9, 0xcac2_1052),
        ("faint", PAPER, 0, FAINT, 2, 0x5c20_3f8d),
        ("wide channels", PAPER, 0, LOUD, 3, 0x8b1b_1394),
        ("wide, no noise", PAPER, 0, LOUD, 0, 0x2a1a_c071),
        ("of another gain", PAPER, 0, AMPLIFIED, 4, 0x02e0_e271),
        ("at the rails", PAPER, 0, RAILED, 4, 0xfe8d_6618),
        ("narrow", PAPER, 0, NARROW, 4, 0x0796_a102),
        ("little damping", UNDAMPED, 0, MIDDLE, 4, 0x87c3_aaca),
        ("much damping", DAMPED, 0, MIDDLE, 4, 0xd4fc_14ae),
        ("small", SMALL, 0, SHORT, 4, 0x4db4_7a07),
        ("light intruder", LIGHT, 0, SHORT, 4, 0xfb1e_fece),
        ("heavy intruder", HEAVY, 0, HARD, 4, 0x5dc7_03f2),
        ("large", LARGE, 0, LONG, 4, 0x191c_c3c2),
        ("one behind", PAPER, 1, FIRM, 4, 0x3f8c_7367),
        ("two behind", PAPER, 0b1010, FIRM, 4, 0x3555_8f96),
        ("behind a small one", SMALL, 0b1111, SHORT, 4, 0xd65f_b798),
        ("heavy behind", HEAVY, 0b0101, HARD, 4, 0xb1b3_c658),
        ("out of range", TINY, 0b0100, VIOLENT, 4, 0x29bf_6525),
    ];
    let (mut measured, mut stated) = (Vec::new(), Vec::new());
    for (n, (what, bead, behind, shape, noise, checksum)) in cases.into_iter().enumerate() {
        // Miri takes half a minute for each, so it runs only one, with powers of two and intruders behind.
        if cfg!(miri) && n != 17 {
            continue;
        }
        let (settings, scans) = (settings(bead, behind), strikes(shape, noise, 4400));
        let calls = if cfg!(miri) {
            &[200][..]
        } else {
            &[1, 33, 200, 4400]
        };
        for &call in calls {
            let found = metered(&settings, &scans, call);
            measured.push(format!("{what}, {:?}, {call}: {found:#010x}", settings.scale));
            stated.push(format!("{what}, {:?}, {call}: {checksum:#010x}", settings.scale));
        }
    }
    assert_eq!(measured, stated);
}
