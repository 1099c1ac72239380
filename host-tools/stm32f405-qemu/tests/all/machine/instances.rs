//! Peripherals with several instances: timers, USARTs, converters; and the wires between them.

use stm32f405_qemu::{AnalogInput, FaultKind, PinInput, Since, UartInput};

use super::bench::*;

const TIM1: u32 = 0x4001_0000;
const TIM6: u32 = 0x4000_1000;
const TIM8: u32 = 0x4001_0400;
const TIM10: u32 = 0x4001_4400;
const TIM12: u32 = 0x4000_1800;
const USART3: u32 = 0x4000_4800;
const UART4: u32 = 0x4000_4c00;
const USART6: u32 = 0x4001_1400;

const CR1: u32 = 0x00;
const DIER: u32 = 0x0c;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2c;

fn bench() -> MachineBench {
    MachineBench::with(|_| {})
}

fn with_wires(wires: &[(&str, &str)]) -> MachineBench {
    let owned = |(from, to): &(&str, &str)| ((*from).into(), (*to).into());
    MachineBench::with(|run| {
        run.wires = wires.iter().map(owned).collect();
        run.record_pins = true;
    })
}

/// Sets a pin to an alternate function.
fn set_function(bench: &mut MachineBench, port: u32, pin: u32, function: u32) {
    let mode = bench.read(port) & !(0b11 << (2 * pin));
    bench.write(port, mode | 0b10 << (2 * pin));
    let register = port + 0x20 + 4 * (pin / 8);
    let functions = bench.read(register) & !(0xf << (4 * (pin % 8)));
    bench.write(register, functions | function << (4 * (pin % 8)));
}

#[test]
fn every_timer_interrupts_at_its_update_by_the_line_that_the_manual_gives_it() {
    // Positions from 0x4000_0000, 0x400 bytes each; those from 64 are on APB2. Lines of the updates.
    let places = [64, 0, 1, 2, 3, 4, 5, 65, 80, 81, 82, 6, 7, 8];
    let lines = [25, 28, 29, 30, 50, 54, 55, 44, 24, 25, 26, 43, 44, 45];
    for (place, line) in places.into_iter().zip(lines) {
        let (timer, mhz) = (0x4000_0000 + 0x400 * place, if place < 64 { 84 } else { 168 });
        let mut bench = bench();
        // 1 MHz and a period of 25 us.
        bench.set(timer, [(PSC, mhz - 1), (ARR, 24), (EGR, 1)]);
        bench.set(timer, [(SR, 0), (DIER, 1), (CR1, 1)]);
        bench.run(60_000, |bench| bench.write(timer + SR, 0));
        let rises: Vec<_> = bench.board.rises.iter().collect();
        assert_eq!(rises, [(&line, &vec![25_000, 50_000])], "{timer:#x}");
        assert_eq!(bench.outcome().unknown_registers, []);
    }
}

#[test]
fn two_timers_on_one_line_hold_it_until_both_are_quiet() {
    let mut bench = bench();
    for timer in [TIM1, TIM10] {
        bench.set(timer, [(DIER, 1), (EGR, 1)]);
    }
    assert!(bench.has_line(25));
    bench.write(TIM1 + SR, 0);
    assert!(bench.has_line(25), "TIM10 still wants it");
    bench.write(TIM10 + SR, 0);
    assert!(!bench.has_line(25));
}

#[test]
fn an_advanced_timer_counts_repetitions_and_has_a_line_for_each_kind_of_event() {
    let mut bench = bench();
    // 168 MHz / 168, a period of 10 us, an update with every third; compare 1 at 4 us.
    bench.set(TIM8, [(PSC, 167), (ARR, 9), (0x30, 2), (0x34, 4)]);
    bench.set(TIM8, [(EGR, 1), (SR, 0), (CR1, 1), (DIER, 0b11)]);
    bench.run(70_000, |bench| bench.write(TIM8 + SR, 0));
    assert_eq!(bench.board.rises[&44], [30_000, 60_000], "update");
    let compares: Vec<u64> = (0..7).map(|period| 4_000 + 10_000 * period).collect();
    assert_eq!(bench.board.rises[&46], compares);
    // A break by software turns the outputs off.
    bench.set(TIM8, [(0x44, 1 << 15), (DIER, 1 << 7), (EGR, 1 << 7)]);
    assert!(bench.has_line(43));
    assert_eq!(bench.read(TIM8 + 0x44), 0);
}

