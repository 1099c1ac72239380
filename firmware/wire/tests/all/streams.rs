//! A stream of frames on a bad line: damaged frames are refused, lost frames are counted.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::HashSet;

use crate::common::{STEP, block, bytes, bytes_of, decode, filler, most, unopening};
use bead_wire::{Arrival, Decoder, Identity, REORDER, ResetCauses};
use proptest::collection::vec;
use proptest::prelude::*;

/// The frame that opens a boot.
fn opening(boot: u8) -> Vec<u8> {
    let identity = Identity {
        firmware: "0.1.0".into(),
        git: "0".into(),
        uid: [7; 12],
        boot: boot.into(),
        reset_cause: ResetCauses::NONE,
        sample_rate_hz: 100_000,
        channels: 2,
    };
    bytes(boot, 0, &identity.into())
}

/// A frame of a boot; number 0 opens it.
fn frame(boot: u8, number: u32) -> Vec<u8> {
    match number {
        0 => opening(boot),
        _ => filler(boot, number),
    }
}

fn arrivals(stream: &[u8]) -> Vec<Arrival> {
    let mut arrivals = Vec::new();
    Decoder::new().feed(stream, |result| arrivals.push(result.unwrap().arrival));
    arrivals
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 1 } else { 64 }))]

    /// Flips every bit of the frame in turn, those of the delimiters too.
    #[test]
    fn a_flipped_bit_costs_its_own_frame_and_no_other(message in unopening(), sequence in 0..u32::MAX - 2) {
        let damaged = bytes(3, sequence + 1, &message);
        let (before, after) = (filler(3, sequence), filler(3, sequence + 2));
        for bit in (0..8 * damaged.len()).step_by(STEP) {
            let mut flipped = damaged.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let mut decoder = Decoder::new();
            let (sequences, rejects) = decode(&mut decoder, &[&before[..], &flipped, &after].concat());
            // After a run of 254 bytes the last COBS code may carry nothing. Then a flip in it leaves the
            // frame as it is.
            if bit / 8 == damaged.len() - 2 && sequences == [sequence, sequence + 1, sequence + 2] {
                continue;
            }
            prop_assert_eq!(&sequences, &[sequence, sequence + 2], "bit {}", bit);
            // A flip that makes a delimiter leaves two pieces.
            prop_assert!(matches!(rejects.len(), 1 | 2), "bit {bit}: {rejects:?}");
            prop_assert_eq!(decoder.counters().lost, 1);
        }
    }
}

proptest! {
    /// Several boots, each with frames dropped anywhere. The first frames of a boot may be dropped, or all of
    /// them.
    #[test]
    fn dropped_frames_are_counted_exactly(boots in vec(vec(any::<bool>(), 1..most(100)), 1..6)) {
        let mut decoder = Decoder::new();
        let (mut lost, mut heard) = (0, 0);
        for (number, kept) in boots.iter().enumerate() {
            let Some(last) = kept.iter().rposition(|&kept| kept) else { continue };
            let first = kept.iter().position(|&kept| kept).unwrap();
            // In the first boot received, earlier frames are unknown. A later boot is received from its
            // start.
            let listened = if heard == 0 { first } else { 0 };
            lost += kept[listened..=last].iter().filter(|&&kept| !kept).count() as u64;
            heard += 1;
            for (n, _) in (0..).zip(kept).filter(|(_, kept)| **kept) {
                decode(&mut decoder, &frame(number as u8, n));
            }
        }
        let counters = decoder.counters();
        prop_assert_eq!((counters.lost, counters.restarts), (lost, u64::saturating_sub(heard, 1)));
        prop_assert_eq!((counters.late, counters.duplicates), (0, 0));
    }

    #[test]
    fn each_byte_ends_in_one_counter(stream in vec(prop_oneof![Just(0u8), any::<u8>()], 0..most(5000))) {
        let mut decoder = Decoder::new();
        let (frames, rejects) = decode(&mut decoder, &stream);
        let counters = decoder.counters();
        prop_assert_eq!(counters.bytes, stream.len() as u64);
        prop_assert_eq!(counters.rejected.total(), rejects.len() as u64);
        prop_assert_eq!(counters.frames, frames.len() as u64);
        let delimiters = stream.iter().filter(|&&byte| byte == 0).count() as u64;
        let refused: u64 = rejects.iter().map(|reject| reject.bytes).sum();
        prop_assert_eq!(refused + delimiters + decoder.pending(), stream.len() as u64);
    }

    /// Each frame comes up to 20 places late, or not at all, or up to three times.
    #[test]
    fn in_any_near_order_lost_is_what_never_came(first: u32, frames in vec((0..20u32, 0..4usize), 1..most(200))) {
        let mut order = vec![(0, 0)];
        for (n, (delay, times)) in (1..).zip(frames) {
            order.extend(std::iter::repeat_n((n + delay, n), times));
        }
        order.sort_by_key(|&(place, _)| place);
        let mut decoder = Decoder::new();
        let (mut came, mut newest, mut late) = (HashSet::new(), 0, 0);
        for (_, n) in &order {
            decode(&mut decoder, &filler(0, first.wrapping_add(*n)));
            late += u64::from(came.insert(*n) && *n < newest);
            newest = newest.max(*n);
        }
        let counters = decoder.counters();
        let unique = came.len() as u64;
        prop_assert_eq!(counters.lost, u64::from(newest) + 1 - unique);
        prop_assert_eq!((counters.late, counters.duplicates), (late, order.len() as u64 - unique));
        prop_assert_eq!(counters.restarts, 0);
    }
}

