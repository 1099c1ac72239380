//! The peripherals together, driven by register writes as firmware would, without QEMU.

mod bench;
mod instances;

use stm32f405_qemu::machine::WRITABLE;
use stm32f405_qemu::{Fault, FaultKind, PinInput, ResetCause, Run, Since, UartInput};

use self::bench::*;

const EXTI: u32 = 0x4001_3c00;

#[test]
fn two_milliseconds_of_triggered_scans_lie_in_memory_in_order_with_an_interrupt_a_half() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM + 0x100, 128);
    bench.run(2_000_000, MachineBench::clear_stream0);

    // 199 whole scans, and the first conversions of one that began at 2 ms are still running.
    let ring = bench.halfwords(SRAM + 0x100, 128);
    let scan = |i: u16| [ring[2 * usize::from(i)], ring[2 * usize::from(i) + 1]];
    // Scans 192..199 have overwritten those of the third pass.
    for i in 0..7 {
        assert_eq!(scan(i), [192 + i, 1192 + i]);
    }
    for i in 7..64 {
        assert_eq!(scan(i), [128 + i, 1128 + i]);
    }
    // 32 scans a half: scan n starts at (n + 1) * 10 µs and its second conversion ends 136 cycles of 21 MHz
    // later.
    let expected: Vec<u64> = (1..=6).map(|half| half * 320_000 + 6_477).collect();
    assert_eq!(bench.board.rises[&DMA2_STREAM0], expected);
    assert_eq!(bench.board.blocks, [32; 6]);
    assert_eq!(
        bench.wakes, 7,
        "one for the first scan and one an interrupt, none a sample"
    );
    assert_eq!(bench.machine.stimulus().sampling().unwrap().first_ns, 10_000);
    assert_eq!(
        (bench.outcome().overruns, bench.outcome().triggers_ignored),
        (0, 0)
    );
    assert_eq!(bench.outcome().unknown_registers, []);
    assert_eq!(bench.outcome().unmodelled, Vec::<String>::new());
}

/// Many scans in one stretch are played by a shorter way than one event at a time.
#[test]
fn what_is_played_in_one_stretch_is_what_is_played_event_by_event() {
    const ADC2: u32 = ADC1 + 0x100;
    let played = |memory: u32, two_converters: bool, step: usize| {
        let input = UartInput::usart1(211_003, *b"beside the scans");
        let mut bench = MachineBench::with_uart_input(ramp(400), &[input]);
        bench.board.sram[0x8000..0x8064].fill(0x5a);
        bench.write(USART1 + 0x08, 84);
        bench.write(USART1 + 0x0c, 1 << 13 | 1 << 5 | 0b11 << 2);
        bench.write(USART1 + 0x14, 1 << 7);
        bench.write(STREAM7 + 0x04, 100);
        bench.write(STREAM7 + 0x08, USART1 + 0x04);
        bench.write(STREAM7 + 0x0c, SRAM + 0x8000);
        bench.write(STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1);
        if two_converters {
            bench.write(RCC + 0x44, 1 << 4 | 0b11 << 8);
            bench.write(ADC2 + 0x08, 0b01 << 28 | 0b1000 << 24 | 1);
        }
        bench.start_acquisition(memory, 128);
        for now in (step as u64..=2_000_000).step_by(step) {
            bench.board.now = now;
            bench.machine.advance(now, &mut bench.board);
        }
        let flags = [DMA2, ADC1, ADC2, USART1, STREAM0 + 0x04].map(|register| bench.read(register));
        let outcome = bench.outcome();
        let counts = (outcome.sampling, outcome.overruns, outcome.triggers_ignored);
        (
            bench.board.sram,
            bench.board.frames,
            bench.board.blocks,
            flags,
            counts,
        )
    };
    // The second memory is GPIOB's output register: a DMA may write there, too.
    for (memory, two) in [(SRAM + 0x100, false), (SRAM + 0x100, true), (GPIOB + 0x14, false)] {
        let each = played(memory, two, 200);
        for stretch in [10_000, 250_000, 2_000_000] {
            assert!(
                played(memory, two, stretch) == each,
                "{memory:#x} {two} {stretch}"
            );
        }
    }
}

