//! A USART or UART (RM0090 section 30): asynchronous, both ways, at the baud rate that BRR gives.
//!
//! # Design
//!
//! The transmitter is a shift register with the time at which its frame ends, and one data register before
//! it. The receiver takes bytes from a queue, each in the time of a frame. The transmitter's idle frame after
//! TE is set is left out. A frame that comes over a wire at another baud rate is a framing error. Noise and
//! parity errors do not happen.

use std::collections::VecDeque;

use super::clock::{self, Apb, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{field, index};

const FE: u32 = 1 << 1;
const ORE: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;

const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const IDLEIE: u32 = 1 << 4;
const RXNEIE: u32 = 1 << 5;
const TCIE: u32 = 1 << 6;
const TXEIE: u32 = 1 << 7;
const PCE: u32 = 1 << 10;
const M: u32 = 1 << 12;
const UE: u32 = 1 << 13;
const OVER8: u32 = 1 << 15;

const EIE: u32 = 1 << 0;
const DMAR: u32 = 1 << 6;
const DMAT: u32 = 1 << 7;

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 3] = [
    (0x0c, 0b11, "CR1: break and mute mode are not modelled"),
    (0x10, 0x4800, "CR2: LIN and synchronous mode are not modelled"),
    (
        0x14,
        0x33e,
        "CR3: flow control, smartcard, IrDA and half duplex are not modelled",
    ),
];

/// Features of a USART: registers are masks of the bits that exist.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct UsartFeatures {
    apb: Apb,
    cr2: u32,
    cr3: u32,
    gtpr: u32,
}

impl UsartFeatures {
    /// USART1, USART6 on APB2.
    pub(crate) const USART: Self = Self {
        apb: Apb::Two,
        cr2: 0x7f6f,
        cr3: 0xfff,
        gtpr: 0xffff,
    };
    /// USART2, USART3.
    pub(crate) const USART_ON_APB1: Self = Self {
        apb: Apb::One,
        ..Self::USART
    };
    /// UART4, UART5: no clock, no flow control, no smartcard (section 30.5).
    pub(crate) const UART: Self = Self {
        apb: Apb::One,
        cr2: 0x706f,
        cr3: 0x8cf,
        gtpr: 0xff,
    };
}

/// A frame that has left a transmitter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SentFrame {
    /// Its 7, 8 or 9 data bits.
    pub(crate) data: u16,
    /// Time that it took without a stall, ns.
    pub(crate) frame_ns: u64,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Usart {
    features: UsartFeatures,
    pclk: u32,
    sr: u32,
    received: u32,
    brr: u32,
    cr: [u32; 3],
    gtpr: u32,
    waiting: Option<u16>,
    /// The frame in the shift register, and when it ends.
    shifting: Option<(SentFrame, u64)>,
    /// No frame ends before this time.
    stalled_until_ns: u64,
    /// Bytes on their way to the receiver, each with the earliest time at which it starts, ns.
    pub(crate) input: VecDeque<(u64, u8)>,
    /// When the last received frame ended.
    input_seen_ns: u64,
    /// When the receiver will call the line idle.
    idle_at: Option<u64>,
    /// The flags that were set when SR was read: an access to DR then clears them.
    armed: u32,
    /// Time that the DMA takes to fetch a received byte, ns.
    pub(crate) dma_latency_ns: u64,
    /// When the DMA will fetch the byte that was received. `None` once that time has come.
    pub(crate) fetch_at: Option<u64>,
    pub(crate) notes: Notes,
}

impl Usart {
    pub(crate) fn new(features: UsartFeatures, pclk: u32) -> Self {
        Self {
            features,
            pclk,
            sr: TXE | TC,
            ..Self::default()
        }
    }

    /// Queues bytes that the other side sends, from `at_ns` on and after all earlier ones.
    pub(crate) fn feed(&mut self, at_ns: u64, bytes: &[u8]) {
        self.input.extend(bytes.iter().map(|byte| (at_ns, *byte)));
    }

