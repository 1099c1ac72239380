//! DMA1 and DMA2 (RM0090 section 10): eight streams each, one item for each request.
//!
//! # Design
//!
//! The model holds counters, flags and rules. It moves no data. Its owner asks for the next [`Beat`] of a
//! stream, moves those bytes, and reports back. A beat is one item of the peripheral's size. Where the FIFO
//! packs unequal sizes, the same bytes end up in memory, in fewer accesses. Priorities, bursts and the FIFO's
//! delay are not modelled: a request is served when it is made.

use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};
use crate::memory::CCM;

const EN: u32 = 1 << 0;
const INTERRUPT_ENABLES: u32 = 0b1_1110;
const HTIE: u32 = 1 << 3;
const TCIE: u32 = 1 << 4;
const CIRC: u32 = 1 << 8;
const PINC: u32 = 1 << 9;
const MINC: u32 = 1 << 10;
/// SxFCR: direct mode is off.
const DMDIS: u32 = 1 << 2;
const DBM: u32 = 1 << 18;
const CT: u32 = 1 << 19;

const FEIF: u32 = 1 << 0;
const TEIF: u32 = 1 << 3;
const HTIF: u32 = 1 << 4;
const TCIF: u32 = 1 << 5;
/// Where a stream's six flags start in LISR (streams 0-3) and HISR (4-7), section 10.5.1.
const FLAGS_AT: [u32; 4] = [0, 6, 16, 22];

const FLOW_CONTROLLER: &str = "SxCR.PFCTRL: the peripheral as flow controller is not modelled";
const OFFSET: &str = "SxCR.PINCOS: an offset of 4 bytes for smaller items is not modelled";
/// Section 2.3: this memory is on the processor's bus only.
const OUT_OF_REACH: &str =
    "SxPAR, SxMxAR: the DMA does not reach the core-coupled memory: a transfer there ends in an error";
/// Sections 10.3.6 and 10.3.8.
const NO_COPIES: &str =
    "SxCR.DIR: DMA1 cannot copy between memories (section 10.3.6): the stream was not started";
const CIRCULAR_COPY: &str =
    "SxCR: a copy between memories cannot be circular (section 10.3.8): the stream was not started";

pub(crate) const STREAMS: usize = 8;

/// Which way a stream moves data (SxCR.DIR).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    /// From the peripheral port to the memory port.
    ToMemory,
    /// From the memory port to the peripheral port.
    ToPeripheral,
    /// From the peripheral port to the memory port, without requests (DMA2 only).
    MemoryToMemory,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Beat {
    pub(crate) peripheral: u32,
    pub(crate) memory: u32,
    /// 1, 2 or 4.
    pub(crate) bytes: u32,
    pub(crate) direction: Direction,
}

/// Part of a transfer that a beat completed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BeatProgress {
    /// True if the beat completed a part of the buffer that the stream interrupts for: HTIF was set with
    /// HTIE, or TCIF with TCIE.
    pub(crate) block: bool,
    pub(crate) ended: bool,
}