#[test]
fn the_ring_shows_how_far_it_is_whenever_the_firmware_looks() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.run(105_000, |_| {});
    // Ten triggers; the tenth scan began at 100 µs and has one conversion.
    assert_eq!(bench.read(STREAM0 + 0x04), 128 - 19);
}

#[test]
fn a_software_start_puts_one_untimed_scan_before_the_first_trigger() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.write(ADC1 + 0x08, ADON_DMA_BY_TIM3 | 1 << 30);
    bench.run(38_000, |_| {});
    assert_eq!(bench.halfwords(SRAM, 8), [0, 1000, 0, 1000, 1, 1001, 2, 1002]);
    assert_eq!(bench.machine.stimulus().sampling().unwrap().scans, 3);
}

#[test]
fn a_ring_whose_stream_is_stopped_overruns_and_goes_on_only_after_ovr_is_cleared() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.run(35_000, |_| {});
    let cr = bench.read(STREAM0);
    bench.write(STREAM0, cr & !1);
    bench.run(95_000, |_| {});
    assert_eq!(bench.outcome().overruns, 1);
    assert_eq!(bench.outcome().triggers_ignored, 5, "those at 50 to 90 µs");
    assert_eq!(bench.read(ADC1) & 1 << 5, 1 << 5);
    bench.write(DMA2 + 0x08, 0x3f);
    bench.write(STREAM0, cr);
    bench.write(ADC1, !(1 << 5));
    bench.read(ADC1 + 0x4c);
    bench.run(109_000, |_| {});
    // The stimulus went on meanwhile: the scan at 100 µs is row 9.
    assert_eq!(bench.halfwords(SRAM, 2), [9, 1009]);
}

#[test]
fn an_overrun_that_nobody_clears_wakes_nobody() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.run(35_000, |_| {});
    let cr = bench.read(STREAM0);
    bench.write(STREAM0, cr & !1);
    bench.wakes = 0;
    bench.run(2_000_000, |_| {});
    // The interrupt of the overrun, perhaps a conversion before it, and nothing at the 190 triggers that
    // follow.
    assert!(bench.wakes <= 2, "{} wakes", bench.wakes);
    assert!(bench.board.lines[18]);
}

#[test]
fn faults_on_demand_look_like_those_of_the_hardware() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.run(35_000, |_| {});
    bench
        .machine
        .fail(FaultKind::AdcOverrun, 35_000, &mut bench.board);
    bench.run(95_000, |_| {});
    assert_eq!((bench.read(ADC1) & 1 << 5, bench.outcome().overruns), (1 << 5, 1));
    assert_eq!(
        bench.read(STREAM0 + 0x04),
        128 - 5,
        "the scan of 30 µs was aborted half way"
    );

    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.run(35_000, |_| {});
    bench
        .machine
        .fail(FaultKind::AdcDmaError, 35_000, &mut bench.board);
    assert!(bench.board.lines[DMA2_STREAM0]);
    assert_eq!(
        (bench.read(DMA2) & 0x3f, bench.read(STREAM0) & 1),
        (1 << 3, 0),
        "TEIF0, and stopped"
    );
}

#[test]
fn channel_17_is_the_internal_reference_against_the_supply_once_it_is_on() {
    let mut bench = MachineBench::new(ramp(1));
    let mut convert = |ccr: u32, supply: Option<u32>| {
        let now = bench.board.now;
        if let Some(millivolts) = supply {
            bench
                .machine
                .fail(FaultKind::Supply { millivolts }, now, &mut bench.board);
        }
        bench.write(ADC1 + 0x304, ccr);
        bench.write(ADC1 + 0x34, 17);
        bench.write(ADC1 + 0x08, 1);
        bench.write(ADC1 + 0x08, 1 << 30 | 1);
        bench.run(now + 100_000, |_| {});
        bench.read(ADC1 + 0x4c)
    };
    assert_eq!(convert(0, None), 0, "off: it floats");
    assert_eq!(convert(1 << 23, None), 1502, "the factory's code at 3.3 V");
    assert_eq!(convert(1 << 23, Some(2700)), 1502 * 3300 / 2700);
}

