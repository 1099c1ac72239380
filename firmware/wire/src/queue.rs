//! The frames that wait to be sent: a ring of bytes.
//!
//! # Design
//! A frame waits without CRC and COBS, in as many bytes as it has ([`Packed`]). A record has its length in
//! four bytes before it and is filled up to whole words, so that it is copied word by word. A window of
//! quiet scans takes half the room of a loud one.
//!
//! **Some room is kept.** [`push`](Queue::push) leaves a number of bytes free that its caller names. Bulk
//! frames leave room for those that a host waits for.

use crate::codes::MAX_SCANS;
use crate::frame::Packed;
use crate::message::Kind;

/// Bytes of a bead's queue: the windows of three strikes, about 3.6 KB each.
pub const OUTBOX: usize = 13 * 1024 - 256;
/// Bytes of it that waveforms, strikes, raw scans and edges leave free: room for everything that a request
/// can ask for, and for the frames of every second.
pub const KEPT: usize = 2048;

/// Bytes before a record.
const LENGTH: usize = 4;

/// Frames that wait, in `N` bytes. `N` is a multiple of four.
pub struct Queue<const N: usize> {
    bytes: [u8; N],
    /// Where the oldest record begins.
    head: usize,
    /// Bytes in use.
    used: usize,
    records: u32,
}

impl<const N: usize> Default for Queue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Queue<N> {
    /// An empty queue.
    pub const fn new() -> Self {
        assert!(N.is_multiple_of(4) && N > taken(Packed::MAX));
        Self {
            bytes: [0; N],
            head: 0,
            used: 0,
            records: 0,
        }
    }

    /// Frames that wait.
    pub const fn waiting(&self) -> u32 {
        self.records
    }

    /// Bytes that are free. [`taken`] says how many a frame takes.
    pub const fn free(&self) -> usize {
        N - self.used
    }

    /// Appends a frame if at least `keep` bytes stay free. Returns true if the frame was appended.
    pub fn push(&mut self, frame: &Packed, keep: usize) -> bool {
        let bytes = frame.bytes();
        let needed = taken(bytes.len());
        if self.free() < needed + keep {
            return false;
        }
        let start = self.wrapped(self.head + self.used);
        self.bytes[start..start + LENGTH].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
        let start = self.wrapped(start + LENGTH);
        let (first, rest) = bytes.split_at(bytes.len().min(N - start));
        self.bytes[start..start + first.len()].copy_from_slice(first);
        if !rest.is_empty() {
            self.bytes[..rest.len()].copy_from_slice(rest);
        }
        self.used += needed;
        self.records += 1;
        true
    }

    /// Moves the oldest frame into `frame`. Returns false if there is none.
    pub fn pop(&mut self, frame: &mut Packed) -> bool {
        if self.records == 0 {
            return false;
        }
        let start = self.head;
        let mut length = [0; LENGTH];
        length.copy_from_slice(&self.bytes[start..start + LENGTH]);
        let room = frame.room(u32::from_le_bytes(length) as usize);
        let needed = taken(room.len());
        let start = self.wrapped(start + LENGTH);
        let (first, rest) = {
            let whole = room.len();
            room.split_at_mut(whole.min(N - start))
        };
        first.copy_from_slice(&self.bytes[start..start + first.len()]);
        if !rest.is_empty() {
            rest.copy_from_slice(&self.bytes[..rest.len()]);
        }
        self.head = self.wrapped(self.head + needed);
        self.used -= needed;
        self.records -= 1;
        true
    }

    const fn wrapped(&self, at: usize) -> usize {
        if at >= N { at - N } else { at }
    }
}

/// Bytes that a frame with a payload of this length takes in a queue.
pub const fn taken(payload: usize) -> usize {
    LENGTH + payload.next_multiple_of(4)
}

/// Bytes that the frames of a window of this many scans take at most, with every scan at both gains.
pub const fn room_for_window(scans: usize) -> usize {
    const fn frame(kind: Kind) -> usize {
        taken(Packed::HEADER + kind.longest())
    }
    scans.div_ceil(MAX_SCANS) * frame(Kind::Waveform) + frame(Kind::Strike) + frame(Kind::Shape)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]

    use super::*;
    use crate::message::Message;
    use std::collections::VecDeque;
    use std::vec::Vec;

    /// Frames of every kind and length, forty thousand of them: they come out as they went in, over every
    /// place of the wrap, and a frame for which there is no room changes nothing.
    #[test]
    fn frames_come_out_in_order_and_whole_whatever_their_lengths() {
        let mut state = 1_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut queue = Queue::<1024>::new();
        let mut waiting: VecDeque<Vec<u8>> = VecDeque::new();
        let mut packed = Packed::new();
        let mut refused = 0;
        const ROUNDS: u32 = if cfg!(miri) { 500 } else { 80_000 };
        for round in 0..ROUNDS {
            if random() % 2 == 0 {
                let kind = Kind::ALL[random() as usize % Kind::ALL.len()];
                packed.pack(7, 2, &Message::draw(kind, &mut random)).unwrap();
                packed.stamp(round, u64::from(round) << 20);
                let keep = (random() % 3) as usize * 128;
                let fits = queue.free() >= taken(packed.bytes().len()) + keep;
                assert_eq!(queue.push(&packed, keep), fits);
                if fits {
                    waiting.push_back(packed.bytes().to_vec());
                }
                refused += u32::from(!fits);
            } else {
                assert_eq!(queue.pop(&mut packed), !waiting.is_empty());
                if let Some(oldest) = waiting.pop_front() {
                    assert_eq!(packed.bytes(), oldest);
                }
            }
            assert_eq!(queue.waiting() as usize, waiting.len());
            let used: usize = waiting.iter().map(|bytes| taken(bytes.len())).sum();
            assert_eq!(queue.free(), 1024 - used);
        }
        assert!(refused > ROUNDS / 80, "{refused}");
    }

    #[test]
    fn a_window_takes_a_record_for_each_piece_and_two_for_its_result() {
        assert_eq!([672, 673].map(room_for_window), [5648, 5904]);
        assert_eq!((OUTBOX, KEPT), (13_056, 2048));
    }
}