#[test]
fn a_compare_output_moves_its_pin_and_over_a_wire_the_input_of_another_channel() {
    let mut bench = with_wires(&[("PB10", "PB11")]);
    // Channel 3 goes low at 84 000 clocks of 84 MHz, channel 4 latches falling edges and interrupts.
    let edges = [(0x20, 1 << 8 | 0b11 << 12), (DIER, 1 << 4)];
    bench.set(TIM2, [(ARR, u32::MAX), (0x1c, 0b101 << 4 | 0b01 << 8)]);
    bench.set(TIM2, edges);
    // Alternate function 1, PB10 open-drain, PB11 with its pull-up.
    bench.set(GPIOB, [(0x24, 0x1100), (0x04, 1 << 10), (0x0c, 0b01 << 22)]);
    bench.write(GPIOB, 0b1010 << 20);
    assert_eq!(bench.read(GPIOB + 0x10) >> 11 & 1, 1, "let go");
    bench.set(TIM2, [(0x3c, 84_000), (0x1c, 0b010 << 4 | 0b01 << 8), (CR1, 1)]);
    bench.run(2_000_000, |bench| bench.write(TIM2 + SR, 0));
    assert_eq!(bench.board.rises[&28], [1_000_000]);
    assert_eq!(bench.read(TIM2 + 0x40), 84_000);
    assert_eq!(bench.read(GPIOB + 0x10) >> 10 & 0b11, 0);
    let outcome = bench.outcome();
    let moved = outcome.pins.iter().find(|pin| pin.name == "PB10").unwrap();
    assert_eq!(moved.changes.last(), Some(&(1_000_000, false)));
}

#[test]
fn the_lock_of_an_advanced_timer_protects_its_dead_time_and_cannot_be_taken_back() {
    let mut bench = bench();
    bench.set(TIM1, [(0x44, 0b11 << 8 | 100), (0x44, 1 << 15 | 7)]);
    // MOE is never locked.
    assert_eq!(bench.read(TIM1 + 0x44), 1 << 15 | 0b11 << 8 | 100);
    bench.set(TIM1, [(0x20, 0b1111), (0x18, 0x78), (0x04, 1 << 8)]);
    let kept = [0x20, 0x18, 0x04].map(|register| bench.read(TIM1 + register));
    assert_eq!(kept, [0b0101, 0, 0]);
}

#[test]
fn a_register_that_a_smaller_timer_lacks_is_reported() {
    let mut bench = bench();
    bench.read(TIM12 + 0x3c);
    bench.write(TIM6 + 0x20, 1);
    let unknown = bench.outcome().unknown_registers;
    let names: Vec<_> = unknown.iter().map(|register| &*register.name).collect();
    assert_eq!(names, ["TIM6+0x20", "TIM12+0x3c"]);
}

#[test]
fn each_line_of_exti_raises_its_own_interrupt_and_none_while_it_is_masked() {
    // Table 61.
    let shared = [[23; 5].as_slice(), &[40; 6]].concat();
    let interrupts = [&[6, 7, 8, 9, 10][..], &shared, &[1, 41, 42, 62, 76, 2, 3]].concat();
    assert_eq!(interrupts.len(), 23);
    for (line, interrupt) in interrupts.into_iter().enumerate() {
        let (mut bench, bit) = (bench(), 1 << line);
        bench.set(EXTI, [(0x10, bit)]);
        assert!(bench.board.lines.is_empty(), "line {line}");
        bench.set(EXTI, [(0x14, bit), (0x00, bit), (0x10, bit)]);
        assert!(bench.board.lines.iter().eq([&interrupt]), "line {line}");
    }
}

