//! The meter on made-up streams: what triggers, what does not, and that no input makes it panic.
#![allow(clippy::unwrap_used, reason = "in a test, an unwrap is an assertion")]

use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::{Meter, Scan, Settings, StrikeFlags, Window, WindowRecord};
use bead_testing::Collector;
use fixed::types::{I0F32, I2F30, I6F26, I16F16};
use proptest::prelude::*;
use std::sync::atomic::AtomicU32;

fn settings() -> Settings {
    derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap()
}

fn scan(force: u16) -> Scan {
    codes_of((force, 2048))
}

/// The wide codes follow from the sensitive ones by the gains of the reference.
fn codes_of((force, acceleration): (u16, u16)) -> Scan {
    let wide = |code: u16, zero: i32| (zero + (i32::from(code) - zero) / 16) as u16;
    Scan::new([force, wide(force, 128), acceleration, wide(acceleration, 2048)])
}

/// Feeds force codes from sample 0.
fn hear(forces: impl IntoIterator<Item = u16>) -> (Meter, Collector) {
    let (settings, mut meter, mut heard) = (settings(), Meter::new(), Collector::default());
    let scans: Vec<Scan> = forces.into_iter().map(scan).collect();
    meter.process(&settings, 0, scans, &mut heard);
    (meter, heard)
}

/// A pulse of 50 samples on a zero of 128.
fn pulse(sample: usize) -> u16 {
    128 + (1500.0 * (std::f64::consts::PI * sample as f64 / 50.0).sin().powi(3)) as u16
}

#[test]
#[cfg_attr(miri, ignore = "thousands of scans")]
fn quiet_never_triggers_whatever_its_level() {
    for level in [0, 128, 4095] {
        let (meter, heard) = hear(std::iter::repeat_n(level, 5000));
        assert!(heard.reports.is_empty() && meter.is_armed());
    }
}

#[test]
#[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
fn a_slow_drift_over_the_whole_range_does_not_trigger() {
    let (meter, heard) = hear((0..400_000).map(|i| (i / 100) as u16));
    assert!(heard.reports.is_empty() && meter.is_armed());
}

#[test]
fn a_meter_is_armed_after_a_history_of_scans_in_which_the_force_does_not_rise() {
    let settings = settings();
    let history = usize::from(settings.window.history);
    // The number of scans after which it is armed.
    let armed = |force: &dyn Fn(usize) -> u16, restart_at: usize| {
        let (mut meter, mut heard) = (Meter::new(), Collector::default());
        (0..1000).position(|index| {
            if index == restart_at {
                meter.restart();
            }
            meter.process(&settings, index as u64, [scan(force(index))], &mut heard);
            meter.is_armed()
        })
    };
    let never = usize::MAX;
    // Whatever the level: the first scans are compared with none before them.
    for level in [0, 128, 4095] {
        assert_eq!(armed(&|_| level, never), Some(history - 1), "{level}");
    }
    assert_eq!(armed(&|_| 128, 100), Some(100 + history - 1));
    // The history begins anew after a rise, but not with a fall, nor with a rise across a restart.
    let step = |at: usize, from: u16, to: u16| move |index: usize| if index < at { from } else { to };
    for at in [60, 100, history - 1] {
        assert_eq!(armed(&step(at, 128, 1128), never), Some(at + history), "{at}");
        assert_eq!(armed(&step(at, 1128, 128), never), Some(history - 1), "{at}");
        assert_eq!(armed(&step(at, 128, 1128), at), Some(at + history - 1), "{at}");
    }
}

#[test]
fn a_meter_that_passes_over_is_armed_again_after_a_history_from_the_scan_after_the_trigger() {
    let settings = settings();
    let history = usize::from(settings.window.history);
    for at in [500, 555] {
        let (mut meter, mut heard) = (Meter::new(), Collector::default());
        meter.pass_over(true);
        let mut feed = |indices: std::ops::Range<usize>| {
            let first = indices.start as u64;
            let scans: Vec<Scan> = indices
                .map(|index| scan(if index < at { 128 } else { 1128 }))
                .collect();
            meter.process(&settings, first, scans, &mut heard);
            (meter.is_armed(), meter.strikes(), meter.passed_over())
        };
        assert_eq!(feed(0..at), (true, 0, 0));
        assert_eq!(feed(at..at + 30), (false, 1, 1));
        assert_eq!(feed(at + 30..at + history), (false, 1, 1));
        assert_eq!(feed(at + history..at + history + 1), (true, 1, 1));
        assert!(heard.reports.is_empty());
    }
}

