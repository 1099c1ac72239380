//! PWM outputs on their pins, over wires to inputs that measure them, and the DMA requests of timers.

use super::bench::*;

const DMA1_STREAM5: usize = 16;

/// TIM3 at 100 kHz with its first channel in PWM mode 1, high for a quarter, at PA6 (AF2).
fn modulating(change: impl FnOnce(&mut stm32f405_qemu::Run)) -> MachineBench {
    let mut bench = MachineBench::with(change);
    bench.set(GPIOA, [(0x20, 2 << 24 | 1), (0x00, 0b10 << 12 | 0b10)]);
    bench.set(
        TIM3,
        [(0x2c, 839), (0x34, 210), (0x18, 0b110 << 4 | 1 << 3), (0x20, 1)],
    );
    bench.set(TIM3, [(0x14, 1), (0x00, 1)]);
    bench
}

#[test]
fn captures_go_to_memory_by_dma_with_the_interrupt_of_the_stream() {
    let mut bench = modulating(|run| run.wires = vec![("PA6".into(), "PA0".into())]);
    // Both edges of TI1 by channel 1: DMA1 stream 5, channel 3.
    bench.set(TIM2, [(0x18, 0b01), (0x20, 0b1011), (0x0c, 1 << 9)]);
    let words = 3 << 25 | 0b10 << 13 | 0b10 << 11 | 1 << 10 | 1 << 4;
    bench.start_stream(stream(DMA1, 5), 4, TIM2 + 0x34, SRAM, words);
    bench.write(TIM2, 1);
    bench.run(100_000, |_| {});
    let captured = bench.halfwords(SRAM, 8);
    assert_eq!(captured, [210, 0, 840, 0, 1050, 0, 1680, 0]);
    assert_eq!(bench.board.rises[&DMA1_STREAM5], [20_000]);
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}

/// LED strips are driven this way: a compare value for each period.
#[test]
fn an_update_fetches_the_next_compare_value_by_dma() {
    let mut bench = modulating(|run| run.record_pins = true);
    for (place, value) in [420_u16, 84, 0].into_iter().enumerate() {
        bench.board.sram[2 * place..][..2].copy_from_slice(&value.to_le_bytes());
    }
    // TIM3_UP: DMA1 stream 2, channel 5.
    let halfwords = 5 << 25 | 0b01 << 13 | 0b01 << 11 | 1 << 10 | 0b01 << 6 | 1 << 4;
    bench.start_stream(stream(DMA1, 2), 3, TIM3 + 0x34, SRAM, halfwords);
    bench.write(TIM3 + 0x0c, 1 << 8);
    bench.pass(55_000);
    // Each value takes effect one update after its fetch.
    let widths: Vec<_> = bench.outcome().pins[0]
        .changes
        .chunks_exact(2)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    assert_eq!(widths, [2_500, 2_500, 5_000, 1_000]);
    assert_eq!(bench.board.rises[&13], [30_000], "DMA1_Stream2");
}
