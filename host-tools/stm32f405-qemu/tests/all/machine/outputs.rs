//! The DAC: its timers, its DMA streams, and wires from its outputs to the converters.

use stm32f405_qemu::{AnalogWire, Since};

use super::bench::*;

const TIM6: u32 = 0x4000_1000;
const DAC: u32 = 0x4000_7400;
/// The streams of its two channels, both by their channel 7.
const STREAMS: [u32; 2] = [stream(DMA1, 5), stream(DMA1, 6)];
const DMA1_STREAM5: usize = 16;
const TIM6_DAC: usize = 54;

const CR: u32 = 0x00;
const DHR12RD: u32 = 0x20;
const DOR1: u32 = 0x2c;
const SR: u32 = 0x34;
/// EN, TEN, and TIM6 as trigger.
const BY_TIM6: u32 = 0b101;
const DMAEN: u32 = 1 << 12;
const DMAUDRIE: u32 = 1 << 13;

/// Both channels by TIM6, 10 us, from a ring of `words` pairs by one request, with these bits of SxCR.
fn play(bench: &mut MachineBench, words: &[[u16; 2]], cr: u32) {
    for (place, pair) in words.iter().enumerate() {
        bench.board.sram[4 * place..][..4]
            .copy_from_slice(&[pair[0].to_le_bytes(), pair[1].to_le_bytes()].concat());
    }
    // Channel 7, words, memory increments, to the peripheral.
    let cr = 7 << 25 | 0b10 << 13 | 0b10 << 11 | 1 << 10 | 0b01 << 6 | cr;
    bench.start_stream(STREAMS[0], words.len() as u32, DAC + DHR12RD, SRAM, cr);
    bench.write(DAC + CR, (BY_TIM6 | DMAEN) | BY_TIM6 << 16);
    bench.set(TIM6, [(0x2c, 839), (0x04, 0b010 << 4), (0x00, 1)]);
}

fn outputs(bench: &mut MachineBench) -> [u32; 2] {
    [DOR1, DOR1 + 4].map(|output| bench.read(DAC + output))
}

#[test]
fn a_timer_plays_pairs_from_memory_by_one_request() {
    let mut bench = MachineBench::with(|_| {});
    play(&mut bench, &[[1000, 3000], [1100, 2900], [1200, 2800]], 0b1_0000);
    let mut played = Vec::new();
    for period in 1..=6 {
        bench.pass(10_000 * period + 5_000);
        played.push(outputs(&mut bench));
    }
    // The first trigger outputs the held value; from then on the stream is one ahead.
    assert_eq!(
        played,
        [
            [0, 0],
            [1000, 3000],
            [1100, 2900],
            [1200, 2800],
            [1200, 2800],
            [1200, 2800]
        ]
    );
    assert_eq!(
        bench.board.rises[&DMA1_STREAM5],
        [30_000],
        "the last pair is fetched"
    );
    assert_eq!(
        bench.read(DAC + SR),
        1 << 13,
        "nobody serves the trigger after that"
    );
    let outcome = bench.outcome();
    assert_eq!((outcome.unmodelled, outcome.unknown_registers), (vec![], vec![]));
}

#[test]
fn a_channel_of_its_own_has_its_own_stream_and_an_underrun_interrupts() {
    let mut bench = MachineBench::with(|_| {});
    let cr = 7 << 25 | 0b01 << 13 | 0b01 << 11 | 1 << 10 | 0b01 << 6;
    bench.board.sram[..4].copy_from_slice(&[0xe8, 3, 0xe9, 3]);
    bench.start_stream(STREAMS[1], 2, DAC + 0x14, SRAM, cr);
    bench.write(DAC + CR, (BY_TIM6 | DMAEN | DMAUDRIE) << 16);
    bench.set(TIM6, [(0x2c, 839), (0x04, 0b010 << 4), (0x00, 1)]);
    bench.pass(35_000);
    assert_eq!(outputs(&mut bench), [0, 1001]);
    bench.pass(65_000);
    // The third trigger requests data, and the fourth finds the request not served.
    assert_eq!(bench.board.rises[&TIM6_DAC], [40_000]);
    assert_eq!(bench.read(DAC + SR), 1 << 29);
}

