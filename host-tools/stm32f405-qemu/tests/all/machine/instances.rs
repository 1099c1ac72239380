//! Peripherals with several instances: timers, USARTs, converters; and the wires between them.

use stm32f405_qemu::{AnalogInput, Run, Since, UartInput};

use super::bench::*;

const GPIOC: u32 = 0x4002_0800;
const TIM1: u32 = 0x4001_0000;
const TIM8: u32 = 0x4001_0400;
const TIM12: u32 = 0x4000_1800;
const EXTI: u32 = 0x4001_3c00;
const ADC3: u32 = 0x4001_2200;
const ADC_CCR: u32 = 0x4001_2304;
const DMA1: u32 = 0x4002_6000;
const USART3: u32 = 0x4000_4800;
const UART4: u32 = 0x4000_4c00;
const USART6: u32 = 0x4001_1400;

const CR1: u32 = 0x00;
const DIER: u32 = 0x0c;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;

/// All clocks on.
fn bench(run: Run) -> MachineBench {
    let mut bench = MachineBench::of(run);
    for enable in [0x30, 0x40, 0x44] {
        bench.write(RCC + enable, u32::MAX);
    }
    bench
}

fn with_wires(wires: &[(&str, &str)]) -> MachineBench {
    let mut run = Run::new("");
    run.wires = wires
        .iter()
        .map(|(from, to)| ((*from).into(), (*to).into()))
        .collect();
    bench(run)
}

/// A pin gets an alternate function.
fn set_function(bench: &mut MachineBench, port: u32, pin: u32, function: u32) {
    let mode = bench.read(port) & !(0b11 << (2 * pin));
    bench.write(port, mode | 0b10 << (2 * pin));
    let register = port + 0x20 + 4 * (pin / 8);
    let functions = bench.read(register) & !(0xf << (4 * (pin % 8)));
    bench.write(register, functions | function << (4 * (pin % 8)));
}

/// 1 Mbit/s, 8N1, with these bits of CR1 beside UE, TE and RE. USART1 and USART6 have 84 MHz, the others 42.
fn start_usart(bench: &mut MachineBench, usart: u32, cr1: u32) {
    let pclk = if usart < 0x4001_0000 { 42 } else { 84 };
    bench.write(usart + 0x08, pclk);
    bench.write(usart + 0x0c, 1 << 13 | 0b11 << 2 | cr1);
}

#[test]
fn every_timer_interrupts_at_its_update_by_the_line_that_the_manual_gives_it() {
    // Address, line of the update, and clock in MHz: APB1's timers have 84, APB2's 168.
    let timers = [
        (0x4001_0000, 25, 168),
        (0x4000_0000, 28, 84),
        (0x4000_0400, 29, 84),
        (0x4000_0800, 30, 84),
        (0x4000_0c00, 50, 84),
        (0x4000_1000, 54, 84),
        (0x4000_1400, 55, 84),
        (0x4001_0400, 44, 168),
        (0x4001_4000, 24, 168),
        (0x4001_4400, 25, 168),
        (0x4001_4800, 26, 168),
        (0x4000_1800, 43, 84),
        (0x4000_1c00, 44, 84),
        (0x4000_2000, 45, 84),
    ];
    for (timer, line, mhz) in timers {
        let mut bench = bench(Run::new(""));
        // 1 MHz and a period of 25 us.
        for (register, value) in [
            (0x28, mhz - 1),
            (0x2c, 24),
            (EGR, 1),
            (SR, 0),
            (DIER, 1),
            (CR1, 1),
        ] {
            bench.write(timer + register, value);
        }
        bench.run(60_000, |bench| bench.write(timer + SR, 0));
        let rises: Vec<_> = bench.board.rises.iter().collect();
        assert_eq!(rises, [(&line, &vec![25_000, 50_000])], "{timer:#x}");
        assert_eq!(bench.outcome().unknown_registers, []);
    }
}

#[test]
fn two_timers_on_one_line_hold_it_until_both_are_quiet() {
    let mut bench = bench(Run::new(""));
    // TIM1's update and TIM10 share line 25.
    for timer in [TIM1, 0x4001_4400] {
        bench.write(timer + DIER, 1);
        bench.write(timer + EGR, 1);
    }
    assert!(bench.board.lines[25]);
    bench.write(TIM1 + SR, 0);
    assert!(bench.board.lines[25], "TIM10 still wants it");
    bench.write(0x4001_4400 + SR, 0);
    assert!(!bench.board.lines[25]);
}