#[test]
fn every_usart_echoes_by_interrupt_on_its_own_pins() {
    const GPIOD: u32 = 0x4002_0c00;
    // Number, name, address, line, transmitter, receiver, function.
    let usarts = [
        (1, "USART2", 0x4000_4400, 38, (GPIOA, 2), (GPIOA, 3), 7),
        (2, "USART3", USART3, 39, (GPIOB, 10), (GPIOB, 11), 7),
        (3, "UART4", UART4, 52, (GPIOA, 0), (GPIOA, 1), 8),
        (4, "UART5", 0x4000_5000, 53, (GPIOC, 12), (GPIOD, 2), 8),
        (5, "USART6", USART6, 71, (GPIOC, 6), (GPIOC, 7), 8),
    ];
    for (number, name, address, line, tx, rx, function) in usarts {
        let mut bench = receiving(name, 50_000, b"echo");
        set_function(&mut bench, tx.0, tx.1, function);
        set_function(&mut bench, rx.0, rx.1, function);
        bench.start_usart(address, 1 << 5);
        bench.run(200_000, |bench| {
            assert!(bench.has_line(line), "{name}");
            let byte = bench.read(address + 0x04);
            bench.write(address + 0x04, byte);
        });
        let echo = b"echo".map(|byte| (number, byte.into()));
        assert_eq!(bench.board.frames, echo, "{name}");
        assert_eq!(bench.outcome().unmodelled, [""; 0]);
    }
}

/// PA11 and PA12 are USART6's by function 8 on an STM32F411 (DocID026289 table 9), but not on an STM32F405.
#[test]
fn a_pin_has_the_functions_of_its_part() {
    for (part, frames) in [("STM32F411CE", 1), ("STM32F405RG", 0)] {
        let mut bench = MachineBench::with(|run| run.chip = part.parse().unwrap());
        set_function(&mut bench, GPIOA, 11, 8);
        bench.start_usart(USART6, 0);
        bench.write(USART6 + 0x04, 0x55);
        bench.run(200_000, |_| {});
        assert_eq!(bench.board.frames.len(), frames, "{part}");
    }
}

/// The regulator's overdrive, and the limits of the buses with it (DocID024030, general operating
/// conditions).
#[test]
fn an_stm32f429_reaches_180_mhz_with_overdrive_and_an_stm32f411_does_not() {
    const PWR: u32 = 0x4000_7000;
    for (part, ready, noted) in [
        ("STM32F429ZI", 0b11 << 16, &[][..]),
        (
            "STM32F411CE",
            0,
            &["RCC PCLK2 is above 100 MHz", "RCC SYSCLK is above 100 MHz"],
        ),
    ] {
        let mut bench = MachineBench::with(|run| run.chip = part.parse().unwrap());
        bench.write(PWR, 0b11 << 16 | 1 << 14);
        assert_eq!(bench.read(PWR + 4) & 0b11 << 16, ready, "{part}");
        // 8 MHz / 8 * 360 / 2, APB1 with a quarter, APB2 with half; five wait states.
        let apb2 = if part.contains("429") { 0b100 } else { 0 };
        bench.set(FLASH, [(0x00, 5 | 0x700)]);
        // The PLL can be set while the internal oscillator is the clock.
        bench.set(RCC, [(0x08, 0), (0x00, 1 << 16 | 1)]);
        bench.set(RCC, [(0x04, 1 << 22 | 360 << 6 | 8)]);
        bench.set(RCC, [(0x00, 1 << 24 | 1 << 16 | 1)]);
        bench.write(RCC + 0x08, apb2 << 13 | 0b101 << 10 | 0b10);
        assert_eq!(bench.outcome().unmodelled, noted, "{part}");
    }
}

/// A machine whose port receives these bytes.
fn receiving(port: &str, at_ns: u64, bytes: &[u8]) -> MachineBench {
    let (port, bytes) = (port.into(), bytes.into());
    MachineBench::with(|run| run.uart_input = vec![UartInput { port, at_ns, bytes }])
}

#[test]
fn nine_data_bits_are_sent_whole_and_carried_whole_by_a_wire() {
    let mut bench = with_wires(&[("PC6", "PC11")]);
    set_function(&mut bench, GPIOC, 6, 8);
    set_function(&mut bench, GPIOC, 11, 8);
    for usart in [USART6, UART4] {
        bench.start_usart(usart, 1 << 12);
    }
    bench.write(USART6 + 0x04, 0x1a5);
    bench.pass(11_000);
    assert_eq!(bench.board.frames, [(5, 0x1a5)]);
    assert_eq!(bench.read(UART4) & 0x20, 0x20, "RXNE");
    assert_eq!(bench.read(UART4 + 0x04), 0x1a5);
}

