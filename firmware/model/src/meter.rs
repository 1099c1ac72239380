//! The strike meter: trigger, history before it, window, and the quiet that arms it again.
//!
//! A window can also be requested, around an instant that another bead or a host names
//! ([`Meter::keep_around`]): a bead that feels little then keeps what it felt.

use core::ops::Range;
use core::sync::atomic::{AtomicU32, Ordering};

use crate::layout::{HISTORY_MAX, LEAD, PIECE};
use crate::quantity::{Scan, pack};
use crate::settings::Settings;
use crate::shape::WindowRecord;
pub use crate::waves::REACH;
use crate::waves::{Around, LAG_MAX, MEASURED, Origin, PlannedWindow, Wave, Waves};
use crate::window::Window;
use bead_wire::{Energy, Kind, MAX_SCANS, Packed, Shape, Strike, Waveform};

/// Scans in a full chunk of a window's waveform.
pub const CHUNK: usize = PIECE;
// A piece of a window fills a frame.
const _: () = assert!(CHUNK == MAX_SCANS);

/// A piece of a window's waveform, with the energies absorbed by its end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chunk {
    /// Number of the strike since power-up, from 0.
    pub strike: u32,
    /// Sample index of the first scan.
    pub first_index: u64,
    /// The codes: [`CHUNK`] scans, fewer in the last chunk of a window.
    pub scans: heapless::Vec<Scan, CHUNK>,
    /// The two scans before them; zeros in the first chunk.
    pub before: [Scan; 2],
    /// True if the result of this piece depends on the wide codes.
    pub loud: bool,
    /// Estimate A at the last scan.
    pub absorbed_measured: Energy,
    /// Estimate B at the last scan.
    pub absorbed_predicted: Energy,
}

/// The waveform frame of a piece. The low-gain codes are sent only if the result depends on them.
impl From<&Chunk> for Waveform {
    fn from(chunk: &Chunk) -> Self {
        let (before, scans) = if chunk.loud {
            (&chunk.before[..], &chunk.scans[..])
        } else {
            (&[][..], &[][..])
        };
        Self {
            strike: chunk.strike,
            first_index: chunk.first_index,
            codes: pack(chunk.scans.iter().copied(), Scan::sensitive),
            wide: pack(before.iter().chain(scans).copied(), Scan::wide),
            absorbed_measured: chunk.absorbed_measured,
            absorbed_predicted: chunk.absorbed_predicted,
        }
    }
}

impl Chunk {
    /// Packs the waveform frame of this piece. Returns true if it fits, which it always does.
    #[inline(never)]
    pub fn pack(&self, packed: &mut Packed, address: u8, boot: u8) -> bool {
        packed
            .pack_body(address, boot, Kind::Waveform, &Waveform::from(self))
            .is_ok()
    }
}

/// Where the meter's results go.
pub trait Sink {
    /// Called when the force triggers at this scan. A window will be opened for it; the one before may still
    /// be measured.
    fn found(&mut self, _trigger_index: u64) {}
    /// Called when a window opens, with the index of the scan that counts as its trigger. Its pieces follow.
    fn opened(&mut self, _trigger_index: u64, _origin: Origin) {}
    /// Called when a piece of the waveform is complete. Pieces come in order and cover the window.
    fn chunk(&mut self, chunk: &Chunk);
    /// Called when a window is complete, after its last chunk, with its result and its shape.
    fn report(&mut self, strike: &Strike, shape: &Shape);
}

/// Scans in memory that a DMA writes: two words each, force and acceleration, the code at the high gain in
/// the lower half.
pub fn scans(words: &[[AtomicU32; 2]]) -> impl ExactSizeIterator<Item = Scan> + '_ {
    let gains = |word: &AtomicU32| {
        let word = word.load(Ordering::Relaxed);
        [word as u16, (word >> 16) as u16]
    };
    words.iter().map(move |[force, acceleration]| {
        let ([force, force_wide], [acceleration, acceleration_wide]) = (gains(force), gains(acceleration));
        Scan::new([force, force_wide, acceleration, acceleration_wide])
    })
}

/// Least number of scans that a call measures: a piece, and the newest scans, which wait until it is known
/// whether they are the foot of a wave. A meter that is called for every scan thus has its result with the
/// last scan of a window.
const LEAST: usize = PIECE + LEAD as usize;

/// Scans of the longest call that the meter is made for.
const CALL: usize = 256;

