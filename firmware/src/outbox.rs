//! The frames that wait to be sent.
//!
//! # Design
//! A task of any priority can put a message in, and never waits: a message that finds no room is dropped and
//! counted. It takes a sequence number all the same, so the host sees the gap. A message is packed first and
//! then copied into a ring of bytes in a critical section, so that numbers and frames are in the same order.
//! The section is some 200 instructions long for the longest frame, 2 to 3 µs. CRC and COBS are the
//! transmitter's work, at the lowest priority.
//!
//! **Room is kept for replies.** What comes in bulk leaves [`KEPT`] bytes free: waveforms, strikes, raw scans
//! and edges. Replies, what a request asks for, what is told every second and faults may use them. So a bead
//! answers whatever its settings, its sensors and its line make it send. While a frame can leave, that room
//! becomes free again within 10 ms, since nothing in bulk may take it.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

use bead_model::Chunk;
use bead_wire::{KEPT, Message, OUTBOX, Packed, Queue, taken};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer, with_timeout};

use crate::{counters, trace};

/// Bytes that the window of a strike needs.
static WINDOW: AtomicUsize = AtomicUsize::new(0);
/// Time that a request waits for room.
const PATIENCE: Duration = Duration::from_millis(20);

static QUEUE: Mutex<CriticalSectionRawMutex, RefCell<Queue<OUTBOX>>> = Mutex::new(RefCell::new(Queue::new()));
/// A frame was put in.
static FILLED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Address of the bead, by the settings in force.
static ADDRESS: AtomicU8 = AtomicU8::new(0);

/// The address under which frames leave.
pub(crate) fn address() -> u8 {
    ADDRESS.load(Ordering::Relaxed)
}

/// Changes the address of the frames that are put in from now on.
pub(crate) fn readdress(address: u8) {
    ADDRESS.store(address, Ordering::Relaxed);
}

/// Puts a message in that comes in bulk, or drops and counts it.
pub(crate) fn push(message: impl Into<Message>) {
    queue(&mut Packed::new(), &message.into(), KEPT);
}

/// Pushes a message of a strike. The message stays in `packed`.
pub(crate) fn push_packed(packed: &mut Packed, message: impl Into<Message>) {
    queue(packed, &message.into(), KEPT);
}

/// Pushes a piece of a window, of which there are dozens. `packed` is working space.
pub(crate) fn push_piece(packed: &mut Packed, chunk: &Chunk) {
    let whole = chunk.pack(packed, address(), trace::boot() as u8);
    put(packed, whole, KEPT);
}

/// Puts a message in that a host waits for, or that is rare. It may use the room that is kept.
pub(crate) fn tell(message: impl Into<Message>) {
    queue(&mut Packed::new(), &message.into(), 0);
}

/// As [`tell`], if this still holds when the message is put in. Returns whether it did.
pub(crate) fn tell_if(message: impl Into<Message>, holds: impl FnOnce() -> bool) -> bool {
    let mut packed = Packed::new();
    let whole = pack(&mut packed, &message.into());
    critical_section::with(|_| {
        let holds = holds();
        if holds {
            put(&mut packed, whole, 0);
        }
        holds
    })
}

// Once in the image: a message is long to build, and it is built where the core should do something else
// quickly.
#[inline(never)]
fn queue(packed: &mut Packed, message: &Message, keep: usize) {
    let whole = pack(packed, message);
    put(packed, whole, keep);
}

/// Packs a message. Returns whether it is whole, which it always is.
pub(crate) fn pack(packed: &mut Packed, message: &Message) -> bool {
    packed.pack(address(), trace::boot() as u8, message).is_ok()
}

#[inline(never)]
fn put(packed: &mut Packed, whole: bool, keep: usize) {
    let mut wake = false;
    counters::update(|c| {
        packed.stamp(c.frames, c.newest_index);
        c.frames = c.frames.wrapping_add(1);
        if !whole {
            c.frames_dropped_too_long += 1;
        } else if QUEUE.lock(|queue| queue.borrow_mut().push(packed, keep)) {
            // The transmitter waits only for the first.
            wake = c.frames_waiting == 0;
            c.frames_waiting += 1;
            trace::keep_waiting(c.frames_waiting);
        } else {
            c.frames_dropped_queue_full += 1;
        }
    });
    if wake {
        FILLED.signal(());
    }
}

/// Bytes that bulk may still take.
pub(crate) fn room() -> usize {
    free().saturating_sub(KEPT)
}

/// Returns `true` if there is room for the window of a strike, which needs `window` bytes.
pub(crate) fn has_room(window: usize) -> bool {
    WINDOW.store(window, Ordering::Relaxed);
    room() >= window
}

/// Bytes that a raw stream leaves besides those of a window: for its next frame, and so that no request waits
/// for it.
pub(crate) const SPARE: usize = taken(Packed::MAX) + KEPT / 2;

fn free() -> usize {
    QUEUE.lock(|queue| queue.borrow().free())
}

/// Waits until a request may be done. A host that sends requests without end shall not take the room that the
/// window of a strike needs, so this waits for that and for its own. If it does not come in time, strikes are
/// what takes it: then only the room for replies must be there, and it always comes.
pub(crate) async fn calm() {
    let calm = async {
        while room() < WINDOW.load(Ordering::Relaxed) + KEPT / 2 {
            Timer::after(Duration::from_millis(1)).await;
        }
    };
    if with_timeout(PATIENCE, calm).await.is_err() {
        while free() < KEPT / 2 {
            Timer::after(Duration::from_millis(1)).await;
        }
    }
}

/// Waits until another frame in bulk leaves the room that the window of a strike needs. Returns false if that
/// does not come in time: then strikes are what takes it.
pub(crate) async fn has_spare(deadline: Instant) -> bool {
    while room() < WINDOW.load(Ordering::Relaxed) + SPARE {
        if Instant::now() >= deadline {
            return false;
        }
        Timer::after(Duration::from_millis(1)).await;
    }
    true
}

/// Moves the oldest frame into `packed`; waits for one.
pub(crate) async fn next(packed: &mut Packed) {
    while !QUEUE.lock(|queue| queue.borrow_mut().pop(packed)) {
        FILLED.wait().await;
    }
}