#[test]
fn each_frame_follows_the_earlier_ones_as_its_boot_and_number_say() {
    const FAR: u32 = 500 - REORDER - 1;
    use Arrival::{Duplicate, First, Late, Next, Restart};
    // The frames of a stream, as boot and number; 0 stands for an opening.
    type Case<'a> = (&'a str, &'a [(u8, u32)], &'a [Arrival]);
    let cases: [Case<'_>; 7] = [
        (
            "the wrap of the sequence is no restart",
            &[(0, u32::MAX - 1), (0, u32::MAX), (0, 1)],
            &[First, Next { lost: 0 }, Next { lost: 1 }],
        ),
        (
            "a power cycle counts boots from 0 again",
            &[(0, 0), (0, 1), (0, 0), (0, 1)],
            &[First, Next { lost: 0 }, Restart { lost: 0 }, Next { lost: 0 }],
        ),
        (
            "an opening received twice in a row is a duplicate",
            &[(0, 0), (0, 0), (0, 1)],
            &[First, Duplicate, Next { lost: 0 }],
        ),
        (
            "a step back as far as frames are reordered is none",
            &[(0, 500), (0, 500 - REORDER)],
            &[First, Duplicate],
        ),
        (
            "a step further back is a restart though its opening was lost",
            &[(0, 500), (0, FAR)],
            &[First, Restart { lost: FAR }],
        ),
        (
            "a frame late by the most allowed fills its gap",
            &[(0, 0), (0, 1 + REORDER), (0, 1), (0, 1)],
            &[First, Next { lost: REORDER }, Late, Duplicate],
        ),
        (
            "a frame late after a restart fills its gap",
            &[(0, 9), (1, 3), (1, 2), (1, 3)],
            &[First, Restart { lost: 3 }, Late, Duplicate],
        ),
    ];
    for (what, frames, expected) in cases {
        let stream: Vec<_> = frames
            .iter()
            .flat_map(|&(boot, number)| frame(boot, number))
            .collect();
        assert_eq!(arrivals(&stream), expected, "{what}");
        let mut decoder = Decoder::new();
        decode(&mut decoder, &stream);
        assert_eq!(decoder.counters().first_sequence, Some(frames[0].1), "{what}");
        assert_eq!(decoder.counters().from_start(), frames[0].1 == 0, "{what}");
        assert_eq!(decoder.counters().frames, frames.len() as u64, "{what}");
        let restarts = expected
            .iter()
            .filter(|arrival| matches!(arrival, Restart { .. }));
        assert_eq!(decoder.counters().restarts, restarts.count() as u64, "{what}");
    }
}

#[test]
fn each_address_has_a_run_of_sequence_numbers_of_its_own() {
    let settings = bead_wire::Message::from(bead_wire::Settings { block: block(b"x") });
    let frame = |address, sequence| bytes_of(address, 0, sequence, &settings);
    // Frames of two beads alternate; two frames of bead 9 are lost.
    let stream = [frame(3, 0), frame(9, 70), frame(3, 1), frame(9, 73), frame(3, 2)].concat();
    let [first, next] = [Arrival::First, Arrival::Next { lost: 0 }];
    assert_eq!(
        arrivals(&stream),
        [first, first, next, Arrival::Next { lost: 2 }, next]
    );
    let mut decoder = Decoder::new();
    decode(&mut decoder, &stream);
    // It is the higher first number of the two, because frames of bead 9 were missed before anyone listened.
    assert_eq!(decoder.counters().first_sequence, Some(70));
    assert_eq!(decoder.counters().lost, 2);
}