#[test]
fn a_crash_on_demand_overwrites_the_vector_of_the_stream_that_serves_the_adc() {
    const VECTOR: u32 = 0x0800_0000 + 4 * (16 + DMA2_STREAM0 as u32);
    let written = |kind: FaultKind| {
        let mut bench = MachineBench::new(ramp(400));
        bench.machine.fail(kind, 0, &mut bench.board);
        assert_eq!(bench.board.flash_writes, [], "no stream serves the ADC yet");
        bench.start_acquisition(SRAM, 128);
        bench.machine.fail(kind, 35_000, &mut bench.board);
        bench.board.flash_writes
    };
    assert_eq!(
        written(FaultKind::WildJump),
        [(VECTOR, vec![0xf1, 0xff, 0xff, 0xef])]
    );
    for (kind, code) in [
        (FaultKind::Hang, vec![0xfe, 0xe7]),
        (FaultKind::RunawayStack, vec![0x0f, 0xb4, 0xfd, 0xe7]),
    ] {
        assert_eq!(
            written(kind),
            [(0x080f_fff0, code), (VECTOR, vec![0xf1, 0xff, 0x0f, 0x08])]
        );
    }
}

#[test]
fn scans_longer_than_the_trigger_period_skip_triggers_and_keep_their_rows() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    // 480 + 12 cycles: 23.4 µs a conversion.
    bench.write(ADC1 + 0x10, 0b111_111);
    bench.run(130_000, |_| {});
    assert_eq!(bench.halfwords(SRAM, 4), [0, 1000, 5, 1005]);
    assert_eq!(bench.outcome().triggers_ignored, 10 - 1 + 1);
}

#[test]
fn a_ring_in_ccm_is_a_transfer_error() {
    let mut bench = MachineBench::new(ramp(10));
    bench.start_acquisition(CCM, 128);
    bench.run(30_000, |_| {});
    assert!(bench.board.lines[DMA2_STREAM0]);
    assert_eq!(bench.read(DMA2) & 0x3f, 1 << 3, "TEIF0");
}

#[test]
fn a_transmission_by_dma_sends_every_byte_at_the_baud_rate_and_wakes_once() {
    let mut bench = MachineBench::new(Vec::new());
    bench.board.sram[..100].copy_from_slice(&std::array::from_fn::<u8, 100, _>(|i| i as u8));
    bench.write(USART1 + 0x08, 84);
    bench.write(USART1 + 0x0c, 1 << 13 | 1 << 3);
    bench.write(USART1 + 0x14, 1 << 7);
    bench.write(STREAM7 + 0x04, 100);
    bench.write(STREAM7 + 0x08, USART1 + 0x04);
    bench.write(STREAM7 + 0x0c, SRAM);
    bench.write(STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1 << 4);
    bench.write(STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1 << 4 | 1);
    bench.run(2_000_000, |b| b.write(DMA2 + 0x0c, 0x3f << 22));
    assert_eq!(bench.board.uart, (0..100).collect::<Vec<u8>>());
    // The last byte leaves memory when the one before the last starts on the line.
    assert_eq!(bench.board.rises[&DMA2_STREAM7], [98 * 10_000]);
    assert_eq!(bench.wakes, 1);
    assert_eq!(bench.read(USART1) & 0xc0, 0xc0, "TXE and TC");
}

#[test]
fn received_bytes_reach_the_firmware_a_frame_apart() {
    let input = UartInput::usart1(50_000, *b"ok");
    let mut bench = MachineBench::with_uart_input(Vec::new(), &[input]);
    bench.write(USART1 + 0x08, 84);
    bench.write(USART1 + 0x0c, 1 << 13 | 1 << 5 | 1 << 2);
    let mut seen = Vec::new();
    bench.run(1_000_000, |b| {
        let byte = b.read(USART1 + 0x04);
        seen.push((b.board.now, byte as u8));
    });
    assert_eq!(seen, [(60_000, b'o'), (70_000, b'k')]);
}

