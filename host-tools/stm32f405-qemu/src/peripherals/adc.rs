//! A converter: ADC1, ADC2 or ADC3 (RM0090 section 13): regular scans, by software or by a timer's trigger.
//!
//! # Design
//!
//! A scan is a start time and a number of ADC clock cycles. Each conversion takes its channel's sampling time
//! plus 12 cycles (fewer at lower resolution; section 13.6). The model says when the next conversion ends.
//! The owner of the model hands in the code at that time, and serves the DMA request.
//!
//! Where the manual leaves room, this is our reading. A trigger during a scan starts nothing and is counted.
//! Data that was not fetched is kept, and the new conversion is lost. With DMA on, an overrun also ends the
//! scan, withdraws the request and blocks triggers until OVR is cleared (section 13.8.1).

use std::ops::Range;

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{field, index};

const AWD: u32 = 1 << 0;
const EOC: u32 = 1 << 1;
const STRT: u32 = 1 << 4;
const OVR: u32 = 1 << 5;

const EOCIE: u32 = 1 << 5;
const SCAN: u32 = 1 << 8;
const OVRIE: u32 = 1 << 26;

const ADON: u32 = 1 << 0;
const CONT: u32 = 1 << 1;
const DMA: u32 = 1 << 8;
const DDS: u32 = 1 << 9;
const EOCS: u32 = 1 << 10;
const ALIGN: u32 = 1 << 11;
const SWSTART: u32 = 1 << 30;

/// CR2.EXTSEL of TIM2, TIM3 and TIM8 TRGO (section 13.13.3).
const TRIGGER_OUTPUTS: [u32; 3] = [0b0110, 0b1000, 0b1110];

/// Sampling time in ADC clock cycles, by SMPx (section 13.13.5).
const SAMPLING: [u32; 8] = [3, 15, 28, 56, 84, 112, 144, 480];

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 4] = [
    (0x04, 0x00c0_0040, "CR1: the analog watchdog is not modelled"),
    (0x04, 0x0800, "CR1.DISCEN: discontinuous mode is not modelled"),
    (0x04, 0x1480, "CR1: injected conversions are not modelled"),
    (0x08, 0x0070_0000, "CR2: injected conversions are not modelled"),
];

#[derive(Debug, Clone, Copy)]
struct ScanProgress {
    started_ns: u64,
    rank: u32,
    /// ADC clock cycles from the start to the end of the conversion at `rank`.
    cycles: u32,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Adc {
    pclk2: u32,
    pub(super) sr: u32,
    cr1: u32,
    cr2: u32,
    smpr: [u32; 2],
    jofr: [u32; 4],
    thresholds: [u32; 2],
    sqr: [u32; 3],
    jsqr: u32,
    dr: u32,
    /// True if ADON was ever set.
    pub(crate) has_been_on: bool,
    /// Divider of PCLK2 (CCR.ADCPRE, section 13.13.16).
    pub(crate) divider: u32,
    scan: Option<ScanProgress>,
    /// True if SWSTART starts a scan while EXTEN selects a trigger.
    pub(crate) software_scan_under_trigger: bool,
    /// True if a scan is to start without a trigger, as soon as the converter waits for one.
    extra: bool,
    /// True if the converter misses the next trigger.
    pub(crate) misses: bool,
    /// A scan has started. Cleared once it is passed on.
    pub(crate) scan_started: bool,
    /// DR holds data that was not read yet.
    unread: bool,
    /// True while a DMA request is pending.
    pub(crate) request: bool,
    /// True after the DMA's last transfer while DDS was clear: no more requests until DMA is set again.
    requests_ended: bool,
    pub(crate) overruns: u64,
    /// Triggers that started nothing.
    pub(crate) triggers_ignored: u64,
    pub(crate) notes: Notes,
}

impl Adc {
    pub(crate) fn new(pclk2: u32) -> Self {
        Self {
            pclk2,
            divider: 2,
            thresholds: [0xfff, 0],
            software_scan_under_trigger: true,
            ..Self::default()
        }
    }

    /// External trigger of regular scans: CR2.EXTSEL (section 13.13.3). `None` if no trigger starts them.
    pub(crate) fn external_trigger(&self) -> Option<u32> {
        let listens = self.cr2 & ADON != 0 && field(self.cr2, 28, 2) != 0;
        listens.then(|| field(self.cr2, 24, 4))
    }