/// Capacity of [`Recent`] in scans: the longest lag and the longest call. When it is full, the scans still
/// needed are moved to the front.
const ROOM: usize = (LAG_MAX + CALL).next_multiple_of(PIECE);

/// The newest scans, in one slice: the trigger needs no arithmetic of a ring.
#[derive(Clone)]
struct Recent {
    scans: [Scan; ROOM],
    /// Number of scans.
    length: usize,
    /// Index of the first scan that is still to be measured.
    next: usize,
    /// Index of the first scan in which no rise was looked for. Only a window that overlaps the one before is
    /// measured from scans that were.
    looked: usize,
}

impl Recent {
    /// Appends as many of `scans` as there is room for. Scans before `needed` may be dropped. Returns true if
    /// scans had to be moved.
    fn append(&mut self, scans: &mut impl ExactSizeIterator<Item = Scan>, needed: usize) -> bool {
        if self.length == 0 {
            // The first scans follow a history of zeros.
            (self.length, self.next, self.looked) = (HISTORY_MAX, HISTORY_MAX, HISTORY_MAX);
        }
        let moves = self.length == ROOM;
        if moves {
            self.make_room(needed);
        }
        let start = self.length;
        self.length = ROOM.min(start + scans.len());
        // `zip` polls the room first. In the other order it would take one scan too many from the iterator
        // and lose it.
        for (room, scan) in self.scans[start..self.length].iter_mut().zip(scans) {
            *room = scan;
        }
        moves
    }

    /// Moves the scans from `unwanted` on to the front.
    fn make_room(&mut self, unwanted: usize) {
        self.scans.copy_within(unwanted..self.length, 0);
        self.length -= unwanted;
        self.next -= unwanted;
        self.looked -= unwanted;
    }

    /// The scans still to be measured.
    fn waiting(&self) -> Range<usize> {
        self.next..self.length
    }
}

#[derive(Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap to box it on, and one meter in all"
)]
// `Idle` has the tag 0: a new meter is all zeros, and takes no flash.
#[repr(u32)]
enum Phase {
    /// Waits for a strike.
    Idle,
    /// Measures a strike.
    Measuring(Measurement),
}

/// Finds strikes in the stream of scans and measures each. It has state only: the settings come with every
/// call.
#[derive(Clone)]
pub struct Meter {
    recent: Recent,
    waves: Waves,
    phase: Phase,
    /// The window that follows the one that is measured, if it `has_next`.
    next: PlannedWindow,
    has_next: bool,
    around: Around,
    /// Forces and accelerations of the window so far.
    record: WindowRecord,
    strikes: u32,
    /// True while strikes are counted, but not measured.
    passing: bool,
    passed_over: u32,
    in_dead_time: u32,
}

impl Default for Meter {
    fn default() -> Self {
        Self::new()
    }
}

impl Meter {
    /// A meter that has seen no scan. It arms after one history of quiet.
    pub const fn new() -> Self {
        Self {
            recent: Recent {
                scans: [Scan::ZERO; ROOM],
                length: 0,
                next: 0,
                looked: 0,
            },
            waves: Waves::new(),
            phase: Phase::Idle,
            next: PlannedWindow::NONE,
            has_next: false,
            around: Around::NOTHING,
            record: WindowRecord::new(),
            strikes: 0,
            passing: false,
            passed_over: 0,
            in_dead_time: 0,
        }
    }

    /// Passes over strikes from now on, or measures them again. A strike passed over is counted and numbered,
    /// but not measured. A measurement under way is completed.
    pub fn pass_over(&mut self, passing: bool) {
        self.passing = passing;
    }

    /// Strikes that were passed over so far.
    pub fn passed_over(&self) -> u32 {
        self.passed_over
    }

    /// Waves so far that no window could hold: they came before the detector was armed, or while too many
    /// scans of windows waited to be measured.
    pub fn in_dead_time(&self) -> u32 {
        self.in_dead_time
    }

    /// Requests a window in which the scan `trigger` counts as the trigger. It opens at the scan `at`, unless
    /// the force has opened one by then: a strike that the bead finds itself takes precedence. It does not
    /// open if the meter is not armed at that scan, or if its history would reach further back than [`REACH`]
    /// and its own length, into another window or across a gap. A new request replaces one that is still
    /// pending.
    pub fn keep_around(&mut self, trigger: u64, at: u64, origin: Origin) {
        self.around = Around { trigger, at, origin };
    }

