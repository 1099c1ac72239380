//! Requests of a host are carried out or refused by name, and strikes are measured as if none had come.

use std::sync::LazyLock;

use bead_recording::strikes::RecordedStrike;
use bead_tests::{Requests, RequestsRun, paper};
use bead_wire::{ANY, Link, MAX_REQUEST, Message, Outcome, Raw, Request, encode_request};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// Scans a second.
const RATE: u64 = 100_000;
/// Bytes a second at 2 Mbaud, 8N1.
const LINE: f64 = 200e3;
/// Two strikes with no request.
static QUIET: LazyLock<Vec<RecordedStrike>> =
    LazyLock::new(|| Requests::new(&paper(2, 0.1, Some(1))).run().received.strikes());

/// Two strikes while the line is busy with `bytes` from 10 ms before the first to 50 ms after it.
fn flooded(bytes: impl Fn(&mut TestRng) -> Vec<u8>) -> RequestsRun {
    let mut requests = Requests::new(&paper(2, 0.1, Some(1)));
    let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let (from, to) = (0.02, 0.1);
    let mut sent = 0;
    while (sent as f64) < (to - from) * LINE {
        let piece = bytes(&mut random);
        sent += piece.len();
        // Back to back: each piece is due while the one before is still being sent.
        requests.send(from, &piece);
    }
    requests.request(0.2, &Request::Identity);
    requests.run()
}

/// Asserts that the host's bytes affected neither the strikes nor the frames that the bead sends by itself.
fn assert_undisturbed(answered: &RequestsRun) {
    let strikes = answered.received.strikes();
    assert_eq!(strikes.len(), 2);
    for (strike, quiet) in strikes.iter().zip(QUIET.iter()) {
        assert_eq!(strike.said, quiet.said, "A and B in every bit");
        assert_eq!((&strike.scans, &strike.chunks), (&quiet.scans, &quiet.chunks));
        assert_eq!(strike.shape, quiet.shape);
    }
    let status = answered.received.status();
    assert_eq!((status.overruns, status.blocks_dropped, status.epoch), (0, 0, 0));
    assert_eq!(
        (status.frames_dropped_queue_full, answered.received.counters.lost),
        (0, 0)
    );
    assert_eq!((answered.outcome.overruns, answered.outcome.resets.len()), (0, 0));
    assert_eq!(answered.received.causes(), []);
    assert_eq!(answered.outcome.unknown_registers, []);
}

fn rejected(link: &Link) -> u32 {
    link.rejected_too_long
        + link.rejected_cobs
        + link.rejected_too_short
        + link.rejected_crc
        + link.rejected_version
        + link.rejected_kind
        + link.rejected_body
        + link.rejected_trailing
}

