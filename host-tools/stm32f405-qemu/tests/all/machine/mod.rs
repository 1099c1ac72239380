//! The peripherals together, driven by register writes as firmware would, without QEMU.

pub(crate) mod bench;
mod buses;
mod clocks;
mod instances;
mod outputs;
mod waves;

use stm32f405_qemu::machine::WRITABLE;
use stm32f405_qemu::{Fault, FaultKind, PinInput, ResetCause, Since, UartInput};

use self::bench::*;

const OVR: u32 = 1 << 5;
const TEIF0: u32 = 1 << 3;
const STREAM7: u32 = stream(DMA2, 7);
/// A stream of channel 4 from memory to a USART.
const TO_USART: u32 = 4 << 25 | 1 << 10 | 1 << 6;

fn acquiring() -> MachineBench {
    let mut bench = MachineBench::new(ramp(400));
    bench.start_acquisition(SRAM, 128);
    bench
}

fn fail(bench: &mut MachineBench, kind: FaultKind) {
    bench.machine.fail(kind, bench.board.now, &mut bench.board);
}

#[test]
fn two_milliseconds_of_triggered_scans_lie_in_memory_in_order_with_an_interrupt_a_half() {
    let mut bench = acquiring();
    bench.run(2_000_000, MachineBench::clear_stream0);

    // 199 whole scans, and the first conversions of one that began at 2 ms and still runs. Scans 192..199
    // have overwritten those of the third pass.
    let ring = bench.halfwords(SRAM, 128);
    let scans = (192..199).chain(135..192);
    let expected: Vec<u16> = scans.flat_map(|scan| [scan, 1000 + scan]).collect();
    assert_eq!(ring, expected);
    // 32 scans per half: scan n starts at (n + 1) * 10 µs, and its second conversion ends 136 cycles of 21
    // MHz later.
    let expected: Vec<u64> = (1..=6).map(|half| half * 320_000 + 6_477).collect();
    assert_eq!(bench.board.rises[&DMA2_STREAM0], expected);
    assert_eq!(bench.board.blocks, [32; 6]);
    // One wake-up for the first scan and one per interrupt, none per sample.
    assert_eq!(bench.wakes, 7);
    let outcome = bench.outcome();
    assert_eq!(outcome.sampling.unwrap().first_ns, 10_000);
    assert_eq!((outcome.overruns, outcome.triggers_ignored), (0, 0));
    assert_eq!(outcome.unknown_registers, []);
    assert_eq!(outcome.unmodelled, [""; 0]);
}