impl BeatProgress {
    pub(crate) const STOPPED: Self = Self {
        block: false,
        ended: true,
    };
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct StreamRegisters {
    cr: u32,
    ndtr: u32,
    par: u32,
    memory: [u32; 2],
    fcr: u32,
    /// Items in a whole pass: NDTR when the stream was enabled.
    total: u32,
    flags: u32,
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Dma {
    /// DMA1 is 0.
    number: usize,
    streams: [StreamRegisters; STREAMS],
    /// For each stream, the channels whose request only other parts have, a bit for each.
    pub(crate) foreign: [u8; STREAMS],
    /// Streams that were just enabled, a bit for each. Cleared once they are noted.
    pub(crate) started: u32,
    pub(crate) notes: Notes,
}

impl Dma {
    /// After reset: DMA1 is 0, DMA2 is 1.
    pub(crate) fn new(number: usize) -> Self {
        let mut dma = Self {
            number,
            ..Self::default()
        };
        dma.streams.iter_mut().for_each(|stream| stream.fcr = 0x21);
        dma
    }

    /// The channel whose requests a stream listens to, if it is enabled and needs requests.
    pub(crate) fn listens_to(&self, stream: usize) -> Option<u32> {
        let s = &self.streams[stream];
        let listens = s.running() && s.direction() != Direction::MemoryToMemory;
        listens.then(|| field(s.cr, 25, 3))
    }

    /// The stream that serves a request: the first of these that is enabled and listens to its channel. The
    /// pairs of stream and channel are from the request mapping (tables 42 and 43).
    pub(crate) fn serving(&self, mapping: &[(usize, u32)]) -> Option<usize> {
        let listens = |(stream, channel): &&(usize, u32)| {
            let s = &self.streams[*stream];
            s.running() && field(s.cr, 25, 3) == *channel && self.foreign[*stream] >> channel & 1 == 0
        };
        mapping.iter().find(listens).map(|(stream, _)| *stream)
    }

    /// Returns `true` if a stream is not stopped.
    pub(crate) fn runs(&self) -> bool {
        self.streams.iter().any(StreamRegisters::running)
    }

    /// Returns the next beat of the stream, `None` if the stream is stopped.
    pub(crate) fn beat(&self, stream: usize) -> Option<Beat> {
        let s = &self.streams[stream];
        if !s.running() {
            return None;
        }
        let bytes = 1 << field(s.cr, 11, 2).min(2);
        let offset = (s.total - s.ndtr) * bytes;
        let step = |increments: u32| if s.cr & increments != 0 { offset } else { 0 };
        Some(Beat {
            peripheral: s.par.wrapping_add(step(PINC)),
            memory: s.memory[s.target()].wrapping_add(step(MINC)),
            bytes,
            direction: s.direction(),
        })
    }

    pub(crate) fn moved(&mut self, stream: usize) -> BeatProgress {
        let s = &mut self.streams[stream];
        let Some(left) = s.ndtr.checked_sub(1) else {
            // The beat itself has reset this controller, by a write to RCC.
            return BeatProgress::STOPPED;
        };
        let half_before = 2 * (s.total - s.ndtr) >= s.total;
        s.ndtr = left;
        let half = !half_before && 2 * (s.total - s.ndtr) >= s.total;
        let full = s.ndtr == 0;
        if half {
            s.flags |= HTIF;
        }
        if full {
            s.flags |= TCIF;
            if s.cr & DBM != 0 {
                s.cr ^= CT;
                s.ndtr = s.total;
            } else if s.cr & CIRC != 0 {
                s.ndtr = s.total;
            } else {
                s.cr &= !EN;
            }
        }
        BeatProgress {
            block: half && s.cr & HTIE != 0 || full && s.cr & TCIE != 0,
            ended: s.cr & EN == 0,
        }
    }

    /// The beat met a bus error: the stream stops (section 10.3.18).
    pub(crate) fn failed(&mut self, stream: usize) {
        let s = &mut self.streams[stream];
        s.flags |= TEIF;
        s.cr &= !EN;
    }

    /// Items that are left of the stream's pass.
    pub(crate) fn items_left(&self, stream: usize) -> u32 {
        self.streams[stream].ndtr
    }

    /// Number of beats until the stream's line rises. `None` if its interrupts are off or the line is up.
    pub(crate) fn beats_to_interrupt(&self, stream: usize) -> Option<u32> {
        let s = &self.streams[stream];
        if !s.running() || self.interrupt(stream) {
            return None;
        }
        let done = s.total - s.ndtr;
        let half = s.total.div_ceil(2);
        let to_half = if done < half { half - done } else { s.ndtr + half };
        let half = (s.cr & HTIE != 0).then_some(to_half);
        let full = (s.cr & TCIE != 0).then_some(s.ndtr);
        half.into_iter().chain(full).min()
    }

    /// Returns the controller after a write, `None` if the write fails or would leave a note.
    pub(crate) fn written(&self, offset: u32, value: u32, now: u64) -> Option<Self> {
        let mut after = self.clone();
        after.write(offset, value, now).ok()?;
        (after.notes == self.notes).then_some(after)
    }

    fn status(&self, first: usize) -> u32 {
        (0..4).fold(0, |word, i| word | self.streams[first + i].flags << FLAGS_AT[i])
    }

    fn clear(&mut self, first: usize, value: u32) {
        for (i, at) in FLAGS_AT.iter().enumerate() {
            self.streams[first + i].flags &= !(value >> at);
        }
    }

    fn write_stream(&mut self, stream: usize, register: u32, value: u32) {
        let s = &mut self.streams[stream];
        let enabled = s.cr & EN != 0;
        let is_address = matches!(register, 0x08..=0x10);
        self.notes
            .note_if(is_address && CCM.contains(&value), OUT_OF_REACH);
        match register {
            0x00 => {
                self.notes.note_if(bit(value, 5), FLOW_CONTROLLER);
                self.notes.note_if(value & PINC != 0 && bit(value, 15), OFFSET);
                if s.write_cr(value & 0x0fef_ffff) {
                    self.start(stream);
                }
            }
            // The settings are protected while the stream runs (sections 10.5.5 to 10.5.10).
            0x04 if !enabled => s.ndtr = value & 0xffff,
            0x08 if !enabled => s.par = value,
            0x0c if !enabled || (s.cr & DBM != 0 && s.target() == 1) => s.memory[0] = value,
            0x10 if !enabled || (s.cr & DBM != 0 && s.target() == 0) => s.memory[1] = value,
            0x14 if !enabled => s.fcr = value & 0x87,
            // FEIE is not protected.
            0x14 => s.fcr = (s.fcr & 0x7) | (value & 0x80),
            _ => self
                .notes
                .note("a stream's setting was written while it runs: ignored"),
        }
    }

    fn start(&mut self, stream: usize) {
        self.started |= 1 << stream;
        let s = &mut self.streams[stream];
        let copies = s.direction() == Direction::MemoryToMemory;
        if copies {
            // Section 10.5.10: the hardware leaves direct mode by itself.
            s.fcr |= DMDIS;
        }
        if copies && (self.number == 0 || s.cr & (CIRC | DBM) != 0) {
            s.cr &= !EN;
            let by_dma1 = self.number == 0;
            self.notes.note(if by_dma1 { NO_COPIES } else { CIRCULAR_COPY });
        } else if s.fcr & DMDIS == 0 {
            // Section 10.5.5: in direct mode both sides have the peripheral's size, and single transfers.
            s.cr = (s.cr & !(0b11 << 13 | 0b1111 << 21)) | field(s.cr, 11, 2) << 13;
        } else if !s.burst_fits() {
            // Section 10.3.12: the stream is disabled with the FIFO error flag.
            s.flags |= FEIF;
            s.cr &= !EN;
        }
    }
}

impl StreamRegisters {
    /// Table 49: the threshold is a whole number of bursts of the memory port. In circular mode and others a
    /// single transfer always fits.
    fn burst_fits(&self) -> bool {
        let beats = [1, 4, 8, 16][field(self.cr, 23, 2) as usize];
        let bytes = beats << field(self.cr, 13, 2).min(2);
        let threshold = 4 * (field(self.fcr, 0, 2) + 1);
        beats == 1 || threshold.is_multiple_of(bytes)
    }

    fn running(&self) -> bool {
        self.cr & EN != 0 && self.ndtr > 0
    }

    fn direction(&self) -> Direction {
        match field(self.cr, 6, 2) {
            0b00 => Direction::ToMemory,
            0b01 => Direction::ToPeripheral,
            _ => Direction::MemoryToMemory,
        }
    }

    fn target(&self) -> usize {
        usize::from(self.cr & DBM != 0 && self.cr & CT != 0)
    }

    /// Writes CR, and returns `true` if this started the stream.
    fn write_cr(&mut self, value: u32) -> bool {
        let was_enabled = self.cr & EN != 0;
        if !was_enabled {
            self.cr = value;
            self.total = self.ndtr;
            return value & EN != 0;
        }
        self.cr = (self.cr & !(INTERRUPT_ENABLES | EN)) | (value & (INTERRUPT_ENABLES | EN));
        if value & EN == 0 {
            // A stream that software stops sets its completion flag (section 10.3.17).
            self.flags |= TCIF;
        }
        false
    }
}

impl Peripheral for Dma {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.status(0),
            0x04 => self.status(4),
            // The clear registers read as 0.
            0x08 | 0x0c => 0,
            0x10..=0xcc if offset.is_multiple_of(4) => {
                let s = &self.streams[(offset as usize - 0x10) / 0x18];
                match (offset - 0x10) % 0x18 {
                    0x00 => s.cr,
                    0x04 => s.ndtr,
                    0x08 => s.par,
                    0x0c => s.memory[0],
                    0x10 => s.memory[1],
                    // FS: the FIFO is empty.
                    _ => (s.fcr & !0x38) | 0x20,
                }
            }
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, _offset: u32, _now: u64) -> Option<u64> {
        Some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 | 0x04 => {}
            0x08 => self.clear(0, value),
            0x0c => self.clear(4, value),
            0x10..=0xcc if offset.is_multiple_of(4) => {
                let stream = (offset as usize - 0x10) / 0x18;
                self.write_stream(stream, (offset - 0x10) % 0x18, value);
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        let old = std::mem::replace(self, Self::new(self.number));
        (self.notes, self.foreign) = (old.notes, old.foreign);
    }

    fn interrupt(&self, stream: usize) -> bool {
        let s = &self.streams[stream];
        // DMEIE, TEIE, HTIE and TCIE have the order of their flags, one bit lower. FEIE is in FCR.
        s.flags & ((s.cr & INTERRUPT_ENABLES) << 1) != 0 || (bit(s.fcr, 7) && bit(s.flags, 0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const HALFWORDS: u32 = 0b01 << 11 | 0b01 << 13;

    const fn stream(n: u32, register: u32) -> u32 {
        0x10 + 0x18 * n + register
    }

    const CR: u32 = stream(0, 0x00);
    const NDTR: u32 = stream(0, 0x04);
    const M0AR: u32 = stream(0, 0x0c);
    const M1AR: u32 = stream(0, 0x10);

    /// Stream `n`, `items` from the ADC's DR to 0x2000_0000.
    fn started(n: u32, items: u32, cr: u32) -> Dma {
        let mut dma = Dma::new(1);
        let cr = HALFWORDS | MINC | cr;
        dma.put(0, [(stream(n, 0x04), items), (stream(n, 0x08), 0x4001_204c)]);
        dma.put(0, [(stream(n, 0x0c), 0x2000_0000), (stream(n, 0), cr)]);
        dma.put(0, [(stream(n, 0), cr | EN)]);
        dma
    }

    fn move_beats(dma: &mut Dma, beats: usize) {
        for _ in 0..beats {
            dma.moved(0);
        }
    }

    #[test]
    fn a_beat_that_resets_its_own_controller_ends_the_stream() {
        let mut dma = started(0, 4, TCIE);
        dma.reset(0);
        let progress = dma.moved(0);
        assert!(progress.ended && !progress.block);
        assert_eq!(dma.get(NDTR, 0), 0);
    }

    #[test]
    fn a_plain_stream_flags_half_and_full_and_stops() {
        for (enabled, [half, full]) in [(0, [false; 2]), (TCIE, [false, true]), (HTIE | TCIE, [true; 2])] {
            let mut dma = started(0, 4, enabled);
            let progress = [(); 4].map(|()| dma.moved(0)).map(|p| (p.block, p.ended));
            let plain = (false, false);
            assert_eq!(progress, [plain, (half, false), plain, (full, true)]);
            assert_eq!(dma.get(0x00, 0), HTIF | TCIF);
            assert_eq!((dma.get(CR, 0) & EN, dma.beat(0)), (0, None));
        }
    }

    #[test]
    fn double_buffer_mode_swaps_targets_at_the_end_of_each() {
        let mut dma = Dma::new(1);
        dma.put(0, [(NDTR, 1), (M0AR, 0x2000_0000), (M1AR, 0x2000_1000)]);
        dma.put(0, [(CR, DBM | CIRC | EN)]);
        let targets = [(); 3].map(|()| {
            let memory = dma.beat(0).unwrap().memory;
            dma.moved(0);
            memory
        });
        assert_eq!(targets, [0x2000_0000, 0x2000_1000, 0x2000_0000]);
    }

    #[test]
    fn flags_stand_where_the_manual_has_them_and_are_cleared_there() {
        let places = [
            (0, 0, 0),
            (1, 0, 6),
            (2, 0, 16),
            (3, 0, 22),
            (4, 4, 0),
            (7, 4, 22),
        ];
        for (n, register, at) in places {
            let mut dma = started(n, 1, 0);
            dma.moved(n as usize);
            assert_eq!(dma.get(register, 0), (HTIF | TCIF) << at, "stream {n}");
            dma.put(0, [(0x08 + register, HTIF << at)]);
            assert_eq!(dma.get(register, 0), TCIF << at, "stream {n}");
        }
    }

    #[test]
    fn the_line_follows_enabled_flags_and_its_rise_is_foretold() {
        let mut dma = started(0, 8, CIRC | HTIE | TCIE);
        assert_eq!(dma.beats_to_interrupt(0), Some(4));
        move_beats(&mut dma, 3);
        assert!(!dma.interrupt(0));
        move_beats(&mut dma, 1);
        assert!(dma.interrupt(0));
        assert_eq!(dma.beats_to_interrupt(0), None, "the line is up already");
        dma.put(0, [(0x08, HTIF)]);
        assert_eq!(dma.beats_to_interrupt(0), Some(4));
        assert_eq!(started(0, 8, CIRC | TCIE).beats_to_interrupt(0), Some(8));
        assert_eq!(started(0, 8, CIRC).beats_to_interrupt(0), None);
        let mut dma = started(0, 8, CIRC | HTIE);
        move_beats(&mut dma, 6);
        dma.put(0, [(0x08, HTIF)]);
        assert_eq!(dma.beats_to_interrupt(0), Some(6), "the half of the next pass");
    }

    #[test]
    fn stopping_by_software_sets_the_completion_flag_and_keeps_what_is_left() {
        let mut dma = started(0, 8, CIRC);
        dma.moved(0);
        dma.put(0, [(CR, HALFWORDS | MINC | CIRC)]);
        assert_eq!((dma.get(0x00, 0), dma.get(NDTR, 0)), (TCIF, 7));
    }

    #[test]
    fn a_running_stream_takes_no_new_setting_but_its_interrupt_enables() {
        let mut dma = started(0, 8, 0);
        dma.put(0, [(NDTR, 99), (M0AR, 0x2000_4000), (CR, EN | TCIE)]);
        let settings = [NDTR, M0AR, CR].map(|register| dma.get(register, 0));
        assert_eq!(settings, [8, 0x2000_0000, HALFWORDS | MINC | TCIE | EN]);
        assert_eq!(dma.notes.iter().count(), 1);
    }

    #[test]
    fn a_request_goes_to_the_enabled_stream_that_listens_to_its_channel() {
        let dma = started(4, 8, 3 << 25);
        assert_eq!(dma.serving(&[(0, 0), (4, 3)]), Some(4));
        assert_eq!(dma.serving(&[(0, 0), (4, 0)]), None);
        assert_eq!(started(0, 0, 0).serving(&[(0, 0)]), None, "NDTR 0 serves nothing");
    }
}
