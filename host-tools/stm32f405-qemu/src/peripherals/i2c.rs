//! An I2C controller as a master with 7-bit addresses (RM0090 section 27).
//!
//! # Design
//!
//! The bus is in one [`Phase`]. A phase that takes time ends at a time that the clock control register gives:
//! a bit for START and STOP, nine for a byte. The model knows no device: at the end of a phase [`I2c::step`]
//! says what has gone over the bus, and the owner answers with the acknowledge bit or the byte. Devices do
//! not stretch the clock, and there is one master, so arbitration is never lost. Slave mode, SMBus, checksums
//! and 10-bit addresses are left out and noted.

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{field, index};

const PE: u32 = 1 << 0;
const START: u32 = 1 << 8;
const STOP: u32 = 1 << 9;
const ACK: u32 = 1 << 10;
const POS: u32 = 1 << 11;
const SWRST: u32 = 1 << 15;

const ITERREN: u32 = 1 << 8;
const ITEVTEN: u32 = 1 << 9;
const ITBUFEN: u32 = 1 << 10;
const DMAEN: u32 = 1 << 11;
const LAST: u32 = 1 << 12;

const SB: u32 = 1 << 0;
const ADDR: u32 = 1 << 1;
const BTF: u32 = 1 << 2;
const RXNE: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
const AF: u32 = 1 << 10;
/// Error flags, cleared by a 0.
const ERRORS: u32 = 0xdf00;

/// A byte and its acknowledge bit.
const BYTE: u64 = 9;

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 2] = [
    (0x00, 0x303a, "CR1: SMBus and checksums are not modelled"),
    (0x08, 0x3ff, "OAR1: slave mode is not modelled"),
];
const LONG_ADDRESS: &str = "DR: addresses of 10 bits are not modelled: nobody answers";
const NO_RATE: &str = "CCR is 0: it is taken as 1";
const STARTED_TWICE: &str = "CR1.START is written while SB is set: here it waits for an address; RM0090 does not say what a part does";

/// The state of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Phase {
    #[default]
    Idle,
    /// START is sent until this time.
    Starting(u64),
    /// SB is set.
    AwaitsAddress,
    Addressing {
        byte: u8,
        ends_ns: u64,
    },
    /// ADDR is set, and the clock is held low until it is cleared.
    Addressed,
    Sending {
        byte: u8,
        ends_ns: u64,
    },
    Receiving {
        ends_ns: u64,
    },
    /// The clock is held low: the firmware is to write, to read, or to end the transfer.
    Holding,
    /// STOP is sent until this time.
    Stopping(u64),
}

/// The end of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum I2cStep {
    Started,
    /// An address: answer with [`I2c::addressed`].
    Address {
        address: u8,
        read: bool,
    },
    /// A byte to the device: answer with [`I2c::sent`].
    Sent(u8),
    /// The device is to give a byte: answer with [`I2c::received`].
    Receive,
    Stopped,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct I2c {
    cr1: u32,
    cr2: u32,
    oar: [u32; 2],
    sr1: u32,
    ccr: u32,
    trise: u32,
    phase: Phase,
    master: bool,
    transmits: bool,
    /// The data registers of the receiver and, if it is full, of the transmitter.
    received: u8,
    waiting: Option<u8>,
    /// A byte that was received while the data register was full.
    shifted: Option<u8>,
    /// ADDR was set when SR1 was read: a read of SR2 then clears it.
    armed: bool,
    /// ACK at the end of the byte before: with POS it applies to the next.
    acknowledges_next: bool,
    /// The device was told that no more bytes are wanted, or has refused one.
    over: bool,
    /// True if the DMA takes one more byte, which is not acknowledged (CR2.LAST).
    last: bool,
    pclk: u32,
    pub(crate) notes: Notes,
}

impl I2c {
    pub(crate) fn new(pclk: u32) -> Self {
        Self {
            trise: 2,
            pclk,
            ..Self::default()
        }
    }

    /// Time of a number of bits (section 27.6.8), ns.
    fn bits(&self, bits: u64) -> u64 {
        let ccr = u64::from(field(self.ccr, 0, 12)).max(1);
        let clocks = match self.ccr >> 14 & 3 {
            0b10 => 3 * ccr,
            0b11 => 25 * ccr,
            _ => 2 * ccr,
        };
        clock::edge(bits * clocks, self.pclk)
    }

    fn after(&self, now: u64, bits: u64) -> u64 {
        now.saturating_add(self.bits(bits))
    }

