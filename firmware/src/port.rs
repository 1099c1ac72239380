//! USART1, both ways, by DMA.
//!
//! # Design
//! 2 Mbaud is 84 MHz / 42 exactly, and what USB serial bridges of today do. 8 data bits, no parity, 1 stop bit, no
//! flow control: neither end can stop the other, so neither can be stopped.
//!
//! What comes in goes round a ring without the core, which is woken at its half, at its end, and when the line falls
//! idle. USART1's own interrupt is one of the lowest: a line that falls idle after every byte costs idle time.

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

/// That of [`Parts::rx_dma`].
const RX_STREAM: usize = 2;
const BAUD: u32 = 2_000_000;

/// What the receiver may fall behind: 5 ms at full rate.
pub(crate) type Ring = [u8; 1024];

/// USART1, its pins and its DMA streams.
pub(crate) struct Parts {
    pub(crate) usart: Peri<'static, peripherals::USART1>,
    pub(crate) tx: Peri<'static, peripherals::PA9>,
    pub(crate) rx: Peri<'static, peripherals::PA10>,
    pub(crate) tx_dma: Peri<'static, peripherals::DMA2_CH7>,
    pub(crate) rx_dma: Peri<'static, peripherals::DMA2_CH2>,
}

/// Makes a receiver's DMA that was stopped begin at the start of its ring again.
///
/// The driver starts it without that, and a stream that is started goes round in as many bytes as NDTR says, from the start
/// of its memory on (RM0090 sections 10.3.9 and 10.3.15): in a part of the ring, and not where the driver looks. The round
/// that stopping it counts (section 10.3.14: TCIF is set) is the one that is begun here.
pub(crate) fn rewind() {
    let stream = DMA2.st(RX_STREAM);
    if !stream.cr().read().en() {
        stream.ndtr().write(|w| w.set_ndt(size_of::<Ring>() as u16));
    }
}

/// Sets up the port.
pub(crate) fn open(
    parts: Parts,
    ring: &'static mut Ring,
) -> (UartTx<'static, Async>, RingBufferedUartRx<'static>) {
    let mut config = Config::default();
    config.baudrate = BAUD;
    // A pin that nothing is wired to is an idle line, not noise.
    config.rx_pull = gpio::Pull::Up;
    let port = Uart::new(
        parts.usart,
        parts.rx,
        parts.tx,
        parts.tx_dma,
        parts.rx_dma,
        Irqs,
        config,
    );
    interrupt::USART1.set_priority(Priority::P6);
    let (transmitter, receiver) = port.expect("2 Mbaud divide 84 MHz").split();
    (transmitter, receiver.into_ring_buffered(ring))
}
