//! An SPI master (RM0090 section 28): full duplex, receive-only and one line, 8 or 16 bits.
//!
//! # Design
//!
//! The transmitter is a shift register with the time at which its frame ends, and one data register before
//! it. A frame goes both ways at once, and is exchanged as a whole when it ends: [`Spi::shifted`] returns
//! what was sent, and [`Spi::took`] takes what was received. Slave mode, checksums, TI frames and I2S are
//! left out and noted.

use super::clock::{self, Apb, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};

const CPHA_CPOL: u32 = 0b11;
const MSTR: u32 = 1 << 2;
const SPE: u32 = 1 << 6;
const LSBFIRST: u32 = 1 << 7;
const SSI: u32 = 1 << 8;
const SSM: u32 = 1 << 9;
const RXONLY: u32 = 1 << 10;
const DFF: u32 = 1 << 11;
const BIDIOE: u32 = 1 << 14;
const BIDIMODE: u32 = 1 << 15;

const RXDMAEN: u32 = 1 << 0;
const TXDMAEN: u32 = 1 << 1;
const ERRIE: u32 = 1 << 5;
const RXNEIE: u32 = 1 << 6;
const TXEIE: u32 = 1 << 7;

const RXNE: u32 = 1 << 0;
const TXE: u32 = 1 << 1;
const CRCERR: u32 = 1 << 4;
const MODF: u32 = 1 << 5;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 3] = [
    (0x00, 0x3000, "CR1: checksums are not modelled"),
    (0x04, 0x10, "CR2.FRF: TI frames are not modelled"),
    (0x1c, 0x800, "I2SCFGR: I2S is not modelled"),
];
const SLAVE: &str = "CR1.MSTR: slave mode is not modelled: nothing is received";
const NO_SELECT: &str = "CR1.SSI: a low software select ends master mode (section 28.5.3, MODF)";

/// A frame on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shifting {
    /// Its 8 or 16 bits, in the order of the line: the first is the highest.
    pub(crate) word: u16,
    pub(crate) bits: u32,
    ends_ns: u64,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Spi {
    apb: Apb,
    pclk: u32,
    cr1: u32,
    cr2: u32,
    /// Without BSY.
    sr: u32,
    received: u16,
    waiting: Option<u16>,
    shifting: Option<Shifting>,
    crc_polynomial: u32,
    i2s: [u32; 2],
    /// OVR was set when DR was read: a read of SR then clears it.
    armed: bool,
    pub(crate) notes: Notes,
}

impl Spi {
    pub(crate) fn new(apb: Apb, pclk: u32) -> Self {
        Self {
            apb,
            pclk,
            sr: TXE,
            crc_polynomial: 7,
            i2s: [0, 0xa],
            ..Self::default()
        }
    }

    fn bits(&self) -> u32 {
        if self.cr1 & DFF == 0 { 8 } else { 16 }
    }

    /// Frequency of the clock (section 28.5.1, BR), Hz.
    pub(crate) fn hz(&self) -> u32 {
        self.pclk >> (field(self.cr1, 3, 3) + 1)
    }

    /// CPOL and CPHA: mode 0 to 3.
    pub(crate) fn mode(&self) -> u8 {
        let [cpha, cpol] = [0, 1].map(|n| u8::from(bit(self.cr1 & CPHA_CPOL, n)));
        2 * cpol + cpha
    }

    fn is_master(&self) -> bool {
        self.cr1 & (SPE | MSTR) == SPE | MSTR
    }

    /// Returns `true` if the clock runs without data to send (section 28.3.5).
    fn only_receives(&self) -> bool {
        match self.cr1 & BIDIMODE {
            0 => self.cr1 & RXONLY != 0,
            _ => self.cr1 & BIDIOE == 0,
        }
    }

    /// Returns `true` for one line, to the device: nothing is received.
    fn only_sends(&self) -> bool {
        self.cr1 & (BIDIMODE | BIDIOE) == BIDIMODE | BIDIOE
    }

    fn in_order(&self, word: u16) -> u16 {
        match (self.cr1 & LSBFIRST, self.bits()) {
            (0, 8) => word & 0xff,
            (0, _) => word,
            (_, 8) => (word as u8).reverse_bits().into(),
            _ => word.reverse_bits(),
        }
    }

