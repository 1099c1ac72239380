//! A sensor on I2C and a memory on SPI, by embassy's drivers: blocking, and with DMA.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::i2c::{self, I2c};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::mhz;
use embassy_stm32::{bind_interrupts, dma, peripherals};
use stm32f405_qemu_images::done;

bind_interrupts!(struct Irqs {
    I2C1_EV => i2c::EventInterruptHandler<peripherals::I2C1>;
    I2C1_ER => i2c::ErrorInterruptHandler<peripherals::I2C1>;
    DMA1_STREAM6 => dma::InterruptHandler<peripherals::DMA1_CH6>;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
    DMA2_STREAM3 => dma::InterruptHandler<peripherals::DMA2_CH3>;
    DMA2_STREAM2 => dma::InterruptHandler<peripherals::DMA2_CH2>;
});

const SENSOR: u8 = 0x48;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(Default::default());

    let mut bus = I2c::new(
        p.I2C1,
        p.PB8,
        p.PB9,
        p.DMA1_CH6,
        p.DMA1_CH0,
        Irqs,
        i2c::Config::default(),
    );
    let mut bytes = [0; 4];
    bus.blocking_write_read(SENSOR, &[0], &mut bytes)
        .expect("the sensor is there");
    defmt::info!("blocking {}", bytes);
    bus.blocking_write(SENSOR, &[6, 60, 61])
        .expect("the sensor is there");
    bus.write_read(SENSOR, &[4], &mut bytes)
        .await
        .expect("the sensor is there");
    defmt::info!("by DMA {}", bytes);
    let mut byte = [0];
    bus.write(SENSOR, &[7]).await.expect("the sensor is there");
    bus.read(SENSOR, &mut byte).await.expect("the sensor is there");
    defmt::info!("one byte {}", byte);
    let nobody = bus.blocking_write(0x49, &[0]).is_err();
    let nobody_async = bus.read(0x49, &mut byte).await.is_err();
    defmt::info!("nobody there: {} {}", nobody, nobody_async);
    // The bus works after an error too.
    bus.blocking_read(SENSOR, &mut byte).expect("the sensor is there");

    let mut config = spi::Config::default();
    config.frequency = mhz(1);
    let mut bus = Spi::new(p.SPI1, p.PA5, p.PA7, p.PA6, p.DMA2_CH3, p.DMA2_CH2, Irqs, config);
    let mut select = Output::new(p.PA4, Level::High, Speed::High);
    let mut identity = [0x9f_u8, 0, 0, 0];
    select.set_low();
    bus.blocking_transfer_in_place(&mut identity)
        .expect("no frame is lost");
    select.set_high();
    defmt::info!("identity {=[u8]:#x}", identity[1..]);
    let mut page = [0_u8; 36];
    page[..4].copy_from_slice(&[0x03, 0, 0, 16]);
    select.set_low();
    bus.transfer_in_place(&mut page).await.expect("no frame is lost");
    select.set_high();
    defmt::info!("page {}", page[4..8]);
    select.set_low();
    bus.blocking_write(&[0x1234_u16]).expect("no frame is lost");
    select.set_high();
    done();
}