#[test]
fn an_advanced_timer_counts_repetitions_and_has_a_line_for_each_kind_of_event() {
    let mut bench = bench(Run::new(""));
    // 168 MHz / 168, a period of 10 us, an update with every third; compare 1 at 4 us.
    for (register, value) in [
        (0x28, 167),
        (0x2c, 9),
        (0x30, 2),
        (0x34, 4),
        (EGR, 1),
        (SR, 0),
        (CR1, 1),
    ] {
        bench.write(TIM8 + register, value);
    }
    bench.write(TIM8 + DIER, 0b11);
    bench.run(70_000, |bench| bench.write(TIM8 + SR, 0));
    assert_eq!(bench.board.rises[&44], [30_000, 60_000], "update");
    assert_eq!(
        bench.board.rises[&46],
        [4_000, 14_000, 24_000, 34_000, 44_000, 54_000, 64_000],
        "compare"
    );
    // A break by software takes the outputs off.
    bench.write(TIM8 + 0x44, 1 << 15);
    bench.write(TIM8 + DIER, 1 << 7);
    bench.write(TIM8 + EGR, 1 << 7);
    assert!(bench.board.lines[43]);
    assert_eq!(bench.read(TIM8 + 0x44), 0);
}

#[test]
fn a_pwm_with_complementary_outputs_runs_and_says_that_no_pin_moves() {
    let mut bench = bench(Run::new(""));
    for (register, value) in [
        (0x18, 0x6868),
        (0x20, 0b0101_0101),
        (0x44, 1 << 15 | 100),
        (CR1, 1),
    ] {
        bench.write(TIM1 + register, value);
    }
    assert_eq!(
        bench.outcome().unmodelled[..2],
        [
            "TIM1 CCER: complementary outputs move no pin",
            "TIM1 CCMR: PWM moves no pin"
        ]
    );
}

#[test]
fn a_compare_output_moves_its_pin_and_over_a_wire_the_input_of_another_channel() {
    let (gpiob, tim2) = (0x4002_0400, 0x4000_0000);
    let mut run = Run::new("");
    run.record_pins = true;
    run.wires = vec![("PB10".into(), "PB11".into())];
    let mut bench = bench(run);
    // Channel 3 goes low at 84 000 clocks of 84 MHz, channel 4 latches falling edges and interrupts.
    for (register, value) in [
        (0x2c, u32::MAX),
        (0x1c, 0b101 << 4 | 0b01 << 8),
        (0x20, 1 << 8 | 0b11 << 12),
        (DIER, 1 << 4),
    ] {
        bench.write(tim2 + register, value);
    }
    // Alternate function 1, PB10 open-drain, PB11 with its pull-up.
    bench.write(gpiob + 0x24, 0x1100);
    bench.write(gpiob + 0x04, 1 << 10);
    bench.write(gpiob + 0x0c, 0b01 << 22);
    bench.write(gpiob, 0b1010 << 20);
    assert_eq!(bench.read(gpiob + 0x10) >> 11 & 1, 1, "let go");
    bench.write(tim2 + 0x3c, 84_000);
    bench.write(tim2 + 0x1c, 0b010 << 4 | 0b01 << 8);
    bench.write(tim2 + CR1, 1);
    bench.run(2_000_000, |bench| {
        bench.write(tim2 + SR, 0);
    });
    assert_eq!(bench.board.rises[&28], [1_000_000]);
    assert_eq!(
        (bench.read(tim2 + 0x40), bench.read(gpiob + 0x10) >> 10 & 0b11),
        (84_000, 0)
    );
    let outcome = bench.outcome();
    let moved = outcome.pins.iter().find(|pin| pin.name == "PB10").unwrap();
    assert_eq!(moved.changes.last(), Some(&(1_000_000, false)));
}