    /// When the DMA is about to fetch the byte that was received.
    pub(crate) fn next_fetch(&self) -> Option<u64> {
        self.fetch_at.filter(|_| self.cr[2] & DMAR != 0)
    }

    /// Drops what the other side has begun to send, as the receiver had no clock until now.
    pub(crate) fn missed(&mut self, now: u64) {
        self.input.retain(|(at_ns, _)| *at_ns >= now);
    }

    fn on(&self, part: u32) -> bool {
        self.cr[0] & UE != 0 && self.cr[0] & part != 0
    }

    /// Bus clocks in a bit (section 30.3.4): 16 or 8 times USARTDIV.
    fn bit_clocks(&self) -> u32 {
        let by_8 = (self.brr & 0xfff0) >> 1 | (self.brr & 7);
        if self.cr[0] & OVER8 == 0 { self.brr } else { by_8 }
    }

    /// Returns `true` if BRR is below its least value (section 30.3.4): USARTDIV is 1 at least.
    fn has_no_rate(&self) -> bool {
        self.brr >> 4 == 0
    }

    /// Time of a frame: start, 8 or 9 bits with the parity, stop bits (section 30.3.2).
    fn frame_ns(&self) -> u64 {
        let data = if self.cr[0] & M == 0 { 8 } else { 9 };
        let stop_halves = [2, 1, 4, 3][field(self.cr[1], 12, 2) as usize];
        let halves = 2 * (1 + data) + stop_halves;
        clock::edge(u64::from(halves * self.bit_clocks()) / 2, self.pclk)
    }

    // The transmitter.

    fn load_shift_register(&mut self, now: u64) {
        // Without a baud rate a frame would take no time, and the DMA could send without end at one moment.
        if self.shifting.is_some() || !self.on(TE) || self.has_no_rate() {
            return;
        }
        if let Some(data) = self.waiting.take() {
            let frame_ns = self.frame_ns();
            let ends_ns = now.saturating_add(frame_ns).max(self.stalled_until_ns);
            self.shifting = Some((SentFrame { data, frame_ns }, ends_ns));
            self.sr |= TXE;
        }
    }

    /// Ends no frame before `until_ns`. The frame that is being sent waits, and so do those after it.
    pub(crate) fn stall(&mut self, until_ns: u64) {
        self.stalled_until_ns = self.stalled_until_ns.max(until_ns);
        if let Some((_, ends_ns)) = &mut self.shifting {
            *ends_ns = until_ns.max(*ends_ns);
        }
    }

    pub(crate) fn next_sent(&self) -> Option<u64> {
        self.shifting.map(|(_, ends_ns)| ends_ns)
    }

    pub(crate) fn sent(&mut self) -> Option<SentFrame> {
        let (mut frame, ends_ns) = self.shifting.take()?;
        self.load_shift_register(ends_ns);
        if self.shifting.is_none() {
            self.sr |= TC;
        }
        // The parity takes the place of the highest bit.
        let bits = 8 + u32::from(self.cr[0] & M != 0) - u32::from(self.cr[0] & PCE != 0);
        frame.data &= (1 << bits) - 1;
        Some(frame)
    }

    /// Returns `true` if the transmitter asks the DMA for data.
    pub(crate) fn dma_transmit_request(&self) -> bool {
        self.cr[2] & DMAT != 0 && self.sr & TXE != 0 && self.on(TE)
    }

    /// When the `n`-th request from now (1 is the next) will be made, if each is served at once.
    pub(crate) fn transmit_request(&self, n: u64) -> Option<u64> {
        (self.cr[2] & DMAT != 0).then_some(())?;
        let more = (n - 1).saturating_mul(self.frame_ns());
        Some(self.next_sent()?.saturating_add(more))
    }

    // The receiver.

    /// Returns `true` if a received byte would interrupt, or goes to a stream of the DMA, which may.
    pub(crate) fn reception_interrupts(&self) -> bool {
        self.on(RE) && (self.cr[0] & (RXNEIE | IDLEIE) != 0 || self.cr[2] & DMAR != 0)
    }

    /// When the next byte has come, or the receiver finds the line idle.
    pub(crate) fn next_received(&self) -> Option<u64> {
        self.next_byte().into_iter().chain(self.idle_at).min()
    }