#[test]
fn over_a_wire_a_frame_of_another_baud_rate_is_a_framing_error_and_the_line_is_idle_after_the_last() {
    let mut bench = with_wires(&[("PB6", "PC7")]);
    set_function(&mut bench, GPIOC, 7, 8);
    bench.start_usart(USART1, 0);
    bench.start_usart(USART6, 1 << 4);
    bench.set(USART1, [(0x04, 0x55), (0x04, 0x66)]);
    for (at, data) in [(10_000, 0x55), (20_000, 0x66)] {
        bench.pass(at);
        assert_eq!(bench.read(USART6) & 0x3f, 0x20, "RXNE alone");
        assert_eq!(bench.read(USART6 + 0x04), data);
    }
    bench.run(40_000, |bench| {
        assert_eq!(bench.board.now, 30_000, "one frame after the last");
        bench.read(USART6);
        bench.read(USART6 + 0x04);
    });
    assert_eq!(bench.board.rises[&71], [30_000]);
    // 5 % slower.
    bench.write(USART6 + 0x08, 88);
    bench.write(USART1 + 0x04, 0x55);
    bench.pass(60_000);
    assert_eq!(bench.read(USART6) & 0x22, 0x22, "FE and RXNE");
}

#[test]
fn a_usart_without_pins_sends_nothing_hears_nothing_and_says_so() {
    let mut bench = receiving("USART1", 10_000, b"x");
    bench.write(GPIOB, 0x0280);
    bench.start_usart(USART1, 1 << 5);
    bench.write(USART1 + 0x04, 0x55);
    bench.pass(100_000);
    assert_eq!((bench.board.frames.len(), bench.has_line(37)), (0, false));
    let expected = [
        "USART1 CR1.RE: bytes came, but no pin is set as its receiver",
        "USART1 CR1.TE: it sends, but no pin is set as its transmitter: nothing leaves the part",
    ];
    assert_eq!(bench.outcome().unmodelled, expected);
}

#[test]
fn a_wire_leads_an_output_to_an_input_to_a_capture_and_to_an_external_interrupt() {
    let mut bench = with_wires(&[("PC0", "PC1"), ("PC0", "PA15")]);
    set_function(&mut bench, GPIOA, 15, 1);
    bench.set(TIM2, [(0x18, 0b01), (0x20, 1), (CR1, 1)]);
    // Line 1 of port C, both edges.
    bench.write(0x4001_3808, 2 << 4);
    bench.set(EXTI, [(0x00, 2), (0x08, 2), (0x0c, 2)]);
    bench.write(GPIOC, 0b01);
    let seen = [(10_000, 1), (15_000, 1), (20_000, 0), (30_000, 1)].map(|(at, level)| {
        bench.board.now = at;
        bench.write(GPIOC + 0x14, level);
        let pending = bench.read(EXTI + 0x14);
        assert_eq!(bench.has_line(7), pending != 0);
        bench.write(EXTI + 0x14, 2);
        let input = bench.read(GPIOC + 0x10) >> 1 & 1;
        (input, bench.read(TIM2 + 0x34), pending)
    });
    assert_eq!(seen, [(1, 840, 2), (1, 840, 0), (0, 840, 2), (1, 2520, 2)]);
    // With the output released, only the pull-up at its other end drives the wire.
    bench.set(GPIOC, [(0x0c, 0b01 << 2), (0x14, 0)]);
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
    let mut bench = MachineBench::with(|run| {
        run.analog_inputs = vec![analog("PC0", &[100, 200]), analog("PF6", &[300])];
        run.analog_inputs.push(analog("PA4", &[400]));
    });
    bench.write(ADC_CCR, 1 << 16);
    assert_eq!([ADC1, ADC2, ADC3].map(|adc| bench.convert(adc, 10)), [100; 3]);
    bench.pass(1_200_000);
    assert_eq!(bench.convert(ADC3, 10), 200);
    let (pa4, pf6) = (bench.convert(ADC1, 4), bench.convert(ADC3, 4));
    assert_eq!((pa4, pf6), (400, 300));
    assert_eq!((bench.convert(ADC1, 5), bench.convert(ADC2, 16)), (0, 0));
    let expected = [
        "ADC1 channel 5 (pin PA5) has no stimulus: it reads 0",
        "ADC2 channel 16 (no pin) has no stimulus: it reads 0",
    ];
    assert_eq!(bench.outcome().unmodelled, expected);
}

