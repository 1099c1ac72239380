//! The last windows, in memory that a reset does not change.
//!
//! # Design
//! A window is a run of parts, each a number and bytes: the frames of a strike without their headers. Windows
//! follow one another in a ring of bytes; new ones replace the oldest. The shorter and quieter they are, the
//! more of them fit. A directory of [`WINDOWS`] entries says where each begins.
//!
//! **Over a reset** nothing of this program's state is trusted. Each entry has a checksum of its own and one
//! of its window's bytes. After a reset the entries that pass are taken up again, and all else is forgotten.
//! After a power-up the memory is random, and no entry passes.
//!
//! The bytes are copied in while a strike is measured, which has little time. Their checksum is made
//! afterwards, [`STEP`] bytes at a time ([`Windows::seal`]). Until then a window can be read, but a reset
//! loses it.

use bead_crc::{RunningChecksum, checksum};

/// Most windows that are kept.
pub const WINDOWS: usize = 32;
/// Bytes before each part: its number, and its length in two bytes.
const HEAD: usize = 4;
/// Bytes that a step of [`Windows::seal`] takes: some 350 instructions, in which no interrupt comes.
const STEP: usize = 32;

/// The memory: plain numbers and bytes only, so that any contents are valid. `N` is a multiple of four.
#[repr(C)]
pub struct WindowMemory<const N: usize> {
    entries: [WindowEntry; WINDOWS],
    ring: [u8; N],
}

impl<const N: usize> WindowMemory<N> {
    /// Memory that holds no window.
    pub const fn new() -> Self {
        Self {
            entries: [WindowEntry::NONE; WINDOWS],
            ring: [0; N],
        }
    }
}

impl<const N: usize> Default for WindowMemory<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Place of a window, and the strike that it is of.
#[derive(Clone, Copy)]
#[repr(C)]
struct WindowEntry {
    /// Number of the window since the memory was cleared.
    serial: u32,
    boot: u32,
    strike: u32,
    /// Start of its bytes in the ring.
    start: u32,
    length: u32,
    parts: u32,
    /// CRC-32 of its bytes.
    contents: u32,
    /// CRC-32 of the fields before it. It is 0 until the window is sealed.
    crc: u32,
}

impl WindowEntry {
    /// An entry without a window.
    const NONE: Self = Self {
        serial: 0,
        boot: 0,
        strike: 0,
        start: 0,
        length: 0,
        parts: 0,
        contents: 0,
        crc: 0,
    };

    fn checksum(&self) -> u32 {
        let words = [
            self.serial,
            self.boot,
            self.strike,
            self.start,
            self.length,
            self.parts,
            self.contents,
        ];
        // 0 stands for an entry that is not sealed.
        checksum(words.map(u32::to_le_bytes).as_flattened()).max(1)
    }
}

/// A window that is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptWindow {
    /// Boot in which it was measured.
    pub boot: u32,
    /// Number of the strike in that boot.
    pub strike: u32,
    /// Number of its parts.
    pub parts: u8,
    /// Number of bytes that it takes.
    pub bytes: u32,
}

/// A place in a window: the next part to read.
#[derive(Clone, Copy, Debug)]
pub struct Cursor {
    serial: u32,
    at: usize,
    part: u8,
}

/// A part of a window, as it was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowPart {
    /// Number of parts before it.
    pub number: u8,
    /// Number of parts of the window.
    pub of: u8,
    /// The number that it was put in with.
    pub kind: u8,
    /// Its length, in bytes.
    pub length: usize,
}

/// The windows in a memory.
pub struct Windows<'m, const N: usize> {
    memory: &'m mut WindowMemory<N>,
    /// Serial numbers of the windows that are kept: from `oldest` to before `next`.
    oldest: u32,
    next: u32,
    /// Where the window being filled begins.
    head: usize,
    /// Bytes before `head` that windows take.
    used: usize,
    /// The window being filled.
    open: Option<WindowEntry>,
    /// The first window that is not sealed, how far its checksum is, and the checksum.
    unsealed: u32,
    summed: usize,
    sum: RunningChecksum,
}

impl<'m, const N: usize> Windows<'m, N> {
    /// Takes over the windows in `memory` if it `survived`; otherwise forgets all of its contents.
    pub fn new(memory: &'m mut WindowMemory<N>, survived: bool) -> Self {
        const { assert!(N.is_multiple_of(4) && N > 0) };
        let mut windows = Self {
            memory,
            oldest: 0,
            next: 0,
            head: 0,
            used: 0,
            open: None,
            unsealed: 0,
            summed: 0,
            sum: RunningChecksum::new(),
        };
        windows.take_up(survived);
        windows.unsealed = windows.next;
        windows
    }