#[test]
fn a_byte_write_to_the_data_register_sends_that_byte_and_one_to_a_port_keeps_the_rest() {
    let mut bench = MachineBench::new(Vec::new());
    bench.write(USART1 + 0x08, 84);
    bench.write(USART1 + 0x0c, 1 << 13 | 1 << 3);
    bench.machine.write(USART1 + 0x04, 1, 0x41, 0, &mut bench.board);
    bench.run(10_000, |_| {});
    assert_eq!(bench.board.uart, b"A");

    bench.write(0x4002_0014, 0x1234);
    bench
        .machine
        .write(0x4002_0015, 1, 0xab, 10_000, &mut bench.board);
    assert_eq!(bench.read(0x4002_0014), 0xab34);
}

#[test]
fn a_narrow_write_to_an_apb_register_is_repeated_over_the_word_without_a_read() {
    let mut bench = MachineBench::new(Vec::new());
    let narrow = |bench: &mut MachineBench, address: u32, bytes: u32, value: u32| {
        bench.machine.write(address, bytes, value, 0, &mut bench.board);
    };
    narrow(&mut bench, TIM3 + 0x2c, 1, 0x12);
    assert_eq!(bench.read(TIM3 + 0x2c), 0x1212);
    narrow(&mut bench, TIM2 + 0x2c, 2, 0x3456);
    assert_eq!(bench.read(TIM2 + 0x2c), 0x3456_3456);
    // EXTI, whose pending bits are cleared by ones: lines 0 and 1 are pending, and line 0 is cleared.
    bench.write(EXTI, 0b11);
    bench.write(EXTI + 0x10, 0b11);
    narrow(&mut bench, EXTI + 0x14, 1, 0b01);
    assert_eq!(bench.read(EXTI + 0x14), 0b10);
}

#[test]
fn an_embassy_time_driver_is_woken_at_its_half_periods() {
    let mut bench = MachineBench::new(Vec::new());
    // 1 MHz, 16-bit period, compare 1 half way, update and compare 1 interrupts.
    for (offset, value) in [
        (0x28, 83),
        (0x2c, 0xffff),
        (0x14, 1),
        (0x10, 0),
        (0x34, 0x8000),
        (0x0c, 3),
        (0, 1),
    ] {
        bench.write(TIM5 + offset, value);
    }
    bench.run(200_000_000, |b| b.write(TIM5 + 0x10, 0));
    let expected: Vec<u64> = (1..=6).map(|n| n * 32_768_000).collect();
    assert_eq!(bench.board.rises[&50], expected);
}

#[test]
fn a_register_without_a_model_and_one_without_its_clock_are_recorded_by_name() {
    let mut bench = MachineBench::new(Vec::new());
    bench.write(0x4001_3008, 7);
    bench.read(0x4001_3008);
    bench.write(RCC + 0x44, 0);
    bench.write(USART1, 0);
    let unknown = bench.outcome().unknown_registers;
    let seen: Vec<_> = unknown
        .iter()
        .map(|u| (u.name.as_str(), u.reads, u.writes, u.last_write))
        .collect();
    assert_eq!(
        seen,
        [
            ("USART1_SR (clock off)", 0, 1, Some(0)),
            ("SPI1_SR", 1, 1, Some(7))
        ]
    );
}

#[test]
fn a_channel_without_stimulus_and_too_few_wait_states_are_reported() {
    let mut bench = MachineBench::new(ramp(10));
    bench.write(0x4002_3c00, 0x704);
    bench.start_acquisition(SRAM, 4);
    bench.write(ADC1 + 0x34, 5 << 5);
    bench.run(30_000, |_| {});
    assert_eq!(
        bench.outcome().unmodelled,
        [
            "FLASH ACR.LATENCY is below table 10 for this HCLK",
            "ADC1 channel 5 (pin PA5) has no stimulus: it reads 0"
        ]
    );
}

