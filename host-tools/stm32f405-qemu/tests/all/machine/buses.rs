//! I2C and SPI within the machine: pins, devices, DMA and interrupts.

use stm32f405_qemu::{Device, SpiFrame};

use super::super::sensor::Sensor;
use super::bench::*;

const I2C1: u32 = 0x4000_5400;
const SPI1: u32 = 0x4001_3000;
const SR1: u32 = I2C1 + 0x14;
const AF: u32 = 1 << 10;
const BTF: u32 = 1 << 2;
const I2C1_EV: usize = 31;
const I2C1_ER: usize = 32;

/// Sends back the previous frame, with one bit inverted.
#[derive(Default)]
struct Echo {
    last: u16,
    frames: Vec<(SpiFrame, u64)>,
    selected: Vec<(bool, u64)>,
}

impl Device for Echo {
    fn select(&mut self, selected: bool, at_ns: u64) {
        self.selected.push((selected, at_ns));
    }

    fn exchange(&mut self, frame: SpiFrame, at_ns: u64) -> u16 {
        self.frames.push((frame, at_ns));
        std::mem::replace(&mut self.last, frame.word ^ 1)
    }
}

/// I2C1 at PB8 and PB9 (AF4), 100 kHz.
fn on_i2c(change: impl FnOnce(&mut stm32f405_qemu::Run)) -> MachineBench {
    let mut bench = MachineBench::with(change);
    bench.set(GPIOB, [(0x00, 0b1010 << 16), (0x04, 0b11 << 8), (0x24, 0x44)]);
    bench.set(I2C1, [(0x04, 42), (0x1c, 210), (0x00, 1)]);
    bench
}

fn pass(bench: &mut MachineBench, ns: u64) {
    bench.pass(bench.board.now + ns);
}

/// Sends START and an address, with these other bits in CR1.
fn address(bench: &mut MachineBench, byte: u32, cr1: u32) {
    bench.write(I2C1, 0x101 | cr1);
    pass(bench, 10_000);
    bench.write(I2C1 + 0x10, byte);
    pass(bench, 90_000);
    bench.read(SR1);
    bench.read(I2C1 + 0x18);
}

#[test]
fn a_sensor_takes_a_register_number_and_gives_bytes_after_a_repeated_start() {
    let mut sensor = None;
    let mut bench = on_i2c(|run| {
        let registers = [1, 2, 3, 4, 5, 6, 7, 8];
        let model = Sensor {
            registers,
            ..Sensor::default()
        };
        sensor = Some(run.devices.on_i2c("I2C1", 0x48, model));
    });
    address(&mut bench, 0x90, 0);
    bench.write(I2C1 + 0x10, 3);
    pass(&mut bench, 90_000);
    assert_eq!(bench.read(SR1) & BTF, BTF);
    // Two bytes: ACK is cleared and STOP requested while the second is being received.
    address(&mut bench, 0x91, 1 << 10);
    pass(&mut bench, 90_000);
    let first = bench.read(I2C1 + 0x10);
    bench.write(I2C1, 0x201);
    pass(&mut bench, 90_000);
    assert_eq!((first, bench.read(I2C1 + 0x10)), (4, 5));
    pass(&mut bench, 10_000);
    assert_eq!(bench.read(I2C1 + 0x18), 0, "the bus is free");
    assert_eq!(bench.read(GPIOB + 0x10) & 1, 1, "the sensor raises PB0");
    let sensor = sensor.unwrap();
    let sensor = sensor.lock().unwrap();
    // Each after START and nine bits; a byte in between.
    assert_eq!(sensor.starts, [(false, 100_000), (true, 290_000)]);
    assert_eq!(sensor.stops, 1);
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}