/// Many scans in one stretch are played by a shortcut instead of event by event.
#[test]
fn what_is_played_in_one_stretch_is_what_is_played_event_by_event() {
    let played = |memory: u32, two_converters: bool, step: usize| {
        let mut bench = MachineBench::with(|run| {
            run.stimulus = ramp(400);
            run.uart_input = vec![UartInput::usart1(211_003, *b"beside the scans")];
        });
        bench.board.sram[0x8000..0x8064].fill(0x5a);
        bench.start_usart(USART1, 1 << 5);
        bench.write(USART1 + 0x14, 1 << 7);
        bench.start_stream(STREAM7, 100, USART1 + 0x04, SRAM + 0x8000, TO_USART);
        if two_converters {
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
        let board = bench.board;
        (board.sram, board.frames, board.blocks, flags, counts)
    };
    // The second memory is GPIOB's output register: a DMA may write there, too.
    for (memory, two) in [(SRAM + 0x100, false), (SRAM + 0x100, true), (GPIOB + 0x14, false)] {
        let each = played(memory, two, 200);
        for stretch in [10_000, 250_000, 2_000_000] {
            let equal = played(memory, two, stretch) == each;
            assert!(equal, "{memory:#x} {two} {stretch}");
        }
    }
}

#[test]
fn a_ring_whose_stream_is_stopped_overruns_and_sleeps_until_ovr_is_cleared() {
    let mut bench = acquiring();
    bench.pass(35_000);
    let cr = bench.read(STREAM0);
    bench.write(STREAM0, cr & !1);
    bench.wakes = 0;
    bench.pass(995_000);
    let outcome = bench.outcome();
    // From 50 µs.
    assert_eq!((outcome.overruns, outcome.triggers_ignored), (1, 95));
    assert_eq!(bench.read(ADC1) & OVR, OVR);
    // The interrupt of the overrun, possibly a conversion before it, and nothing at the triggers that follow.
    assert!(bench.has_line(18) && bench.wakes <= 2, "{} wakes", bench.wakes);
    bench.write(DMA2 + 0x08, 0x3f);
    bench.write(STREAM0, cr);
    bench.write(ADC1, !OVR);
    bench.read(ADC1 + 0x4c);
    bench.pass(1_009_000);
    // The stimulus went on meanwhile: the scan at 1 ms is row 99.
    assert_eq!(bench.halfwords(SRAM, 2), [99, 1099]);
}

#[test]
fn faults_on_demand_look_like_those_of_the_hardware() {
    let mut bench = acquiring();
    bench.pass(35_000);
    fail(&mut bench, FaultKind::AdcOverrun);
    bench.pass(95_000);
    assert_eq!((bench.read(ADC1) & OVR, bench.outcome().overruns), (OVR, 1));
    // The scan of 30 µs was aborted half way.
    assert_eq!(bench.read(STREAM0 + 0x04), 128 - 5);

    let mut bench = acquiring();
    bench.pass(35_000);
    fail(&mut bench, FaultKind::AdcDmaError);
    assert!(bench.has_line(DMA2_STREAM0));
    assert_eq!((bench.read(DMA2) & 0x3f, bench.read(STREAM0) & 1), (TEIF0, 0));
}

#[test]
fn a_crash_on_demand_overwrites_the_vector_of_the_stream_that_serves_the_adc() {
    const VECTOR: u32 = 0x0800_0000 + 4 * (16 + DMA2_STREAM0 as u32);
    let written = |kind: FaultKind| {
        let mut bench = MachineBench::new(ramp(400));
        fail(&mut bench, kind);
        assert_eq!(bench.board.flash_writes, [], "no stream serves the ADC yet");
        bench.start_acquisition(SRAM, 128);
        bench.board.now = 35_000;
        fail(&mut bench, kind);
        bench.board.flash_writes
    };
    let to_handler = (VECTOR, vec![0xf1, 0xff, 0x0f, 0x08]);
    let hang = (0x080f_fff0, vec![0xfe, 0xe7]);
    let push = (0x080f_fff0, vec![0x0f, 0xb4, 0xfd, 0xe7]);
    let nowhere = (VECTOR, vec![0xf1, 0xff, 0xff, 0xef]);
    assert_eq!(written(FaultKind::WildJump), [nowhere]);
    assert_eq!(written(FaultKind::Hang), [hang, to_handler.clone()]);
    assert_eq!(written(FaultKind::RunawayStack), [push, to_handler]);
}

#[test]
fn scans_longer_than_the_trigger_period_skip_triggers_and_keep_their_rows() {
    let mut bench = acquiring();
    // 480 + 12 cycles: 23.4 µs a conversion.
    bench.write(ADC1 + 0x10, 0b111_111);
    bench.pass(130_000);
    assert_eq!(bench.halfwords(SRAM, 4), [0, 1000, 5, 1005]);
    assert_eq!(bench.outcome().triggers_ignored, 10 - 1 + 1);
}

#[test]
fn a_ring_in_ccm_is_a_transfer_error_and_is_named() {
    let mut bench = MachineBench::new(ramp(10));
    bench.start_acquisition(0x1000_0000, 128);
    bench.pass(30_000);
    assert!(bench.has_line(DMA2_STREAM0));
    assert_eq!(bench.read(DMA2) & 0x3f, TEIF0);
    // Each of the three addresses, including one that no stream uses.
    for register in [0x08, 0x0c, 0x10] {
        let mut bench = MachineBench::new(Vec::new());
        bench.set(STREAM0, [(register, 0x1001_0000), (register, 0x2000_0000)]);
        assert_eq!(bench.outcome().unmodelled, [""; 0]);
        bench.write(STREAM0 + register, 0x1000_fffc);
        assert!(
            bench.outcome().unmodelled[0].contains("core-coupled memory"),
            "{register:#x}"
        );
    }
}

#[test]
fn a_transmission_by_dma_sends_every_byte_at_the_baud_rate_and_wakes_once() {
    let mut bench = MachineBench::new(Vec::new());
    let bytes = std::array::from_fn::<u8, 100, _>(|i| i as u8);
    bench.board.sram[..100].copy_from_slice(&bytes);
    bench.start_usart(USART1, 0);
    bench.write(USART1 + 0x14, 1 << 7);
    bench.start_stream(STREAM7, 100, USART1 + 0x04, SRAM, TO_USART | 1 << 4);
    bench.run(2_000_000, |b| b.write(DMA2 + 0x0c, 0x3f << 22));
    assert_eq!(bench.board.frames, bytes.map(|byte| (0, byte.into())));
    // The last byte leaves memory when the one before the last starts on the line.
    assert_eq!(bench.board.rises[&70], [98 * 10_000]);
    assert_eq!(bench.wakes, 1);
    assert_eq!(bench.read(USART1) & 0xc0, 0xc0, "TXE and TC");
}

#[test]
fn a_narrow_write_is_repeated_over_the_word_on_apb_and_leaves_the_rest_of_it_elsewhere() {
    let mut bench = MachineBench::new(Vec::new());
    bench.write_narrow(TIM3 + 0x2c, 1, 0x12);
    assert_eq!(bench.read(TIM3 + 0x2c), 0x1212);
    bench.write_narrow(TIM2 + 0x2c, 2, 0x3456);
    assert_eq!(bench.read(TIM2 + 0x2c), 0x3456_3456);
    // Such a write reads no register: of EXTI's pending bits, which a one clears, it clears only line 0's.
    bench.set(EXTI, [(0x00, 0b11), (0x10, 0b11)]);
    bench.write_narrow(EXTI + 0x14, 1, 0b01);
    assert_eq!(bench.read(EXTI + 0x14), 0b10);
    bench.start_usart(USART1, 0);
    bench.write_narrow(USART1 + 0x04, 1, 0x41);
    bench.pass(10_000);
    assert_eq!(bench.board.frames, [(0, 0x41)]);
    bench.write(GPIOA + 0x14, 0x1234);
    bench.write_narrow(GPIOA + 0x15, 1, 0xab);
    assert_eq!(bench.read(GPIOA + 0x14), 0xab34);
}

#[test]
fn a_register_without_a_model_and_one_without_its_clock_are_recorded_by_name() {
    let mut bench = MachineBench::new(Vec::new());
    bench.write(0x4000_6404, 7);
    bench.read(0x4000_6404);
    bench.write(RCC + 0x44, 0);
    bench.write(USART1, 0);
    let unknown = bench.outcome().unknown_registers;
    let seen = unknown
        .iter()
        .map(|u| (&*u.name, u.clock_off, u.reads, u.writes, u.last_write));
    let seen: Vec<_> = seen.collect();
    assert_eq!(seen[0], ("CAN1_MSR", false, 1, 1, Some(7)));
    assert_eq!(seen[1..], [("USART1_SR (clock off)", true, 0, 1, Some(0))]);
}

#[test]
fn a_machine_that_listens_to_a_pin_or_a_receiver_is_not_at_rest() {
    let mut bench = MachineBench::new(Vec::new());
    bench.set(RCC, [(0x44, 1 << 4 | 1 << 14)]);
    assert!(bench.machine.is_at_rest());
    let rests_after = |bench: &mut MachineBench, address, words: [u32; 2]| {
        words.map(|word| {
            bench.write(address, word);
            bench.machine.is_at_rest()
        })
    };
    // The receiver and its interrupt; then an enabled rising edge.
    assert_eq!(
        rests_after(
            &mut bench,
            USART1 + 0x0c,
            [1 << 13 | 1 << 2, 1 << 13 | 1 << 2 | 1 << 5]
        ),
        [true, false]
    );
    assert_eq!(rests_after(&mut bench, USART1 + 0x0c, [1 << 5, 0]), [true, true]);
    bench.write(USART1 + 0x14, 1 << 6);
    assert_eq!(
        rests_after(&mut bench, USART1 + 0x0c, [1 << 13 | 1 << 2, 0]),
        [false, true]
    );
    assert_eq!(rests_after(&mut bench, EXTI, [1, 1]), [true, true]);
    assert_eq!(rests_after(&mut bench, EXTI + 0x08, [2, 3]), [true, false]);
}

#[test]
fn a_software_reset_starts_the_peripherals_anew_and_the_world_goes_on() {
    let mut bench = acquiring();
    bench.run(1_000_000, MachineBench::clear_stream0);
    bench.machine.reset(bench.board.now, &mut bench.board);
    let flags = bench.read(RCC + 0x74) >> 24;
    assert_eq!(flags, 0b1_1110, "SFTRSTF beside the flags of power-up");
    assert_eq!(bench.read(STREAM0), 0, "its clock is off");
    assert_eq!(bench.machine.next_interrupt(), None);
    assert_eq!(bench.machine.stimulus().ends_at(), Some(10_000 + 400 * 10_000));
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::Software);
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
    bench.pass(19_999);
    assert!(bench.board.stalled && bench.board.rises.is_empty());
    bench.pass(20_000);
    assert!(!bench.board.stalled);
    assert_eq!(bench.board.rises[&29], [20_000], "TIM3 was due at 10 us");
    let changed = (WRITABLE.start, vec![0x44, 0x33, 0x22, 0x11]);
    assert_eq!(bench.board.flash_changes, [changed]);
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
fn the_watchdog_bites_in_the_midst_of_an_erase_that_takes_longer() {
    let mut bench = MachineBench::new(vec![[0; 4]]);
    // The prescaler stays 4: 512 ms.
    bench.write(IWDG, 0xcccc);
    bench.open_flash();
    bench.write(FLASH + 0x10, 0b10 << 8 | 11 << 3 | 1 << 1 | 1 << 16);
    assert!(bench.board.stalled);
    bench.pass(512_000_000);
    assert_eq!(bench.board.resets_wanted, 1);
    bench.machine.reset(512_000_000, &mut bench.board);
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::Watchdog);
    assert_eq!(bench.read(RCC + 0x74) >> 29 & 1, 1, "IWDGRSTF");
    assert_eq!(bench.read(FLASH + 0x0c), 0);
}

