//! Bytes between the threads that read ports and the one that records them.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Index of a port, receive time of the last of the bytes, and the bytes. An empty piece means that the port
/// is back after it was away.
pub type PortBytes = (usize, Instant, Vec<u8>);

/// A queue of received bytes with an upper bound. While it is full, `push` waits: the sender at the other end
/// of a socket then waits too, and a serial line loses bytes, which shows in its frames.
pub struct Queue {
    most: usize,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    pieces: VecDeque<PortBytes>,
    /// Bytes of the pieces, and of the room that each takes beside them.
    bytes: usize,
    closed: bool,
}

/// Bytes that a piece takes beside its own.
const PIECE: usize = size_of::<PortBytes>() + 16;

impl Queue {
    /// An empty queue for at most about `most` bytes.
    pub fn new(most: usize) -> Self {
        Self {
            most,
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Appends a piece. Waits while the queue is full; false if it is closed.
    pub fn push(&self, piece: PortBytes) -> bool {
        let cost = piece.2.len() + PIECE;
        let mut state = self.state();
        while state.bytes > 0 && state.bytes + cost > self.most && !state.closed {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.closed {
            return false;
        }
        state.bytes += cost;
        state.pieces.push_back(piece);
        self.changed.notify_all();
        true
    }

    /// Takes the oldest piece, and waits for one if there is none: `Ok(None)` after `patience`.
    ///
    /// # Errors
    /// [`Closed`]: the queue is closed and empty.
    pub fn pop(&self, patience: Duration) -> Result<Option<PortBytes>, Closed> {
        let deadline = Instant::now() + patience;
        let mut state = self.state();
        loop {
            if let Some(piece) = state.pieces.pop_front() {
                state.bytes -= piece.2.len() + PIECE;
                self.changed.notify_all();
                return Ok(Some(piece));
            }
            if state.closed {
                return Err(Closed);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            (state, _) = self
                .changed
                .wait_timeout(state, left)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Closes the queue: nothing more goes in, and what is in it can still be taken out.
    pub fn close(&self) {
        self.state().closed = true;
        self.changed.notify_all();
    }
}

/// The queue is closed and empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Closed;

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    const AT_ONCE: Duration = Duration::ZERO;

    fn piece(byte: u8) -> PortBytes {
        (0, Instant::now(), vec![byte; 1000])
    }

    #[test]
    fn a_full_queue_makes_its_sender_wait_and_loses_nothing() {
        let queue = Queue::new(5000);
        thread::scope(|scope| {
            scope.spawn(|| {
                assert!((0..100).all(|byte| queue.push(piece(byte))));
                queue.close();
            });
            let mut came = Vec::new();
            while let Ok(piece) = queue.pop(Duration::from_secs(10)) {
                assert!(queue.state().bytes <= 5000);
                came.extend(piece.map(|(_, _, bytes)| bytes[0]));
            }
            assert_eq!(came, (0..100).collect::<Vec<u8>>());
        });
    }

    #[test]
    fn a_closed_queue_gives_what_it_has_and_ends_a_sender_that_waits() {
        let queue = Queue::new(1500);
        assert_eq!(queue.pop(AT_ONCE), Ok(None));
        assert!(queue.push(piece(7)));
        thread::scope(|scope| {
            let waiting = scope.spawn(|| queue.push(piece(8)));
            while !waiting.is_finished() {
                queue.close();
            }
            assert!(!waiting.join().unwrap());
        });
        assert_eq!(queue.pop(AT_ONCE).unwrap().unwrap().2[0], 7);
        assert_eq!(queue.pop(AT_ONCE), Err(Closed));
    }

    #[test]
    fn a_piece_larger_than_the_queue_passes_when_it_is_empty() {
        let queue = Queue::new(10);
        assert!(queue.push(piece(1)));
        assert_eq!(queue.pop(AT_ONCE).unwrap().unwrap().2.len(), 1000);
    }
}