#[test]
fn a_flood_at_full_rate_changes_no_bit_and_a_request_behind_it_is_done() {
    // Intact, but of an unknown kind: each is owed a reply.
    let unknown = bead_testing::framed(&[bead_wire::VERSION, 99, 1, 0, ANY]).repeat(100);
    type Flood<'a> = &'a dyn Fn(&mut TestRng) -> Vec<u8>;
    // The requests are refused, or are more than the receiver holds while it replies.
    let floods: [(Flood<'_>, std::ops::Range<u32>, bool); 4] = [
        (
            &|random| {
                let mut bytes = vec![0; 1000];
                random.fill_bytes(&mut bytes);
                bytes
            },
            // Every 256th byte ends something.
            50..80,
            false,
        ),
        (&|_| vec![0; 1000], 0..1, false),
        (&|_| vec![0xA5; 1000], 1..2, false),
        (&|_| unknown.clone(), 101..10_000, true),
    ];
    for (n, (bytes, range, overruns)) in floods.into_iter().enumerate() {
        let answered = flooded(bytes);
        assert_undisturbed(&answered);
        let link = answered.received.last::<Link>();
        println!("{link:?}");
        assert!(range.contains(&rejected(&link)), "flood {n}: {link:?}");
        assert_eq!((link.overruns > 0, link.line_errors), (overruns, 0), "flood {n}");
        assert_eq!(answered.received.answer(0).0, Outcome::Done, "flood {n}");
        if !overruns {
            // Every byte came in.
            let request = encode_request(ANY, 0, &Request::Identity, &mut [0; MAX_REQUEST]).map(<[u8]>::len);
            assert_eq!(
                Ok(link.bytes),
                request.map(|length| (0.08 * LINE) as u64 + length as u64)
            );
        }
    }
}

#[test]
fn no_byte_is_lost_to_a_core_that_looks_before_the_dma_has_fetched_it() {
    let mut requests = Requests::new(&paper(0, 0.1, Some(1)));
    requests.machine.count_instructions = false;
    // A fifth of the time that a byte takes.
    requests.machine.receive_dma_latency_ns = 1_000;
    let all = 60;
    for n in 0..all {
        // At all phases of whatever the bead does once a millisecond or so.
        requests.request(0.02 + 0.00137 * f64::from(n), &Request::Arm);
    }
    let answered = requests.run();
    let link = answered.received.last::<Link>();
    assert_eq!((link.requests, link.overruns, link.line_errors), (all, 0, 0));
    assert_eq!(
        (link.rejected_crc, link.rejected_cobs, link.rejected_too_short),
        (0, 0, 0)
    );
    for n in 0..all {
        assert_eq!(answered.received.answer(n as u16).0, Outcome::Done, "request {n}");
    }
}

#[test]
fn a_line_that_falls_idle_after_every_byte_changes_no_bit() {
    let mut requests = Requests::new(&paper(2, 0.1, Some(1)));
    // A byte takes 5 µs, the line is idle after 5 more: an interrupt each 11 µs.
    for n in 0..7000 {
        requests.send(0.02 + f64::from(n) * 11e-6, &[n as u8]);
    }
    let answered = requests.run();
    assert_undisturbed(&answered);
    assert_eq!(answered.received.last::<Link>().bytes, 7000);
}

#[test]
fn a_bead_says_what_a_block_costs_since_it_was_last_asked() {
    // Strikes at 20 and 120 ms after the first scan, which comes some 17 ms after the start.
    let mut requests = Requests::new(&paper(2, 0.1, Some(1)));
    for at in [0.09, 0.12, 0.2] {
        requests.request(at, &Request::Status);
    }
    let answered = requests.run();
    let loads = [0, 1, 2].map(|number| {
        let [.., Message::Load(load)] = answered.received.answered(number)[..] else {
            panic!("{:?}", answered.received.answered(number));
        };
        *load
    });
    let [struck, quiet, again] = loads;
    println!("{loads:?}");
    // 2 ms at 168 MHz.
    assert!(loads.iter().all(|load| load.period_cycles == 336_000));
    // Blocks of 2 ms between the requests, one more or less.
    assert!((14..=16).contains(&quiet.blocks), "{quiet:?}");
    assert!((39..=41).contains(&again.blocks), "{again:?}");
    for load in loads {
        assert!(load.mean_cycles > 0 && load.mean_cycles <= load.worst_cycles);
        assert!(load.worst_cycles < load.period_cycles, "no block is late");
    }
    // A strike costs what quiet does not: the estimators' some 360 instructions a sample. The worst quiet
    // block has moved the history too.
    for load in [struck, again] {
        assert!(load.worst_cycles > 5 * quiet.mean_cycles && load.worst_cycles > 2 * quiet.worst_cycles);
    }
}

#[test]
fn a_raw_stream_carries_what_the_converter_gave_and_counts_what_it_could_not_carry() {
    let mut requests = Requests::new(&paper(2, 0.1, Some(1)));
    requests.request(0.02, &Request::Raw { duration_ms: 300 });
    let answered = requests.run();
    let mut raw = 0;
    let mut next = None;
    let mut gaps = 0;
    for piece in answered.received.all::<Raw>() {
        for (index, codes) in (piece.first_index as usize..).zip(piece.codes.iter()) {
            // Scan 0 was started by software, before the first row.
            let [force, _, acceleration, _] = answered.rows[index.max(1) - 1];
            assert_eq!(codes, [force, acceleration], "scan {index}");
        }
        gaps += u64::from(next.is_some_and(|next| next != piece.first_index));
        next = Some(piece.first_index + piece.codes.len() as u64);
        raw += piece.codes.len() as u64;
    }
    let link = answered.received.last::<Link>();
    assert_eq!(
        (link.raw_sent, link.raw_sent + link.raw_dropped),
        (raw, 3 * RATE / 10)
    );
    println!("{raw} of {} scans in {gaps} gaps", 3 * RATE / 10);
    // 124 bytes take 32 scans over a line of 200 bytes a millisecond.
    assert!((45..55).contains(&(100 * raw / (3 * RATE / 10))), "{raw}");
    assert_undisturbed(&answered);
    assert_eq!(answered.received.answer(0).0, Outcome::Done);
}

#[test]
fn a_flood_of_requests_is_done_as_far_as_it_is_heard_and_none_of_it_twice() {
    let mut requests = Requests::new(&paper(2, 0.1, Some(1)));
    for _ in 0..1500 {
        // Back to back: each is due while the one before is still being sent.
        requests.request(0.02, &Request::Arm);
    }
    let last = requests.request(0.2, &Request::Arm);
    let answered = requests.run();
    assert_undisturbed(&answered);
    let replies: Vec<_> = (0..=last).map(|n| answered.received.replies(n).count()).collect();
    let received: usize = replies.iter().sum();
    let link = answered.received.last::<Link>();
    println!(
        "{received} of {} requests, {} overruns",
        replies.len(),
        link.overruns
    );
    assert!(replies.iter().all(|count| *count <= 1));
    assert_eq!(link.requests as usize, received);
    // One that the ring held when it ran over may be cut.
    assert!(rejected(&link) <= link.overruns, "{link:?}");
    assert!(link.overruns > 0 && received > 100);
    assert_eq!(
        answered.received.answer(last).0,
        Outcome::Done,
        "when the line is quiet again"
    );
}