#[test]
fn the_lock_of_an_advanced_timer_protects_its_dead_time_and_cannot_be_taken_back() {
    let mut bench = bench(Run::new(""));
    bench.write(TIM1 + 0x44, 0b11 << 8 | 100);
    bench.write(TIM1 + 0x44, 1 << 15 | 7);
    assert_eq!(
        bench.read(TIM1 + 0x44),
        1 << 15 | 0b11 << 8 | 100,
        "MOE is never locked"
    );
    bench.write(TIM1 + 0x20, 0b1111);
    bench.write(TIM1 + 0x18, 0x78);
    bench.write(TIM1 + 0x04, 1 << 8);
    assert_eq!(
        [0x20, 0x18, 0x04].map(|register| bench.read(TIM1 + register)),
        [0b0101, 0, 0]
    );
}

#[test]
fn a_register_that_a_smaller_timer_lacks_is_reported() {
    let mut bench = bench(Run::new(""));
    bench.read(TIM12 + 0x3c);
    bench.write(0x4000_1000 + 0x20, 1);
    let unknown = bench.outcome().unknown_registers;
    let names: Vec<_> = unknown.iter().map(|register| register.name.as_str()).collect();
    assert_eq!(names, ["TIM6+0x20", "TIM12+0x3c"]);
}

#[test]
fn a_write_to_the_counter_or_an_enable_leaves_the_prescaler_where_it_is() {
    let mut bench = bench(Run::new(""));
    // 84 MHz / 8400 = 10 kHz.
    for (register, value) in [(0x28, 8399), (EGR, 1), (CR1, 1)] {
        bench.write(TIM3 + register, value);
    }
    bench.board.now = 160_000;
    bench.write(TIM3 + 0x24, 1000);
    bench.board.now = 199_999;
    assert_eq!(bench.read(TIM3 + 0x24), 1000);
    bench.board.now = 200_000;
    assert_eq!(bench.read(TIM3 + 0x24), 1001, "the tick that had begun at 100 us");
}

#[test]
fn every_usart_echoes_by_interrupt_on_its_own_pins() {
    const A: u32 = GPIOA;
    const B: u32 = GPIOB;
    // Number, name, address, line, transmitter, receiver, function.
    let usarts = [
        (1, "USART2", 0x4000_4400, 38, (A, 2), (A, 3), 7),
        (2, "USART3", USART3, 39, (B, 10), (B, 11), 7),
        (3, "UART4", UART4, 52, (A, 0), (A, 1), 8),
        (4, "UART5", 0x4000_5000, 53, (GPIOC, 12), (0x4002_0c00, 2), 8),
        (5, "USART6", USART6, 71, (GPIOC, 6), (GPIOC, 7), 8),
    ];
    for (number, name, address, line, tx, rx, function) in usarts {
        let mut run = Run::new("");
        run.uart_input = vec![UartInput {
            port: name.into(),
            at_ns: 50_000,
            bytes: b"echo".to_vec(),
        }];
        let mut bench = bench(run);
        set_function(&mut bench, tx.0, tx.1, function);
        set_function(&mut bench, rx.0, rx.1, function);
        start_usart(&mut bench, address, 1 << 5);
        bench.run(200_000, |bench| {
            assert!(bench.board.lines[line], "{name}");
            let byte = bench.read(address + 0x04);
            bench.write(address + 0x04, byte);
        });
        assert_eq!(
            bench.board.frames,
            b"echo".map(|byte| (number, byte.into())),
            "{name}"
        );
        assert_eq!(bench.outcome().unmodelled, [""; 0]);
    }
}

#[test]
fn a_usart_on_apb1_receives_and_sends_by_dma1() {
    let mut run = Run::new("");
    run.uart_input = vec![UartInput {
        port: "USART3".into(),
        at_ns: 10_000,
        bytes: b"absorber".to_vec(),
    }];
    let mut bench = bench(run);
    set_function(&mut bench, GPIOB, 10, 7);
    set_function(&mut bench, GPIOB, 11, 7);
    start_usart(&mut bench, USART3, 0);
    bench.write(USART3 + 0x14, 0b11 << 6);
    // Stream 1 channel 4 receives eight bytes, with an interrupt; stream 3 channel 4 then sends them.
    for (stream, cr) in [(1, 1 << 10 | 1 << 4), (3, 1 << 10 | 1 << 6)] {
        let at = DMA1 + 0x10 + 0x18 * stream;
        bench.write(at + 0x04, 8);
        bench.write(at + 0x08, USART3 + 0x04);
        bench.write(at + 0x0c, SRAM);
        bench.write(at, 4 << 25 | cr | u32::from(stream == 1));
    }
    bench.run(400_000, |bench| {
        // It is also woken for each byte.
        if bench.board.lines[12] {
            assert_eq!(bench.board.now, 90_000);
            bench.write(DMA1 + 0x08, 0x3f << 6);
            bench.write(DMA1 + 0x10 + 0x18 * 3, 4 << 25 | 1 << 10 | 1 << 6 | 1);
        }
    });
    assert_eq!(bench.board.frames, b"absorber".map(|byte| (2, byte.into())));
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}