#[test]
fn wires_lead_outputs_to_inputs_and_an_input_without_one_keeps_its_own_codes() {
    let wire = |from, to, gain| {
        let mut wire = AnalogWire::new(from, to);
        wire.gain = gain;
        wire
    };
    let mut bench = MachineBench::with(|run| {
        run.stimulus = vec![[7, 8, 9, 10]];
        run.stimulus_since = Since::PowerUp;
        run.analog_wires = vec![
            wire("PA4", "PA0", 1.0),
            wire("PA5", "PA2", 1.0),
            wire("PA4", "PA1", 1.0 / 16.0),
        ];
    });
    bench.write(ADC_CCR, 1 << 16);
    let codes = |bench: &mut MachineBench, adc| [0, 1, 2, 3].map(|channel| bench.convert(adc, channel));
    assert_eq!(codes(&mut bench, ADC3), [7, 8, 9, 10], "the outputs are off");
    bench.set(DAC, [(DHR12RD, 3000 << 16 | 1600), (CR, 1 << 16 | 1)]);
    bench.pass(bench.board.now + 5_000);
    assert_eq!(codes(&mut bench, ADC3), [1600, 100, 3000, 10]);
    assert_eq!(codes(&mut bench, ADC1), [1600, 100, 3000, 10]);
    let own = [4, 5].map(|channel| bench.convert(ADC1, channel));
    assert_eq!(own, [1600, 3000], "their own pins");
    bench.set(DAC, [(CR, 1 << 16)]);
    assert_eq!(bench.convert(ADC1, 4), 0, "a pin that is open");
    bench.set(DAC, [(CR, 1 << 16 | 1), (DHR12RD, 3000 << 16 | 4095)]);
    bench.pass(bench.board.now + 5_000);
    assert_eq!(bench.convert(ADC1, 4), 4095 - 249, "0.2 V below the supply");
    bench.set(DAC, [(CR, 1 << 16)]);
    assert_eq!(codes(&mut bench, ADC3), [7, 8, 3000, 10]);
    // The first conversion came too soon after the outputs were switched on.
    assert_eq!(
        bench.outcome().unmodelled,
        [
            "DAC CR.BOFF is clear: the output ends 0.2 V before the rails, as under full load; under less load, \
             silicon comes closer",
            "ADC1 channel 4 (pin PA4) has no stimulus: it reads 0",
        ]
    );
}

#[test]
fn scans_and_outputs_of_the_same_timer_go_together() {
    let mut bench = MachineBench::with(|run| run.analog_wires = vec![AnalogWire::new("PA4", "PA0")]);
    // TIM2, which both can have.
    for (place, code) in [1000_u16, 1010, 1020, 1030].into_iter().enumerate() {
        bench.board.sram[0x1000 + 2 * place..][..2].copy_from_slice(&code.to_le_bytes());
    }
    let cr = 7 << 25 | 0b01 << 13 | 0b01 << 11 | 1 << 10 | 0b01 << 6;
    bench.start_stream(STREAMS[0], 4, DAC + 0x08, SRAM + 0x1000, cr);
    bench.write(DAC + CR, 0b100 << 3 | 0b101 | DMAEN);
    bench.start_stream(STREAM0, 12, ADC1 + 0x4c, SRAM, 1 << 13 | 1 << 11 | 1 << 10);
    bench.write(ADC1 + 0x04, 1 << 8);
    bench.write(ADC_CCR, 1 << 16);
    bench.set(ADC1, [(0x10, 0b011_011), (0x2c, 1 << 20), (0x34, 0)]);
    bench.write(ADC1 + 0x08, ADON_DMA_BY_TIM3 & !(0xf << 24) | 0b0110 << 24);
    bench.set(TIM2, [(0x2c, 839), (0x04, 0b010 << 4), (0x00, 1)]);
    bench.pass(69_000);
    // Each scan converts PA0 twice.
    assert_eq!(
        bench.halfwords(SRAM, 12),
        [
            249, 249, 1000, 1000, 1010, 1010, 1020, 1020, 1030, 1030, 1030, 1030
        ]
    );
}