    /// When the phase ends by itself.
    pub(crate) fn next_step(&self) -> Option<u64> {
        match self.phase {
            Phase::Starting(ends_ns)
            | Phase::Stopping(ends_ns)
            | Phase::Addressing { ends_ns, .. }
            | Phase::Sending { ends_ns, .. }
            | Phase::Receiving { ends_ns } => Some(ends_ns),
            Phase::Idle | Phase::AwaitsAddress | Phase::Addressed | Phase::Holding => None,
        }
    }

    /// Ends the phase at the time that [`Self::next_step`] gave.
    pub(crate) fn step(&mut self, at: u64) -> Option<I2cStep> {
        Some(match self.phase {
            Phase::Starting(_) => {
                self.cr1 &= !START;
                self.sr1 = (self.sr1 & (ERRORS | RXNE)) | SB;
                (self.master, self.phase) = (true, Phase::AwaitsAddress);
                I2cStep::Started
            }
            Phase::Addressing { byte, .. } => I2cStep::Address {
                address: byte >> 1,
                read: byte & 1 == 1,
            },
            Phase::Sending { byte, .. } => I2cStep::Sent(byte),
            Phase::Receiving { .. } => I2cStep::Receive,
            Phase::Stopping(_) => {
                self.cr1 &= !STOP;
                self.sr1 &= ERRORS | RXNE;
                (self.master, self.transmits, self.waiting) = (false, false, None);
                self.phase = Phase::Idle;
                self.proceed(at);
                I2cStep::Stopped
            }
            _ => return None,
        })
    }

    /// Takes the answer to an address: a device has acknowledged it, or none has.
    pub(crate) fn addressed(&mut self, acknowledged: bool, at: u64) {
        if let Phase::Addressing { byte, .. } = self.phase {
            self.transmits = byte & 1 == 0;
        }
        self.over = !acknowledged;
        if acknowledged {
            self.sr1 |= ADDR;
            self.phase = Phase::Addressed;
        } else {
            self.sr1 |= AF;
            self.hold(at);
        }
    }

    /// Takes the device's answer to a byte.
    pub(crate) fn sent(&mut self, acknowledged: bool, at: u64) {
        self.over = !acknowledged;
        if !acknowledged {
            self.sr1 |= AF;
        } else if self.cr1 & (START | STOP) == 0
            && let Some(byte) = self.waiting.take()
        {
            self.sr1 |= TXE;
            self.send(byte, at);
            return;
        } else {
            self.sr1 |= BTF;
        }
        self.hold(at);
    }

    /// The device has given a byte.
    pub(crate) fn received(&mut self, byte: u8, at: u64) {
        let own = self.cr1 & ACK != 0;
        let before = std::mem::replace(&mut self.acknowledges_next, own);
        let acknowledged = if self.cr1 & POS != 0 { before } else { own };
        self.over = !acknowledged || std::mem::take(&mut self.last);
        if self.sr1 & RXNE != 0 {
            self.shifted = Some(byte);
            self.sr1 |= BTF;
            self.hold(at);
            return;
        }
        self.received = byte;
        self.sr1 |= RXNE;
        if self.over || self.cr1 & (START | STOP) != 0 {
            self.hold(at);
        } else {
            self.receive(at);
        }
    }

    fn hold(&mut self, at: u64) {
        self.phase = Phase::Holding;
        self.proceed(at);
    }

    fn send(&mut self, byte: u8, now: u64) {
        self.sr1 &= !BTF;
        let ends_ns = self.after(now, BYTE);
        self.phase = Phase::Sending { byte, ends_ns };
    }

    fn receive(&mut self, now: u64) {
        let ends_ns = self.after(now, BYTE);
        self.phase = Phase::Receiving { ends_ns };
    }

    /// Sends START or STOP if one is asked for and the bus is free for it.
    fn proceed(&mut self, now: u64) {
        match self.phase {
            Phase::Idle => self.cr1 &= !STOP,
            Phase::AwaitsAddress | Phase::Holding if self.cr1 & STOP != 0 => {
                self.sr1 &= !(BTF | SB);
                self.phase = Phase::Stopping(self.after(now, 1));
            }
            Phase::Holding => {}
            Phase::AwaitsAddress => {
                self.notes.note_if(self.cr1 & START != 0, STARTED_TWICE);
                return;
            }
            _ => return,
        }
        if self.cr1 & START != 0 && matches!(self.phase, Phase::Idle | Phase::Holding) {
            self.check_clock();
            self.sr1 &= !(BTF | TXE);
            self.waiting = None;
            self.phase = Phase::Starting(self.after(now, 1));
        }
    }