#[test]
fn nine_data_bits_are_sent_whole_and_carried_whole_by_a_wire() {
    let mut bench = with_wires(&[("PC6", "PC11")]);
    set_function(&mut bench, GPIOC, 6, 8);
    set_function(&mut bench, GPIOC, 11, 8);
    for usart in [USART6, UART4] {
        start_usart(&mut bench, usart, 1 << 12);
    }
    bench.write(USART6 + 0x04, 0x1a5);
    bench.run(11_000, |_| {});
    assert_eq!(bench.board.frames, [(5, 0x1a5)]);
    assert_eq!(
        (bench.read(UART4) & 0x20, bench.read(UART4 + 0x04)),
        (0x20, 0x1a5)
    );
}

#[test]
fn over_a_wire_a_frame_of_another_baud_rate_is_a_framing_error_and_the_line_is_idle_after_the_last() {
    let mut bench = with_wires(&[("PB6", "PC7")]);
    set_function(&mut bench, GPIOC, 7, 8);
    start_usart(&mut bench, USART1, 0);
    start_usart(&mut bench, USART6, 1 << 4);
    bench.write(USART1 + 0x04, 0x55);
    bench.write(USART1 + 0x04, 0x66);
    bench.run(10_000, |_| {});
    assert_eq!(
        (bench.read(USART6) & 0x3f, bench.read(USART6 + 0x04)),
        (0x20, 0x55)
    );
    bench.run(20_000, |_| {});
    assert_eq!(
        (bench.read(USART6) & 0x3f, bench.read(USART6 + 0x04)),
        (0x20, 0x66)
    );
    bench.run(40_000, |bench| {
        assert_eq!(bench.board.now, 30_000, "one frame after the last");
        bench.read(USART6);
        bench.read(USART6 + 0x04);
    });
    assert_eq!(bench.board.rises[&71], [30_000]);
    // 5 % slower.
    bench.write(USART6 + 0x08, 88);
    bench.write(USART1 + 0x04, 0x55);
    bench.run(60_000, |_| {});
    assert_eq!(bench.read(USART6) & 0x22, 0x22, "FE and RXNE");
}

#[test]
fn a_usart_without_pins_sends_nothing_hears_nothing_and_says_so() {
    let mut run = Run::new("");
    run.uart_input = vec![UartInput::usart1(10_000, *b"x")];
    let mut bench = bench(run);
    bench.write(GPIOB, 0x0280);
    start_usart(&mut bench, USART1, 1 << 5);
    bench.write(USART1 + 0x04, 0x55);
    bench.run(100_000, |_| {});
    assert_eq!((bench.board.frames.len(), bench.board.lines[37]), (0, false));
    assert_eq!(
        bench.outcome().unmodelled,
        [
            "USART1 CR1.RE: bytes came, and no pin is its receiver",
            "USART1 CR1.TE: it sends, and no pin is its transmitter: nothing leaves the part"
        ]
    );
}

#[test]
fn a_wire_leads_an_output_to_an_input_and_to_a_capture() {
    let mut bench = with_wires(&[("PC0", "PC1"), ("PC0", "PA15")]);
    set_function(&mut bench, GPIOA, 15, 1);
    bench.write(TIM2 + 0x18, 0b01);
    bench.write(TIM2 + 0x20, 1);
    bench.write(TIM2, 1);
    bench.write(GPIOC, 0b01);
    let mut levels = Vec::new();
    for (at, level) in [(10_000, 1), (20_000, 0), (30_000, 1)] {
        bench.board.now = at;
        bench.write(GPIOC + 0x14, level);
        levels.push((bench.read(GPIOC + 0x10) >> 1 & 1, bench.read(TIM2 + 0x34)));
    }
    assert_eq!(levels, [(1, 840), (0, 840), (1, 2520)]);
    // With the output let go, nothing drives the wire: the pull-up of its other end does.
    bench.write(GPIOC + 0x0c, 0b01 << 2);
    bench.write(GPIOC + 0x14, 0);
    assert_eq!(bench.read(GPIOC + 0x10) & 0b10, 0);
    bench.write(GPIOC, 0);
    assert_eq!(bench.read(GPIOC + 0x10) & 0b10, 0b10);
}