#[test]
fn an_address_without_a_device_and_a_bus_without_pins_give_af_with_its_interrupt() {
    let mut bench = on_i2c(|run| drop(run.devices.on_i2c("I2C1", 0x48, Sensor::default())));
    bench.write(I2C1 + 0x04, 42 | 1 << 8);
    address(&mut bench, 0x92, 0);
    assert_eq!(bench.read(SR1) & AF, AF);
    assert!(bench.has_line(I2C1_ER) && !bench.has_line(I2C1_EV));
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
    let mut bench = on_i2c(|run| drop(run.devices.on_i2c("I2C1", 0x48, Sensor::default())));
    bench.write(GPIOB + 0x24, 0x47);
    address(&mut bench, 0x90, 0);
    assert_eq!(bench.read(SR1) & AF, AF);
    assert!(bench.outcome().unmodelled[0].contains("no pins"));
    let mut bench = on_i2c(|_| {});
    address(&mut bench, 0x90, 0);
    assert!(bench.outcome().unmodelled[0].contains("no device of this run"));
}

/// SPI1 at PA5 to PA7 (AF5), PA4 as select: 84 MHz / 8, mode 3.
fn on_spi(change: impl FnOnce(&mut stm32f405_qemu::Run)) -> MachineBench {
    let mut bench = MachineBench::with(change);
    bench.set(
        GPIOA,
        [(0x18, 1 << 4), (0x20, 0x555 << 20), (0x00, 0b1010_1001 << 8)],
    );
    bench.write(SPI1, 0x300 | 1 << 6 | 2 << 3 | 1 << 2 | 0b11);
    bench
}

#[test]
fn a_frame_reaches_the_device_whose_pin_is_low_and_no_other() {
    let mut echoes = None;
    let mut bench = on_spi(|run| {
        let pins = ["PA4", "PB1"];
        echoes = Some(pins.map(|pin| run.devices.on_spi("SPI1", pin, Echo::default())));
    });
    let exchange = |bench: &mut MachineBench, word: u32| {
        bench.write(SPI1 + 0x0c, word);
        pass(bench, 800);
        bench.read(SPI1 + 0x0c)
    };
    bench.pass(1_000);
    assert_eq!(exchange(&mut bench, 0x11), 0, "MISO floats");
    bench.write(GPIOA + 0x18, 1 << 20);
    assert_eq!([0x22, 0x33].map(|word| exchange(&mut bench, word)), [0, 0x23]);
    bench.write(GPIOA + 0x18, 1 << 4);
    let [one, other] = echoes.unwrap();
    let one = one.lock().unwrap();
    let frame = |word| SpiFrame {
        word,
        bits: 8,
        mode: 3,
        hz: 10_500_000,
    };
    // 8 / 10.5 MHz.
    assert_eq!(
        one.frames,
        [(frame(0x22), 1_800 + 762), (frame(0x33), 2_600 + 762)]
    );
    assert_eq!(one.selected, [(true, 1_800), (false, 3_400)]);
    assert_eq!(
        (&other.lock().unwrap().frames, bench.outcome().unmodelled),
        (&vec![], vec![])
    );
}

#[test]
fn the_dma_exchanges_frames_both_ways_and_a_wire_brings_them_back() {
    const TX: u32 = stream(DMA2, 3);
    const RX: u32 = stream(DMA2, 0);
    let text = *b"there and back";
    let mut bench = on_spi(|run| run.wires = vec![("PA7".into(), "PA6".into())]);
    bench.board.sram[..text.len()].copy_from_slice(&text);
    let items = text.len() as u32;
    bench.write(SPI1 + 0x04, 0b11);
    bench.start_stream(RX, items, SPI1 + 0x0c, SRAM + 0x100, 3 << 25 | 1 << 10 | 1 << 4);
    bench.start_stream(TX, items, SPI1 + 0x0c, SRAM, 3 << 25 | 1 << 10 | 0b01 << 6);
    bench.pass(100_000);
    assert_eq!(bench.board.sram[0x100..][..text.len()], text);
    // 14 frames of 762 ns without a pause.
    assert_eq!(bench.board.rises[&DMA2_STREAM0], [14 * 762]);
}