#[test]
fn resetting_a_peripheral_through_rcc_stops_it() {
    let mut bench = MachineBench::new(Vec::new());
    bench.start_tim3();
    bench.write(RCC + 0x20, 1 << 1);
    bench.write(RCC + 0x20, 0);
    assert_eq!((bench.read(TIM3), bench.read(TIM3 + 0x2c)), (0, 0xffff));
}

#[test]
fn a_software_reset_starts_the_peripherals_anew_and_the_world_goes_on() {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench.run(1_000_000, MachineBench::clear_stream0);
    bench.machine.reset(bench.board.now, &mut bench.board);
    assert_eq!(
        bench.read(RCC + 0x74) >> 24,
        0b1_1110,
        "SFTRSTF beside the flags of power-up"
    );
    assert_eq!(bench.read(STREAM0), 0, "its clock is off");
    assert_eq!(bench.machine.next_interrupt(), None);
    assert_eq!(bench.machine.stimulus().ends_at(), Some(10_000 + 400 * 10_000));
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::Software);
}

#[test]
fn a_watchdog_that_is_not_fed_wants_a_reset_once_and_shows_it_in_csr() {
    let mut bench = MachineBench::new(Vec::new());
    bench.write(IWDG, 0xcccc);
    bench.run(400_000_000, |_| {});
    bench.write(IWDG, 0xaaaa);
    bench.run(900_000_000, |_| {});
    assert_eq!(bench.board.resets_wanted, 0);
    bench.run(1_000_000_000, |_| {});
    assert_eq!(bench.board.resets_wanted, 1);
    bench.machine.reset(bench.board.now, &mut bench.board);
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::Watchdog);
    assert_eq!(bench.read(RCC + 0x74) & 1 << 29, 1 << 29);
}

#[test]
fn a_copy_between_memories_is_done_when_it_is_started() {
    let mut bench = MachineBench::new(Vec::new());
    bench.board.sram[..8].copy_from_slice(b"absorber");
    let stream1 = STREAM0 + 0x18;
    bench.write(stream1 + 0x04, 8);
    bench.write(stream1 + 0x08, SRAM);
    bench.write(stream1 + 0x0c, SRAM + 64);
    bench.write(stream1, 0b10 << 6 | 0b11 << 9 | 1);
    assert_eq!(&bench.board.sram[64..72], b"absorber");
    assert_eq!(bench.read(DMA2), 0x30 << 6);
}

#[test]
fn the_processor_stands_still_while_flash_is_written_and_serves_what_came_up_after_that() {
    let mut bench = MachineBench::new(vec![[0; 4]]);
    bench.start_tim3();
    bench.write(TIM3 + 0x0c, 1);
    bench.open_flash();
    bench.board.now = 4_000;
    bench.store(WRITABLE.start, 0x1122_3344);
    assert!(bench.board.stalled);
    bench.run(19_999, |_| {});
    assert!(bench.board.stalled && bench.board.rises.is_empty());
    bench.run(20_000, |_| {});
    assert!(!bench.board.stalled);
    assert_eq!(bench.board.rises[&29], [20_000], "TIM3 was due at 10 us");
    assert_eq!(
        bench.board.flash_changes,
        [(WRITABLE.start, vec![0x44, 0x33, 0x22, 0x11])]
    );
}

#[test]
fn a_processor_that_wakes_nevertheless_is_stalled_again_when_it_looks_for_the_end() {
    let mut bench = MachineBench::new(vec![[0; 4]]);
    bench.open_flash();
    bench.store(WRITABLE.start, 0);
    bench.board.stalled = false;
    assert_eq!(bench.read(FLASH + 0x0c), 1 << 16);
    assert!(bench.board.stalled);
}

#[test]
fn a_power_cut_loses_memory_and_leaves_the_flags_of_power_up_alone() {
    let mut bench = MachineBench::new(vec![[0; 4]]);
    bench.machine.reset(1_000, &mut bench.board);
    bench.board.now = 2_000;
    bench.machine.fail(FaultKind::PowerCut, 2_000, &mut bench.board);
    assert_eq!((bench.board.resets_wanted, bench.board.memory_lost), (1, 0));
    bench.machine.reset(2_000, &mut bench.board);
    assert_eq!(bench.board.memory_lost, 1);
    assert_eq!(bench.read(RCC + 0x74), 0x0e00_0000);
    let causes: Vec<_> = bench.outcome().resets.iter().map(|r| r.cause).collect();
    assert_eq!(causes, [ResetCause::Software, ResetCause::PowerCut]);
}

