//! Lines through simulated delays, and segments of beads that share a line.

use super::alignment::*;
use super::common::CommonTime;
use super::fit::median;
use super::segments::*;
use crate::frames::Frame;
use crate::strikes::RecordedStrike;
use bead_wire::{Arrival, Body, Health, Kind, Message, Strike};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Debug, Clone, Copy)]
enum Delays {
    /// A queue: exponential, 1 ms in the mean.
    Queue,
    /// A host that asks every millisecond.
    Polled,
    /// A fifth of the frames waits for up to 50 ms more.
    Stalls,
    /// The queue grows to twentyfold over the time.
    Growing,
}

fn exponential(rng: &mut ChaCha8Rng, mean: f64) -> f64 {
    -mean * (1.0 - rng.random::<f64>()).ln()
}

/// Frames of a bead that is fast by `ppm`, this many a second for `seconds`, as a segment holds them.
fn delayed(ppm: f64, seconds: f64, rate: f64, delays: Delays, seed: u64) -> Segment {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut segment = Segment {
        sample_rate_hz: Some(100_000),
        ..Segment::default()
    };
    let mut time = 0.0;
    while time < seconds {
        time += if rate > 4.0 {
            exponential(&mut rng, 1.0 / rate)
        } else {
            1.0 / rate
        };
        let late = match delays {
            Delays::Queue => exponential(&mut rng, 1e-3),
            Delays::Polled => (time * 1e3).ceil() / 1e3 - time + exponential(&mut rng, 2e-4),
            Delays::Stalls if rng.random_bool(0.2) => 0.05 * rng.random::<f64>(),
            Delays::Stalls => exponential(&mut rng, 5e-4),
            Delays::Growing => exponential(&mut rng, 5e-4) * (1.0 + 20.0 * time / seconds),
        };
        // By the bead's own clock; the index moves by blocks of 200 samples.
        let index = (time * 500.0).floor() * 200.0;
        let after = time / (1.0 + ppm * 1e-6) + late + 2e-4;
        let received = 1_700_000_000_000_000_000 + (after * 1e9) as u64;
        let mut status = Frame::of(0, 0, Arrival::Next { lost: 0 }, Health::default());
        status.header.sample_index = index as u64;
        status.received_ns = Some(received);
        segment.push(&status);
    }
    segment
}

#[test]
fn the_drift_is_found_within_its_uncertainty_whatever_holds_frames_up() {
    for delays in [Delays::Queue, Delays::Polled, Delays::Stalls, Delays::Growing] {
        for (seconds, rate, most) in [(60.0, 4.0, 12.0), (60.0, 50.0, 10.0), (600.0, 4.0, 0.15)] {
            let errors: Vec<(f64, f64)> = (0..100)
                .map(|seed| {
                    let ppm = seed as f64 - 50.0;
                    let fit = delayed(ppm, seconds, rate, delays, seed).fit().unwrap();
                    (fit.drift_ppm - ppm, fit.uncertainty_ppm.unwrap())
                })
                .collect();
            let held = errors.iter().filter(|(error, within)| error.abs() <= *within);
            let held = held.count();
            let typical = median(&mut errors.iter().map(|(_, within)| *within).collect::<Vec<_>>());
            let rms = (errors.iter().map(|(error, _)| error * error).sum::<f64>() / 100.0).sqrt();
            println!("{delays:?} {seconds} s, {rate}/s: rms {rms:.3} ppm, said ±{typical:.3}, held {held} %");
            assert!(held >= 90, "{delays:?} {seconds} s: {held} of 100");
            assert!(typical < most, "{delays:?} {seconds} s: ±{typical} ppm");
        }
    }
}

#[test]
fn frames_that_come_faster_or_slower_than_any_crystal_are_not_in_real_time() {
    let comes = |times: f64| {
        delayed((times - 1.0) * 1e6, 60.0, 4.0, Delays::Queue, 3)
            .fit()
            .unwrap()
    };
    for times in [1.67, 5.0, 0.5, 1.002, 0.998] {
        assert!(!comes(times).in_real_time(), "{times}");
    }
    for ppm in [0.0, 150.0, -900.0] {
        assert!(comes(1.0 + ppm * 1e-6).in_real_time(), "{ppm} ppm");
    }
}

#[test]
fn a_recording_of_days_costs_no_more_memory_and_gives_the_drift_as_well() {
    // Two days, two frames a second.
    let segment = delayed(35.0, 172_800.0, 2.0, Delays::Queue, 7);
    assert!(segment.buckets.len() <= 8192, "{}", segment.buckets.len());
    assert!(segment.frames > 300_000);
    let fit = segment.fit().unwrap();
    let off = (fit.drift_ppm - 35.0).abs();
    assert!(off < 2e-3 && off <= fit.uncertainty_ppm.unwrap(), "{fit:?}");
}

