//! The meter on made-up streams: what triggers, what does not, and that no coefficient makes it panic.

use crate::{paper, pulse, replayed};
use bead_model::{Meter, Scan, scans};
use bead_testing::Collector;
use fixed::types::{I0F32, I2F30, I6F26, I16F16};
use proptest::prelude::*;
use std::sync::atomic::AtomicU32;

/// The wide code follows from the sensitive one by the gains of the reference.
fn scan(force: u16) -> Scan {
    let wide = 128 + (i32::from(force) - 128) / 16;
    Scan::new([force, wide as u16, 2048, 2048])
}

/// Force codes of a stream with pulses of 50 samples that start at these, over a zero of 128.
fn pulses(starts: &[usize]) -> impl Fn(usize) -> u16 {
    move |at| {
        let since = starts.iter().filter_map(|start| at.checked_sub(*start)).min();
        128 + since.map_or(0, |since| pulse(since, 1500.0))
    }
}

#[test]
#[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
fn only_a_rise_in_a_short_time_triggers_and_a_pulse_in_a_window_has_none_of_its_own() {
    type Stream<'a> = &'a dyn Fn(usize) -> u16;
    let cases: [(Stream<'_>, usize, &[u64]); 7] = [
        (&|_| 0, 5000, &[]),
        (&|_| 4095, 5000, &[]),
        // A drift over the whole range.
        (&|at| (at / 100) as u16, 400_000, &[]),
        (&pulses(&[1000]), 3000, &[1000]),
        (&pulses(&[1000, 2500]), 4000, &[1000, 2500]),
        (&pulses(&[1000, 1200]), 4000, &[1000]),
        (&pulses(&[1000, 1300]), 4000, &[1000, 1300]),
    ];
    for (force, length, starts) in cases {
        let (mut meter, mut heard) = (Meter::new(), Collector::default());
        let scans: Vec<Scan> = (0..length).map(|at| scan(force(at))).collect();
        meter.process(&paper(), 0, scans, &mut heard);
        assert!(meter.is_armed());
        assert_eq!(heard.reports.len(), starts.len(), "{starts:?}");
        for ((number, report), start) in (0..).zip(&heard.reports).zip(starts) {
            assert_eq!(report.strike, number);
            assert!((*start..start + 20).contains(&report.trigger_index), "{report:?}");
            assert_eq!(report.trigger_index - report.first_index + 1, 160);
            assert!(report.peak_index.abs_diff(start + 25) <= 1, "{report:?}");
        }
    }
}

#[test]
fn a_meter_is_armed_after_a_history_of_scans_in_which_the_force_does_not_rise() {
    let settings = paper();
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
    // The level does not matter: the first scans are compared with none before them.
    for level in [0, 128, 4095] {
        assert_eq!(armed(&|_| level, never), Some(history - 1), "{level}");
    }
    assert_eq!(armed(&|_| 128, 100), Some(100 + history - 1));
    // After a rise, which lasts for the lookback here, it takes the lookback more. A fall does not matter,
    // nor does a rise across a restart.
    let step = |at: usize, from: u16, to: u16| move |index: usize| if index < at { from } else { to };
    for at in [60, 100, history - 1] {
        let rearmed = at + 2 * usize::from(settings.window.lookback) + history - 1;
        assert_eq!(armed(&step(at, 128, 1128), never), Some(rearmed), "{at}");
        assert_eq!(armed(&step(at, 1128, 128), never), Some(history - 1), "{at}");
        assert_eq!(armed(&step(at, 128, 1128), at), Some(at + history - 1), "{at}");
    }
}

#[test]
fn a_meter_that_passes_over_is_armed_again_after_a_history_and_the_lookback_from_the_end_of_the_rise() {
    let settings = paper();
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
        let armed = at + 2 * usize::from(settings.window.lookback) + history;
        assert_eq!(feed(at + 30..armed - 1), (false, 1, 1));
        assert_eq!(feed(armed - 1..armed), (true, 1, 1));
        assert!(heard.reports.is_empty());
    }
}

