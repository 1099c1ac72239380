//! A stream of frames on a bad line: damaged frames are refused, lost frames are counted.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::HashSet;

use crate::common::{STEP, bytes, bytes_of, decode, filler, message, most, unopening};
use bead_wire::{Arrival, Decoder, Identity, MAX_FRAME, REORDER, ResetCauses};
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

/// Frames of one boot: the opening one, then fillers.
fn boot(number: u8, frames: u32) -> Vec<Vec<u8>> {
    (0..frames)
        .map(|n| {
            if n == 0 {
                opening(number)
            } else {
                filler(number, n)
            }
        })
        .collect()
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
            prop_assert_eq!(&sequences, &[sequence, sequence + 2], "bit {}", bit);
            // A flip that makes a delimiter leaves two pieces.
            prop_assert!(matches!(rejects.len(), 1 | 2), "bit {bit}: {rejects:?}");
            prop_assert_eq!(decoder.counters().lost, 1);
        }
    }
}

proptest! {
    #[test]
    fn dropped_frames_are_counted_exactly(first: u32, kept in vec(any::<bool>(), 1..most(300))) {
        let mut decoder = Decoder::new();
        let sequence = |n: usize| first.wrapping_add(n as u32);
        for n in (0..kept.len()).filter(|&n| kept[n]) {
            decode(&mut decoder, &filler(0, sequence(n)));
        }
        // Frames before the first one received and after the last one are unknown.
        let heard = kept.iter().position(|&kept| kept);
        let last = kept.iter().rposition(|&kept| kept);
        let between = heard.zip(last).map_or(&[][..], |(first, last)| &kept[first..=last]);
        let lost = between.iter().filter(|&&kept| !kept).count();
        let counters = decoder.counters();
        prop_assert_eq!(counters.first_sequence, heard.map(sequence));
        prop_assert_eq!(counters.lost, lost as u64);
        prop_assert_eq!(counters.restarts, 0);
    }

    /// Several boots, each with frames dropped anywhere. The first frames of a boot may be dropped, or all of
    /// them.
    #[test]
    fn dropped_frames_are_counted_exactly_over_restarts(boots in vec(vec(any::<bool>(), 1..most(100)), 1..6)) {
        let mut decoder = Decoder::new();
        let (mut lost, mut heard) = (0, 0);
        for (number, kept) in boots.iter().enumerate() {
            let Some(last) = kept.iter().rposition(|&kept| kept) else { continue };
            let first = kept.iter().position(|&kept| kept).unwrap();
            // In the first boot heard, earlier frames are unknown. A later boot is heard from its start.
            let listened = if heard == 0 { first } else { 0 };
            lost += kept[listened..=last].iter().filter(|&&kept| !kept).count() as u64;
            heard += 1;
            for (frame, _) in boot(number as u8, kept.len() as u32).iter().zip(kept).filter(|(_, kept)| **kept) {
                decode(&mut decoder, frame);
            }
        }
        let counters = decoder.counters();
        prop_assert_eq!((counters.lost, counters.restarts), (lost, u64::saturating_sub(heard, 1)));
        prop_assert_eq!((counters.late, counters.duplicates), (0, 0));
    }

    #[test]
    fn noise_between_frames_costs_no_frame(
        messages in vec((message(), vec(any::<u8>(), 0..most(2 * MAX_FRAME))), 1..8),
    ) {
        let mut stream = Vec::new();
        for (n, (message, noise)) in messages.iter().enumerate() {
            stream.extend(noise);
            stream.extend(bytes(0, n as u32, message));
        }
        let mut decoder = Decoder::new();
        let (sequences, _) = decode(&mut decoder, &stream);
        prop_assert!(sequences.into_iter().eq(0..messages.len() as u32));
        prop_assert_eq!(decoder.counters().lost, 0);
        prop_assert!(decoder.counters().from_start());
        prop_assert_eq!(decoder.counters().bytes, stream.len() as u64);
    }

    #[test]
    fn a_stream_cut_anywhere_costs_one_frame(messages in vec(message(), 3..6), cut: prop::sample::Index) {
        let frames: Vec<_> = (0..).zip(&messages).map(|(n, message)| bytes(0, n, message)).collect();
        let stream = frames.concat();
        let cut = cut.index(stream.len());
        // The bead is reset while it sends, so its next boot follows in the middle of a frame.
        let mut decoder = Decoder::new();
        let (sequences, rejects) = decode(&mut decoder, &[&stream[..cut], &boot(1, 2).concat()].concat());
        let whole = |frame: usize| frames[..=frame].concat().len() <= cut + 1;
        let expected = (0..frames.len()).take_while(|&n| whole(n)).map(|n| n as u32).chain(0..2);
        prop_assert!(sequences.into_iter().eq(expected));
        prop_assert!(rejects.len() <= 1);
    }

    #[test]
    fn it_does_not_matter_in_what_pieces_bytes_come(
        stream in vec(prop_oneof![
            message().prop_map(|message| bytes(0, 9, &message)),
            vec(any::<u8>(), 0..40),
        ], 0..8),
        pieces in vec(0..200usize, 0..30),
    ) {
        let stream = stream.concat();
        let mut whole = Decoder::new();
        let expected = decode(&mut whole, &stream);
        let (mut pieced, mut rest) = (Decoder::new(), &stream[..]);
        let mut got = (Vec::new(), Vec::new());
        for length in pieces.into_iter().chain([stream.len()]) {
            let (piece, tail) = rest.split_at(length.min(rest.len()));
            let (sequences, rejects) = decode(&mut pieced, piece);
            got.0.extend(sequences);
            got.1.extend(rejects);
            rest = tail;
        }
        prop_assert_eq!(got, expected);
        prop_assert_eq!(pieced.counters(), whole.counters());
        prop_assert_eq!(pieced.pending(), whole.pending());
    }

    #[test]
    fn each_byte_ends_in_one_counter(stream in vec(prop_oneof![Just(0u8), any::<u8>()], 0..most(5000))) {
        let mut decoder = Decoder::new();
        let (frames, rejects) = decode(&mut decoder, &stream);
        let counters = decoder.counters();
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
fn the_wrap_of_the_sequence_is_no_restart() {
    let stream: Vec<_> = [u32::MAX - 1, u32::MAX, 1]
        .map(|sequence| filler(0, sequence))
        .concat();
    assert_eq!(
        arrivals(&stream),
        [
            Arrival::First,
            Arrival::Next { lost: 0 },
            Arrival::Next { lost: 1 }
        ]
    );
}

#[test]
fn an_identity_numbered_zero_begins_a_run_though_the_boot_is_the_same() {
    // After a power cycle boots are counted from 0 again.
    let stream = [boot(0, 10), boot(0, 3)].concat().concat();
    let mut decoder = Decoder::new();
    decode(&mut decoder, &stream);
    assert_eq!((decoder.counters().restarts, decoder.counters().lost), (1, 0));
    assert_eq!(arrivals(&stream)[10], Arrival::Restart { lost: 0 });
}

#[test]
fn an_identity_numbered_zero_received_twice_in_a_row_is_a_duplicate() {
    let stream = [opening(0), opening(0), filler(0, 1)].concat();
    assert_eq!(
        arrivals(&stream),
        [Arrival::First, Arrival::Duplicate, Arrival::Next { lost: 0 }]
    );
}

#[test]
fn a_step_far_back_is_a_restart_though_its_identity_was_lost() {
    let near = [filler(0, 500), filler(0, 500 - REORDER)].concat();
    assert_eq!(arrivals(&near), [Arrival::First, Arrival::Duplicate]);
    let far = [filler(0, 500), filler(0, 500 - REORDER - 1)].concat();
    assert_eq!(
        arrivals(&far),
        [
            Arrival::First,
            Arrival::Restart {
                lost: 500 - REORDER - 1
            }
        ]
    );
}

#[test]
fn a_frame_late_by_the_most_allowed_fills_its_gap() {
    let stream = [filler(0, 0), filler(0, 1 + REORDER), filler(0, 1), filler(0, 1)].concat();
    let expected = [
        Arrival::First,
        Arrival::Next { lost: REORDER },
        Arrival::Late,
        Arrival::Duplicate,
    ];
    assert_eq!(arrivals(&stream), expected);
}

#[test]
fn a_frame_late_after_a_restart_fills_its_gap() {
    let stream = [filler(0, 9), filler(1, 3), filler(1, 2), filler(1, 3)].concat();
    let expected = [
        Arrival::First,
        Arrival::Restart { lost: 3 },
        Arrival::Late,
        Arrival::Duplicate,
    ];
    assert_eq!(arrivals(&stream), expected);
}

#[test]
fn joining_late_says_that_the_loss_before_is_unknown() {
    let mut decoder = Decoder::new();
    decode(&mut decoder, &filler(0, 41));
    assert_eq!(
        (decoder.counters().first_sequence, decoder.counters().lost),
        (Some(41), 0)
    );
    assert!(!decoder.counters().from_start());
}

#[test]
fn each_address_has_a_run_of_sequence_numbers_of_its_own() {
    let text = crate::common::block(b"x");
    let frame = |address, sequence| {
        let settings = bead_wire::Settings { block: text.clone() };
        bytes_of(address, 0, sequence, &settings.into())
    };
    // Frames of two beads alternate; two frames of bead 9 are lost.
    let stream = [frame(3, 0), frame(9, 70), frame(3, 1), frame(9, 73), frame(3, 2)].concat();
    assert_eq!(
        arrivals(&stream),
        [
            Arrival::First,
            Arrival::First,
            Arrival::Next { lost: 0 },
            Arrival::Next { lost: 2 },
            Arrival::Next { lost: 0 },
        ]
    );
    let mut decoder = Decoder::new();
    decode(&mut decoder, &stream);
    // It is the higher first number of the two, because frames of bead 9 were missed before anyone listened.
    assert_eq!(decoder.counters().first_sequence, Some(70));
    assert_eq!(decoder.counters().lost, 2);
}
