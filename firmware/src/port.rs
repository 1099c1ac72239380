//! USART1, both ways, by DMA.
//!
//! # Design
//! 2 Mbaud is exactly 84 MHz / 42, and common USB serial bridges can do it. 8 data bits, no parity, 1 stop
//! bit. There is no flow control, so neither end can stop the other.
//!
//! The DMA puts the bytes that come in into a ring. The core is woken at the half and at the end of the ring,
//! and when the line falls idle. USART1's own interrupt has one of the lowest priorities: a line that falls
//! idle after every byte costs idle time only.

use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::mode::Async;
use embassy_stm32::pac::DMA2;
use embassy_stm32::usart::{self, Config, RingBufferedUartRx, Uart, UartTx};
use embassy_stm32::{Peri, bind_interrupts, dma, gpio, peripherals};

bind_interrupts!(struct Irqs {
    USART1 => usart::InterruptHandler<peripherals::USART1>;
    DMA2_STREAM2 => dma::InterruptHandler<peripherals::DMA2_CH2>;
    DMA2_STREAM7 => dma::InterruptHandler<peripherals::DMA2_CH7>;
});

/// Number of the receiver's stream.
const RX_STREAM: usize = 2;
const BAUD: u32 = 2_000_000;

/// Bytes by which the receiver may fall behind: 5 ms at full rate.
pub(crate) type Ring = [u8; 1024];

/// Makes the receiver's DMA, if it was stopped, begin at the start of its ring again.
///
/// The driver starts the stream without setting NDTR. The stream would then go round in as many bytes as NDTR
/// was left with, from the start of the memory on (RM0090 sections 10.3.9 and 10.3.15): in a part of the
/// ring, and not where the driver looks. Stopping a stream sets TCIF (section 10.3.14), which the driver
/// counts as a round: it is the round that begins here.
pub(crate) fn rewind() {
    let stream = DMA2.st(RX_STREAM);
    if !stream.cr().read().en() {
        stream.ndtr().write(|w| w.set_ndt(size_of::<Ring>() as u16));
    }
}

/// Sets up the port.
pub(crate) fn open(
    usart: Peri<'static, peripherals::USART1>,
    tx: Peri<'static, peripherals::PA9>,
    rx: Peri<'static, peripherals::PA10>,
    tx_dma: Peri<'static, peripherals::DMA2_CH7>,
    rx_dma: Peri<'static, peripherals::DMA2_CH2>,
    ring: &'static mut Ring,
) -> (UartTx<'static, Async>, RingBufferedUartRx<'static>) {
    let mut config = Config::default();
    config.baudrate = BAUD;
    // A pin without a wire is then an idle line, not noise.
    config.rx_pull = gpio::Pull::Up;
    let port = Uart::new(usart, rx, tx, tx_dma, rx_dma, Irqs, config);
    interrupt::USART1.set_priority(Priority::P6);
    let (transmitter, receiver) = port.expect("2 Mbaud divide 84 MHz").split();
    (transmitter, receiver.into_ring_buffered(ring))
}