#[test]
fn words_of_a_dma_hold_the_high_gain_in_their_lower_half_and_are_measured_as_scans() {
    let settings = paper();
    let force = pulses(&[500]);
    let expected: Vec<Scan> = (0..1500).map(|at| scan(force(at))).collect();
    let word = |low: u16, high: u16| AtomicU32::new(u32::from(low) | u32::from(high) << 16);
    let words: Vec<[AtomicU32; 2]> = expected
        .iter()
        .map(|scan| {
            let [force, force_wide, acceleration, acceleration_wide] = scan.codes();
            [word(force, force_wide), word(acceleration, acceleration_wide)]
        })
        .collect();
    assert_eq!(scans(&words).collect::<Vec<_>>(), expected);
    assert_eq!(scans(&words).len(), words.len());
    let (mut meter, mut heard) = (Meter::new(), Collector::default());
    meter.process_words(&settings, 0, &words, &mut heard);
    assert_eq!(heard.reports.len(), 1);
    assert_eq!(heard, Collector::measure(&settings, 0, &expected));
}

/// Whatever triggers, and however long the windows: a meter that is to pass over strikes comes to rest within
/// the longest window, its lag and the next window, 20 ms, and stays there.
#[test]
#[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
fn a_meter_that_passes_over_ends_its_strike_measures_no_other_and_counts_them() {
    for (length, every) in [(129, 300), (672, 900), (1024, 1100), (1024, 1160), (1024, 1200)] {
        let mut settings = paper();
        settings.window.length = length;
        settings.window.history = 128;
        let (mut meter, mut heard) = (Meter::new(), Collector::default());
        let stream = |at: usize| pulses(&[0])(at % every);
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
        assert!(rested <= 10, "{length} every {every}: {rested} blocks");
        assert_eq!(heard.reports.len(), at_rest, "no strike is measured after it");
        assert!(meter.passed_over() > 10);
        assert_eq!(meter.strikes() as usize, at_rest + meter.passed_over() as usize);
        // And goes on from there.
        meter.pass_over(false);
        let scans: Vec<Scan> = (80_000..84_000).map(|at| scan(stream(at))).collect();
        meter.process(&settings, 80_000, scans, &mut heard);
        assert!(heard.reports.len() > at_rest);
        let next = heard.reports[at_rest].strike as usize;
        assert_eq!(next, at_rest + meter.passed_over() as usize);
    }
}

proptest! {
    #[test]
    fn any_coefficients_are_survived_with_any_codes(
        bits in prop::collection::vec(prop_oneof![any::<i32>(), Just(i32::MAX), Just(i32::MIN)], 25),
        codes in prop::collection::vec([0u16..4096, 0u16..4096, 0u16..4096, 0u16..4096], 600),
    ) {
        let mut bits = bits.into_iter();
        // Any value from the upper part of the range of a coefficient.
        let mut next = |most: i32| bits.next().unwrap().rem_euclid(most) + 1;
        let mut settings = paper();
        // 65 km/s² over 4095 codes, a third for each of the three sums. The format holds all forces.
        for channel in [&mut settings.force.sensitive, &mut settings.force.wide] {
            let most = next(i32::MAX - 1) + 1;
            channel.per_code = I2F30::from_bits(most);
            channel.slope = I2F30::from_bits(next(most - 1));
            channel.curve = I2F30::from_bits(-next(most / 2));
        }
        for channel in [&mut settings.acceleration.sensitive, &mut settings.acceleration.wide] {
            let most = next(1 << 28) + 1;
            channel.per_code = I6F26::from_bits(most);
            channel.slope = I6F26::from_bits(next(most - 1));
            channel.curve = I6F26::from_bits(-next(most / 2));
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
        chain.delay = I16F16::from_bits(next(i32::MAX));
        // In a build with overflow checks a sum that leaves its format panics.
        let scans: Vec<Scan> = codes.into_iter().map(Scan::new).collect();
        let (window, record) = replayed(&settings, 0, &scans);
        window.report(&settings, &record);
    }
}