    /// Finds the windows that are whole, from the newest back. A damaged window between them stays as a
    /// window without parts.
    fn take_up(&mut self, survived: bool) {
        for slot in 0..WINDOWS {
            let entry = self.memory.entries[slot];
            let sound = survived && entry.crc == entry.checksum() && self.is_whole(&entry, slot);
            if !sound {
                self.memory.entries[slot] = WindowEntry::NONE;
            }
        }
        let sound = |entry: &&WindowEntry| entry.parts > 0;
        let Some(newest) = self
            .memory
            .entries
            .iter()
            .filter(sound)
            .max_by_key(|entry| entry.serial)
        else {
            return;
        };
        let end = (newest.start + newest.length) as usize % N;
        self.head = end;
        self.next = newest.serial + 1;
        self.oldest = self.next;
        let mut start = end;
        for serial in (0..self.next).rev().take(WINDOWS) {
            let entry = &mut self.memory.entries[serial as usize % WINDOWS];
            if entry.serial != serial || entry.parts == 0 {
                *entry = WindowEntry {
                    serial,
                    start: start as u32,
                    ..WindowEntry::NONE
                };
                continue;
            }
            // From its start to that of the window behind it.
            let span = match (start + N - entry.start as usize) % N {
                0 => N,
                span => span,
            };
            if self.used + span > N {
                break;
            }
            self.used += span;
            start = entry.start as usize;
            self.oldest = serial;
        }
    }

    fn is_whole(&self, entry: &WindowEntry, slot: usize) -> bool {
        let (start, length) = (entry.start as usize, entry.length as usize);
        let fits = entry.serial as usize % WINDOWS == slot
            && entry.serial < u32::MAX
            && start < N
            && start.is_multiple_of(4)
            && (1..=N).contains(&length)
            && (1..=u32::from(u8::MAX)).contains(&entry.parts);
        if !fits {
            return false;
        }
        let mut sum = RunningChecksum::new();
        for slice in slices(&self.memory.ring, start, length) {
            sum.update(slice);
        }
        sum.finish() == entry.contents
    }

    /// Begins a window. One that was begun and not closed is forgotten.
    pub fn open(&mut self, boot: u32, strike: u32) {
        if self.next - self.oldest == WINDOWS as u32 {
            self.drop_oldest();
        }
        self.open = Some(WindowEntry {
            serial: self.next,
            boot,
            strike,
            start: self.head as u32,
            ..WindowEntry::NONE
        });
    }

    /// Forgets the window that is being filled.
    pub fn abandon(&mut self) {
        self.open = None;
    }

    /// Returns `true` if a window is being filled.
    pub fn is_filling(&self) -> bool {
        self.open.is_some()
    }

    /// Returns `true` if this window is being filled.
    pub fn is_open(&self, boot: u32, strike: u32) -> bool {
        self.open
            .is_some_and(|open| (open.boot, open.strike) == (boot, strike))
    }

    /// Appends a part to the window being filled. The oldest windows give way. A window for which even the
    /// whole memory has no room is forgotten.
    pub fn append(&mut self, kind: u8, bytes: &[u8]) {
        let needed = HEAD + bytes.len().next_multiple_of(4);
        let Some(open) = self.open else { return };
        let length = open.length as usize;
        while self.used + length + needed > N {
            if self.oldest == self.next {
                self.open = None;
                return;
            }
            self.drop_oldest();
        }
        let [low, high] = (bytes.len() as u16).to_le_bytes();
        let at = self.head + length;
        // `HEAD` divides the ring, so a head never wraps.
        let start = at % N;
        self.memory.ring[start..start + HEAD].copy_from_slice(&[kind, 0, low, high]);
        let start = (at + HEAD) % N;
        let (first, rest) = bytes.split_at(bytes.len().min(N - start));
        self.memory.ring[start..start + first.len()].copy_from_slice(first);
        if !rest.is_empty() {
            self.memory.ring[..rest.len()].copy_from_slice(rest);
        }
        self.open = Some(WindowEntry {
            length: (length + needed) as u32,
            parts: open.parts + 1,
            ..open
        })
        .filter(|open| open.parts <= u32::from(u8::MAX));
    }