    /// Returns `true` if a scan is under way or could be started from outside.
    pub(crate) fn is_in_use(&self) -> bool {
        self.scan.is_some() || self.external_trigger().is_some()
    }

    pub(crate) fn trigger(&mut self, now: u64) {
        let waits = self.external_trigger().is_some();
        if waits && std::mem::take(&mut self.misses) || self.scan.is_some() || self.blocked() {
            self.triggers_ignored += 1;
        } else {
            self.start(now);
        }
    }

    /// Starts a scan without a trigger: now, or once the converter waits for one and no scan runs.
    pub(crate) fn start_extra(&mut self, now: u64) {
        self.extra = true;
        self.start_if_extra(now);
    }

    fn start_if_extra(&mut self, now: u64) {
        if self.extra && self.external_trigger().is_some() && self.scan.is_none() && !self.blocked() {
            self.extra = false;
            self.start(now);
        }
    }

    /// Returns `true` after an overrun under DMA: no conversion until OVR is cleared.
    pub(crate) fn blocked(&self) -> bool {
        self.sr & OVR != 0 && self.cr2 & DMA != 0
    }

    fn start(&mut self, now: u64) {
        // DocID022152, ADC characteristics, at 2.4 V and above. A crystal may be off by less than 1/1000.
        let fast = self.pclk2 / self.divider.max(1) > 36_036_000;
        self.notes.note_if(fast, "the converter's clock is above 36 MHz");
        self.sr |= STRT;
        self.scan_started = true;
        self.scan = Some(ScanProgress {
            started_ns: now,
            rank: 0,
            cycles: self.conversion_cycles(0),
        });
    }

    /// Conversions in a scan: SQR1.L + 1, or one without CR1.SCAN.
    pub(crate) fn scan_length(&self) -> u32 {
        let more = field(self.sqr[0], 20, 4);
        if self.cr1 & SCAN == 0 { 1 } else { more + 1 }
    }

    /// The channel at a rank (0 is the first): SQR3 holds ranks 1-6, SQR2 7-12, SQR1 13-16.
    fn channel_at(&self, rank: u32) -> u32 {
        field(self.sqr[2 - rank as usize / 6], 5 * (rank % 6), 5)
    }

    fn conversion_cycles(&self, rank: u32) -> u32 {
        let channel = self.channel_at(rank);
        let sampling = match channel {
            0..=9 => field(self.smpr[1], 3 * channel, 3),
            10..=18 => field(self.smpr[0], 3 * (channel - 10), 3),
            _ => 0,
        };
        SAMPLING[sampling as usize] + self.bits()
    }

    /// RES: 12, 10, 8 or 6 bits. A conversion takes one cycle for each.
    fn bits(&self) -> u32 {
        12 - 2 * field(self.cr1, 24, 2)
    }

    fn cycles_ns(&self, cycles: u64) -> u64 {
        clock::edge(cycles * u64::from(self.divider), self.pclk2)
    }

    pub(crate) fn next_conversion(&self) -> Option<u64> {
        let scan = self.scan?;
        Some(scan.started_ns.saturating_add(self.cycles_ns(scan.cycles.into())))
    }

    pub(crate) fn converting(&self) -> Option<u32> {
        self.scan.map(|s| self.channel_at(s.rank))
    }

    /// When the `n`-th conversion from now (1 is the next) ends: maybe too early, never too late. `trigger`
    /// returns the time of the `i`-th trigger from now (0 is the next).
    pub(crate) fn conversion(&self, n: u64, trigger: impl Fn(u64) -> Option<u64>) -> Option<u64> {
        debug_assert!(n > 0);
        let length = self.scan_length();
        let cycles = |ranks: Range<u32>| ranks.map(|r| u64::from(self.conversion_cycles(r))).sum::<u64>();
        let mut n = n - 1;
        if let Some(scan) = self.scan {
            let left = u64::from(length.saturating_sub(scan.rank)).max(1);
            if n < left {
                let more = cycles(scan.rank + 1..scan.rank + 1 + n as u32);
                let whole = self.cycles_ns(u64::from(scan.cycles) + more);
                return Some(scan.started_ns.saturating_add(whole));
            }
            n -= left;
            if self.cr2 & CONT != 0 {
                let rest = u64::from(scan.cycles) + cycles(scan.rank + 1..length);
                let whole = n / u64::from(length) * cycles(0..length);
                let part = cycles(0..(n % u64::from(length)) as u32 + 1);
                let ns = self.cycles_ns(rest + whole + part);
                return Some(scan.started_ns.saturating_add(ns));
            }
        }
        if self.blocked() {
            return None;
        }
        let start = trigger(n / u64::from(length))?;
        let scan = cycles(0..(n % u64::from(length)) as u32 + 1);
        Some(start.saturating_add(self.cycles_ns(scan)))
    }