#[test]
fn a_pin_is_read_by_each_converter_that_has_it() {
    let analog = |pin: &str, codes: &[u16]| AnalogInput {
        pin: pin.into(),
        since: Since::PowerUp,
        period_ns: 1_000_000,
        codes: codes.into(),
    };
    let mut run = Run::new("");
    run.analog_inputs = vec![
        analog("PC0", &[100, 200]),
        analog("PF6", &[300]),
        analog("PA4", &[400]),
    ];
    let mut bench = bench(run);
    bench.write(ADC1 + 0x304, 1 << 16);
    // One conversion at a time, by software: ADC1 at 0x000, ADC2 at 0x100, ADC3 at 0x200.
    let mut convert = |adc: u32, channel: u32, at: u64| {
        let base = ADC1 + 0x100 * (adc - 1);
        bench.board.now = at;
        bench.write(base + 0x34, channel);
        bench.write(base + 0x08, 1);
        bench.write(base + 0x08, 1 << 30 | 1);
        bench.run(at + 10_000, |_| {});
        bench.read(base + 0x4c)
    };
    assert_eq!(
        [1, 2, 3].map(|adc| convert(adc, 10, u64::from(adc) * 100_000)),
        [100; 3]
    );
    assert_eq!(convert(3, 10, 1_200_000), 200);
    assert_eq!(
        [convert(1, 4, 1_300_000), convert(3, 4, 1_400_000)],
        [400, 300],
        "PA4 and PF6"
    );
    assert_eq!(convert(2, 16, 1_500_000), 0);
    assert_eq!(
        bench.outcome().unmodelled,
        ["ADC2 channel 16 (no pin) has no stimulus: it reads 0"]
    );
}

#[test]
fn the_third_converter_samples_by_a_trigger_into_memory_as_the_first_does() {
    let mut run = Run::new("");
    run.stimulus = ramp(400);
    run.stimulus_since = Since::FirstScan;
    let mut bench = bench(run);
    // The prescaler is common, and ADC1's clock is off.
    bench.write(RCC + 0x44, 1 << 10);
    bench.write(ADC_CCR, 1 << 16);
    assert_eq!(bench.read(ADC_CCR), 1 << 16);
    // DMA2 stream 1, channel 2.
    let stream = STREAM0 + 0x18;
    for (register, value) in [(0x04, 64), (0x08, ADC3 + 0x4c), (0x0c, SRAM)] {
        bench.write(stream + register, value);
    }
    bench.write(
        stream,
        2 << 25 | 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 1 << 4 | 1,
    );
    for (register, value) in [(0x04, 1 << 8), (0x10, 0b011_011), (0x2c, 1 << 20), (0x34, 1 << 5)] {
        bench.write(ADC3 + register, value);
    }
    bench.write(ADC3 + 0x08, ADON_DMA_BY_TIM3);
    bench.start_tim3();
    bench.run(330_000, |bench| bench.write(DMA2 + 0x08, 0x3f << 6));
    let expected: Vec<u16> = (0..32).flat_map(|i| [i, 1000 + i]).collect();
    assert_eq!(bench.halfwords(SRAM, 64), expected);
    assert_eq!(
        (bench.board.rises[&57].len(), &bench.board.blocks[..]),
        (1, &[32][..])
    );
    assert_eq!(bench.outcome().sampling.unwrap().first_ns, 10_000);
    assert_eq!(bench.outcome().unknown_registers, []);
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}

#[test]
fn the_sensors_of_the_part_belong_to_the_first_converter_alone() {
    let mut bench = bench(Run::new(""));
    bench.write(ADC_CCR, 0b11 << 22);
    for (converter, channel, expected) in [(0, 16, 943), (0, 17, 1502), (0, 18, 2047), (1, 17, 0)] {
        let base = ADC1 + 0x100 * converter;
        bench.write(base + 0x34, channel);
        bench.write(base + 0x08, 1);
        bench.write(base + 0x08, 1 << 30 | 1);
        let now = bench.board.now;
        bench.run(now + 100_000, |_| {});
        assert_eq!(bench.read(base + 0x4c), expected, "channel {channel}");
    }
}

