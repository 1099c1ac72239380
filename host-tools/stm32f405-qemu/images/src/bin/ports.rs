//! Three ports by embassy's drivers: one echoes by interrupt what comes from outside, two talk over a wire by
//! DMA.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_stm32::usart::{BufferedInterruptHandler, BufferedUart, Config, InterruptHandler, Uart, UartTx};
use embassy_stm32::{bind_interrupts, dma, peripherals};
use embedded_io_async::{Read, Write};
use stm32f405_qemu_images::done;

bind_interrupts!(struct Irqs {
    USART3 => BufferedInterruptHandler<peripherals::USART3>;
    USART6 => InterruptHandler<peripherals::USART6>;
    DMA1_STREAM6 => dma::InterruptHandler<peripherals::DMA1_CH6>;
    DMA2_STREAM1 => dma::InterruptHandler<peripherals::DMA2_CH1>;
    DMA2_STREAM6 => dma::InterruptHandler<peripherals::DMA2_CH6>;
});

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(Default::default());

    let (mut sending, mut receiving) = ([0; 16], [0; 16]);
    let (tx, rx) = (p.PB10, p.PB11);
    let mut echo = BufferedUart::new(
        p.USART3,
        rx,
        tx,
        &mut sending,
        &mut receiving,
        Irqs,
        Config::default(),
    )
    .expect("115200 baud can be made of 16 MHz");
    for _ in 0..4 {
        let mut byte = [0];
        echo.read_exact(&mut byte).await.expect("no byte was lost");
        echo.write_all(&byte).await.expect("the port is open");
    }
    echo.flush().await.expect("the port is open");

    let mut from = UartTx::new(p.USART2, p.PA2, p.DMA1_CH6, Irqs, Config::default())
        .expect("115200 baud can be made of 16 MHz");
    let mut to = Uart::new(
        p.USART6,
        p.PC7,
        p.PC6,
        p.DMA2_CH6,
        p.DMA2_CH1,
        Irqs,
        Config::default(),
    )
    .expect("115200 baud can be made of 16 MHz");
    let mut text = [0; 32];
    let (received, sent) =
        embassy_futures::join::join(to.read_until_idle(&mut text), from.write(b"over a wire")).await;
    sent.expect("the port is open");
    let received = received.expect("the frames fit");
    defmt::info!("received {=[u8]:a}", text[..received]);
    done();
}