    fn check_clock(&mut self) {
        let (freq, mhz) = (field(self.cr2, 0, 6), self.pclk / 1_000_000);
        if freq != mhz {
            self.notes.note(format!(
                "CR2.FREQ is {freq}, but PCLK1 has {mhz} MHz (section 27.6.2)"
            ));
        }
        self.notes.note_if(field(self.ccr, 0, 12) == 0, NO_RATE);
    }

    /// SR2 is read after SR1: ADDR is cleared, and the bytes begin.
    fn clear_addr(&mut self, now: u64) {
        self.sr1 &= !ADDR;
        self.armed = false;
        if self.transmits {
            self.sr1 |= TXE;
            self.hold(now);
        } else {
            self.acknowledges_next = self.cr1 & ACK != 0;
            self.receive(now);
        }
    }

    /// DR is read, by the processor or the DMA.
    fn take_data(&mut self, now: u64) -> u32 {
        let value = u32::from(self.received);
        match self.shifted.take() {
            Some(byte) => {
                self.received = byte;
                self.sr1 &= !BTF;
                if self.phase == Phase::Holding && !self.over {
                    self.receive(now);
                }
            }
            None => self.sr1 &= !(RXNE | BTF),
        }
        value
    }

    fn put_data(&mut self, byte: u8, now: u64) {
        match self.phase {
            Phase::AwaitsAddress => {
                self.notes.note_if(byte & 0xf8 == 0xf0, LONG_ADDRESS);
                self.sr1 &= !SB;
                let ends_ns = self.after(now, BYTE);
                self.phase = Phase::Addressing { byte, ends_ns };
            }
            Phase::Holding if self.transmits && !self.over => self.send(byte, now),
            Phase::Sending { .. } => {
                self.waiting = Some(byte);
                self.sr1 &= !TXE;
            }
            _ => {}
        }
    }

    fn write_cr1(&mut self, value: u32, now: u64) {
        self.cr1 = value & 0xbffb;
        if value & SWRST != 0 {
            let old = std::mem::replace(self, Self::new(self.pclk));
            (self.cr1, self.notes) = (old.cr1, old.notes);
        }
        if self.cr1 & PE == 0 || value & SWRST != 0 {
            self.cr1 &= !(START | STOP);
            (self.phase, self.master, self.sr1) = (Phase::Idle, false, 0);
            (self.waiting, self.shifted) = (None, None);
            return;
        }
        self.proceed(now);
    }

    // Requests to the DMA.

    /// Returns `true` if the transmitter asks the DMA for data.
    pub(crate) fn dma_transmit_request(&self) -> bool {
        self.cr2 & DMAEN != 0 && self.transmits && self.sr1 & TXE != 0 && !self.over
    }

    /// Returns `true` if the receiver asks the DMA to fetch data.
    pub(crate) fn dma_receive_request(&self) -> bool {
        self.cr2 & DMAEN != 0 && self.sr1 & RXNE != 0
    }

    /// Notes that the DMA has fetched a byte and takes `left` more.
    pub(crate) fn fetched(&mut self, left: u32) {
        self.last |= self.cr2 & LAST != 0 && left == 1;
    }
}