    /// Ends the window being filled: from now on it is kept.
    pub fn close(&mut self) {
        let Some(open) = self.open.take().filter(|open| open.parts > 0) else {
            return;
        };
        self.memory.entries[self.next as usize % WINDOWS] = open;
        self.next += 1;
        self.used += open.length as usize;
        self.head = (self.head + open.length as usize) % N;
    }

    fn drop_oldest(&mut self) {
        let dropped = self.oldest;
        let start = self.entry(dropped).start as usize;
        self.memory.entries[dropped as usize % WINDOWS] = WindowEntry::NONE;
        self.oldest += 1;
        self.used = if self.oldest == self.next {
            0
        } else {
            let behind = self.entry(self.oldest).start as usize;
            self.used - (behind + N - start) % N
        };
        if self.unsealed == dropped {
            self.unsealed = self.oldest;
            self.restart_sum();
        }
    }

    fn restart_sum(&mut self) {
        self.summed = 0;
        self.sum = RunningChecksum::new();
    }

    /// Computes the next part of the outstanding checksums. Returns true if there is more to do.
    pub fn seal(&mut self) -> bool {
        if self.unsealed == self.next {
            return false;
        }
        let entry = *self.entry(self.unsealed);
        let step = STEP.min(entry.length as usize - self.summed);
        if step > 0 {
            let start = (entry.start as usize + self.summed) % N;
            for slice in slices(&self.memory.ring, start, step) {
                self.sum.update(slice);
            }
            self.summed += step;
            return true;
        }
        let contents = core::mem::take(&mut self.sum).finish();
        let entry = WindowEntry { contents, ..entry };
        self.memory.entries[self.unsealed as usize % WINDOWS] = WindowEntry {
            crc: entry.checksum(),
            ..entry
        };
        self.unsealed += 1;
        self.restart_sum();
        self.unsealed != self.next
    }

    /// The kept window with this number; the oldest is 0.
    pub fn kept(&self, number: u32) -> Option<KeptWindow> {
        let serials = self.oldest..self.next;
        let entries = serials.map(|serial| self.entry(serial));
        let entry = entries.filter(|entry| entry.parts > 0).nth(number as usize)?;
        Some(KeptWindow {
            boot: entry.boot,
            strike: entry.strike,
            parts: entry.parts as u8,
            bytes: entry.length,
        })
    }

    /// A cursor at the first part of a window.
    pub fn find(&self, boot: u32, strike: u32) -> Option<Cursor> {
        (self.oldest..self.next)
            .map(|serial| self.entry(serial))
            .find(|entry| entry.parts > 0 && (entry.boot, entry.strike) == (boot, strike))
            .map(|entry| Cursor {
                serial: entry.serial,
                at: 0,
                part: 0,
            })
    }

    /// Copies the next part of a window to the head of `room`. `Ok(None)` after the last one.
    ///
    /// # Errors
    /// The window gave way to newer ones.
    pub fn read(&self, cursor: &mut Cursor, room: &mut [u8]) -> Result<Option<WindowPart>, GaveWay> {
        if !(self.oldest..self.next).contains(&cursor.serial) {
            return Err(GaveWay);
        }
        let entry = self.entry(cursor.serial);
        if u32::from(cursor.part) == entry.parts {
            return Ok(None);
        }
        let start = (entry.start as usize + cursor.at) % N;
        let [kind, _, low, high] = [0, 1, 2, 3].map(|n| self.memory.ring[start + n]);
        let length = usize::from(u16::from_le_bytes([low, high]));
        let room = room.get_mut(..length).ok_or(GaveWay)?;
        let [first, rest] = slices(&self.memory.ring, (start + HEAD) % N, length);
        room[..first.len()].copy_from_slice(first);
        room[first.len()..].copy_from_slice(rest);
        let number = cursor.part;
        cursor.part += 1;
        cursor.at += HEAD + length.next_multiple_of(4);
        Ok(Some(WindowPart {
            number,
            of: entry.parts as u8,
            kind,
            length,
        }))
    }

    fn entry(&self, serial: u32) -> &WindowEntry {
        &self.memory.entries[serial as usize % WINDOWS]
    }
}

/// Bytes of a ring, in two pieces if they wrap.
fn slices<const N: usize>(ring: &[u8; N], start: usize, length: usize) -> [&[u8]; 2] {
    let first = length.min(N - start);
    [&ring[start..start + first], &ring[..length - first]]
}