    /// Forgets all scans, so that no window mixes samples from before and after a gap. Strike numbers
    /// continue.
    pub fn restart(&mut self) {
        self.phase = Phase::Idle;
        self.in_dead_time += u32::from(core::mem::take(&mut self.has_next));
        self.waves = Waves::new();
        (self.recent.next, self.recent.looked) = (self.recent.length, self.recent.length);
    }

    /// Strikes that have triggered so far.
    pub fn strikes(&self) -> u32 {
        self.strikes
    }

    /// Returns `true` if a strike would be measured if it came now.
    pub fn is_armed(&self) -> bool {
        !self.is_measuring() && self.waves.is_armed
    }

    /// Returns `true` if a strike is being measured: [`restart`](Self::restart) would cut it.
    pub fn is_measuring(&self) -> bool {
        self.has_next || matches!(self.phase, Phase::Measuring(_))
    }

    /// Takes scans, the first with the sample index `first_index`; indices are consecutive between calls of
    /// [`restart`](Self::restart). The results do not depend on how the scans are cut into calls.
    ///
    /// Every scan is checked for a rise when it comes. Measuring is most of the work, and when a strike
    /// triggers, its whole history waits to be measured. To spread this work, a call measures 3 scans for
    /// every 8 that it receives, and at least `LEAST`; fewer if it has to move scans in memory or to compute
    /// a report. The meter therefore lags behind during a window: at its end, by the history and 5/3 of the
    /// length. In calls of up to 256 scans it has room for the lag of the longest window, and no call
    /// measures more than that share. A longer call measures all that it can.
    pub fn process(
        &mut self,
        settings: &Settings,
        first_index: u64,
        scans: impl IntoIterator<IntoIter: ExactSizeIterator<Item = Scan>>,
        sink: &mut (impl Sink + ?Sized),
    ) {
        let mut scans = scans.into_iter();
        let [measured, of] = MEASURED;
        let is_short = scans.len() <= CALL;
        let allowed = if is_short {
            (scans.len() * measured / of).max(LEAST)
        } else {
            usize::MAX
        };
        let mut quota = allowed;
        let mut end_index = first_index;
        while scans.len() > 0 {
            end_index += scans.len() as u64;
            let needed = self.needed(settings, end_index - scans.len() as u64);
            if self.recent.append(&mut scans, needed) && self.is_measuring() {
                // Moving scans is work too.
                quota -= quota / 4;
            }
            end_index -= scans.len() as u64;
            while self.find(settings, end_index, sink) {
                let lags = self.recent.waiting().len() > LAG_MAX;
                if quota == 0 && lags {
                    // The limit of the lag.
                    quota = PIECE;
                }
                // A report takes as long as some scans. The next call has time for it, unless calls are so
                // short that this one may be the last.
                let may_wait = is_short && allowed > LEAST && !lags;
                if !self.measure(settings, end_index, &mut quota, may_wait, sink) {
                    break;
                }
                if is_short && matches!(self.phase, Phase::Idle) {
                    // The report used up the time of this call.
                    quota = 0;
                }
            }
        }
    }

    /// Place of the first scan that is still needed. The scan after the last has the index `end_index`.
    fn needed(&self, settings: &Settings, end_index: u64) -> usize {
        let Recent {
            length, next, looked, ..
        } = self.recent;
        let [history, lookback] = [settings.window.history, settings.window.lookback].map(usize::from);
        if !self.is_measuring() {
            return next.saturating_sub(REACH + history);
        }
        // Where the next window begins, or may begin yet.
        let begins = if self.has_next {
            length.saturating_sub((end_index - self.next.first) as usize)
        } else {
            looked.saturating_sub(history + lookback)
        };
        next.min(begins)
    }

    /// Like [`process`](Self::process), for scans in memory that a DMA writes ([`scans`]). It is compiled for
    /// speed with this crate, whatever its caller is compiled for.
    pub fn process_words(
        &mut self,
        settings: &Settings,
        first_index: u64,
        words: &[[AtomicU32; 2]],
        sink: &mut dyn Sink,
    ) {
        self.process(settings, first_index, scans(words), sink);
    }

    /// Searches the new scans for the next rise that opens a window, and opens that window unless another is
    /// being measured. Returns true if a window is being measured. The scan after the last has the index
    /// `end_index`.
    fn find(&mut self, settings: &Settings, end_index: u64, sink: &mut (impl Sink + ?Sized)) -> bool {
        loop {
            if !self.has_next
                && let Some(window) = self.look(settings, end_index, sink)
            {
                (self.next, self.has_next) = (window, true);
                self.next.strike = self.strikes;
                self.strikes += 1;
            }
            if matches!(self.phase, Phase::Measuring(_)) {
                return true;
            }
            if !core::mem::take(&mut self.has_next) {
                self.recent.next = self.recent.looked;
                return false;
            }
            sink.opened(self.next.trigger, self.next.origin);
            self.record.clear();
            self.phase = Phase::Measuring(Measurement::open(self.next));
            self.recent.next = self.recent.length - (end_index - self.next.first) as usize;
        }
    }