#[test]
fn power_goes_during_the_operation_that_a_fault_names_and_what_it_wrote_is_half_there() {
    let mut bench = MachineBench::new(vec![[0; 4]]);
    let cut = FaultKind::PowerCutInFlash {
        after: 1,
        percent: 50,
    };
    bench.machine.fail(cut, 0, &mut bench.board);
    bench.open_flash();
    bench.store(WRITABLE.start, 0);
    bench.run(50_000, |_| {});
    bench.store(WRITABLE.start + 4, 0);
    bench.run(57_999, |_| {});
    assert_eq!(bench.board.resets_wanted, 0);
    bench.run(58_000, |_| {});
    assert_eq!(bench.board.resets_wanted, 1);
    bench.machine.reset(58_000, &mut bench.board);
    let contents = bench.machine.flash();
    assert_eq!(contents[..4], [0; 4]);
    let ones: u32 = contents[4..8].iter().map(|byte| byte.count_ones()).sum();
    assert!((8..=24).contains(&ones), "half of 32, by a draw: {ones}");
    assert!(contents[8..].iter().all(|byte| *byte == 0xff));
}

#[test]
fn the_watchdog_bites_in_the_midst_of_an_erase_that_takes_longer() {
    let mut bench = MachineBench::new(vec![[0; 4]]);
    // The prescaler stays 4: 512 ms.
    bench.write(IWDG, 0xcccc);
    bench.open_flash();
    bench.write(FLASH + 0x10, 0b10 << 8 | 11 << 3 | 1 << 1 | 1 << 16);
    assert!(bench.board.stalled);
    bench.run(512_000_000, |_| {});
    assert_eq!(bench.board.resets_wanted, 1);
    bench.machine.reset(512_000_000, &mut bench.board);
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::Watchdog);
    assert_eq!(bench.read(FLASH + 0x0c), 0);
}

/// TIM2 started by TIM3's first update, its channel 1 capturing rising edges of PA15 with an interrupt;
/// samples at 100 kHz.
fn capturing(changes_ns: &[u64]) -> MachineBench {
    let input = PinInput {
        pin: "PA15".into(),
        since: Since::FirstScan,
        changes_ns: changes_ns.to_vec(),
    };
    let mut bench = MachineBench::with_inputs(vec![[0; 4]], &[], &[input]);
    bench.write(GPIOA + 0x24, 1 << 28);
    bench.write(GPIOA, 0xa800_0000 & !(0b11 << 30) | 0b10 << 30);
    bench.write(TIM2 + 0x08, 0b010 << 4 | 0b110);
    bench.write(TIM2 + 0x18, 0b01);
    bench.write(TIM2 + 0x20, 1);
    bench.write(TIM2 + 0x0c, 1 << 1);
    bench.start_acquisition(SRAM, 64);
    bench.start_tim3();
    bench
}

const TIM2_LINE: usize = 28;

#[test]
fn an_edge_is_captured_in_clocks_since_the_first_scan_and_interrupts_at_its_time() {
    // The first scan is TIM3's first update, at 10 us, and starts TIM2.
    let mut bench = capturing(&[123_456, 200_000]);
    let mut captured = Vec::new();
    bench.run(1_000_000, |bench| {
        if bench.board.lines[TIM2_LINE] {
            captured.push((bench.board.now, bench.read(TIM2 + 0x34)));
        }
    });
    // 123.456 us at 84 MHz are 10370.3 clocks.
    assert_eq!(captured, [(133_456, 10_370)]);
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
    assert_eq!(bench.read(GPIOA + 0x10) >> 15 & 1, 0, "the level is low again");
}