#[test]
fn host_times_are_late_by_the_least_delay_and_no_more_than_the_residual() {
    let fit = delayed(35.0, 600.0, 50.0, Delays::Queue, 3).fit().unwrap();
    for true_seconds in [0.0, 300.0, 600.0] {
        let host = fit.host_ns(true_seconds * (1.0 + 35e-6));
        let late = (host - 1_700_000_000_000_000_000) as f64 * 1e-9 - true_seconds;
        // 0.2 ms is the least delay put in; the least of the index's blocks and of the queue come on top,
        // and what the slope leaves over half of the time.
        let slope = fit.uncertainty_ppm.unwrap() * 1e-6 * 300.0;
        assert!(
            (2e-4 - slope..2e-4 + 3e-4).contains(&late),
            "{late} s at {true_seconds} s"
        );
    }
}

#[test]
fn frames_made_before_the_sample_clock_ran_do_not_count() {
    let mut with_start = Segment {
        sample_rate_hz: Some(100_000),
        ..Segment::default()
    };
    let mut identity = Frame::of(0, 0, Arrival::First, Health::default());
    // Two milliseconds before index 0.
    identity.received_ns = Some(1_699_999_999_998_000_000);
    with_start.push(&identity);
    assert_eq!((with_start.frames, with_start.fit()), (1, None));
    identity.header.sample_index = 200;
    identity.received_ns = Some(1_700_000_000_003_000_000);
    with_start.push(&identity);
    assert!(with_start.fit().is_some());
}

#[test]
fn a_moment_says_nothing_of_the_drift() {
    let fit = delayed(35.0, 0.9, 4.0, Delays::Queue, 3).fit().unwrap();
    assert_eq!((fit.drift_ppm, fit.uncertainty_ppm), (0.0, None));
    let untimed = Segment {
        sample_rate_hz: Some(100_000),
        ..Segment::default()
    };
    assert_eq!(untimed.fit(), None);
}

/// Edges of a clock with a rate and an offset, in steps of an 84 MHz counter, one every `period` s.
fn edges(rate: f64, offset: f64, period: f64, count: u32) -> Vec<f64> {
    let step = |time: f64| (time * 84e6).floor() / 84e6;
    (0..count)
        .map(|n| step((f64::from(n) * period + offset) * rate))
        .collect()
}

#[test]
fn two_clocks_that_share_edges_agree_to_the_step_of_their_counters() {
    let own = edges(1.0 + 30.37e-6, 0.7, 1.0, 60);
    let reference = edges(1.0 - 12.11e-6, 0.2, 1.0, 60);
    let alignment = Alignment::through(own.into_iter().zip(reference).collect()).unwrap();
    let expected = ((1.0 + 30.37e-6) / (1.0 - 12.11e-6) - 1.0) * 1e6;
    let uncertainty = alignment.drift_uncertainty_ppm.unwrap();
    assert!(
        (alignment.drift_ppm - expected).abs() < uncertainty,
        "{alignment:?}"
    );
    assert!(uncertainty < 2e-4, "{uncertainty}");
    // Two counters of 11.9 ns steps: √(2/12) of one, rms.
    assert!(
        (3e-9..7e-9).contains(&alignment.residual_rms_s),
        "{}",
        alignment.residual_rms_s
    );
    for true_time in [0.01, 17.3, 58.99] {
        let mapped = alignment.reference((true_time + 0.7) * (1.0 + 30.37e-6));
        let off = mapped - (true_time + 0.2) * (1.0 - 12.11e-6);
        assert!(off.abs() < 25e-9, "{off} s at {true_time} s");
    }
}

#[test]
fn a_crystal_that_wanders_is_followed_between_the_edges() {
    // 0.5 ppm to and fro in 20 s: 1.6 us.
    let wander = |time: f64| time + 1.6e-6 * (time * std::f64::consts::TAU / 20.0).sin();
    let pairs: Vec<(f64, f64)> = (0..60).map(|n| (wander(f64::from(n)), f64::from(n))).collect();
    let alignment = Alignment::through(pairs).unwrap();
    assert!(alignment.residual_max_s > 1e-6, "the line does not follow");
    let off = alignment.reference(wander(30.4)) - 30.4;
    assert!(off.abs() < 25e-9, "{off}");
}