    fn load_shift_register(&mut self, now: u64) {
        if self.shifting.is_some() || !self.is_master() {
            return;
        }
        let word = if self.only_receives() {
            u16::MAX
        } else if let Some(word) = self.waiting.take() {
            self.sr |= TXE;
            word
        } else {
            return;
        };
        let bits = self.bits();
        let clocks = u64::from(bits) << (field(self.cr1, 3, 3) + 1);
        self.shifting = Some(Shifting {
            word: self.in_order(word),
            bits,
            ends_ns: now.saturating_add(clock::edge(clocks, self.pclk)),
        });
    }

    /// When the frame under way ends.
    pub(crate) fn next_frame(&self) -> Option<u64> {
        self.shifting.map(|frame| frame.ends_ns)
    }

    /// Ends the frame under way. Answer with [`Self::took`].
    pub(crate) fn shifted(&mut self) -> Option<Shifting> {
        self.shifting.take()
    }

    /// Takes the bits that came during the frame.
    pub(crate) fn took(&mut self, word: u16, now: u64) {
        if !self.only_sends() {
            if self.sr & RXNE != 0 {
                // The data register keeps its frame, and the new one is lost (section 28.3.10).
                self.sr |= OVR;
            } else {
                self.received = self.in_order(word);
                self.sr |= RXNE;
            }
        }
        self.load_shift_register(now);
    }

    fn write_cr1(&mut self, value: u32, now: u64) {
        self.cr1 = value & 0xffff;
        if self.is_master() && value & (SSM | SSI) == SSM {
            self.sr |= MODF;
            self.cr1 &= !(SPE | MSTR);
            self.notes.note(NO_SELECT);
        }
        self.notes.note_if(self.cr1 & (SPE | MSTR) == SPE, SLAVE);
        self.load_shift_register(now);
    }

    /// Returns `true` if the transmitter asks the DMA for data.
    pub(crate) fn dma_transmit_request(&self) -> bool {
        self.cr2 & TXDMAEN != 0 && self.sr & TXE != 0 && self.is_master()
    }

    /// Returns `true` if the receiver asks the DMA to fetch data.
    pub(crate) fn dma_receive_request(&self) -> bool {
        self.cr2 & RXDMAEN != 0 && self.sr & RXNE != 0
    }
}

