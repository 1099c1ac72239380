//! A noisy link between bead and host: what is damaged is refused and counted, what is whole is believed.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use bead_recording::frames::{self, Frame};
use bead_tests::{RunFrames, paper};
use proptest::prelude::*;

/// A run with two strikes, heard without noise.
static CLEAN: LazyLock<RunFrames> = LazyLock::new(|| {
    let run = paper(2, 0.05, Some(1)).run();
    RunFrames::new(run.unwrap_or_else(|failure| panic!("{failure}")).stream)
});

/// A frame's identity: nothing that depends on what was lost before it.
fn key(frame: &Frame) -> (u32, String) {
    (frame.header.sequence, format!("{:?}", frame.message))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bits_cost_the_frames_they_hit_and_no_other(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0u8..8), 1..20)
    ) {
        let mut noisy = CLEAN.stream.clone();
        for (place, bit) in &flips {
            noisy[place.index(CLEAN.stream.len())] ^= 1 << bit;
        }
        let sent: BTreeSet<_> = CLEAN.frames.iter().map(key).collect();
        let (received, counters) = frames::decode(&noisy);
        for frame in &received {
            prop_assert!(sent.contains(&key(frame)), "a frame that was never sent: {frame:?}");
        }
        // A flip in a delimiter between two frames can cost both.
        prop_assert!(received.len() + 2 * flips.len() >= sent.len());
        // Losses between the first and the last frame are counted to the frame.
        if let (Some(first), Some(last)) = (received.first(), received.last()) {
            let span = u64::from(last.header.sequence - first.header.sequence) + 1;
            prop_assert_eq!(counters.lost, span - received.len() as u64);
        }
    }

    #[test]
    fn a_link_that_goes_away_for_a_while_is_counted_exactly(
        from in any::<prop::sample::Index>(), length in 1usize..3000
    ) {
        let from = from.index(CLEAN.stream.len());
        let to = (from + length).min(CLEAN.stream.len());
        let torn = [&CLEAN.stream[..from], &CLEAN.stream[to..]].concat();
        let (received, counters) = frames::decode(&torn);
        if let (Some(first), Some(last)) = (received.first(), received.last()) {
            let span = u64::from(last.header.sequence - first.header.sequence) + 1;
            prop_assert_eq!(counters.lost, span - received.len() as u64);
        }
    }
}