/// TIM2 started by TIM3's first update, its channel 1 capturing rising edges of PA15 with an interrupt;
/// samples at 100 kHz.
fn capturing(changes_ns: Vec<u64>) -> MachineBench {
    let mut bench = MachineBench::with(|run| {
        run.pin_inputs = vec![PinInput::new("PA15", Since::FirstScan, changes_ns)];
    });
    bench.set(GPIOA, [(0x24, 1 << 28), (0x00, 0xa800_0000)]);
    bench.write(TIM2 + 0x08, 0b010 << 4 | 0b110);
    bench.set(TIM2, [(0x18, 0b01), (0x20, 1), (0x0c, 1 << 1)]);
    bench.start_acquisition(SRAM, 64);
    bench
}

const TIM2_LINE: usize = 28;

#[test]
fn an_edge_is_captured_in_clocks_since_the_first_scan_and_interrupts_at_its_time() {
    // The first scan is TIM3's first update, at 10 us, and starts TIM2.
    let mut bench = capturing(vec![123_456, 200_000]);
    let mut captured = Vec::new();
    bench.run(1_000_000, |bench| {
        if bench.has_line(TIM2_LINE) {
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
    let mut bench = capturing(vec![50_000, 60_000, 150_000]);
    bench.write(GPIOA + 0x24, 2 << 28);
    bench.pass(100_000);
    assert_eq!(bench.board.rises.get(&TIM2_LINE), None, "AF2 is no TIM2");
    bench.write(GPIOA + 0x24, 1 << 28);
    bench.pass(1_000_000);
    assert_eq!(bench.board.rises[&TIM2_LINE], [160_000]);
}

#[test]
fn a_storm_of_edges_wakes_nobody_while_the_flag_stands() {
    let mut bench = capturing((0..100_000).map(|n| 1_000 + 10 * n).collect());
    // The handler masks the channel and leaves the flag.
    bench.write(TIM2 + 0x0c, 0);
    bench.pass(900_000);
    assert_eq!(bench.board.rises.get(&TIM2_LINE), None);
    // The first scan, and blocks of 16 scans.
    assert!(bench.wakes <= 1 + 6, "{}", bench.wakes);
    assert_eq!(bench.read(TIM2 + 0x10) & !1, 1 << 9 | 1 << 6 | 1 << 1);
}

#[test]
fn a_software_scan_under_a_trigger_is_taken_or_ignored_as_the_run_says() {
    let scans = |taken: bool| {
        let mut bench = MachineBench::with(|run| {
            run.stimulus = ramp(10);
            run.software_scan_under_trigger = taken;
        });
        bench.start_acquisition(SRAM, 64);
        bench.write(ADC1 + 0x08, ADON_DMA_BY_TIM3 | 1 << 30);
        bench.pass(9_000);
        let by_software = bench.halfwords(SRAM, 2);
        bench.pass(29_000);
        let scans = bench.machine.stimulus().sampling().unwrap().scans;
        assert_eq!(scans, 2, "the software's is not counted");
        (by_software, bench.halfwords(SRAM, 6))
    };
    // Row 0 is read by the software's scan and by the first triggered one.
    let (taken, ignored) = (scans(true), scans(false));
    assert_eq!(taken, (vec![0, 1000], vec![0, 1000, 0, 1000, 1, 1001]));
    assert_eq!(ignored, (vec![0, 0], vec![0, 1000, 1, 1001, 0, 0]));
}

/// USART1 at 1 Mbit/s that receives `abc` from 10 µs, by DMA2 stream 2 into SRAM.
fn receiving(latency_ns: u64) -> MachineBench {
    let mut bench = MachineBench::with(|run| {
        run.receive_dma_latency_ns = latency_ns;
        run.uart_input = vec![UartInput::usart1(10_000, *b"abc")];
    });
    bench.write(USART1 + 0x14, 1 << 6);
    bench.start_usart(USART1, 0);
    let cr = 4 << 25 | 1 << 10 | 1 << 8;
    bench.start_stream(stream(DMA2, 2), 64, USART1 + 0x04, SRAM, cr);
    bench
}

#[test]
fn a_byte_that_the_processor_reads_before_a_late_dma_is_lost_to_it() {
    // Bytes come at 20, 30 and 40 µs. The processor reads DR 1 µs after the second.
    for (latency_ns, fetched) in [(0, b"abc"), (900, b"abc"), (1_100, b"ac\0")] {
        let mut bench = receiving(latency_ns);
        bench.pass(31_000);
        assert_eq!(bench.read(USART1 + 0x04), u32::from(b'b'));
        bench.pass(60_000);
        assert_eq!(bench.board.sram[..3], *fetched, "{latency_ns} ns");
    }
    // A byte that arrives before the previous one was fetched is lost as well.
    let mut bench = receiving(11_000);
    bench.pass(60_000);
    assert_eq!(bench.board.sram[..3], *b"ac\0");
    assert_eq!(bench.read(USART1) >> 3 & 1, 1, "ORE");
}

#[test]
fn a_supply_ramps_up_in_steps_of_10_mv_from_power_up_on() {
    let ramp: Vec<_> = Fault::supply_ramp(1800, 3300, 15_000_000).collect();
    assert_eq!(ramp.len(), 151);
    let supply = |at_ns, millivolts| Fault::after_power_up(at_ns, FaultKind::Supply { millivolts });
    let expected = [supply(0, 1800), supply(7_500_000, 2550), supply(15_000_000, 3300)];
    assert_eq!([0, 75, 150].map(|step| ramp[step]), expected);
    let last = Fault::supply_ramp(3300, 3295, 1_000).last();
    assert_eq!(last, Some(supply(1_000, 3295)));
}

#[test]
fn rows_that_no_triggered_scan_plays_are_said() {
    let mut bench = MachineBench::new(ramp(3));
    bench.write(ADC_CCR, 1 << 16);
    bench.convert(ADC1, 0);
    let said = bench.outcome().unmodelled;
    assert_eq!(said.len(), 1);
    assert!(said[0].starts_with("ADC1 no triggered scan came"), "{said:?}");
}

#[test]
fn the_time_of_each_clock_adds_up_to_the_run() {
    let mut bench = MachineBench::new(Vec::new());
    bench.pass(1_000_000);
    bench.write(RCC + 0x08, 0);
    bench.pass(1_500_000);
    let expected = [(16_000_000, 500_000), (168_000_000, 1_000_000)];
    assert_eq!(bench.outcome().hclk_ns, expected);
}

/// Random writes by which firmware sets streams up anew.
#[test]
fn steady_writes_to_a_dma_controller_do_what_others_do_and_are_refused_where_they_do_more() {
    const DMA2_STREAM2: u32 = stream(DMA2, 2);
    // LIFCR, and CR with and without EN and TCIE, NDTR, PAR, M0AR, FCR.
    let mut choices = vec![(DMA2 + 0x08, 0x3d << 16)];
    for enables in [0, 1, 1 << 4, 1 << 4 | 1] {
        choices.push((DMA2_STREAM2, 4 << 25 | 1 << 10 | enables));
    }
    choices.extend(
        [
            (0x04, 100),
            (0x04, 7),
            (0x08, USART1 + 4),
            (0x0c, SRAM),
            (0x14, 0x21),
        ]
        .map(|(at, value)| (DMA2_STREAM2 + at, value)),
    );
    let [mut steady, mut plain] = [(); 2].map(|()| MachineBench::new(Vec::new()));
    let (mut random, mut accepted, mut came_back) = (1u32, 0, 0);
    for n in 0..2000 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let (address, value) = choices[(random >> 16) as usize % choices.len()];
        let now = steady.board.now + 8;
        (steady.board.now, plain.board.now) = (now, now);
        let lines = steady.board.lines.clone();
        steady.machine.keep_registers();
        let before = registers(&mut steady);
        let may_rise = n % 2 == 0;
        let written = steady
            .machine
            .write_steady(address, value, now, &mut steady.board, |_| may_rise);
        if written.is_some() {
            accepted += 1;
            assert!(may_rise || steady.board.lines.is_subset(&lines));
            let changed = steady.board.lines != lines || registers(&mut steady) != before;
            // State that no register shows may differ.
            assert!(!(changed && steady.machine.are_registers_as_kept()));
            came_back += u32::from(steady.machine.are_registers_as_kept());
        } else {
            assert_eq!(steady.board.lines, lines);
            steady.write(address, value);
        }
        plain.write(address, value);
        assert_eq!(registers(&mut steady), registers(&mut plain));
        assert_eq!(steady.board.lines, plain.board.lines);
        assert_eq!(steady.outcome().unmodelled, plain.outcome().unmodelled);
    }
    assert!(accepted > 1000 && came_back > 100, "{accepted}, {came_back}");
}

/// The status of a DMA controller and the registers of its stream 2.
fn registers(bench: &mut MachineBench) -> Vec<u32> {
    let status = [DMA2, DMA2 + 4];
    let stream = (0..6).map(|n| stream(DMA2, 2) + 4 * n);
    status
        .into_iter()
        .chain(stream)
        .map(|at| bench.read(at))
        .collect()
}

#[test]
fn a_steady_write_moves_no_data() {
    let steady = |bench: &mut MachineBench, address, value| {
        let (now, board) = (bench.board.now, &mut bench.board);
        bench.machine.write_steady(address, value, now, board, |_| true)
    };
    let mut bench = MachineBench::new(Vec::new());
    bench.start_usart(USART1, 0);
    bench.set(STREAM7, [(0x08, USART1 + 4), (0x0c, SRAM), (0x04, 3)]);
    // Nothing requests data yet.
    assert!(steady(&mut bench, STREAM7, TO_USART | 1).is_some());
    assert!(steady(&mut bench, STREAM7, TO_USART).is_some());
    bench.write(USART1 + 0x14, 1 << 7);
    assert_eq!(steady(&mut bench, STREAM7, TO_USART | 1), None);
    assert_eq!(bench.read(STREAM7) & 1, 0);
    // A copy between memories needs no request.
    let copies = 0b10 << 6 | 1 << 10 | 1 << 9;
    bench.set(STREAM0, [(0x08, SRAM), (0x0c, SRAM + 64), (0x04, 8)]);
    assert_eq!(steady(&mut bench, STREAM0, copies | 1), None);
    assert_eq!(bench.read(DMA2) & 1 << 5, 0, "TCIF");
    // Another peripheral.
    assert_eq!(steady(&mut bench, TIM2 + 0x24, 0), None);
}

/// External clock mode 1 with an internal trigger (sections 18.3.15 and 18.4.3): one timer is the prescaler
/// of another.
#[test]
fn a_timer_counts_the_trigger_output_of_another_and_interrupts_at_its_own_update() {
    const TIM2_LINE: usize = 28;
    let mut bench = MachineBench::new(Vec::new());
    // ITR2 is TIM3. Every second trigger is counted, up to 4.
    bench.set(
        TIM2,
        [(0x08, 0b010 << 4 | 0b111), (0x28, 1), (0x2c, 4), (0x14, 1)],
    );
    bench.set(TIM2, [(0x10, 0), (0x0c, 1), (0x00, 1)]);
    bench.start_tim3();
    bench.pass(75_000);
    assert_eq!(bench.read(TIM2 + 0x24), 3, "after seven triggers, one each 10 us");
    assert_eq!(bench.read(TIM2 + 0x10), 1 << 6, "TIF");
    bench.run(350_000, |bench| {
        if bench.has_line(TIM2_LINE) {
            bench.write(TIM2 + 0x10, 0);
        }
    });
    assert_eq!(bench.board.rises[&TIM2_LINE], [100_000, 200_000, 300_000]);
    // Without CEN the triggers are ignored.
    bench.write(TIM2, 0);
    let before = bench.read(TIM2 + 0x24);
    bench.pass(450_000);
    assert_eq!(bench.read(TIM2 + 0x24), before);
    assert_eq!(bench.outcome().unmodelled, [""; 0]);
}