#[test]
fn an_edge_reaches_the_timer_only_through_the_alternate_function() {
    let mut bench = capturing(&[50_000, 60_000, 150_000]);
    bench.write(GPIOA + 0x24, 2 << 28);
    bench.run(100_000, |_| {});
    assert_eq!(bench.board.rises.get(&TIM2_LINE), None, "AF2 is no TIM2");
    bench.write(GPIOA + 0x24, 1 << 28);
    bench.run(1_000_000, |_| {});
    assert_eq!(bench.board.rises[&TIM2_LINE], [160_000]);
}

#[test]
fn a_storm_of_edges_wakes_nobody_while_the_flag_stands() {
    let storm: Vec<u64> = (0..100_000).map(|n| 1_000 + 10 * n).collect();
    let mut bench = capturing(&storm);
    // The handler masks the channel and leaves the flag.
    bench.write(TIM2 + 0x0c, 0);
    let before = bench.wakes;
    bench.run(900_000, |_| {});
    assert_eq!(bench.board.rises.get(&TIM2_LINE), None);
    // The first scan, and blocks of 16 scans.
    assert!(bench.wakes - before <= 1 + 6, "{}", bench.wakes - before);
    assert_eq!(bench.read(TIM2 + 0x10) & !1, 1 << 9 | 1 << 6 | 1 << 1);
}

#[test]
fn a_software_scan_under_a_trigger_is_taken_or_ignored_as_the_run_says() {
    let scans = |taken: bool| {
        let mut run = Run::new("none");
        run.stimulus = ramp(10);
        run.software_scan_under_trigger = taken;
        let mut bench = MachineBench::of(run);
        bench.start_acquisition(SRAM, 64);
        bench.write(ADC1 + 0x08, ADON_DMA_BY_TIM3 | 1 << 30);
        bench.run(9_000, |_| {});
        let by_software = bench.halfwords(SRAM, 2);
        bench.run(19_000, |_| {});
        (by_software, bench.halfwords(SRAM, 4))
    };
    // Row 0 is read by the software's scan and by the first triggered one.
    assert_eq!(scans(true), (vec![0, 1000], vec![0, 1000, 0, 1000]));
    assert_eq!(scans(false), (vec![0, 0], vec![0, 1000, 0, 0]));
}

/// USART1 at 1 Mbit/s that receives these bytes from 10 µs on, by DMA2 stream 2 into SRAM.
fn receiving(bytes: &[u8], latency_ns: u64) -> MachineBench {
    const STREAM2: u32 = DMA2 + 0x10 + 2 * 0x18;
    let mut run = Run::new("none");
    run.receive_dma_latency_ns = latency_ns;
    run.uart_input = vec![UartInput::usart1(10_000, bytes)];
    let mut bench = MachineBench::of(run);
    bench.write(USART1 + 0x08, 84);
    bench.write(USART1 + 0x14, 1 << 6);
    bench.write(USART1 + 0x0c, 1 << 13 | 1 << 2);
    bench.write(STREAM2 + 0x04, 64);
    bench.write(STREAM2 + 0x08, USART1 + 0x04);
    bench.write(STREAM2 + 0x0c, SRAM);
    bench.write(STREAM2, 4 << 25 | 1 << 10 | 1 << 8 | 1);
    bench
}

#[test]
fn a_byte_that_the_processor_reads_before_a_late_dma_is_lost_to_it() {
    // Bytes come at 20, 30 and 40 µs. The processor reads DR 1 µs after the second.
    let heard = |latency_ns| {
        let mut bench = receiving(b"abc", latency_ns);
        bench.run(31_000, |_| {});
        let read = bench.read(USART1 + 0x04);
        bench.run(60_000, |_| {});
        (bench.board.sram[..3].to_vec(), read)
    };
    assert_eq!(heard(0), (b"abc".to_vec(), u32::from(b'b')));
    assert_eq!(heard(900), (b"abc".to_vec(), u32::from(b'b')));
    assert_eq!(heard(1_100), (b"ac\0".to_vec(), u32::from(b'b')));
    // A byte that finds the one before it not fetched is lost as well.
    let mut bench = receiving(b"abc", 11_000);
    bench.run(60_000, |_| {});
    assert_eq!(bench.board.sram[..3], *b"ac\0");
    assert_eq!(bench.read(USART1) >> 3 & 1, 1, "ORE");
}