#[test]
fn an_edge_that_one_bead_missed_shifts_no_other() {
    let segment = |skip: usize, ppm: f64| {
        let mut segment = delayed(ppm, 60.0, 50.0, Delays::Queue, 5);
        let rate = 1.0 + ppm * 1e-6;
        segment.edges = (1..59).map(|n| f64::from(n) * 1e5 * rate).collect();
        segment.edges.remove(skip);
        segment
    };
    let placed = |segment: Segment| PlacedEdges::of(&segment, &segment.fit().unwrap()).unwrap();
    let pairs = placed(segment(10, 25.0)).in_common(&placed(segment(40, -25.0)));
    assert_eq!(pairs.len(), 56);
    for (own, reference) in pairs {
        assert!((own / (1.0 + 25e-6) - reference / (1.0 - 25e-6)).abs() < 1e-9);
    }
}

#[test]
fn after_a_power_cycle_a_strike_is_on_the_time_of_its_own_boot() {
    // Bead 7 was switched off and on, and saw edges only then; bead 8 saw them as well.
    let boot = |address: u8, edges: u32| {
        let mut segment = delayed(0.0, 60.0, 50.0, Delays::Queue, 5);
        segment.address = address;
        segment.edges = (1..=edges).map(|n| f64::from(n) * 1e5).collect();
        segment
    };
    let time = CommonTime::among(&[boot(7, 1), boot(8, 50), boot(7, 50)]);
    assert!(time.is_shared());
    let said = Strike::draw(&mut || 0);
    let at = |address: u8, nth_boot: Option<usize>| {
        let strike = RecordedStrike {
            nth_boot,
            ..RecordedStrike::new(address, said)
        };
        let has_host_time = time.host(&strike, 1e5).is_some();
        assert_eq!(has_host_time, nth_boot != Some(2), "{nth_boot:?}");
        time.common(&strike, 1e5)
    };
    assert_eq!(at(7, Some(0)), None);
    assert_eq!(at(7, Some(1)), at(8, Some(0)));
    assert!(at(7, Some(1)).is_some());
    // A strike that was fetched later has only the low byte.
    assert_eq!(at(7, None), at(7, Some(1)));
    // A boot beyond those that are kept.
    assert_eq!(at(7, Some(2)), None);
}

#[test]
fn two_beads_on_one_line_have_segments_of_their_own() {
    let rate = |address| if address == 3 { 1.0 + 40e-6 } else { 1.0 - 25e-6 };
    let (mut tracker, mut live) = (Tracker::default(), Live::default());
    let mut places = Segments::default();
    let mut boots = [0u8; 2];
    for n in 0..400u64 {
        for (bead, address) in [3u8, 9].into_iter().enumerate() {
            // The second bead restarts in the middle, and the first one does not notice.
            let restart = n == 0 || address == 9 && n == 200;
            boots[bead] += u8::from(restart && n > 0);
            let after = if address == 9 && n >= 200 { n - 200 } else { n };
            let index = ((after + 1) as f64 * 25_000.0 * rate(address)) as u64;
            let arrival = match (restart, n) {
                (true, 0) => Arrival::First,
                (true, _) => Arrival::Restart { lost: 0 },
                _ => Arrival::Next { lost: 0 },
            };
            let mut frame = Frame::of(address, boots[bead], arrival, Health::default());
            (frame.header.sequence, frame.header.sample_index) = (n as u32, index);
            frame.received_ns = Some(1_700_000_000_000_000_000 + n * 250_000_000 + u64::from(address));
            let place = places.place(&frame);
            tracker.push(&frame);
            live.push(&frame);
            assert_eq!(tracker.segments[place].address, address);
            tracker.segments[place].sample_rate_hz = Some(100_000);
        }
    }
    let found = tracker.segments.iter();
    let found: Vec<_> = found
        .map(|segment| (segment.address, segment.boot, segment.frames))
        .collect();
    assert_eq!(found, [(3, 0, 400), (9, 0, 200), (9, 1, 200)]);
    for segment in &tracker.segments {
        let fit = segment.fit().unwrap();
        let off = fit.drift_ppm - (rate(segment.address) - 1.0) * 1e6;
        assert!(off.abs() < 0.5, "address {}: off by {off} ppm", segment.address);
    }
    let current = live.segments().map(|segment| (segment.address, segment.boot));
    assert_eq!(current.collect::<Vec<_>>(), [(3, 0), (9, 1)]);
    // Live segments keep no edge and no strike.
    for kind in [Kind::Sync, Kind::Shape] {
        let message = Message::draw(kind, &mut || 0);
        let frame = Frame::of(3, 0, Arrival::Next { lost: 0 }, message);
        tracker.push(&frame);
        live.push(&frame);
    }
    let counts = |segment: &Segment| (segment.edges.len(), segment.struck.len());
    assert_eq!(counts(&tracker.segments[0]), (1, 1));
    assert!(live.segments().map(counts).all(|counts| counts == (0, 0)));
}