#[test]
fn words_of_a_dma_hold_the_high_gain_in_their_lower_half() {
    use bead_model::scans;
    let words =
        [[0x0123_0456, 0x0789_0ABC], [0x0FFF_0000, 0x0000_0FFF]].map(|words| words.map(AtomicU32::new));
    let codes: Vec<[u16; 4]> = scans(&words).map(Scan::codes).collect();
    assert_eq!(codes, [[0x456, 0x123, 0xABC, 0x789], [0, 0xFFF, 0xFFF, 0]]);
    assert_eq!(scans(&words).len(), 2);
}

#[test]
#[cfg_attr(miri, ignore = "thousands of scans")]
fn words_of_a_dma_are_measured_as_the_scans_that_they_hold() {
    let forces: Vec<u16> = (0..1500)
        .map(|i| {
            if (500..550).contains(&i) {
                pulse(i - 500)
            } else {
                128
            }
        })
        .collect();
    let word = |[low, high]: [u16; 2]| AtomicU32::new(u32::from(low) | u32::from(high) << 16);
    let words: Vec<[AtomicU32; 2]> = forces
        .iter()
        .map(|&force| {
            let [force, force_wide, acceleration, acceleration_wide] = scan(force).codes();
            [word([force, force_wide]), word([acceleration, acceleration_wide])]
        })
        .collect();
    let (mut meter, mut heard) = (Meter::new(), Collector::default());
    meter.process_words(&settings(), 0, &words, &mut heard);
    assert_eq!(heard.reports.len(), 1);
    let again = hear(forces).1;
    assert_eq!((&heard.reports, &heard.shapes), (&again.reports, &again.shapes));
}

#[test]
#[cfg_attr(miri, ignore = "thousands of scans")]
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
#[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
fn strike_upon_strike_in_one_call_is_the_same_as_in_many() {
    let settings = settings();
    let stream: Vec<Scan> = (0..60_000)
        .map(|i| scan(if i % 900 < 50 { pulse(i % 900) } else { 128 }))
        .collect();
    let hear = |piece: usize| {
        let (mut meter, mut heard, mut index) = (Meter::new(), Collector::default(), 0);
        for scans in stream.chunks(piece) {
            meter.process(&settings, index, scans.iter().copied(), &mut heard);
            index += scans.len() as u64;
        }
        // The last strike is complete in either case.
        meter.process(&settings, index, [scan(128); 3000], &mut heard);
        (heard.reports.clone(), heard.shapes.clone(), heard.samples())
    };
    let whole = hear(stream.len());
    assert!(whole.0.len() > 60, "{}", whole.0.len());
    for piece in [1, 50, 200, 1000, 7000] {
        assert_eq!(hear(piece), whole, "{piece}");
    }
}

/// Whatever triggers, in windows of whatever length: a meter that is to pass over comes to rest within the
/// longest window and its lag, 16 ms, and stays there.
#[test]
#[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
fn a_meter_that_passes_over_ends_its_strike_measures_no_other_and_counts_them() {
    for (length, every) in [(129, 130), (672, 900), (1024, 1000), (1024, 1160), (1024, 1200)] {
        let mut settings = settings();
        settings.window.length = length;
        settings.window.history = 128;
        let (mut meter, mut heard) = (Meter::new(), Collector::default());
        let stream = |at: usize| if at % every < 50 { pulse(at % every) } else { 128 };
        let (mut rested, mut at_rest) = (None, 0);
        for block in 0..400 {
            meter.pass_over(block >= 200);
            let scans: Vec<Scan> = (200 * block..200 * (block + 1))
                .map(|at| scan(stream(at)))
                .collect();
            meter.process(&settings, 200 * block as u64, scans, &mut heard);
            if block >= 200 && !meter.is_measuring() && rested.is_none() {
                (rested, at_rest) = (Some(block - 200), heard.reports.len());
            }
        }
        let rested = rested.unwrap_or_else(|| panic!("{length} every {every}: never at rest"));
        assert!(rested <= 8, "{length} every {every}: {rested} blocks");
        assert_eq!(heard.reports.len(), at_rest, "no strike is measured after it");
        assert!(meter.passed_over() > 10);
        assert_eq!(meter.strikes() as usize, at_rest + meter.passed_over() as usize);
        // And goes on from there.
        meter.pass_over(false);
        let scans: Vec<Scan> = (80_000..84_000).map(|at| scan(stream(at))).collect();
        meter.process(&settings, 80_000, scans, &mut heard);
        assert!(heard.reports.len() > at_rest);
        assert_eq!(
            heard.reports[at_rest].strike as usize,
            at_rest + meter.passed_over() as usize
        );
    }
}