    /// Searches the scans not yet checked for the next window.
    fn look(
        &mut self,
        settings: &Settings,
        end_index: u64,
        sink: &mut (impl Sink + ?Sized),
    ) -> Option<PlannedWindow> {
        loop {
            let Recent { length, looked, .. } = self.recent;
            let index = end_index - (length - looked) as u64;
            if looked == length {
                return None;
            }
            self.waves.begin(settings, index);
            let before = self.around.at.saturating_sub(index);
            let is_asked = self.around.origin != Origin::Force && before < (length - looked) as u64;
            let end = if is_asked {
                looked + before as usize
            } else {
                length
            };
            if end == looked {
                let around = core::mem::replace(&mut self.around, Around::NOTHING);
                let kept = index.saturating_sub(looked as u64);
                match self.waves.asked(settings, around, index, kept) {
                    None => continue,
                    window => return window,
                }
            }
            let allowed = !self.passing;
            let (found, passed) = self
                .waves
                .look(settings, &self.recent.scans, looked..end, index, allowed);
            self.recent.looked += passed;
            match found {
                None => {}
                Some(Wave::Missed) => self.in_dead_time += 1,
                Some(Wave::Triggers { .. }) if self.passing => {
                    self.strikes += 1;
                    self.passed_over += 1;
                }
                Some(Wave::Triggers { trigger, cut }) => {
                    if let (Phase::Measuring(current), Some(end)) = (&mut self.phase, cut) {
                        current.end = end;
                    }
                    sink.found(trigger);
                    return Some(self.waves.plan(settings, trigger, trigger, Origin::Force));
                }
            }
        }
    }

    /// Measures some of the waiting scans. Returns false if none can be measured. With `may_wait`, the last
    /// scan of a window, which completes its report, is left for a call that has time for it.
    fn measure(
        &mut self,
        settings: &Settings,
        end_index: u64,
        quota: &mut usize,
        may_wait: bool,
        sink: &mut (impl Sink + ?Sized),
    ) -> bool {
        let new = self.recent.waiting();
        let Phase::Measuring(strike) = &mut self.phase else {
            return false;
        };
        let index = end_index - new.len() as u64;
        let looked = end_index - (self.recent.length - self.recent.looked) as u64;
        let known = self.waves.known_until(looked, strike.end).saturating_sub(index) as usize;
        let mut some = new.start..new.end.min(new.start + known.min(*quota));
        let ends = index + some.len() as u64 == strike.end;
        if ends && may_wait && *quota < some.len() + strike.report_scans() {
            some.end -= 1;
        }
        if some.is_empty() {
            return false;
        }
        let taken = some.len();
        let over = strike.process(settings, &self.recent.scans[some], &mut self.record, sink);
        *quota -= taken;
        self.recent.next = new.start + taken;
        if over {
            self.phase = Phase::Idle;
        }
        true
    }
}

/// A strike that is being measured.
#[derive(Clone)]
struct Measurement {
    window: Window,
    /// Sample indices of its first scan, and of the one after its last. A wave may cut it.
    first: u64,
    end: u64,
    chunk: Chunk,
}

impl Measurement {
    fn open(window: PlannedWindow) -> Self {
        let PlannedWindow {
            strike, first, end, ..
        } = window;
        Self {
            window: Window::open(strike, first),
            end,
            first,
            chunk: Chunk {
                strike,
                first_index: first,
                ..Chunk::default()
            },
        }
    }

    /// Scans that could be measured in the time of the report.
    fn report_scans(&self) -> usize {
        (self.end - self.first) as usize / 16
    }