#[test]
fn the_third_converter_samples_by_a_trigger_into_memory_as_the_first_does() {
    let mut bench = MachineBench::new(ramp(400));
    // The prescaler is common, and ADC1's clock is off.
    bench.write(RCC + 0x44, 1 << 10);
    // DMA2 stream 1, channel 2.
    let cr = 2 << 25 | 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 1 << 4;
    bench.start_stream(stream(DMA2, 1), 64, ADC3 + 0x4c, SRAM, cr);
    bench.write(ADC3 + 0x04, 1 << 8);
    bench.start_scans(ADC3);
    assert_eq!(bench.read(ADC_CCR), 1 << 16);
    bench.run(330_000, |bench| bench.write(DMA2 + 0x08, 0x3f << 6));
    let expected: Vec<u16> = (0..32).flat_map(|i| [i, 1000 + i]).collect();
    assert_eq!(bench.halfwords(SRAM, 64), expected);
    assert_eq!(bench.board.rises[&57].len(), 1);
    assert_eq!(bench.board.blocks, [32]);
    let outcome = bench.outcome();
    assert_eq!(outcome.sampling.unwrap().first_ns, 10_000);
    assert_eq!(outcome.unknown_registers, []);
    assert_eq!(outcome.unmodelled, [""; 0]);
}

#[test]
fn the_sensors_of_the_part_belong_to_the_first_converter_alone_and_follow_the_supply() {
    let mut bench = bench();
    // CCR, converter, channel, supply, code: off, the channel floats.
    for (ccr, adc, channel, millivolts, code) in [
        (0, ADC1, 17, 3300, 0),
        (0b11 << 22, ADC1, 16, 3300, 943),
        (0b11 << 22, ADC1, 17, 3300, 1502),
        (0b11 << 22, ADC1, 18, 3300, 2048),
        (0b11 << 22, ADC2, 17, 3300, 0),
        // 1835.8
        (0b11 << 22, ADC1, 17, 2700, 1836),
    ] {
        let supply = FaultKind::Supply { millivolts };
        bench.machine.fail(supply, bench.board.now, &mut bench.board);
        bench.write(ADC_CCR, ccr);
        assert_eq!(bench.convert(adc, channel), code, "channel {channel}");
    }
}

#[test]
fn other_parts_have_the_temperature_sensor_at_the_channel_of_the_battery_which_goes_first() {
    let mut bench = MachineBench::with(|run| run.chip = "STM32F429ZI".parse().unwrap());
    for (ccr, channel, code) in [(1 << 23, 16, 0), (1 << 23, 18, 943), (0b11 << 22, 18, 1024)] {
        bench.write(ADC_CCR, ccr);
        assert_eq!(bench.convert(ADC1, channel), code, "channel {channel}");
    }
}

#[test]
fn a_stream_that_waits_for_a_request_that_no_model_makes_is_noted_by_its_name() {
    let mut bench = bench();
    for (dma, number, channel) in [(DMA2, 6, 4), (DMA2, 3, 4), (DMA1, 5, 4)] {
        let at = stream(dma, number);
        bench.set(at, [(0x00, 0), (0x04, 8), (0x00, channel << 25 | 1)]);
    }
    let expected = [
        "DMA2 S3CR: the stream waits for SDIO, a request that no model makes",
        "DMA2 S6CR: the stream waits for SDIO, a request that no model makes",
    ];
    assert_eq!(bench.outcome().unmodelled, expected);
}