#[test]
#[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
fn no_call_measures_more_than_its_share_whatever_the_window_and_wherever_in_a_call_it_begins() {
    const CALL: usize = 200;
    for (history, length) in [(160, 672), (256, 1024), (128, 1024), (256, 257)] {
        let mut settings = settings();
        (settings.window.history, settings.window.length) = (history, length);
        for phase in 0..CALL {
            let at = 1000 + phase;
            let stream = (0..6000).map(|i| {
                scan(if (at..at + 50).contains(&i) {
                    pulse(i - at)
                } else {
                    128
                })
            });
            let stream: Vec<Scan> = stream.collect();
            let (mut meter, mut heard, mut measured) = (Meter::new(), Collector::default(), 0);
            for (call, scans) in stream.chunks(CALL).enumerate() {
                meter.process(&settings, (call * CALL) as u64, scans.iter().copied(), &mut heard);
                // What was measured is told in chunks of 32 scans.
                let share = CALL * 5 / 8 + 31;
                assert!(
                    heard.samples() - measured <= share,
                    "{} scans in call {call}, history {history}, length {length}, phase {phase}",
                    heard.samples() - measured
                );
                measured = heard.samples();
            }
            assert_eq!((heard.reports.len(), measured), (1, usize::from(length)));
        }
    }
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
    assert_eq!(report.trigger_index - report.first_index + 1, 160);
    assert_eq!(heard.samples(), usize::from(report.samples));
    assert!(
        (1024..=1026).contains(&report.peak_index),
        "{}",
        report.peak_index
    );
}

#[test]
fn a_strike_straight_after_a_restart_is_left_out_rather_than_measured_without_its_zero() {
    let (settings, mut meter, mut heard) = (settings(), Meter::new(), Collector::default());
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
        meter.process(&settings, i as u64, [scan(stream(i))], &mut heard);
    }
    assert!(heard.reports.is_empty());
    assert!(meter.is_armed());
}

#[test]
fn a_pulse_that_drives_the_reduced_chain_out_of_its_range_is_flagged() {
    let flags = |newtons_per_code: f64| {
        let mut front_end = FrontEnd::reference();
        front_end.force.per_code = newtons_per_code;
        front_end.force.wide_per_code = newtons_per_code;
        let capture = Capture {
            threshold: 30.0,
            ..Capture::default()
        };
        let settings = derive(&Bead::paper(), &front_end, &capture).unwrap();
        let (mut meter, mut heard) = (Meter::new(), Collector::default());
        let quiet = std::iter::repeat_n(128, 1000);
        let scans: Vec<Scan> = quiet
            .chain((0..50).map(pulse))
            .chain(std::iter::repeat_n(128, 1000))
            .map(|force| Scan::new([force, force, 2048, 2048]))
            .collect();
        meter.process(&settings, 0, scans, &mut heard);
        heard.reports[0].flags
    };
    // Peaks of 300 N and of 2.8 kN give overlaps of 80 and 390 µm; half the format is 256 µm. The
    // acceleration is zero.
    assert_eq!(flags(0.2), StrikeFlags::ESTIMATES_DIFFER);
    assert_eq!(flags(1.9), StrikeFlags::CHAIN_RANGE);
}

/// Scans of a stream that is drawn; under Miri, which is slow, little more than a window.
const MANY: usize = if cfg!(miri) { 950 } else { 2000 };