impl Peripheral for I2c {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 | 0x0c => self.oar[index(offset, 0x08)],
            0x10 => self.take_data(now),
            0x14 => {
                self.armed = self.sr1 & ADDR != 0;
                self.sr1
            }
            0x18 => {
                let state = (u32::from(self.master) * 0b11) | (u32::from(self.master && self.transmits) << 2);
                if self.armed && self.phase == Phase::Addressed {
                    self.clear_addr(now);
                }
                state
            }
            0x1c => self.ccr,
            0x20 => self.trise,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, _now: u64) -> Option<u64> {
        // Reading DR takes a byte, and reading SR2 may clear ADDR.
        let steady = !matches!(offset, 0x10) && (offset != 0x18 || self.phase != Phase::Addressed);
        steady.then_some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.notes.note_bits(&UNMODELLED, offset, value);
        match offset {
            0x00 => self.write_cr1(value, now),
            0x04 => self.cr2 = value & 0x1f3f,
            0x08 => self.oar[0] = value & 0x83ff,
            0x0c => self.oar[1] = value & 0xff,
            0x10 => self.put_data(value as u8, now),
            // rc_w0.
            0x14 => self.sr1 &= value | !ERRORS,
            0x18 => {}
            0x1c => self.ccr = value & 0xcfff,
            0x20 => self.trise = value & 0x3f,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        let notes = std::mem::take(&mut self.notes);
        *self = Self {
            notes,
            ..Self::new(self.pclk)
        };
    }

    /// Events, and errors.
    fn interrupt(&self, output: usize) -> bool {
        if output == 1 {
            return self.cr2 & ITERREN != 0 && self.sr1 & ERRORS != 0;
        }
        let of_buffer = if self.cr2 & ITBUFEN != 0 { TXE | RXNE } else { 0 };
        self.cr2 & ITEVTEN != 0 && self.sr1 & (SB | ADDR | BTF | of_buffer) != 0
    }

    fn next_interrupt(&self) -> Option<u64> {
        self.next_step()
            .filter(|_| self.cr2 & (ITERREN | ITEVTEN | DMAEN) != 0)
    }

    fn set_clocks(&mut self, clocks: &ClockTree, _now: u64) {
        self.pclk = clocks.pclk1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR1: u32 = 0x00;
    const CR2: u32 = 0x04;
    const DR: u32 = 0x10;
    const SR1: u32 = 0x14;
    const SR2: u32 = 0x18;
    const CCR: u32 = 0x1c;
    /// A bit at 100 kHz, and a byte.
    const BIT_NS: u64 = 10_000;
    const BYTE_NS: u64 = 9 * BIT_NS;

    /// 42 MHz / 420 = 100 kHz.
    fn running(cr1: u32) -> I2c {
        let mut i2c = I2c::new(42_000_000);
        i2c.put(0, [(CR2, 42), (CCR, 210), (CR1, PE | cr1)]);
        i2c
    }

    fn step(i2c: &mut I2c) -> (u64, I2cStep) {
        let at = i2c.next_step().expect("something is under way");
        (at, i2c.step(at).expect("it ends"))
    }

    /// Addresses a device and clears ADDR. Returns the time.
    fn address(i2c: &mut I2c, byte: u32) -> u64 {
        let (at, _) = step(i2c);
        assert_eq!(i2c.get(SR1, at), SB);
        i2c.put(at, [(DR, byte)]);
        let (at, said) = step(i2c);
        let (address, read) = ((byte >> 1) as u8, byte & 1 == 1);
        assert_eq!(said, I2cStep::Address { address, read });
        i2c.addressed(true, at);
        assert_eq!(i2c.get(SR1, at), ADDR);
        i2c.get(SR2, at);
        at
    }

    #[test]
    fn two_bytes_are_sent_after_start_and_address_and_end_with_stop() {
        let mut i2c = running(START);
        let at = address(&mut i2c, 0x90);
        assert_eq!(at, BIT_NS + BYTE_NS);
        assert_eq!((i2c.get(SR1, at), i2c.get(SR2, at)), (TXE, 0b111));
        i2c.put(at, [(DR, 1)]);
        assert_eq!(i2c.get(SR1, at), TXE, "it is in the shift register");
        i2c.put(at, [(DR, 2)]);
        assert_eq!(i2c.get(SR1, at), 0);
        assert_eq!(step(&mut i2c), (at + BYTE_NS, I2cStep::Sent(1)));
        i2c.sent(true, at + BYTE_NS);
        assert_eq!(i2c.get(SR1, at + BYTE_NS), TXE);
        let (at, said) = step(&mut i2c);
        assert_eq!(said, I2cStep::Sent(2));
        i2c.sent(true, at);
        assert_eq!((i2c.get(SR1, at), i2c.next_step()), (TXE | BTF, None));
        i2c.put(at, [(CR1, PE | STOP)]);
        assert_eq!(step(&mut i2c), (at + BIT_NS, I2cStep::Stopped));
        assert_eq!((i2c.get(CR1, at), i2c.get(SR1, at), i2c.get(SR2, at)), (PE, 0, 0));
    }

    #[test]
    fn an_address_or_a_byte_that_nobody_acknowledges_sets_af_and_the_clock_is_held() {
        let mut i2c = running(START);
        i2c.put(0, [(CR2, 42 | ITERREN)]);
        step(&mut i2c);
        i2c.put(BIT_NS, [(DR, 0x90)]);
        let (at, _) = step(&mut i2c);
        i2c.addressed(false, at);
        assert_eq!((i2c.get(SR1, at), i2c.next_step()), (AF, None));
        assert_eq!([0, 1].map(|line| i2c.interrupt(line)), [false, true]);
        i2c.put(at, [(SR1, !AF), (CR1, PE | STOP)]);
        assert_eq!(step(&mut i2c).1, I2cStep::Stopped);

        let mut i2c = running(START);
        let at = address(&mut i2c, 0x90);
        i2c.put(at, [(DR, 1)]);
        let (at, _) = step(&mut i2c);
        i2c.sent(false, at);
        i2c.put(at, [(DR, 2)]);
        assert_eq!((i2c.get(SR1, at), i2c.next_step()), (AF | TXE, None));
    }

    #[test]
    fn a_byte_more_than_the_registers_hold_stretches_the_clock() {
        let mut i2c = running(START | ACK);
        let at = address(&mut i2c, 0x91);
        for byte in [1, 2] {
            let (at, said) = step(&mut i2c);
            assert_eq!(said, I2cStep::Receive);
            i2c.received(byte, at);
        }
        let at = at + 2 * BYTE_NS;
        assert_eq!((i2c.get(SR1, at), i2c.next_step()), (RXNE | BTF, None));
        assert_eq!(i2c.get(DR, at + 5), 1);
        assert_eq!(i2c.next_step(), Some(at + 5 + BYTE_NS), "the third");
        assert_eq!((i2c.get(SR1, at + 5), i2c.get(DR, at + 5)), (RXNE, 2));
    }

    /// Section 27.3.3, closing the communication.
    #[test]
    fn the_byte_after_ack_is_cleared_is_the_last_and_with_pos_the_one_after_it() {
        let received = |pos: u32| {
            let mut i2c = running(START | ACK | pos);
            let now = address(&mut i2c, 0x91);
            i2c.put(now, [(CR1, PE | pos)]);
            let mut bytes = 0;
            while let Some(at) = i2c.next_step() {
                i2c.step(at);
                i2c.received(7, at);
                bytes += 1;
            }
            bytes
        };
        assert_eq!([received(0), received(POS)], [1, 2]);
    }

    #[test]
    fn a_stop_in_time_ends_after_the_byte_under_way_and_a_start_begins_again() {
        for (asked, then) in [(STOP, I2cStep::Stopped), (START, I2cStep::Started)] {
            let mut i2c = running(START | ACK);
            let at = address(&mut i2c, 0x91);
            i2c.put(at + 5, [(CR1, PE | asked)]);
            let (at, _) = step(&mut i2c);
            i2c.received(7, at);
            assert_eq!(step(&mut i2c), (at + BIT_NS, then));
            assert_eq!(i2c.get(DR, at), 7);
        }
    }

    #[test]
    fn a_second_start_before_the_address_waits_for_it_and_is_noted() {
        let mut i2c = running(START);
        let (at, _) = step(&mut i2c);
        assert_eq!(i2c.notes.iter().count(), 0);
        i2c.put(at, [(CR1, PE | START)]);
        assert_eq!((i2c.next_step(), i2c.notes.iter().count()), (None, 1));
    }

    #[test]
    fn with_last_the_byte_that_the_dma_takes_last_is_not_acknowledged() {
        let mut i2c = running(START | ACK);
        i2c.put(0, [(CR2, 42 | DMAEN | LAST)]);
        address(&mut i2c, 0x91);
        let mut left = 3;
        while let Some(at) = i2c.next_step() {
            i2c.step(at);
            i2c.received(left as u8, at);
            assert!(i2c.dma_receive_request());
            i2c.get(DR, at);
            left -= 1;
            i2c.fetched(left);
        }
        assert_eq!(left, 0);
    }

    #[test]
    fn fast_modes_have_three_and_25_clocks_a_unit() {
        let bits = [0x8023, 0xc004].map(|ccr| {
            let mut i2c = I2c::new(42_000_000);
            i2c.put(0, [(CCR, ccr)]);
            i2c.bits(1)
        });
        // 42 MHz / 105 = 400 kHz, 42 MHz / 100 = 420 kHz.
        assert_eq!(bits, [2_500, 2_381]);
    }

    #[test]
    fn a_frequency_that_is_not_the_bus_clocks_is_noted() {
        let mut i2c = running(0);
        i2c.put(0, [(CR2, 16), (CR1, PE | START)]);
        let notes: Vec<_> = i2c.notes.iter().collect();
        assert_eq!(notes, ["CR2.FREQ is 16, but PCLK1 has 42 MHz (section 27.6.2)"]);
    }
}