/// SPI1's transmitter requests stream 2 of DMA2 by channel 2 on an STM32F411 (RM0383 table 28), but not on an
/// STM32F405.
#[test]
fn a_stream_serves_the_requests_of_its_part() {
    const SPI1: u32 = 0x4001_3000;
    let waits = "DMA2 S2CR: the stream waits for channel 2, which has no request";
    for (part, left, noted) in [("STM32F411CE", 3, &[][..]), ("STM32F405RG", 5, &[waits][..])] {
        let mut bench = MachineBench::with(|run| run.chip = part.parse().unwrap());
        bench.set(SPI1, [(0x04, 0b10), (0x00, 0x300 | 1 << 6 | 1 << 2)]);
        let writes = [(0x04, 5), (0x08, SPI1 + 0x0c), (0x0c, SRAM)];
        bench.set(stream(DMA2, 2), writes);
        bench.write(stream(DMA2, 2), 2 << 25 | 1 << 10 | 0b01 << 6 | 1);
        assert_eq!(bench.read(stream(DMA2, 2) + 0x04), left, "{part}");
        let mut notes = bench.outcome().unmodelled;
        notes.retain(|note| note.contains("stream"));
        assert_eq!(notes, noted, "{part}");
    }
}

#[test]
fn a_burst_that_does_not_fit_the_fifo_stops_the_stream_with_its_error() {
    // Memory size, burst, threshold: table 49.
    let fits = |size: u32, burst: u32, threshold: u32| {
        let mut bench = bench();
        bench.set(STREAM0, [(0x04, 64), (0x14, 1 << 2 | threshold)]);
        bench.write(STREAM0, burst << 23 | size << 13 | 1);
        let enabled = bench.read(STREAM0) & 1 == 1;
        assert_eq!(bench.read(DMA2) & 1 == 1, !enabled, "FEIF0");
        enabled
    };
    let whole = [true; 4];
    let halves = [false, true, false, true];
    let last = [false, false, false, true];
    let none = [false; 4];
    for (size, bursts) in [[whole, halves, last], [halves, last, none], [last, none, none]]
        .iter()
        .enumerate()
    {
        for (burst, expected) in bursts.iter().enumerate() {
            let found = [0, 1, 2, 3].map(|threshold| fits(size as u32, burst as u32 + 1, threshold));
            assert_eq!(found, *expected, "size {size}, burst {}", burst + 1);
        }
    }
    assert!(fits(2, 0, 0), "single transfers always fit");
}

#[test]
fn copies_between_memories_leave_direct_mode_and_cannot_be_circular_or_of_dma1() {
    let started = |dma: u32, cr: u32| {
        let mut bench = bench();
        bench.board.sram[..8].copy_from_slice(b"absorber");
        bench.start_stream(stream(dma, 0), 8, SRAM, SRAM + 64, 0b10 << 6 | 0b11 << 9 | cr);
        let complete = bench.read(dma) & 1 << 5 != 0;
        assert_eq!(bench.board.sram[64..72] == *b"absorber", complete);
        let direct = bench.read(stream(dma, 0) + 0x14) >> 2 & 1 == 0;
        (complete, direct, bench.outcome().unmodelled.join(" "))
    };
    assert_eq!(started(DMA2, 0), (true, false, String::new()));
    for (dma, cr, why) in [
        (DMA2, 1 << 8, "cannot be circular"),
        (DMA1, 0, "DMA1 cannot copy"),
    ] {
        let (complete, _, notes) = started(dma, cr);
        assert!(!complete && notes.contains(why), "{notes}");
    }
}

/// TI2 was high before its pin was connected to the timer: TI1 follows it, so the counter counts down.
#[test]
fn an_encoder_knows_the_level_that_its_other_input_has_had_from_the_beginning() {
    const SMCR: u32 = 0x08;
    const CNT: u32 = 0x24;
    let inputs = [("PA6", [30_000, 50_000]), ("PA7", [1_000, 40_000])];
    let inputs = inputs.map(|(pin, changes)| PinInput::new(pin, Since::PowerUp, changes));
    let mut bench = MachineBench::with(|run| run.pin_inputs = inputs.into());
    bench.pass(10_000);
    for pin in [6, 7] {
        set_function(&mut bench, GPIOA, pin, 2);
    }
    bench.set(TIM3, [(ARR, 99), (SMCR, 0b011), (DIER, 1), (CR1, 1)]);
    bench.pass(60_000);
    assert_eq!((bench.read(TIM3 + CNT), bench.read(TIM3) >> 4 & 1), (97, 1));
    assert_eq!(bench.board.rises[&29], [30_000], "below zero");
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}
