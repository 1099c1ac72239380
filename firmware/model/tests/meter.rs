//! The meter on made-up streams: what triggers, what does not, and that nothing makes it fall over.
#![allow(clippy::unwrap_used, reason = "in a test, an unwrap is an assertion")]

use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::{AdcCode, Chunk, Meter, Scan, Settings, Shape, Sink, StrikeReport, Window};
use fixed::types::{I2F30, I4F28, I8F24, I16F16};
use proptest::prelude::*;

#[derive(Default)]
struct Heard {
    samples: usize,
    reports: Vec<StrikeReport>,
    shapes: Vec<Shape>,
}

impl Sink for Heard {
    fn chunk(&mut self, chunk: &Chunk) {
        self.samples += chunk.scans.len();
    }
    fn report(&mut self, report: &StrikeReport) {
        self.reports.push(*report);
    }
    fn shape(&mut self, report: &StrikeReport, shape: &Shape) {
        assert_eq!(self.reports.last(), Some(report));
        self.shapes.push(*shape);
    }
}

fn settings() -> Settings {
    derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap()
}

fn scan(force: u16) -> Scan {
    Scan {
        force: AdcCode::new(force),
        acceleration: AdcCode::new(2048),
    }
}

/// Feeds force codes from sample 0.
fn hear(forces: impl IntoIterator<Item = u16>) -> (Meter, Heard) {
    let (settings, mut meter, mut heard) = (settings(), Meter::new(), Heard::default());
    for (index, force) in forces.into_iter().enumerate() {
        meter.process(&settings, index as u64, scan(force), &mut heard);
    }
    (meter, heard)
}

/// A pulse of 50 samples on a zero of 128.
fn pulse(sample: usize) -> u16 {
    128 + (1500.0 * (std::f64::consts::PI * sample as f64 / 50.0).sin().powi(3)) as u16
}

#[test]
fn quiet_never_triggers_whatever_its_level() {
    for level in [0, 128, 4095] {
        let (meter, heard) = hear(std::iter::repeat_n(level, 5000));
        assert!(heard.reports.is_empty() && meter.is_armed());
    }
}

#[test]
fn a_slow_drift_over_the_whole_range_does_not_trigger() {
    let (meter, heard) = hear((0..400_000).map(|i| (i / 100) as u16));
    assert!(heard.reports.is_empty() && meter.is_armed());
}

#[test]
fn two_pulses_give_two_reports_and_one_inside_a_window_gives_none_of_its_own() {
    let stream = |second: usize| {
        (0..4000).map(move |i| match i {
            1000..1050 => pulse(i - 1000),
            i if (second..second + 50).contains(&i) => pulse(i - second),
            _ => 128,
        })
    };
    let (_, heard) = hear(stream(2500));
    assert_eq!(heard.reports.iter().map(|r| r.strike).collect::<Vec<_>>(), [0, 1]);
    let (_, heard) = hear(stream(1300));
    assert_eq!(heard.reports.len(), 1);
}

#[test]
fn the_history_starts_before_the_trigger_by_the_length_set() {
    let (_, heard) = hear((0..3000).map(|i| {
        if (1000..1050).contains(&i) {
            pulse(i - 1000)
        } else {
            128
        }
    }));
    let report = heard.reports[0];
    assert!(
        (1000..1020).contains(&report.trigger_index),
        "{}",
        report.trigger_index
    );
    assert_eq!(report.trigger_index - report.first_index + 1, 128);
    assert_eq!(heard.samples, usize::from(report.samples));
    assert!(
        (1024..=1026).contains(&report.peak_index),
        "{}",
        report.peak_index
    );
}

#[test]
fn a_strike_straight_after_a_restart_is_left_out_rather_than_measured_without_its_zero() {
    let (settings, mut meter, mut heard) = (settings(), Meter::new(), Heard::default());
    let stream = |i: usize| {
        if (1000..1050).contains(&i) {
            pulse(i - 1000)
        } else {
            128
        }
    };
    for i in 0..3000 {
        if i == 950 {
            meter.restart();
        }
        meter.process(&settings, i as u64, scan(stream(i)), &mut heard);
    }
    assert!(heard.reports.is_empty());
    assert!(meter.is_armed());
}

proptest! {
    #[test]
    fn any_codes_whatever_are_survived(codes in prop::collection::vec((0u16..4096, 0u16..4096), 2000)) {
        let (settings, mut meter, mut heard) = (settings(), Meter::new(), Heard::default());
        // A step first, so that the noise is measured and not waited out.
        let quiet = (0..300).map(|_| (128, 2048)).chain([(1000, 2048)]);
        for (index, (force, acceleration)) in quiet.chain(codes).enumerate() {
            let scan = Scan { force: AdcCode::new(force), acceleration: AdcCode::new(acceleration) };
            meter.process(&settings, index as u64, scan, &mut heard);
        }
        prop_assert!(!heard.reports.is_empty());
    }

    #[test]
    fn any_settings_that_validate_are_survived_with_any_codes(
        bits in prop::collection::vec(prop_oneof![any::<i32>(), Just(i32::MAX), Just(i32::MIN)], 20),
        codes in prop::collection::vec((0u16..4096, 0u16..4096), 600),
    ) {
        let mut bits = bits.into_iter();
        let mut next = || bits.next().unwrap();
        let mut settings = settings();
        for channel in [&mut settings.force, &mut settings.acceleration] {
            channel.per_code = I4F28::from_bits(next());
            channel.pole = I2F30::from_bits(next() & 0x3fff_ffff);
        }
        let observer = &mut settings.observer;
        observer.decay = I2F30::from_bits(next());
        observer.start = I2F30::from_bits(next() >> 1);
        observer.end = I2F30::from_bits(next() >> 1);
        observer.velocity_per_displacement = I8F24::from_bits(next());
        observer.velocity_per_acceleration = I2F30::from_bits(next());
        observer.energy = I16F16::from_bits(next());
        let chain = &mut settings.chain;
        chain.contact = I2F30::from_bits((next() & 0x7fff_ffff) / 64);
        for coefficient in [
            &mut chain.relaxation,
            &mut chain.incoming,
            &mut chain.host,
            &mut chain.stiffness,
            &mut chain.damping,
            &mut chain.intruder,
        ] {
            *coefficient = I2F30::from_bits(next() & 0x7fff_ffff);
        }
        chain.energy = I16F16::from_bits(next());
        prop_assert_eq!(settings.validate(), Ok(()));

        // Products that leave their format panic in a build with debug assertions, sums in one with overflow checks.
        let mut window = Window::open(0, 0);
        for (force, acceleration) in codes {
            window.process(&settings, Scan { force: AdcCode::new(force), acceleration: AdcCode::new(acceleration) });
        }
        window.report(&settings);
    }

    #[test]
    fn any_bytes_whatever_are_no_settings_or_valid_ones(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(settings) = Settings::decode(&bytes) {
            prop_assert!(settings.validate().is_ok());
        }
    }
}