    /// Ends the conversion under way. `code` is what it found, in 12 bits.
    pub(crate) fn finish(&mut self, code: u16, now: u64) {
        let Some(scan) = self.scan else { return };
        let lost = self.unread && self.cr2 & (DMA | EOCS) != 0;
        let last = scan.rank + 1 >= self.scan_length();
        if lost {
            self.overrun();
            if self.blocked() {
                return;
            }
        } else {
            let code = u32::from(code) >> (12 - self.bits());
            // Section 13.4: left alignment is within a halfword, or within a byte for 6 bits.
            let width = if self.bits() == 6 { 8 } else { 16 };
            let (left, shift) = (self.cr2 & ALIGN != 0, width - self.bits());
            self.dr = if left { code << shift } else { code };
            self.unread = true;
            self.request = self.requests_dma();
            if last || self.cr2 & EOCS != 0 {
                self.sr |= EOC;
            }
        }
        self.scan = (!last).then(|| {
            let rank = scan.rank + 1;
            ScanProgress {
                rank,
                cycles: scan.cycles + self.conversion_cycles(rank),
                ..scan
            }
        });
        if last && self.cr2 & CONT != 0 {
            self.start(now);
        }
    }

    /// A conversion is lost. Under DMA the scan is aborted and the request withdrawn.
    pub(crate) fn overrun(&mut self) {
        self.sr |= OVR;
        self.overruns += 1;
        if self.blocked() {
            self.scan = None;
            self.request = false;
        }
    }

    /// Returns `true` if each conversion makes a DMA request.
    pub(crate) fn requests_dma(&self) -> bool {
        self.cr2 & DMA != 0 && !self.requests_ended
    }

    /// DR is read, by the processor or the DMA: the data is fetched and EOC clears (section 13.13.1).
    pub(crate) fn take_data(&mut self) -> u32 {
        self.unread = false;
        self.request = false;
        self.sr &= !EOC;
        self.dr
    }

    /// The DMA stream made its last transfer. Without DDS no request follows (section 13.8.1).
    pub(crate) fn dma_ended(&mut self) {
        self.requests_ended = self.cr2 & DDS == 0;
    }

    /// Returns `true` if a conversion that no DMA fetches would raise the line: at its end by EOC, or at the
    /// end of the next one by OVR.
    pub(crate) fn interrupts_on_conversion(&self) -> bool {
        self.cr1 & (EOCIE | OVRIE) != 0 && !self.interrupt(0)
    }