    fn next_byte(&self) -> Option<u64> {
        let starts = self.input.front()?.0.max(self.input_seen_ns);
        // Without a baud rate a frame takes no time: the receiver loses bytes at once.
        Some(starts.saturating_add(self.frame_ns()))
    }

    /// Receives the frame that [`Self::next_received`] announced. `connected`: a pin is the receiver's.
    /// `busy`: another frame is on the line.
    pub(crate) fn receive(&mut self, now: u64, connected: bool, busy: bool) {
        if self.idle_at.is_some_and(|at| at <= now) {
            self.idle_at = None;
            self.sr |= if busy { 0 } else { IDLE };
            return;
        }
        let Some((_, byte)) = self.input.pop_front() else {
            return;
        };
        self.input_seen_ns = now;
        if connected {
            self.take_in(byte.into(), now);
        } else if self.on(RE) {
            self.notes
                .note("CR1.RE: bytes came, but no pin is set as its receiver");
        }
    }

    pub(crate) fn arrive(&mut self, frame: SentFrame, now: u64) {
        // Section 30.3.5, table 142: the receiver tolerates some 3 % in all.
        let off = self.frame_ns().abs_diff(frame.frame_ns);
        let framing = 100 * off > 3 * self.frame_ns();
        if self.on(RE) && framing {
            self.sr |= FE;
        }
        self.take_in(if framing { 0 } else { frame.data }, now);
    }

    fn take_in(&mut self, data: u16, now: u64) {
        if !self.on(RE) {
            return;
        }
        if self.sr & RXNE != 0 {
            // The byte in the data register stays, the new one is lost (section 30.3.3).
            self.sr |= ORE;
        } else {
            self.received = u32::from(data);
            self.sr |= RXNE;
            self.fetch_at = (self.dma_latency_ns > 0).then(|| now.saturating_add(self.dma_latency_ns));
        }
        self.idle_at = Some(now.saturating_add(self.frame_ns()));
        if self.input.front().is_some_and(|(at_ns, _)| *at_ns <= now) {
            self.idle_at = None;
        }
    }

    /// Returns `true` if the receiver asks the DMA to fetch data.
    pub(crate) fn dma_receive_request(&self) -> bool {
        self.cr[2] & DMAR != 0 && self.sr & RXNE != 0 && self.fetch_at.is_none()
    }

    /// DR is read, by the processor or the DMA.
    pub(crate) fn take_data(&mut self) -> u32 {
        self.sr &= !(RXNE | (self.armed & (FE | ORE | IDLE)));
        self.armed &= TC;
        self.fetch_at = None;
        self.received
    }

    pub(crate) fn put_data(&mut self, value: u32, now: u64) {
        self.sr &= !(TXE | (self.armed & TC));
        self.armed &= !TC;
        if self.cr[0] & TE != 0 {
            self.sr &= !TC;
        }
        self.waiting = Some((value & 0x1ff) as u16);
        self.load_shift_register(now);
    }
}

