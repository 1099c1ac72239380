//! USART1, both ways, by DMA.
//!
//! # Design
//! 2 Mbaud is exactly 84 MHz / 42, and common USB serial bridges can do it. 8 data bits, no parity, 1 stop
//! bit. There is no flow control, so neither end can stop the other.
//!
//! The driver sends frames. Only the DMA receives: it puts bytes into a ring. The driver's receiver would
//! read the data register whenever it is woken, and a byte that the DMA has not fetched yet would be lost. So
//! this one only polls the DMA's position, every [`POLL`]. No byte and no idle line interrupts the core,
//! whatever the sender does. An interrupt counts the rounds of the ring, one each 1024 bytes.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering, fence};

use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::mode::Async;
use embassy_stm32::pac::dma::vals::{Dir, Pl, Size};
use embassy_stm32::pac::{DMA2, USART1};
use embassy_stm32::usart::{Config, RxPin, TxPin, UartTx};
use embassy_stm32::{Peri, bind_interrupts, dma, peripherals};
use embassy_time::{Duration, Timer};

bind_interrupts!(struct Irqs {
    DMA2_STREAM7 => dma::InterruptHandler<peripherals::DMA2_CH7>;
});

const BAUD: u32 = 2_000_000;
/// Alternate function of PA10 and PB7 as USART1_RX (DocID022152 table 9).
const AF7: u8 = 7;
/// The receiver's stream, and USART1_RX's channel there (RM0090 table 43).
const STREAM: usize = 2;
const REQUEST: u8 = 4;

/// Bytes by which the receiver may fall behind: 5 ms at full rate.
const SIZE: usize = 1024;
/// Interval of the polls for new bytes, in which 400 can come.
const POLL: Duration = Duration::from_millis(2);

/// Ring of received bytes, made of atomics, since the DMA writes to it while the core reads.
static RING: [AtomicU8; SIZE] = [const { AtomicU8::new(0) }; SIZE];
/// Rounds that the DMA has completed; wraps.
static ROUNDS: AtomicU32 = AtomicU32::new(0);

/// Sets up the port.
pub(crate) fn open(
    usart: Peri<'static, peripherals::USART1>,
    tx: Peri<'static, impl TxPin<peripherals::USART1>>,
    rx: Peri<'static, impl RxPin<peripherals::USART1>>,
    tx_dma: Peri<'static, peripherals::DMA2_CH7>,
    rx_dma: Peri<'static, peripherals::DMA2_CH2>,
) -> (UartTx<'static, Async>, Receiver) {
    let mut config = Config::default();
    config.baudrate = BAUD;
    let Ok(transmitter) = UartTx::new(usart, tx, tx_dma, Irqs, config) else {
        panic!("2 Mbaud divide 84 MHz");
    };
    (transmitter, Receiver::new(rx, rx_dma))
}

/// The receiving half of the port.
pub(crate) struct Receiver {
    _pin: Flex<'static>,
    _stream: Peri<'static, peripherals::DMA2_CH2>,
    /// Bytes that were taken; wraps.
    taken: u32,
    /// Count of received bytes at the last error of the line.
    erred: u32,
}

/// Reason why bytes are missing or doubtful.
pub(crate) enum Missing {
    /// More came than the ring holds.
    Overrun,
    /// A byte had no stop bit, or came before the one before it was fetched.
    Broken,
    /// No byte is missing, but one had noise: the checksum of its frame shows if it is wrong.
    Noise,
}

impl Receiver {
    fn new(
        pin: Peri<'static, impl RxPin<peripherals::USART1>>,
        stream: Peri<'static, peripherals::DMA2_CH2>,
    ) -> Self {
        // Pulled up, so that a pin without a wire is an idle line, not noise.
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(AF7, AfType::input(Pull::Up));
        let ring = DMA2.st(STREAM);
        ring.par().write_value(USART1.dr().as_ptr() as u32);
        ring.m0ar().write_value(RING.as_ptr().expose_provenance() as u32);
        ring.ndtr().write(|w| w.set_ndt(SIZE as u16));
        ring.cr().write(|w| {
            w.set_chsel(REQUEST);
            w.set_dir(Dir::PERIPHERAL_TO_MEMORY);
            w.set_psize(Size::BITS8);
            w.set_msize(Size::BITS8);
            w.set_minc(true);
            w.set_circ(true);
            w.set_pl(Pl::HIGH);
            w.set_tcie(true);
            w.set_teie(true);
        });
        ring.cr().modify(|w| w.set_en(true));
        USART1.cr3().modify(|w| w.set_dmar(true));
        USART1.cr1().modify(|w| w.set_re(true));
        Self {
            _pin: pin,
            _stream: stream,
            taken: 0,
            erred: 0,
        }
    }

    /// Takes some bytes; waits for at least one.
    pub(crate) async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Missing> {
        loop {
            let status = USART1.sr().read();
            let came = came();
            let broken = status.fe() || status.ore();
            if (broken || status.ne()) && came != self.erred {
                self.erred = came;
                if !broken {
                    // The status was read, so the stream's next fetch clears the flag.
                    return Err(Missing::Noise);
                }
                // After the read of the status, this clears the flags (RM0090 section 30.6.1). A byte may get
                // lost, so all are dropped.
                let _ = USART1.dr().read();
                return Err(Missing::Broken);
            }
            let waiting = came.wrapping_sub(self.taken) as usize;
            if waiting > 0 {
                let length = waiting.min(bytes.len());
                for (byte, at) in bytes[..length].iter_mut().zip(self.taken as usize..) {
                    *byte = RING[at % SIZE].load(Ordering::Relaxed);
                }
                // The bytes may have been written over meanwhile.
                if self::came().wrapping_sub(self.taken) as usize > SIZE {
                    return Err(Missing::Overrun);
                }
                self.taken = self.taken.wrapping_add(length as u32);
                return Ok(length);
            }
            Timer::after(POLL).await;
        }
    }

    /// Drops all bytes until none has come for [`POLL`].
    pub(crate) async fn quiet(&mut self) {
        loop {
            let before = came();
            Timer::after(POLL).await;
            self.taken = came();
            if self.taken == before {
                return;
            }
        }
    }
}

/// Bytes that have come since the start; wraps.
fn came() -> u32 {
    fence(Ordering::Acquire);
    let left = || u32::from(DMA2.st(STREAM).ndtr().read().ndt());
    critical_section::with(|_| {
        let (mut rounds, mut left_now) = (ROUNDS.load(Ordering::Relaxed), left());
        // A round that ended while interrupts wait is not counted yet, and `left` may be from before its end.
        if DMA2.isr(STREAM / 4).read().tcif(STREAM % 4) {
            rounds = rounds.wrapping_add(1);
            left_now = left();
        }
        rounds
            .wrapping_mul(SIZE as u32)
            .wrapping_add(SIZE as u32 - left_now)
    })
}

/// The stream's interrupt: a round is complete, or the bus failed.
pub(crate) fn on_interrupt() {
    let flags = DMA2.isr(STREAM / 4).read();
    assert!(!flags.teif(STREAM % 4), "DMA: error on the receiver's stream");
    if flags.tcif(STREAM % 4) {
        DMA2.ifcr(STREAM / 4).write(|w| w.set_tcif(STREAM % 4, true));
        // The only writer.
        ROUNDS.store(ROUNDS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
}