#[test]
fn a_supply_ramps_up_in_steps_of_10_mv_from_power_up_on() {
    let ramp: Vec<_> = Fault::supply_ramp(1800, 3300, 15_000_000).collect();
    assert_eq!(ramp.len(), 151);
    let millivolts = |millivolts| FaultKind::Supply { millivolts };
    assert_eq!(ramp[0], Fault::after_power_up(0, millivolts(1800)));
    assert_eq!(ramp[75], Fault::after_power_up(7_500_000, millivolts(2550)));
    assert_eq!(ramp[150], Fault::after_power_up(15_000_000, millivolts(3300)));
    let down: Vec<_> = Fault::supply_ramp(3300, 3295, 1_000).collect();
    assert_eq!(down[1], Fault::after_power_up(1_000, millivolts(3295)));
}

#[test]
fn levels_and_rows_since_power_up_need_no_scan() {
    let mut run = Run::new("none");
    run.stimulus = ramp(3);
    run.stimulus_since = Since::PowerUp;
    run.pin_inputs = vec![PinInput {
        pin: "PC7".into(),
        since: Since::PowerUp,
        changes_ns: vec![5_000, 8_000],
    }];
    let mut bench = MachineBench::of(run);
    bench.write(RCC + 0x30, 1 << 2);
    let mut levels = Vec::new();
    for at in [4_999, 5_000, 7_999, 8_000] {
        bench.run(at, |_| {});
        levels.push(bench.read(0x4002_0810) >> 7 & 1);
    }
    assert_eq!(levels, [0, 1, 1, 0]);
    // Scans by software, 15 and 25 µs after power-up, at 21 MHz.
    bench.write(ADC1 + 0x304, 1 << 16);
    bench.write(ADC1 + 0x08, 1);
    for (at, code) in [(15_000, 1), (25_000, 2)] {
        bench.run(at, |_| {});
        bench.write(ADC1 + 0x08, 1 << 30 | 1);
        bench.run(at + 9_000, |_| {});
        assert_eq!(bench.read(ADC1 + 0x4c), code);
    }
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}

#[test]
fn rows_that_no_triggered_scan_plays_are_said() {
    let mut bench = MachineBench::new(ramp(3));
    bench.write(ADC1 + 0x304, 1 << 16);
    bench.write(ADC1 + 0x08, 1);
    bench.write(ADC1 + 0x08, 1 << 30 | 1);
    bench.run(100_000, |_| {});
    let said = bench.outcome().unmodelled;
    assert_eq!(said.len(), 1);
    assert!(said[0].starts_with("ADC1 no triggered scan came"), "{said:?}");
}

#[test]
fn a_core_above_30_mhz_without_prefetch_or_a_cache_is_noted_while_it_stays_so() {
    let mut bench = MachineBench::new(Vec::new());
    let mut said = |acr: u32| {
        bench.write(FLASH, acr);
        bench.outcome().unmodelled.len()
    };
    assert_eq!(
        [0x705, 0x605, 0x505, 0x005, 0x705].map(&mut said),
        [0, 1, 1, 3, 0]
    );
}

#[test]
fn a_converter_above_36_mhz_is_noted() {
    let mut bench = MachineBench::new(Vec::new());
    // PCLK2 is 84 MHz, and the prescaler 2.
    bench.write(ADC1 + 0x08, 1);
    bench.write(ADC1 + 0x08, 1 << 30 | 1);
    assert_eq!(
        bench.outcome().unmodelled,
        ["ADC1 the converter's clock is above 36 MHz"]
    );
}

#[test]
fn the_time_of_each_clock_adds_up_to_the_run() {
    let mut bench = MachineBench::new(Vec::new());
    bench.run(1_000_000, |_| {});
    bench.write(RCC + 0x08, 0);
    bench.run(1_500_000, |_| {});
    assert_eq!(
        bench.outcome().hclk_ns,
        [(16_000_000, 500_000), (168_000_000, 1_000_000)]
    );
}