impl Peripheral for Usart {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => {
                self.armed = self.sr & (TC | FE | ORE | IDLE);
                self.sr
            }
            0x04 => self.take_data(),
            0x08 => self.brr,
            0x0c | 0x10 | 0x14 => self.cr[index(offset, 0x0c)],
            0x18 => self.gtpr,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, _now: u64) -> Option<u64> {
        // Reading the data register takes a byte.
        (offset != 0x04).then_some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.notes.note_bits(&UNMODELLED, offset, value);
        match offset {
            // TC and RXNE are rc_w0; the rest is read-only here.
            0x00 => self.sr &= value | !(TC | RXNE),
            0x04 => self.put_data(value, now),
            0x08 => {
                self.brr = value & 0xffff;
                self.notes.note_if(self.has_no_rate(), "BRR: USARTDIV is below 1");
                self.load_shift_register(now);
            }
            0x0c => {
                self.cr[0] = value & 0xbfff;
                self.load_shift_register(now);
            }
            0x10 => self.cr[1] = value & self.features.cr2,
            0x14 => self.cr[2] = value & self.features.cr3,
            0x18 => self.gtpr = value & self.features.gtpr,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// Cuts the frame under way. The other side goes on sending.
    fn reset(&mut self, _now: u64) {
        let old = std::mem::replace(self, Self::new(self.features, self.pclk));
        (self.notes, self.dma_latency_ns) = (old.notes, old.dma_latency_ns);
        (self.input, self.input_seen_ns) = (old.input, old.input_seen_ns);
        self.stalled_until_ns = old.stalled_until_ns;
    }

    fn interrupt(&self, _output: usize) -> bool {
        let [cr1, _, cr3] = self.cr;
        let by_dma = cr3 & EIE != 0 && cr3 & DMAR != 0;
        let errors = if by_dma { ORE | FE } else { 0 };
        let overrun = if cr1 & RXNEIE != 0 { ORE } else { 0 };
        // The enables of TXE, TC, RXNE and IDLE have the bit numbers of their flags.
        self.sr & (cr1 & (TXEIE | TCIE | RXNEIE | IDLEIE) | errors | overrun) != 0
    }

    fn next_interrupt(&self) -> Option<u64> {
        if self.interrupt(0) {
            return None;
        }
        let [cr1, _, cr3] = self.cr;
        let sending = self.next_sent().filter(|_| cr1 & (TXEIE | TCIE) != 0);
        let receiving = self.next_byte().filter(|_| cr1 & RXNEIE != 0 || cr3 & DMAR != 0);
        let idle = self.next_received().filter(|_| cr1 & IDLEIE != 0);
        let events = [sending, receiving, self.next_fetch(), idle];
        events.into_iter().flatten().min()
    }

    fn set_clocks(&mut self, clocks: &ClockTree, _now: u64) {
        self.pclk = clocks.of_bus(self.features.apb);
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const SR: u32 = 0x00;
    const DR: u32 = 0x04;
    const BRR: u32 = 0x08;
    const CR1: u32 = 0x0c;
    const CR2: u32 = 0x10;
    const CR3: u32 = 0x14;
    /// A frame of ten bits at 1 Mbit/s.
    const FRAME_NS: u64 = 10_000;

    /// 84 MHz / 84 = 1 Mbit/s, 8N1.
    fn running(cr1: u32) -> Usart {
        let mut usart = Usart::new(UsartFeatures::USART, 84_000_000);
        usart.put(0, [(BRR, 84), (CR1, UE | cr1)]);
        usart
    }

    /// Ends the frame that is being sent. Returns its time and its data.
    fn sent(usart: &mut Usart) -> (u64, u16) {
        (usart.next_sent().unwrap(), usart.sent().unwrap().data)
    }

    #[test]
    fn the_first_byte_goes_to_the_shift_register_at_once_and_the_second_waits() {
        let mut usart = running(TE);
        usart.put(0, [(DR, 0x55)]);
        assert_eq!(usart.get(SR, 0), TXE);
        usart.put(0, [(DR, 0xaa)]);
        assert_eq!(usart.get(SR, 0), 0);
        assert_eq!((sent(&mut usart), usart.get(SR, 0)), ((FRAME_NS, 0x55), TXE));
        assert_eq!(sent(&mut usart), (2 * FRAME_NS, 0xaa));
        assert_eq!(usart.get(SR, 0), TXE | TC);
    }

    #[test]
    fn a_stalled_transmitter_ends_no_frame_until_its_time_and_loses_none() {
        let mut usart = running(TE);
        usart.put(0, [(DR, 0x55), (DR, 0xaa)]);
        usart.stall(1_000_000);
        assert_eq!(sent(&mut usart), (1_000_000, 0x55));
        assert_eq!(sent(&mut usart), (1_000_000 + FRAME_NS, 0xaa));
        let mut usart = running(TE);
        usart.stall(1_000_000);
        usart.put(5_000, [(DR, 0x55)]);
        assert_eq!(usart.next_sent(), Some(1_000_000), "also what comes after");
    }

    #[test]
    fn tc_is_cleared_by_reading_sr_and_writing_dr_or_by_a_zero() {
        let mut usart = running(TE);
        usart.put(0, [(SR, !TC)]);
        assert_eq!(usart.get(SR, 0), TXE);
        let mut usart = running(TE);
        usart.get(SR, 0);
        usart.put(0, [(DR, 1)]);
        assert_eq!(usart.get(SR, 0), TXE);
    }

    #[test]
    fn the_frame_time_follows_brr_word_length_stop_bits_and_oversampling() {
        // Two stop bits; one and a half; USARTDIV 10.5 by 8 (mantissa 10, fraction 4); 115200 baud.
        for (brr, cr1, cr2, ns) in [
            (84, 0, 0, 10_000),
            (84, M, 0, 11_000),
            (84, 0, 0b10 << 12, 11_000),
            (84, 0, 0b11 << 12, 10_500),
            (10 << 4 | 4, OVER8, 0, 10_000),
            (729, 0, 0, 86_786),
        ] {
            let mut usart = running(TE);
            usart.put(0, [(BRR, brr), (CR2, cr2), (CR1, UE | TE | cr1), (DR, 0)]);
            assert_eq!(usart.next_sent(), Some(ns));
        }
    }

    #[test]
    fn received_bytes_come_a_frame_apart_and_then_the_line_is_idle() {
        let mut usart = running(RE);
        usart.feed(5_000, b"ab");
        let mut seen = Vec::new();
        while let Some(at) = usart.next_received() {
            usart.receive(at, true, false);
            seen.push((at, usart.get(SR, 0) & (RXNE | IDLE), usart.get(DR, 0) as u8));
        }
        let bytes = [(15_000, RXNE, b'a'), (25_000, RXNE, b'b')];
        assert_eq!((&seen[..2], seen[2]), (&bytes[..], (35_000, IDLE, b'b')));
        assert_eq!(seen.len(), 3, "idle is flagged once");
    }

    #[test]
    fn a_byte_that_finds_the_register_full_is_lost_and_flagged() {
        let mut usart = running(RE | RXNEIE);
        usart.feed(0, b"ab");
        for _ in 0..2 {
            let at = usart.next_received().unwrap();
            usart.receive(at, true, false);
        }
        assert!(usart.interrupt(0));
        assert_eq!(usart.get(SR, 0) & (RXNE | ORE), RXNE | ORE);
        assert_eq!(usart.get(DR, 0), u32::from(b'a'));
        assert_eq!(usart.get(SR, 0) & (RXNE | ORE), 0, "SR, then DR: both clear");
    }

    #[test]
    fn the_line_follows_enabled_flags_and_its_rise_is_foretold() {
        let mut usart = running(TE);
        assert!(!usart.interrupt(0));
        usart.put(0, [(DR, 1), (CR1, UE | TE | TCIE)]);
        assert_eq!(usart.next_interrupt(), Some(FRAME_NS));
        usart.sent();
        assert!(usart.interrupt(0));
    }

    #[test]
    fn without_a_baud_rate_nothing_is_sent_and_the_dma_waits() {
        let mut usart = running(TE);
        usart.put(0, [(BRR, 0), (CR3, DMAT)]);
        usart.put_data(0x55, 0);
        assert_eq!((usart.next_sent(), usart.dma_transmit_request()), (None, false));
        usart.put(5_000, [(BRR, 84)]);
        assert_eq!(sent(&mut usart), (5_000 + FRAME_NS, 0x55));
    }

    #[test]
    fn nothing_is_sent_or_received_while_disabled() {
        let mut usart = running(0);
        usart.put(0, [(DR, 1)]);
        assert_eq!(usart.next_sent(), None);
        usart.feed(0, b"a");
        usart.receive(FRAME_NS, true, false);
        assert_eq!(usart.get(SR, 0) & RXNE, 0);
    }

    #[test]
    fn seven_data_bits_are_what_parity_leaves_of_eight() {
        let mut usart = running(TE | PCE);
        usart.put(0, [(DR, 0xff)]);
        assert_eq!(sent(&mut usart).1, 0x7f);
    }
}