impl Peripheral for Spi {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => {
                let status = self.sr | if self.shifting.is_some() { BSY } else { 0 };
                if std::mem::take(&mut self.armed) {
                    self.sr &= !OVR;
                }
                status
            }
            0x0c => {
                self.sr &= !RXNE;
                self.armed = self.sr & OVR != 0;
                self.received.into()
            }
            0x10 => self.crc_polynomial,
            // The checksums are not made.
            0x14 | 0x18 => 0,
            0x1c => self.i2s[0],
            0x20 => self.i2s[1],
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, _now: u64) -> Option<u64> {
        // Reading DR takes a frame, and reading SR after it clears OVR.
        (offset != 0x0c && !self.armed).then_some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.notes.note_bits(&UNMODELLED, offset, value);
        match offset {
            0x00 => {
                // MODF is cleared by a write to CR1 after SR was read.
                self.sr &= !MODF;
                self.write_cr1(value, now);
            }
            0x04 => self.cr2 = value & 0xf7,
            0x08 => self.sr &= value | !CRCERR,
            0x0c => {
                self.waiting = Some(value as u16);
                self.sr &= !TXE;
                self.load_shift_register(now);
            }
            0x10 => self.crc_polynomial = value & 0xffff,
            0x14 | 0x18 => {}
            0x1c => self.i2s[0] = value & 0xfbf,
            0x20 => self.i2s[1] = value & 0x3ff,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        let notes = std::mem::take(&mut self.notes);
        *self = Self {
            notes,
            ..Self::new(self.apb, self.pclk)
        };
    }

    fn interrupt(&self, _output: usize) -> bool {
        let wanted = [(RXNEIE, RXNE), (TXEIE, TXE), (ERRIE, OVR | MODF | CRCERR)];
        wanted
            .iter()
            .any(|(enable, flags)| self.cr2 & enable != 0 && self.sr & flags != 0)
    }

    fn next_interrupt(&self) -> Option<u64> {
        let asks = self.cr2 & (RXDMAEN | TXDMAEN | ERRIE | RXNEIE | TXEIE) != 0;
        self.next_frame().filter(|_| asks)
    }

    fn set_clocks(&mut self, clocks: &ClockTree, _now: u64) {
        self.pclk = clocks.of_bus(self.apb);
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR1: u32 = 0x00;
    const CR2: u32 = 0x04;
    const SR: u32 = 0x08;
    const DR: u32 = 0x0c;
    const ON: u32 = SPE | MSTR | SSM | SSI;
    /// Eight bits at 42 MHz / 4.
    const FRAME_NS: u64 = 762;

    fn running(cr1: u32) -> Spi {
        let mut spi = Spi::new(Apb::One, 42_000_000);
        spi.put(0, [(CR1, ON | 1 << 3 | cr1)]);
        spi
    }

    /// Ends a frame with these bits from the other side. Returns its time and what it sent.
    fn exchange(spi: &mut Spi, word: u16) -> (u64, u16) {
        let at = spi.next_frame().expect("a frame is under way");
        let frame = spi.shifted().expect("a frame is under way");
        spi.took(word, at);
        (at, frame.word)
    }

    #[test]
    fn a_frame_goes_both_ways_in_the_time_of_its_bits() {
        let mut spi = running(0);
        assert_eq!((spi.get(SR, 0), spi.hz(), spi.mode()), (TXE, 10_500_000, 0));
        spi.put(0, [(DR, 0x12), (DR, 0x34)]);
        assert_eq!(spi.get(SR, 0), BSY);
        assert_eq!(exchange(&mut spi, 0xab), (FRAME_NS, 0x12));
        assert_eq!(spi.get(SR, FRAME_NS), TXE | RXNE | BSY);
        assert_eq!(spi.get(DR, FRAME_NS), 0xab);
        assert_eq!(exchange(&mut spi, 0xcd), (2 * FRAME_NS, 0x34));
        assert_eq!((spi.get(DR, 0), spi.get(SR, 0)), (0xcd, TXE));
    }

    #[test]
    fn sixteen_bits_and_the_order_of_bits_are_as_set() {
        let mut spi = running(DFF | CPHA_CPOL);
        spi.put(0, [(DR, 0x1234)]);
        assert_eq!((exchange(&mut spi, 0xabcd), spi.mode()), ((1524, 0x1234), 3));
        assert_eq!(spi.get(DR, 0), 0xabcd);
        let mut spi = running(LSBFIRST);
        spi.put(0, [(DR, 0x01)]);
        assert_eq!(exchange(&mut spi, 0x80).1, 0x80);
        assert_eq!(spi.get(DR, 0), 0x01);
    }

    #[test]
    fn a_frame_that_nobody_has_read_stays_and_the_next_is_lost() {
        let mut spi = running(0);
        spi.put(0, [(CR2, ERRIE), (DR, 1), (DR, 2)]);
        exchange(&mut spi, 7);
        assert!(!spi.interrupt(0));
        exchange(&mut spi, 8);
        assert!(spi.interrupt(0));
        assert_eq!((spi.get(SR, 0), spi.get(DR, 0)), (TXE | RXNE | OVR, 7));
        assert_eq!((spi.get(SR, 0), spi.get(SR, 0)), (TXE | OVR, TXE));
    }

    #[test]
    fn a_receiver_clocks_by_itself_until_it_is_turned_off_and_a_sender_receives_nothing() {
        for receives in [RXONLY, BIDIMODE] {
            let mut spi = running(receives);
            assert_eq!(exchange(&mut spi, 5).0, FRAME_NS);
            assert_eq!((spi.get(DR, 0), spi.next_frame()), (5, Some(2 * FRAME_NS)));
            spi.put(FRAME_NS, [(CR1, ON & !SPE)]);
            exchange(&mut spi, 6);
            assert_eq!(spi.next_frame(), None);
        }
        let mut spi = running(BIDIMODE | BIDIOE);
        spi.put(0, [(DR, 1)]);
        exchange(&mut spi, 5);
        assert_eq!(spi.get(SR, 0), TXE);
    }

    #[test]
    fn a_master_that_is_not_selected_by_software_is_turned_off() {
        let mut spi = Spi::new(Apb::One, 42_000_000);
        spi.put(0, [(CR1, SPE | MSTR | SSM)]);
        assert_eq!((spi.get(CR1, 0), spi.get(SR, 0)), (SSM, TXE | MODF));
        spi.put(0, [(CR1, ON), (DR, 1)]);
        assert_eq!(spi.get(SR, 0), TXE | BSY);
    }
}