proptest! {
    #[test]
    fn any_codes_whatever_are_survived(codes in prop::collection::vec([0u16..4096, 0u16..4096, 0u16..4096, 0u16..4096], MANY)) {
        let (settings, mut meter, mut heard) = (settings(), Meter::new(), Collector::default());
        // A step first, so that the meter measures the noise and does not wait for its end.
        let quiet = (0..300).map(|_| (128, 2048)).chain([(1000, 2048)]).map(codes_of);
        let stream: Vec<Scan> = quiet.chain(codes.into_iter().map(Scan::new)).collect();
        meter.process(&settings, 0, stream.iter().copied(), &mut heard);
        prop_assert!(!heard.reports.is_empty());
    }

    #[test]
    fn any_coefficients_are_survived_with_any_codes(
        bits in prop::collection::vec(prop_oneof![any::<i32>(), Just(i32::MAX), Just(i32::MIN)], 21),
        codes in prop::collection::vec([0u16..4096, 0u16..4096, 0u16..4096, 0u16..4096], 600),
    ) {
        let mut bits = bits.into_iter();
        // Any value from the upper part of the range of a coefficient.
        let mut next = |most: i32| bits.next().unwrap().rem_euclid(most) + 1;
        let mut settings = settings();
        // 65 km/s² over 4095 codes, a third for each of the three sums. The format holds all forces.
        for channel in [&mut settings.force.sensitive, &mut settings.force.wide] {
            let most = next(i32::MAX - 1) + 1;
            channel.per_code = I2F30::from_bits(most);
            channel.slope = I2F30::from_bits(next(most - 1));
        }
        for channel in [&mut settings.acceleration.sensitive, &mut settings.acceleration.wide] {
            let most = next(1 << 28) + 1;
            channel.per_code = I6F26::from_bits(most);
            channel.slope = I6F26::from_bits(next(most - 1));
        }
        settings.observer.start = I0F32::from_bits(next(i32::MAX));
        settings.observer.end = I0F32::from_bits(next(i32::MAX));
        settings.observer.energy = I2F30::from_bits(next(i32::MAX));
        let chain = &mut settings.chain;
        for coefficient in [
            &mut chain.contact,
            &mut chain.incoming,
            &mut chain.stiffness,
            &mut chain.damping,
            &mut chain.intruder,
            &mut chain.host,
        ] {
            *coefficient = I0F32::from_bits(next(i32::MAX));
        }
        chain.relaxation = I2F30::from_bits(next(i32::MAX));
        chain.energy = I16F16::from_bits(next(i32::MAX));
        for channel in [settings.force.sensitive, settings.force.wide] {
            prop_assert!(channel.is_bounded());
        }
        for channel in [settings.acceleration.sensitive, settings.acceleration.wide] {
            prop_assert!(channel.is_bounded());
        }

        // In a build with overflow checks a sum that leaves its format panics.
        let (mut window, mut record) = (Window::open(0, 0), Box::<WindowRecord>::default());
        record.clear();
        let scans: Vec<Scan> = codes.into_iter().map(Scan::new).collect();
        window.process(&settings, &scans, &mut record);
        window.report(&settings, &record);
    }

    #[test]
    #[cfg_attr(miri, ignore = "thousands of scans")]
    fn how_the_stream_is_cut_into_calls_changes_nothing(
        cuts in prop::collection::vec(1usize..400, 1..40),
        noise in prop::collection::vec(0u16..8, 2 * MANY),
    ) {
        let settings = settings();
        let stream: Vec<Scan> = (0..)
            .zip(noise)
            .map(|(i, noise)| {
                let force = if (1000..1050).contains(&i) { pulse(i - 1000) } else { 128 };
                codes_of((force + noise, 1920 + force + 7 * noise))
            })
            .collect();
        let (mut whole, mut heard) = (Meter::new(), Collector::default());
        whole.process(&settings, 0, stream.iter().copied(), &mut heard);
        let (mut meter, mut in_pieces, mut start) = (Meter::new(), Collector::default(), 0);
        for cut in cuts.into_iter().cycle() {
            let end = (start + cut).min(stream.len());
            meter.process(&settings, start as u64, stream[start..end].iter().copied(), &mut in_pieces);
            start = end;
            if start == stream.len() {
                break;
            }
        }
        prop_assert_eq!(heard.reports.len(), 1);
        prop_assert_eq!((&heard.reports, &heard.shapes), (&in_pieces.reports, &in_pieces.shapes));
        prop_assert_eq!(heard.samples(), in_pieces.samples());
    }

    #[test]
    fn any_bytes_whatever_are_no_settings_or_valid_ones(bytes in prop::collection::vec(any::<u8>(), 0..256)) {
        if let Ok(settings) = Settings::decode(&bytes) {
            prop_assert_eq!(Settings::new(settings.description()), Ok(settings));
        }
    }
}