#[test]
fn a_stream_that_waits_for_a_request_that_no_model_makes_is_noted_by_its_name() {
    let mut bench = bench(Run::new(""));
    for (dma, stream, channel) in [(DMA1, 5, 3), (DMA1, 0, 0), (DMA1, 5, 4)] {
        let at = dma + 0x10 + 0x18 * stream;
        bench.write(at, 0);
        bench.write(at + 0x04, 8);
        bench.write(at, channel << 25 | 1);
    }
    assert_eq!(
        bench.outcome().unmodelled,
        [
            "DMA1 S0CR: the stream waits for SPI3_RX, which no model requests",
            "DMA1 S5CR: the stream waits for TIM2_CH1, which no model requests",
        ]
    );
}

#[test]
fn a_burst_that_does_not_fit_the_fifo_stops_the_stream_with_its_error() {
    // Memory size, burst, threshold: table 49.
    let fits = |size: u32, burst: u32, threshold: u32| {
        let mut bench = bench(Run::new(""));
        bench.write(STREAM0 + 0x04, 64);
        bench.write(STREAM0 + 0x14, 1 << 2 | threshold);
        bench.write(STREAM0, burst << 23 | size << 13 | 1);
        let enabled = bench.read(STREAM0) & 1 == 1;
        assert_eq!(bench.read(DMA2) & 1 == 1, !enabled, "FEIF0");
        enabled
    };
    let allowed: Vec<_> = (0..3)
        .flat_map(|size| (1..4).map(move |burst| (size, burst)))
        .map(|(size, burst)| [0, 1, 2, 3].map(|threshold| fits(size, burst, threshold)))
        .collect();
    assert_eq!(
        allowed,
        [
            [true, true, true, true],
            [false, true, false, true],
            [false, false, false, true],
            [false, true, false, true],
            [false, false, false, true],
            [false; 4],
            [false, false, false, true],
            [false; 4],
            [false; 4],
        ]
    );
    assert!(fits(2, 0, 0), "single transfers always fit");
}

#[test]
fn copies_between_memories_leave_direct_mode_and_cannot_be_circular_or_of_dma1() {
    let started = |dma: u32, cr: u32| {
        let mut bench = bench(Run::new(""));
        bench.write(dma + 0x10 + 0x04, 8);
        bench.write(dma + 0x10 + 0x08, SRAM);
        bench.write(dma + 0x10 + 0x0c, SRAM + 64);
        bench.write(dma + 0x10, 0b10 << 6 | 0b11 << 9 | cr | 1);
        let copied = bench.read(dma) & 1 << 5 != 0;
        (
            copied,
            bench.read(dma + 0x10 + 0x14) >> 2 & 1,
            bench.outcome().unmodelled,
        )
    };
    assert_eq!(started(DMA2, 0), (true, 1, vec![]));
    let (copied, _, notes) = started(DMA2, 1 << 8);
    assert!(!copied && notes[0].contains("cannot be circular"), "{notes:?}");
    let (copied, _, notes) = started(DMA1, 0);
    assert!(!copied && notes[0].contains("DMA1 cannot copy"), "{notes:?}");
}

#[test]
fn a_wire_leads_an_output_to_an_external_interrupt() {
    let mut bench = with_wires(&[("PC0", "PC1")]);
    // Line 1 of port C, both edges.
    for (register, value) in [
        (0x4001_3808, 2 << 4),
        (EXTI, 2),
        (EXTI + 0x08, 2),
        (EXTI + 0x0c, 2),
    ] {
        bench.write(register, value);
    }
    bench.write(GPIOC, 0b01);
    let mut pending = Vec::new();
    for level in [1, 1, 0] {
        bench.write(GPIOC + 0x14, level);
        pending.push((bench.board.lines[7], bench.read(EXTI + 0x14)));
        bench.write(EXTI + 0x14, 2);
    }
    assert_eq!(pending, [(true, 2), (false, 0), (true, 2)]);
}