    fn write_cr2(&mut self, value: u32, now: u64) {
        if value & DMA == 0 || self.cr2 & DMA == 0 {
            self.request = false;
            self.requests_ended = false;
        }
        self.cr2 = value & 0x3f7f_0f03;
        self.has_been_on |= value & ADON != 0;
        let other = self
            .external_trigger()
            .is_some_and(|extsel| !TRIGGER_OUTPUTS.contains(&extsel));
        self.notes
            .note_if(other, "CR2.EXTSEL: only TIM2, TIM3 and TIM8 TRGO are modelled");
        let may_start = field(self.cr2, 28, 2) == 0 || self.software_scan_under_trigger;
        if self.cr2 & ADON == 0 {
            self.scan = None;
        } else if value & SWSTART != 0 && may_start && self.scan.is_none() && !self.blocked() {
            self.start(now);
        }
        self.start_if_extra(now);
    }
}

impl Peripheral for Adc {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.sr,
            0x04 => self.cr1,
            0x08 => self.cr2,
            0x0c | 0x10 => self.smpr[index(offset, 0x0c)],
            0x14..=0x20 if offset.is_multiple_of(4) => self.jofr[index(offset, 0x14)],
            0x24 | 0x28 => self.thresholds[index(offset, 0x24)],
            0x2c | 0x30 | 0x34 => self.sqr[index(offset, 0x2c)],
            0x38 => self.jsqr,
            0x4c => self.take_data(),
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, _now: u64) -> Option<u64> {
        // Reading DR clears EOC.
        (offset != 0x4c).then_some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.notes.note_bits(&UNMODELLED, offset, value);
        match offset {
            // rc_w0.
            0x00 => self.sr &= value | !(AWD | EOC | STRT | OVR | 0b1100),
            0x04 => self.cr1 = value & 0x07c0_ffff,
            0x08 => self.write_cr2(value, now),
            0x0c => self.smpr[0] = value & 0x07ff_ffff,
            0x10 => self.smpr[1] = value & 0x3fff_ffff,
            0x14..=0x20 if offset.is_multiple_of(4) => self.jofr[index(offset, 0x14)] = value & 0xfff,
            0x24 | 0x28 => self.thresholds[index(offset, 0x24)] = value & 0xfff,
            0x2c => self.sqr[0] = value & 0x00ff_ffff,
            0x30 | 0x34 => self.sqr[index(offset, 0x2c)] = value & 0x3fff_ffff,
            0x38 => self.jsqr = value & 0x003f_ffff,
            0x4c => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// The counts go on.
    fn reset(&mut self, _now: u64) {
        let old = std::mem::replace(self, Self::new(self.pclk2));
        (self.overruns, self.triggers_ignored) = (old.overruns, old.triggers_ignored);
        (self.extra, self.misses) = (old.extra, old.misses);
        self.software_scan_under_trigger = old.software_scan_under_trigger;
        (self.divider, self.notes, self.has_been_on) = (old.divider, old.notes, old.has_been_on);
    }

    fn interrupt(&self, _output: usize) -> bool {
        (self.sr & EOC != 0 && self.cr1 & EOCIE != 0) || (self.sr & OVR != 0 && self.cr1 & OVRIE != 0)
    }

    fn set_clocks(&mut self, clocks: &ClockTree, _now: u64) {
        self.pclk2 = clocks.pclk2;
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const SR: u32 = 0x00;
    const CR1: u32 = 0x04;
    const CR2: u32 = 0x08;
    const SMPR2: u32 = 0x10;
    const SQR1: u32 = 0x2c;
    const SQR2: u32 = 0x30;
    const SQR3: u32 = 0x34;
    const DR: u32 = 0x4c;
    const BY_TIM3: u32 = 0b01 << 28 | 0b1000 << 24;

    /// Two channels, 0 then 1, at PCLK2/4 = 21 MHz with 56 + 12 cycles each: 3.238 µs a conversion.
    fn scanning(cr2: u32) -> Adc {
        let mut adc = Adc::new(84_000_000);
        adc.divider = 4;
        adc.put(0, [(CR1, SCAN), (SMPR2, 0b011_011)]);
        adc.put(0, [(SQR1, 1 << 20), (SQR3, 1 << 5), (CR2, ADON | cr2)]);
        adc
    }

    #[test]
    fn a_conversion_takes_its_sampling_time_and_twelve_cycles() {
        let mut adc = scanning(BY_TIM3);
        adc.trigger(1_000);
        for (channel, cycles) in [(0, 68), (1, 136)] {
            assert_eq!(adc.converting(), Some(channel));
            let ends = 1_000 + clock::edge(cycles, 21_000_000);
            assert_eq!(adc.next_conversion(), Some(ends));
            adc.finish(100, ends);
        }
        let cycles = (0..8).map(|code| {
            adc.put(0, [(SMPR2, code)]);
            adc.conversion_cycles(0)
        });
        // Sampling times of RM0090 section 13.13.5, and twelve cycles.
        assert!(cycles.eq([15, 27, 40, 68, 96, 124, 156, 492]));
    }

    #[test]
    fn the_end_of_conversion_shows_after_the_scan_or_after_each_as_eocs_says_and_a_read_clears_it() {
        let mut adc = scanning(SWSTART);
        adc.finish(7, 1);
        assert_eq!(adc.get(SR, 0), STRT);
        adc.finish(8, 2);
        let read = [SR, DR, SR].map(|register| adc.get(register, 0));
        assert_eq!(read, [STRT | EOC, 8, STRT]);
        let mut adc = scanning(EOCS | SWSTART);
        adc.finish(7, 1);
        assert_eq!(adc.get(SR, 0), STRT | EOC);
    }

    #[test]
    fn the_trigger_source_is_what_extsel_names_while_the_adc_is_on() {
        assert_eq!(scanning(BY_TIM3).external_trigger(), Some(0b1000));
        assert_eq!(scanning(0b1000 << 24).external_trigger(), None, "EXTEN is 0");
        let mut adc = scanning(BY_TIM3);
        adc.put(0, [(CR2, BY_TIM3)]);
        assert_eq!(adc.external_trigger(), None, "ADON is 0");
        adc.put(0, [(CR2, SWSTART)]);
        assert_eq!(adc.next_conversion(), None, "nor by software");
    }

    #[test]
    fn requests_end_with_the_last_transfer_unless_dds() {
        for (dds, request) in [(0, false), (DDS, true)] {
            let mut adc = scanning(BY_TIM3 | DMA | dds);
            adc.trigger(0);
            adc.finish(1, 3_239);
            adc.take_data();
            adc.dma_ended();
            adc.finish(2, 6_477);
            assert_eq!(adc.request, request, "DDS {dds:#x}");
        }
    }

    #[test]
    fn the_time_of_a_later_conversion_counts_scans_and_triggers() {
        let mut adc = scanning(BY_TIM3);
        let trigger = |i: u64| Some(10_000 + 10_000 * i);
        let (first, second) = (clock::edge(68, 21_000_000), clock::edge(136, 21_000_000));
        assert_eq!(adc.conversion(1, trigger), Some(10_000 + first));
        assert_eq!(adc.conversion(4, trigger), Some(20_000 + second));
        adc.trigger(500);
        assert_eq!(adc.conversion(1, trigger), Some(500 + first));
        assert_eq!(adc.conversion(2, trigger), Some(500 + second));
        assert_eq!(adc.conversion(3, trigger), Some(10_000 + first));
        assert_eq!(adc.conversion(3, |_| None), None);
    }

    #[test]
    fn continuous_mode_starts_the_next_scan_where_the_last_ends() {
        let mut adc = scanning(CONT | SWSTART);
        let fifth = adc.conversion(5, |_| None).unwrap();
        for _ in 0..4 {
            let at = adc.next_conversion().unwrap();
            adc.finish(0, at);
        }
        let off = adc.next_conversion().unwrap().abs_diff(fifth);
        assert!(off <= 2, "rounded to ns once a scan");
    }

    #[test]
    fn without_scan_mode_only_the_first_rank_is_converted() {
        let mut adc = scanning(0);
        adc.put(0, [(CR1, 0), (CR2, ADON | SWSTART)]);
        adc.finish(5, 1);
        assert_eq!(adc.converting(), None);
    }

    #[test]
    fn ranks_above_six_come_from_sqr2_and_sqr1() {
        let mut adc = scanning(0);
        adc.put(0, [(SQR2, 9 << 5), (SQR1, 13 << 20 | 11 << 5)]);
        assert_eq!((adc.channel_at(7), adc.channel_at(13)), (9, 11));
    }

    #[test]
    fn lower_resolution_drops_low_bits_and_cycles_and_left_alignment_moves_up() {
        // Six bits are aligned to the left of a byte.
        for (resolution, align, cycles, data) in [
            (0b10, 0, 64, 0xab),
            (0b10, ALIGN, 64, 0xab00),
            (0b11, ALIGN, 62, 0b10_1010 << 2),
        ] {
            let mut adc = scanning(0);
            adc.put(0, [(CR1, SCAN | resolution << 24), (CR2, ADON | align | SWSTART)]);
            assert_eq!(adc.next_conversion(), Some(clock::edge(cycles, 21_000_000)));
            adc.finish(0xabc, 1);
            assert_eq!(adc.get(DR, 0), data);
        }
    }

    #[test]
    fn what_is_not_modelled_is_noted() {
        let mut adc = scanning(0);
        adc.put(0, [(CR2, ADON | 0b01 << 28), (CR1, 1 << 11)]);
        assert_eq!(adc.notes.iter().count(), 2);
        assert_eq!(adc.read(0x50, 0), Err(NoRegister));
        adc = Adc::new(84_000_000);
        adc.put(0, [(CR2, ADON | SWSTART)]);
        let notes: Vec<_> = adc.notes.iter().collect();
        assert_eq!(notes, ["the converter's clock is above 36 MHz"]);
    }
}