    /// Takes the next scans, none beyond the end of the window. Returns true at the end of the window.
    fn process(
        &mut self,
        settings: &Settings,
        scans: &[Scan],
        record: &mut WindowRecord,
        sink: &mut (impl Sink + ?Sized),
    ) -> bool {
        let Self { window, chunk, .. } = self;
        let samples = (self.end - self.first) as u16;
        let mut rest = scans;
        while !rest.is_empty() {
            let room = CHUNK - chunk.scans.len();
            let (piece, after) = rest.split_at(rest.len().min(room));
            rest = after;
            window.process(settings, piece, record);
            // There is room: the piece was cut to fit.
            let _ = chunk.scans.extend_from_slice(piece);
            let done = window.samples() == samples;
            if done || chunk.scans.is_full() {
                chunk.loud = window.is_loud();
                chunk.absorbed_measured = window.absorbed_measured(settings);
                chunk.absorbed_predicted = window.absorbed_predicted(settings);
                sink.chunk(chunk);
                if let Some(last) = chunk.scans.last_chunk() {
                    chunk.before = *last;
                }
                chunk.first_index += chunk.scans.len() as u64;
                chunk.scans.clear();
            }
            if done {
                let (strike, shape) = window.report(settings, record);
                sink.report(&strike, &shape);
            }
        }
        window.samples() == samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Bead, Capture, FrontEnd, derive};

    /// Discards everything.
    struct Nowhere;

    impl Sink for Nowhere {
        fn chunk(&mut self, _: &Chunk) {}
        fn report(&mut self, _: &Strike, _: &Shape) {}
    }

    /// Number of scans that wait after each call of `call` scans. The window is opened by the force, which
    /// rises at the scan `at`; or by the line, whose request comes at that scan, as late as it can.
    fn lags([history, length]: [u16; 2], call: usize, by_force: bool, at: usize) -> Vec<usize> {
        let mut settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        (settings.window.history, settings.window.length) = (history, length);
        let (mut meter, mut lags) = (Meter::new(), Vec::new());
        if !by_force {
            let late = (REACH - call) as u64;
            meter.keep_around(at as u64 - late, at as u64, Origin::Line);
        }
        for first in (0..6000).step_by(call) {
            let force = |index| if by_force && index >= at { 500 } else { 128 };
            let scans = (first..first + call).map(|index| Scan::new([force(index), 128, 2048, 2048]));
            meter.process(&settings, first as u64, scans, &mut Nowhere);
            lags.push(meter.recent.waiting().len());
        }
        let complete = meter.strikes() == 1 && !meter.is_measuring();
        assert!(complete && lags.ends_with(&[0]), "{length}, {call}, {at}");
        lags
    }

    #[test]
    #[cfg_attr(miri, ignore = "thousands of scans")]
    fn a_call_measures_its_part_of_its_scans_and_a_quarter_less_if_it_moves_those_in_memory() {
        // The room is full after twelve calls; the seventh has the trigger.
        let (call, measured) = (232, 87);
        let lags = lags([160, 672], call, true, 1500);
        assert_eq!((ROOM - HISTORY_MAX, call * 3 / 8), (12 * call, measured));
        let more: Vec<usize> = lags[6..13].windows(2).map(|lags| lags[1] - lags[0]).collect();
        assert_eq!(more, [145, 145, 145, 145, 145, 145 + measured / 4]);
        // The call that completes the window leaves nothing: each scan was looked at when it came.
        let end = 1500 + 1 - 160 + 672;
        let last = lags.iter().rposition(|&lag| lag > 0).unwrap();
        let left = lags[last] - ((last + 1) * call - end);
        assert!((1..=measured).contains(&left), "{left}");
    }

    #[test]
    #[cfg_attr(miri, ignore = "hundreds of thousands of scans")]
    fn the_meter_lags_by_no_more_than_its_limit_and_by_less_if_the_force_opened_the_window() {
        let mut nearest = 0;
        for window in [[256, 1024], [160, 672], [128, 1024], [256, 257]] {
            let [history, length] = window.map(usize::from);
            for call in [32, 50, 100, 199, 200, 201, 256] {
                for at in [2000, 2000 + call / 3, 2000 + call / 2, 2000 + call - 1] {
                    // The history waits, and 5 of 8 scans that come; so does the rest of a call, in
                    // which the scans may have been moved.
                    let most = |by_force| lags(window, call, by_force, at).into_iter().max().unwrap();
                    let by_force = most(true);
                    let bound = history + length * 5 / 3 + call + call / 10;
                    assert!(by_force <= bound, "{window:?}, {call}, {at}: {by_force}");
                    let asked = most(false);
                    assert!(asked <= LAG_MAX, "{window:?}, {call}, {at}: {asked}");
                    nearest = nearest.max(asked);
                }
            }
        }
        assert!(
            nearest * 20 >= LAG_MAX * 19,
            "no more room than is needed: {nearest}"
        );
    }
}