/// A window is no longer kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GaveWay;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]

    use super::*;
    use std::vec::Vec;

    const N: usize = 2048;

    /// A window as it was put in.
    #[derive(Clone, Debug, PartialEq)]
    struct PutWindow {
        boot: u32,
        strike: u32,
        parts: Vec<(u8, Vec<u8>)>,
    }

    fn random(state: &mut u64) -> usize {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as usize
    }

    /// Memory as after power-up.
    fn memory(state: &mut u64) -> WindowMemory<N> {
        let mut word = || random(state) as u32 * 2 + 1;
        let mut entries = [WindowEntry::NONE; WINDOWS];
        for entry in &mut entries {
            for field in FIELDS {
                *field(entry) = word();
            }
            (entry.start, entry.length, entry.parts) = (entry.start % N as u32, entry.length % N as u32, 1);
        }
        WindowMemory {
            entries,
            ring: core::array::from_fn(|_| word() as u8),
        }
    }

    fn given(state: &mut u64, boot: u32, strike: u32) -> PutWindow {
        let parts = 1 + random(state) % 6;
        let part = |state: &mut u64| {
            let kind = random(state) as u8;
            let length = random(state) % 60;
            (kind, (0..length).map(|_| random(state) as u8).collect())
        };
        PutWindow {
            boot,
            strike,
            parts: (0..parts).map(|_| part(state)).collect(),
        }
    }

    /// Fills a window and does not close it.
    fn put(windows: &mut Windows<'_, N>, given: &PutWindow) {
        windows.open(given.boot, given.strike);
        for (kind, bytes) in &given.parts {
            windows.append(*kind, bytes);
        }
    }

    fn keep(windows: &mut Windows<'_, N>, given: &PutWindow) {
        put(windows, given);
        windows.close();
        while windows.seal() {}
    }

    /// A window of parts of these lengths.
    fn of(strike: u32, lengths: &[usize]) -> PutWindow {
        let part = |(n, &length): (usize, &usize)| (n as u8, std::vec![strike as u8; length]);
        PutWindow {
            boot: 0,
            strike,
            parts: lengths.iter().enumerate().map(part).collect(),
        }
    }

    fn all(windows: &Windows<'_, N>) -> Vec<PutWindow> {
        let kept = (0..).map_while(|number| windows.kept(number));
        kept.map(|kept| {
            let mut cursor = windows.find(kept.boot, kept.strike).unwrap();
            let (mut parts, mut room) = (Vec::new(), [0; 64]);
            while let Some(part) = windows.read(&mut cursor, &mut room).unwrap() {
                assert_eq!((usize::from(part.number), part.of), (parts.len(), kept.parts));
                parts.push((part.kind, room[..part.length].to_vec()));
            }
            assert_eq!(parts.len(), usize::from(kept.parts));
            PutWindow {
                boot: kept.boot,
                strike: kept.strike,
                parts,
            }
        })
        .collect()
    }

    /// Bytes that a window takes.
    fn size(given: &PutWindow) -> usize {
        let parts = given.parts.iter();
        parts
            .map(|(_, bytes)| HEAD + bytes.len().next_multiple_of(4))
            .sum()
    }

    #[test]
    fn the_newest_windows_are_kept_whole_over_resets_and_the_oldest_give_way() {
        let state = &mut 1;
        let mut memory = memory(state);
        let mut expected: Vec<PutWindow> = Vec::new();
        let mut most = 0;
        const BOOTS: u32 = if cfg!(miri) { 4 } else { 300 };
        for boot in 0..BOOTS {
            let mut windows = Windows::new(&mut memory, boot > 0);
            assert_eq!(all(&windows), expected, "boot {boot}");
            for strike in 0..random(state) as u32 % 40 {
                let new = given(state, boot, strike);
                if random(state).is_multiple_of(8) {
                    put(&mut windows, &new); // it is cut, and never closed
                    assert!(windows.is_open(boot, strike));
                    continue;
                }
                keep(&mut windows, &new);
                assert_eq!(all(&windows).last(), Some(&new));
                expected.push(new);
            }
            // The memory keeps the newest of all windows.
            let kept = all(&windows);
            let gone = expected.len() - kept.len();
            expected.drain(..gone);
            assert_eq!(kept, expected, "boot {boot}");
            most = most.max(kept.len());
            // The free space is smaller than the window that displaced the oldest, or the directory is full.
            let bytes: usize = kept.iter().map(size).sum();
            let is_full = kept.len() == WINDOWS || bytes + 2 * 6 * 64 > N;
            assert!(gone == 0 || is_full, "{bytes} bytes");
        }
        assert!(most > 15, "{most}");
    }

    #[test]
    fn of_a_memory_after_power_up_nothing_is_believed_nor_after_a_short_loss_of_power() {
        for seed in 0..if cfg!(miri) { 2 } else { 50_u64 } {
            let mut memory = memory(&mut { seed });
            assert!(all(&Windows::new(&mut memory, true)).is_empty());
        }
        let mut memory = memory(&mut 3);
        keep(&mut Windows::new(&mut memory, false), &of(0, &[20]));
        for (survived, kept) in [(true, 1), (false, 0), (true, 0)] {
            assert_eq!(all(&Windows::new(&mut memory, survived)).len(), kept);
        }
    }

    #[test]
    fn a_flipped_bit_costs_the_window_that_it_is_in_and_no_other() {
        let state = &mut 5;
        let mut memory = memory(state);
        let mut windows = Windows::new(&mut memory, false);
        (0..40).for_each(|strike| keep(&mut windows, &given(state, 1, strike)));
        let kept = all(&windows);
        assert!(kept.len() > 8);
        let mut lost = 0;
        for place in (0..N).step_by(if cfg!(miri) { 1777 } else { 7 }) {
            let mut copy = WindowMemory { ..memory };
            copy.ring[place] ^= 1 << (random(state) % 8);
            let mut windows = Windows::new(&mut copy, true);
            let left = all(&windows);
            assert!(left.iter().all(|window| kept.contains(window)));
            assert!(left.len() + 1 >= kept.len(), "{place}: {}", left.len());
            lost += kept.len() - left.len();
            // It goes on as before.
            let next = given(state, 2, 0);
            keep(&mut windows, &next);
            assert_eq!(all(&windows).last(), Some(&next));
        }
        assert!(lost > 100 || cfg!(miri), "{lost}");
    }

    #[test]
    fn a_window_that_gives_way_while_it_is_read_says_so() {
        let mut memory = memory(&mut 7);
        let mut windows = Windows::new(&mut memory, false);
        put(&mut windows, &of(0, &[50; 10]));
        assert!(windows.find(0, 0).is_none(), "it is not complete");
        windows.close();
        let (mut cursor, mut room) = (windows.find(0, 0).unwrap(), [0; 64]);
        assert!(windows.read(&mut cursor, &mut room).unwrap().is_some());
        (1..4).for_each(|strike| keep(&mut windows, &of(strike, &[50; 10])));
        assert_eq!(windows.read(&mut cursor, &mut room), Err(GaveWay));
        assert!(windows.find(0, 0).is_none());
    }

    #[test]
    fn a_window_that_gives_way_while_it_is_sealed_leaves_the_seal_to_those_behind_it() {
        let mut memory = memory(&mut 9);
        let mut windows = Windows::new(&mut memory, false);
        put(&mut windows, &of(0, &[60; 16]));
        windows.close();
        assert!(windows.seal() && windows.seal());
        let newer = [of(1, &[60; 24]), of(2, &[60; 8])];
        newer.iter().for_each(|new| keep(&mut windows, new));
        assert_eq!(all(&windows), newer);
        assert_eq!(all(&Windows::new(&mut memory, true)), newer);
    }

    #[test]
    fn of_many_small_windows_as_many_are_kept_as_the_directory_has_entries() {
        let mut memory = memory(&mut 11);
        let mut windows = Windows::new(&mut memory, false);
        let given: Vec<_> = (0..3 * WINDOWS as u32 + 5).map(|n| of(n, &[4])).collect();
        for (n, new) in given.iter().enumerate() {
            keep(&mut windows, new);
            if !cfg!(miri) || n.is_multiple_of(25) {
                assert_eq!(all(&windows), given[(n + 1).saturating_sub(WINDOWS)..=n]);
            }
        }
        let newest = &given[given.len() - WINDOWS..];
        assert_eq!(all(&Windows::new(&mut memory, true)), newest);
    }

    #[test]
    fn a_window_that_fills_the_whole_memory_is_kept_and_one_of_a_word_more_is_not() {
        let mut memory = memory(&mut 13);
        let mut windows = Windows::new(&mut memory, false);
        keep(&mut windows, &of(0, &[20]));
        let whole = of(1, &[60; N / 64]);
        assert_eq!(size(&whole), N);
        keep(&mut windows, &whole);
        assert_eq!(all(&windows), std::slice::from_ref(&whole));
        assert_eq!(all(&Windows::new(&mut memory, true)), [whole]);
        let mut windows = Windows::new(&mut memory, true);
        let mut lengths = [60; N / 64];
        lengths[0] = 61;
        keep(&mut windows, &of(2, &lengths));
        assert!(all(&windows).is_empty());
        keep(&mut windows, &of(3, &[20]));
        assert_eq!(all(&windows), [of(3, &[20])]);
    }

    #[test]
    fn a_window_is_filled_from_its_opening_until_it_is_closed_or_given_up() {
        let mut memory = memory(&mut 17);
        let mut windows = Windows::new(&mut memory, false);
        assert!(!windows.is_filling() && !windows.is_open(0, 0));
        keep(&mut windows, &of(0, &[8]));
        assert!(!windows.is_filling() && !windows.is_open(0, 0));
        windows.open(3, 5);
        assert!(windows.is_filling() && windows.is_open(3, 5));
        assert!(!windows.is_open(3, 4) && !windows.is_open(2, 5));
        windows.append(1, &[7; 30]);
        windows.abandon();
        assert!(!windows.is_filling() && !windows.is_open(3, 5));
        windows.append(1, &[7; 30]);
        windows.close();
        // A window without parts is not kept either; any number of them takes no room.
        for strike in 0..2 * WINDOWS as u32 {
            windows.open(4, strike);
            windows.close();
        }
        assert_eq!(all(&windows), [of(0, &[8])]);
    }

    /// The fields of an entry.
    const FIELDS: [fn(&mut WindowEntry) -> &mut u32; 8] = [
        |entry| &mut entry.serial,
        |entry| &mut entry.boot,
        |entry| &mut entry.strike,
        |entry| &mut entry.start,
        |entry| &mut entry.length,
        |entry| &mut entry.parts,
        |entry| &mut entry.contents,
        |entry| &mut entry.crc,
    ];

    #[test]
    fn an_entry_of_which_a_bit_has_changed_is_not_believed_whichever_it_is() {
        let mut memory = memory(&mut 19);
        let mut windows = Windows::new(&mut memory, false);
        (1..4).for_each(|strike| keep(&mut windows, &of(strike, &[20])));
        for field in FIELDS {
            for bit in (0..32).step_by(if cfg!(miri) { 31 } else { 1 }) {
                let mut copy = WindowMemory { ..memory };
                *field(&mut copy.entries[1]) ^= 1 << bit;
                let windows = Windows::new(&mut copy, true);
                assert_eq!(all(&windows), [of(1, &[20]), of(3, &[20])]);
                assert!(windows.find(0, 0).is_none(), "what is left of it has no number");
            }
        }
    }

    /// Another image, with a memory of another size, may leave such an entry.
    #[test]
    fn an_entry_with_a_right_checksum_that_does_not_fit_the_memory_is_not_believed() {
        let mut memory = memory(&mut 21);
        keep(&mut Windows::new(&mut memory, false), &of(0, &[20]));
        let sound = memory.entries[0];
        assert!((sound.start, sound.length) == (0, 24));
        let most = N as u32;
        // Field, value, and whether it is one that a memory of this size can have.
        for (field, value, fits) in [
            (0, 32, true),
            (0, 1, false),
            (0, 33, false),
            (0, u32::MAX, false),
            (3, 4, true),
            (3, most - 4, true),
            (3, 2, false),
            (3, most, false),
            (3, most + 4, false),
            (4, 8, true),
            (4, most, true),
            (4, 0, false),
            (4, most + 1, false),
            (5, 255, true),
            (5, 0, false),
            (5, 256, false),
        ] {
            let slot = if value == u32::MAX { WINDOWS - 1 } else { 0 };
            let mut entry = sound;
            *FIELDS[field](&mut entry) = value;
            // The bytes are right too, as far as there are any.
            let bytes = memory.ring.iter().cycle().skip(entry.start as usize);
            let bytes: Vec<u8> = bytes.take(entry.length as usize).copied().collect();
            entry.contents = checksum(&bytes);
            entry.crc = entry.checksum();
            let mut copy = WindowMemory {
                entries: [WindowEntry::NONE; WINDOWS],
                ..memory
            };
            copy.entries[slot] = entry;
            let windows = Windows::new(&mut copy, true);
            assert_eq!(windows.kept(0).is_some(), fits, "field {field} is {value}");
        }
    }
}
