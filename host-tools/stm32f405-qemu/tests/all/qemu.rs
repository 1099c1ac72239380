//! Images of a few instructions in real QEMU. The overlay fits QEMU, and each way to fail has its own error.
//!
//! The images are made here. Each is a loop that copies values from a table into registers and then sleeps,
//! and a handler that does the same. So every test shows all that its image does.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use stm32f405_qemu::{
    Fault, FaultKind, FlashOperation, Inputs, Level, Outcome, PinInput, Poke, ResetCause, Run, RunEnd,
    RunError, Since, Uart, UartInput, functions,
};

const FLASH: u32 = 0x0800_0000;
const SRAM: u32 = 0x2000_0000;
const VECTORS: usize = 16 + 82;
const RESET_AT: u32 = FLASH + 4 * VECTORS as u32;
const HANDLER_AT: u32 = RESET_AT + 20;
const TABLES_AT: u32 = HANDLER_AT + 20;

const RCC: u32 = 0x4002_3800;
const TIM3: u32 = 0x4000_0400;
const IWDG: u32 = 0x4000_3000;
const USART1: u32 = 0x4001_1000;
const ADC1: u32 = 0x4001_2000;
const DMA2: u32 = 0x4002_6400;
const STREAM0: u32 = DMA2 + 0x10;
const STREAM7: u32 = DMA2 + 0x10 + 7 * 0x18;
const NVIC_ISER1: u32 = 0xe000_e104;
const DMA2_STREAM0: usize = 56;
const TIM2_LINE: usize = 28;
/// AIRCR: the key, and SYSRESETREQ.
const RESET_REQUEST: (u32, u32) = (0xe000_ed0c, 0x05fa_0004);

/// GPIOB: PB6 is USART1's transmitter (AF7).
const TRANSMITTER: [(u32, u32); 2] = [(0x4002_0400, 0x0280 | 0b10 << 12), (0x4002_0420, 7 << 24)];

type Writes<'a> = &'a [(u32, u32)];

/// Instruction at the end of the loop's table.
const SLEEP: u16 = 0xbf30;
const RETURN: u16 = 0x4770;
const BRANCH_TO_SELF: u16 = 0xe7fe;

/// An image that makes the writes of `main` and then executes `then`. The handler of DMA2 stream 0 and of
/// TIM2 makes the writes of `handler`.
fn image(main: Writes<'_>, then: u16, handler: Writes<'_>) -> Vec<u8> {
    let handler_table = TABLES_AT + 8 * (main.len() as u32 + 1);
    let mut vectors = [0u32; VECTORS];
    vectors[0] = SRAM + 0x1_0000;
    vectors[1] = RESET_AT | 1;
    vectors[16 + DMA2_STREAM0] = HANDLER_AT | 1;
    vectors[16 + TIM2_LINE] = HANDLER_AT | 1;

    let mut code: Vec<u8> = vectors.iter().flat_map(|v| v.to_le_bytes()).collect();
    for (end, table) in [(then, TABLES_AT), (RETURN, handler_table)] {
        // ldr r2, table; next: ldmia r2!, {r0, r1}; cmp r0, #0; beq end; str r1, [r0]; b next; end: …; b end
        let instructions = [0x4a03, 0xca03, 0x2800, 0xd001, 0x6001, 0xe7fa, end, 0xe7fd];
        code.extend(instructions.iter().flat_map(|i: &u16| i.to_le_bytes()));
        code.extend(table.to_le_bytes());
    }
    for table in [main, handler] {
        for (address, value) in table.iter().chain(&[(0, 0)]) {
            code.extend(address.to_le_bytes());
            code.extend(value.to_le_bytes());
        }
    }
    elf(
        &code,
        &[
            ("handler", HANDLER_AT | 1, 20, 2),
            ("_SEGGER_RTT", SRAM + 0x100, 48, 1),
        ],
    )
}

/// An ELF with one segment in flash and a symbol table: name, address, size, type.
fn elf(code: &[u8], symbols: &[(&str, u32, u32, u8)]) -> Vec<u8> {
    let words = |values: &[u32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let mut strings = vec![0u8];
    let mut table = words(&[0; 4]);
    for (name, address, size, kind) in symbols {
        table.extend(words(&[strings.len() as u32, *address, *size]));
        // Global, of this type, in no section of ours.
        table.extend([0x10 | kind, 0, 0xf1, 0xff]);
        strings.extend(name.bytes().chain([0]));
    }
    let code_at = 52 + 32;
    let table_at = code_at + code.len() as u32;
    let strings_at = table_at + table.len() as u32;
    let sections_at = strings_at + strings.len() as u32;

    let mut file = vec![0x7f, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    // An executable for ARM, version 1, entry, program headers, sections, EABI 5 flags.
    file.extend(words(&[
        2 | 40 << 16,
        1,
        RESET_AT | 1,
        52,
        sections_at,
        0x0500_0200,
    ]));
    // Header sizes and counts: one segment, three sections, names in the last.
    file.extend(words(&[52 | 32 << 16, 1 | 40 << 16, 3 | 2 << 16]));
    let size = code.len() as u32;
    file.extend(words(&[1, code_at, FLASH, FLASH, size, size, 5, 4]));
    file.extend(code);
    file.extend(&table);
    file.extend(&strings);
    file.extend(words(&[0; 10]));
    file.extend(words(&[0, 2, 0, 0, table_at, table.len() as u32, 2, 1, 4, 16]));
    file.extend(words(&[0, 3, 0, 0, strings_at, strings.len() as u32, 0, 0, 1, 0]));
    file
}

/// The run of an image, and the folder that holds it.
struct ImageBench {
    run: Run,
    _folder: tempfile::TempDir,
}

fn bench(image: &[u8]) -> ImageBench {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("image.elf");
    std::fs::write(&path, image).unwrap();
    let mut run = Run::new(path);
    run.tail_ns = 100_000;
    run.sampling_deadline_ns = 1_000_000;
    ImageBench { run, _folder: folder }
}

/// Scans of both channels at 10 kHz into a ring of 8, each full ring sent over USART1 at 1 Mbit/s; all at 16
/// MHz.
fn acquiring() -> Vec<u8> {
    acquiring_after(&[])
}

/// An acquiring image that makes other writes first.
fn acquiring_after(first: Writes<'_>) -> Vec<u8> {
    let dma_halfwords = 1 << 13 | 1 << 11 | 1 << 10;
    let main = [
        (RCC + 0x30, 1 << 22 | 1 << 1),
        (RCC + 0x40, 1 << 1),
        (RCC + 0x44, 1 << 4 | 1 << 8),
        (NVIC_ISER1, 1 << (DMA2_STREAM0 - 32)),
        (STREAM0 + 0x04, 16),
        (STREAM0 + 0x08, ADC1 + 0x4c),
        (STREAM0 + 0x0c, SRAM),
        (STREAM0, dma_halfwords | 1 << 8 | 1 << 4 | 1),
        (ADC1 + 0x04, 1 << 8),
        (ADC1 + 0x2c, 1 << 20),
        (ADC1 + 0x34, 1 << 5),
        (ADC1 + 0x08, 0b01 << 28 | 0b1000 << 24 | 1 << 9 | 1 << 8 | 1),
        TRANSMITTER[0],
        TRANSMITTER[1],
        (USART1 + 0x08, 16),
        (USART1 + 0x0c, 1 << 13 | 1 << 3),
        (USART1 + 0x14, 1 << 7),
        (TIM3 + 0x2c, 1599),
        (TIM3 + 0x04, 0b010 << 4),
        (TIM3, 1),
    ];
    let handler = [
        (DMA2 + 0x08, 0x3f),
        (DMA2 + 0x0c, 0x3f << 22),
        (STREAM7 + 0x04, 32),
        (STREAM7 + 0x08, USART1 + 0x04),
        (STREAM7 + 0x0c, SRAM),
        (STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1),
    ];
    image(&[first, &main].concat(), SLEEP, &handler)
}

/// Notes of the run, without the one of its core: at 16 MHz an instruction takes longer than 8 ns.
fn noted(outcome: &Outcome) -> Vec<&str> {
    let noted = outcome.unmodelled.iter().map(String::as_str);
    noted
        .filter(|what| !what.starts_with("processor an instruction"))
        .collect()
}

fn run_acquiring(change: impl FnOnce(&mut Run)) -> Outcome {
    let mut bench = bench(&acquiring());
    bench.run.stimulus = (0..80).map(|i| [i, 4095 - i, 0, 0]).collect();
    bench.run.sample_period_ns = 100_000;
    bench.run.tail_ns = 700_000;
    change(&mut bench.run);
    bench.run.execute().unwrap()
}

#[test]
fn every_row_of_the_stimulus_comes_out_of_the_uart_in_order() {
    let outcome = run_acquiring(|_| {});
    let rows: Vec<u8> = (0..80u16)
        .flat_map(|i| [i, 4095 - i])
        .flat_map(u16::to_le_bytes)
        .collect();
    assert_eq!(outcome.uart, rows);
    // A full ring is sent back to back: at 1 Mbit/s a byte takes 10 us.
    let apart: Vec<u64> = outcome.uart_ns[..32]
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .collect();
    assert_eq!(
        (outcome.uart_ns.len(), apart),
        (outcome.uart.len(), vec![10_000; 31])
    );
    // 8 ms of rows and 0.7 ms of tail, both ends included.
    assert_eq!(outcome.sampling.unwrap().scans, 88);
    assert_eq!(
        (outcome.overruns, outcome.triggers_ignored, outcome.resets.len()),
        (0, 0, 0)
    );
    assert_eq!((outcome.unknown_registers.len(), noted(&outcome).len()), (0, 0));
}

#[test]
fn the_same_run_gives_the_same_bytes_counts_and_times() {
    let [a, b] = [(); 2].map(|()| run_acquiring(|_| {}));
    assert_eq!(
        (a.uart, a.instructions, a.sampling, a.virtual_ns),
        (b.uart, b.instructions, b.sampling, b.virtual_ns)
    );
}

#[test]
fn instructions_are_counted_by_function_and_by_block() {
    let outcome = run_acquiring(|run| {
        run.functions = vec![
            ("block".into(), "handler".into()),
            ("none".into(), "no_such".into()),
        ];
        run.work = vec!["block".into()];
    });
    let instructions = outcome.instructions.unwrap();
    // A load, six turns of five, the last of three, and the return.
    let one_handler = 1 + 6 * 5 + 3 + 1;
    let [block, none] = &instructions.functions[..] else {
        panic!("two labels")
    };
    assert_eq!(
        (block.calls, block.instructions, block.symbols),
        (10, 10 * one_handler, 1)
    );
    assert_eq!((none.calls, none.instructions, none.symbols), (0, 0, 0));
    // From one full ring to the next: the stream does not interrupt at the half.
    let worst = instructions.worst_block.unwrap();
    assert_eq!(worst.scans, 8);
    // The handler, and the branch and the WFI of the loop that it came back to.
    assert_eq!(worst.instructions, one_handler + 2);
    // Every block has the handler in it, and the last handler is in none.
    let working = instructions.working.unwrap();
    assert_eq!(
        (working.scans, working.instructions),
        (9 * 8, 9 * (one_handler + 2))
    );
    // To an image without such a function every block is an idle one.
    let idle_of = |work: &str| {
        let outcome = run_acquiring(|run| {
            run.functions = vec![("none".into(), "no_such".into())];
            run.work = vec![work.into()];
        });
        outcome.instructions.unwrap().idle
    };
    assert_eq!(instructions.idle, None);
    assert_eq!(idle_of("none"), instructions.working);
    assert_eq!(
        run_acquiring(|run| run.count_instructions = false).instructions,
        None
    );
}

#[test]
fn flash_blocks_are_where_they_were_put() {
    let main = [
        (RCC + 0x30, 1 << 22 | 1 << 1),
        (RCC + 0x44, 1 << 4),
        TRANSMITTER[0],
        TRANSMITTER[1],
        (USART1 + 0x08, 16),
        (USART1 + 0x0c, 1 << 13 | 1 << 3),
        (USART1 + 0x14, 1 << 7),
        (STREAM7 + 0x04, 8),
        (STREAM7 + 0x08, USART1 + 0x04),
        (STREAM7 + 0x0c, 0x080e_0000),
        (STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1),
    ];
    let mut bench = bench(&image(&main, SLEEP, &[]));
    bench.run.flash = vec![(0x080e_0000, b"settings".to_vec())];
    assert_eq!(bench.run.execute().unwrap().uart, b"settings");
}

#[test]
fn an_image_that_never_samples_ends_at_the_deadline_and_says_so() {
    let outcome = bench(&image(&[], SLEEP, &[])).run.execute().unwrap();
    assert_eq!((outcome.sampling, outcome.virtual_ns), (None, 1_000_000));
}

#[test]
fn unknown_registers_and_moved_pins_are_reported_by_name() {
    let main = [
        (RCC + 0x30, 1 << 2),
        (0x4002_0800, 1),
        (0x4002_0818, 1),
        (0x4001_3008, 7),
    ];
    let outcome = bench(&image(&main, SLEEP, &[])).run.execute().unwrap();
    let unknown: Vec<_> = outcome
        .unknown_registers
        .iter()
        .map(|u| (u.name.as_str(), u.last_write))
        .collect();
    assert_eq!(unknown, [("SPI1_SR", Some(7))]);
    let pins: Vec<_> = outcome.pins.iter().map(|p| (p.name.as_str(), p.edges)).collect();
    assert_eq!(pins, [("PC0", 1)]);
}

#[test]
fn a_plain_rtt_log_is_read_out_of_guest_memory() {
    let word = |s: &[u8; 4]| u32::from_le_bytes(*s);
    let block = SRAM + 0x100;
    let main = [
        (block + 28, SRAM + 0x200),
        (block + 32, 64),
        (block + 36, 8),
        (block + 40, 0),
        (block + 16, 1),
        (SRAM + 0x200, word(b"hell")),
        (SRAM + 0x204, word(b"o\nx\n")),
        (block, word(b"SEGG")),
        (block + 4, word(b"ER R")),
        (block + 8, word(b"TT\0\0")),
    ];
    let outcome = bench(&image(&main, SLEEP, &[])).run.execute().unwrap();
    let lines: Vec<String> = outcome.log.iter().map(ToString::to_string).collect();
    assert_eq!(lines, ["hello", "x"]);
}

#[test]
fn a_firmware_that_resets_itself_is_counted_at_the_same_times_in_every_run() {
    let [a, b] = [(); 2].map(|()| {
        let mut bench = bench(&image(&[RESET_REQUEST], SLEEP, &[]));
        bench.run.sampling_deadline_ns = 2_000;
        bench.run.execute().unwrap()
    });
    assert!(a.resets.len() > 20, "{:?}", a.resets);
    assert!(a.resets.iter().all(|r| r.cause == ResetCause::Software));
    assert_eq!((a.resets, a.instructions), (b.resets, b.instructions));
}

#[test]
fn an_overrun_on_demand_ends_the_samples_of_an_image_that_does_not_clear_it() {
    let outcome = run_acquiring(|run| {
        run.faults = vec![Fault::after_first_scan(4_150_000, FaultKind::AdcOverrun)];
    });
    // Five full rings had been sent.
    assert_eq!((outcome.overruns, outcome.uart.len()), (1, 5 * 32));
    assert!(outcome.triggers_ignored > 40, "{}", outcome.triggers_ignored);
}

#[test]
fn a_watchdog_that_nobody_feeds_resets_a_sleeping_image_every_time_it_runs_out() {
    // Prescaler 4 and reload 7: 1 ms of the 32 kHz clock.
    let main = [(IWDG, 0x5555), (IWDG + 0x08, 7), (IWDG, 0xcccc)];
    let mut bench = bench(&image(&main, SLEEP, &[]));
    bench.run.sampling_deadline_ns = 4_500_000;
    let resets = bench.run.execute().unwrap().resets;
    assert!(resets.iter().all(|r| r.cause == ResetCause::Watchdog));
    assert_eq!(
        resets.iter().map(|r| r.at_ns / 1_000_000).collect::<Vec<_>>(),
        [1, 2, 3, 4]
    );
}

#[test]
fn a_poke_over_the_code_locks_up_an_image_without_a_fault_handler() {
    let mut bench = bench(&acquiring());
    bench.run.stimulus = vec![[0; 4]; 80];
    bench.run.sample_period_ns = 100_000;
    bench.run.pokes = vec![Poke {
        at_ns: 3_000_000,
        address: HANDLER_AT,
        bytes: vec![0xde; 20],
    }];
    let outcome = bench.run.execute().unwrap();
    assert!(
        matches!(outcome.end, RunEnd::LockedUp(Some(_))),
        "{:?}",
        outcome.end
    );
    let said = outcome.verdict().unwrap_err();
    assert!(said.contains("locked up"), "{said}");
    // What was there before it is there.
    assert!(outcome.sampling.is_some());
}

#[test]
fn an_image_that_hangs_is_stopped_by_the_timeout() {
    let mut bench = bench(&image(&[], BRANCH_TO_SELF, &[]));
    bench.run.sampling_deadline_ns = u64::MAX;
    bench.run.timeout = Duration::from_millis(300);
    let error = bench.run.execute().unwrap_err();
    assert!(matches!(error, RunError::Timeout { .. }), "{error}");
}

#[test]
fn a_fault_handler_that_is_a_loop_takes_no_longer_than_other_code_and_the_watchdog_ends_it() {
    // 800 periods of 125 us, and then a store where there is no memory.
    let main = [
        (IWDG, 0x5555),
        (IWDG + 0x08, 799),
        (IWDG, 0xcccc),
        (0xa000_0000, 0),
    ];
    let mut image = image(&main, BRANCH_TO_SELF, &[]);
    // The vector of HardFault, in the segment: the instruction after the loop over the table.
    let hard_fault = 52 + 32 + 4 * 3;
    image[hard_fault..hard_fault + 4].copy_from_slice(&((RESET_AT + 12) | 1).to_le_bytes());
    let mut bench = bench(&image);
    bench.run.sampling_deadline_ns = 150_000_000;
    // It takes a tenth of a second. With a look at the registers at each of 19 million turns, it would be a
    // minute.
    bench.run.timeout = Duration::from_secs(20);
    let outcome = bench.run.execute().unwrap();
    let resets: Vec<_> = outcome.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(
        (resets, outcome.exceptions.len()),
        (vec![ResetCause::Watchdog], 2)
    );
}

#[test]
fn a_qemu_that_its_debugger_ends_is_no_timeout_and_what_it_said_is_passed_on() {
    let mut bench = bench(&image(&[], SLEEP, &[]));
    let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = free.local_addr().unwrap().port();
    bench.run.gdb = Some(port);
    let taken = bench.run.execute().unwrap_err();
    assert!(matches!(taken, RunError::Input(_)), "{taken}");
    drop(free);
    let debugger = std::thread::spawn(move || {
        let started = Instant::now();
        while started.elapsed() < Duration::from_secs(60) {
            if let Ok(mut stub) = TcpStream::connect((Ipv4Addr::LOCALHOST, port)) {
                // `kill`; QEMU closes its end.
                stub.write_all(b"$k#6b").unwrap();
                let _ = stub.read_to_end(&mut Vec::new());
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    let ended = bench.run.execute().unwrap_err();
    debugger.join().unwrap();
    assert!(
        matches!(&ended, RunError::QemuEnded(how, _) if how.contains("GDBstub")),
        "{ended}"
    );
}

#[test]
fn a_missing_image_a_foreign_one_and_one_without_symbols_are_told_apart() {
    let missing = Run::new("/no/such/image").execute().unwrap_err();
    assert!(matches!(missing, RunError::ImageMissing { .. }), "{missing}");
    let foreign = Run::new(std::env::current_exe().unwrap()).execute().unwrap_err();
    assert!(matches!(foreign, RunError::NotArmElf { .. }), "{foreign}");
    let mut stripped = bench(&elf(&[0; 8], &[]));
    stripped.run.functions = vec![("a".into(), "b".into())];
    let stripped = stripped.run.execute().unwrap_err();
    assert!(matches!(stripped, RunError::NoSymbols { .. }), "{stripped}");
}

#[test]
fn a_missing_qemu_and_a_program_that_is_none_are_told_apart() {
    let mut bench = bench(&image(&[], SLEEP, &[]));
    bench.run.qemu = Some("/no/such/qemu".into());
    let missing = bench.run.execute().unwrap_err();
    assert!(matches!(missing, RunError::QemuMissing { .. }), "{missing}");
    bench.run.qemu = Some("true".into());
    let other = bench.run.execute().unwrap_err();
    assert!(matches!(other, RunError::QemuVersion { .. }), "{other}");
    bench.run.qemu = Some(std::env::temp_dir());
    let folder = bench.run.execute().unwrap_err();
    assert!(
        matches!(&folder, RunError::QemuUnusable(_, why) if why.contains("denied")),
        "{folder}"
    );
    bench.run.qemu = Some(script(&bench, "echo QEMU emulator version 6.2.0"));
    let old = bench.run.execute().unwrap_err();
    assert!(
        matches!(&old, RunError::QemuUnusable(_, why) if why.contains("6.2.0")),
        "{old}"
    );
}

#[test]
fn a_missing_overlay_and_a_file_that_is_none_are_told_apart() {
    let mut bench = bench(&image(&[], SLEEP, &[]));
    bench.run.overlay = Some("/no/such/overlay.so".into());
    let missing = bench.run.execute().unwrap_err();
    assert!(matches!(missing, RunError::OverlayMissing { .. }), "{missing}");
    bench.run.overlay = Some(bench.run.elf.clone());
    let other = bench.run.execute().unwrap_err();
    assert!(matches!(other, RunError::OverlayOdd { .. }), "{other}");
}

/// A shell script in place of QEMU. Another process writes it: a file that this process, or a child that it
/// just forked, has open for writing cannot be executed.
fn script(bench: &ImageBench, text: &str) -> PathBuf {
    let path = bench.run.elf.with_file_name("qemu.sh");
    let write = "printf '#!/bin/sh\\n%s\\n' \"$1\" > \"$0\" && chmod +x \"$0\"";
    let status = Command::new("sh")
        .arg("-c")
        .arg(write)
        .arg(&path)
        .arg(text)
        .status()
        .unwrap();
    assert!(status.success());
    path
}

#[test]
fn a_qemu_of_unknown_version_is_asked_again_with_the_plugin_version_that_it_names() {
    let mut bench = bench(&acquiring());
    let real = std::env::var("STM32F405_QEMU").unwrap_or_else(|_| "qemu-system-arm".into());
    let newer =
        format!("[ \"$1\" = --version ] && echo 'QEMU emulator version 99.0.0' && exit\nexec {real} \"$@\"");
    bench.run.qemu = Some(script(&bench, &newer));
    assert!(bench.run.execute().unwrap().sampling.is_some());
}

#[test]
fn what_a_qemu_that_fails_says_is_passed_on() {
    let error = |said: &str, status: i32| {
        let mut bench = bench(&image(&[], SLEEP, &[]));
        let version = "[ \"$1\" = --version ] && echo 'QEMU emulator version 7.2.0' && exit";
        bench.run.qemu = Some(script(
            &bench,
            &format!("{version}\necho '{said}' >&2; exit {status}"),
        ));
        bench.run.execute().unwrap_err()
    };
    let odd = error("no such machine", 1);
    assert!(
        matches!(&odd, RunError::Qemu(_, line) if line == "no such machine"),
        "{odd}"
    );
    let misfit = error("stm32f405-qemu: FLASH_ACR is odd", 86);
    assert!(
        matches!(&misfit, RunError::SelfTest(line) if line == "FLASH_ACR is odd"),
        "{misfit}"
    );
    let refused = error("stm32f405-qemu: this QEMU does not export timer_mod", 1);
    assert!(matches!(refused, RunError::OverlayRefused { .. }), "{refused}");
}

#[test]
fn codes_beyond_the_adc_and_blocks_beyond_flash_are_refused() {
    let refused = |change: fn(&mut Run)| {
        let mut bench = bench(&image(&[], SLEEP, &[]));
        change(&mut bench.run);
        bench.run.execute().unwrap_err().to_string()
    };
    let code = refused(|run| run.stimulus = vec![[0, 4096, 0, 0]]);
    assert!(code.starts_with("stimulus row 0 is [0, 4096, 0, 0]"), "{code}");
    let pin = refused(|run| {
        run.pin_inputs = vec![PinInput {
            pin: "PA16".into(),
            since: Since::FirstScan,
            changes_ns: vec![],
        }];
    });
    assert!(pin.starts_with("there is no pin \"PA16\""), "{pin}");
    let crystal = refused(|run| run.hse_ppm = 1000.0);
    assert!(crystal.contains("off by 1000 ppm"), "{crystal}");
    let block = refused(|run| run.flash = vec![(0x080f_ffff, vec![0; 2])]);
    assert!(block.contains("are outside 0x08000000..0x08100000"), "{block}");
}

const FLASH_REGISTERS: u32 = 0x4002_3c00;
/// The first word of sector 10.
const WRITABLE: u32 = 0x080c_0000;
const UNLOCK: [(u32, u32); 2] = [
    (FLASH_REGISTERS + 0x04, 0x4567_0123),
    (FLASH_REGISTERS + 0x04, 0xcdef_89ab),
];
/// CR: words; PG, or SER with STRT for sector 10.
const PROGRAM: (u32, u32) = (FLASH_REGISTERS + 0x10, 0b10 << 8 | 1);
const ERASE: (u32, u32) = (FLASH_REGISTERS + 0x10, 0b10 << 8 | 10 << 3 | 1 << 1 | 1 << 16);

/// Sends the first `bytes` of sector 10 over USART1 by DMA.
fn send(bytes: u32) -> [(u32, u32); 11] {
    [
        (RCC + 0x30, 1 << 22 | 1 << 1),
        (RCC + 0x44, 1 << 4 | 1 << 8),
        TRANSMITTER[0],
        TRANSMITTER[1],
        (USART1 + 0x08, 16),
        (USART1 + 0x0c, 1 << 13 | 1 << 3),
        (USART1 + 0x14, 1 << 7),
        (STREAM7 + 0x04, bytes),
        (STREAM7 + 0x08, USART1 + 0x04),
        (STREAM7 + 0x0c, WRITABLE),
        (STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1),
    ]
}

fn sector_10(outcome: &Outcome) -> &[u8] {
    assert_eq!((outcome.flash.0, outcome.flash.1.len()), (WRITABLE, 256 << 10));
    &outcome.flash.1[..128 << 10]
}

#[test]
fn what_the_image_programs_can_be_read_clears_bits_only_and_is_there_at_the_end() {
    let word = |s: &[u8; 4]| u32::from_le_bytes(*s);
    let mut main = UNLOCK.to_vec();
    main.extend([
        PROGRAM,
        (WRITABLE, word(b"flas")),
        (WRITABLE + 4, word(b"h\xff\xff\xff")),
        (WRITABLE + 4, word(b"\xffed!")),
    ]);
    main.extend(send(8));
    let mut bench = bench(&image(&main, SLEEP, &[]));
    let outcome = bench.run.execute().unwrap();
    assert_eq!(outcome.uart, b"flashed!");
    assert_eq!(noted(&outcome), [""; 0]);
    assert_eq!(sector_10(&outcome)[..9], *b"flashed!\xff");
    let [first, second, _] = outcome.flash_operations[..] else {
        panic!("three operations: {:?}", outcome.flash_operations)
    };
    // 16 us, and the five instructions of the loop from one store to the next.
    assert_eq!(second.at_ns - first.at_ns, 16_000 + 5 * 8);
    assert_eq!(
        first,
        FlashOperation {
            address: WRITABLE,
            bytes: 4,
            erase: false,
            ..first
        }
    );

    // The same flash again, under an image that only reads it.
    bench = self::bench(&image(&send(8), SLEEP, &[]));
    bench.run.flash = vec![outcome.flash];
    assert_eq!(bench.run.execute().unwrap().uart, b"flashed!");
}

#[test]
fn an_erase_takes_its_second_and_costs_the_emulator_next_to_nothing() {
    let mut main = UNLOCK.to_vec();
    main.push(ERASE);
    main.extend(send(4));
    let mut bench = bench(&image(&main, SLEEP, &[]));
    bench.run.flash = vec![(WRITABLE, vec![0; 256 << 10])];
    bench.run.sampling_deadline_ns = 1_001_000_000;
    bench.run.timeout = Duration::from_secs(20);
    let outcome = bench.run.execute().unwrap();
    assert_eq!(outcome.uart, [0xff; 4]);
    assert!(sector_10(&outcome).iter().all(|byte| *byte == 0xff));
    assert!(outcome.flash.1[128 << 10..].iter().all(|byte| *byte == 0));
    assert!(outcome.instructions.unwrap().total < 200);
}

#[test]
fn flash_outlives_a_reset_and_a_poke_does_not() {
    let mut main = send(4).to_vec();
    main.extend(UNLOCK);
    // Each start programs one bit less and resets: 0x7f, then what has been there stays.
    main.extend([PROGRAM, (WRITABLE, 0xffff_ff7f), RESET_REQUEST]);
    let mut bench = bench(&image(&main, SLEEP, &[]));
    bench.run.sampling_deadline_ns = 200_000;
    // QEMU loads a block anew at each reset, over what was programmed: it must not stay.
    bench.run.flash = vec![(WRITABLE, vec![0xff; 4])];
    bench.run.pokes = vec![Poke {
        at_ns: 100_000,
        address: WRITABLE + 8,
        bytes: vec![0; 4],
    }];
    let outcome = bench.run.execute().unwrap();
    assert!(outcome.resets.len() > 5, "{:?}", outcome.resets);
    // A start is shorter than the four bytes take on the line.
    let (first, others) = outcome.uart.split_first().unwrap();
    assert_eq!(*first, 0xff);
    assert!(others.iter().all(|byte| *byte == 0x7f), "{others:?}");
    assert_eq!(
        sector_10(&outcome)[..12],
        [0x7f, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255]
    );
}

#[test]
fn a_store_to_a_sector_of_the_image_or_without_pg_is_reported_and_changes_nothing() {
    let main = [
        UNLOCK[0],
        UNLOCK[1],
        (WRITABLE, 0),
        PROGRAM,
        (FLASH + 0x8_0000, 0),
    ];
    let outcome = bench(&image(&main, SLEEP, &[])).run.execute().unwrap();
    assert!(outcome.flash_operations.is_empty());
    assert_eq!(
        noted(&outcome),
        [
            "FLASH a sector before 10 was programmed: only 10 and 11 can be, the others read as protected",
            "FLASH a store to flash without CR.PG: nothing was programmed",
        ]
    );
}

/// Samples as [`acquiring`] does. Then it programs one word of sector 10 after the other.
fn logging() -> Vec<u8> {
    let mut main = UNLOCK.to_vec();
    main.extend([
        (RCC + 0x40, 1 << 1),
        (RCC + 0x44, 1 << 8),
        (ADC1 + 0x08, 0b01 << 28 | 0b1000 << 24 | 1),
        (TIM3 + 0x2c, 1599),
        (TIM3 + 0x04, 0b010 << 4),
        (TIM3, 1),
        PROGRAM,
    ]);
    main.extend((0..40).map(|n| (WRITABLE + 4 * n, 0)));
    image(&main, SLEEP, &[])
}

#[test]
fn a_power_cut_restarts_the_image_and_leaves_a_word_half_programmed_every_time_alike() {
    let cut = |percent| {
        let mut bench = bench(&logging());
        bench.run.stimulus = vec![[0; 4]; 20];
        bench.run.sample_period_ns = 100_000;
        bench.run.faults = vec![Fault::after_first_scan(
            0,
            FaultKind::PowerCutInFlash { after: 3, percent },
        )];
        bench.run.execute().unwrap()
    };
    let [a, b] = [(); 2].map(|()| cut(50));
    let causes: Vec<_> = a.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(causes, [ResetCause::PowerCut]);
    let [.., cut_short, next] = &a.flash_operations[..a.flash_operations.len() - 39] else {
        panic!("operations before and after the cut")
    };
    assert_eq!(next.address, WRITABLE, "from the start again");
    assert_eq!(a.resets[0].at_ns, cut_short.at_ns + 8_000);
    assert_eq!(
        (a.resets, a.flash_operations, a.instructions, a.virtual_ns),
        (b.resets, b.flash_operations, b.instructions, b.virtual_ns)
    );
}

#[test]
fn a_power_cut_at_a_time_loses_ram_and_a_reset_does_not() {
    // What stands in RAM is sent at once, and then replaced by a word that the next start will find.
    let mut main = send(4).to_vec();
    main[9].1 = SRAM + 0x400;
    main.extend([(SRAM + 0x400, 0x0403_0201), (RCC + 0x40, 1 << 1)]);
    main.extend([
        (ADC1 + 0x08, 0b01 << 28 | 0b1000 << 24 | 1),
        (TIM3 + 0x2c, 1599),
        (TIM3 + 0x04, 0b010 << 4),
        (TIM3, 1),
    ]);
    let sent_after = |faults: Vec<Fault>, watchdog: bool| {
        let mut main = main.clone();
        if watchdog {
            // Prescaler 4 and reload 3: 0.5 ms.
            main.extend([(0x4000_3000, 0x5555), (0x4000_3008, 3), (0x4000_3000, 0xcccc)]);
        }
        let mut bench = bench(&image(&main, SLEEP, &[]));
        bench.run.stimulus = vec![[0; 4]; 7];
        bench.run.sample_period_ns = 100_000;
        bench.run.tail_ns = 100_000;
        bench.run.faults = faults;
        let outcome = bench.run.execute().unwrap();
        assert_eq!(
            outcome.resets.len(),
            1,
            "{:?} {}",
            outcome.sampling,
            outcome.virtual_ns
        );
        outcome.uart[4..].to_vec()
    };
    let power_cut = Fault::after_first_scan(500_000, FaultKind::PowerCut);
    assert_eq!(sent_after(vec![], true), [1, 2, 3, 4]);
    let noise = sent_after(vec![power_cut], false);
    assert_eq!(noise.len(), 4);
    assert_ne!(noise, [1, 2, 3, 4]);
}

#[test]
fn edges_on_a_pin_wake_a_sleeping_image_that_captures_them_and_no_other() {
    const GPIOA: u32 = 0x4002_0000;
    const GPIOC: u32 = 0x4002_0800;
    const TIM2: u32 = 0x4000_0000;
    const NVIC_ISER0: u32 = 0xe000_e100;
    let outcome = |alternate_function: u32| {
        let main = [
            (RCC + 0x30, 1 | 1 << 2),
            (RCC + 0x40, 0b11),
            (RCC + 0x44, 1 << 8),
            (NVIC_ISER0, 1 << TIM2_LINE),
            (GPIOC, 1),
            (GPIOA + 0x24, alternate_function << 28),
            (GPIOA, 0xa800_0000),
            (TIM2 + 0x18, 0b01),
            (TIM2 + 0x20, 1),
            (TIM2 + 0x0c, 1 << 1),
            (TIM2, 1),
            (ADC1 + 0x08, 0b01 << 28 | 0b1000 << 24 | 1),
            (TIM3 + 0x2c, 1599),
            (TIM3 + 0x04, 0b010 << 4),
            (TIM3, 1),
        ];
        // PC0 up and down, and the flag cleared.
        let handler = [(GPIOC + 0x18, 1), (GPIOC + 0x18, 1 << 16), (TIM2 + 0x10, 0)];
        let mut bench = bench(&image(&main, SLEEP, &handler));
        bench.run.stimulus = vec![[0; 4]; 8];
        bench.run.sample_period_ns = 100_000;
        bench.run.pin_inputs = vec![PinInput {
            pin: "PA15".into(),
            since: Since::FirstScan,
            changes_ns: vec![50_000, 150_000, 250_000, 350_000, 450_000],
        }];
        bench.run.execute().unwrap()
    };
    let three_rises = outcome(1);
    assert_eq!(noted(&three_rises), [""; 0]);
    assert_eq!(
        three_rises.pins.iter().map(|pin| pin.edges).collect::<Vec<_>>(),
        [3 * 2]
    );
    assert!(outcome(2).pins.is_empty(), "AF2 of PA15 is no TIM2");
}

#[test]
fn a_crystal_that_is_off_makes_every_scan_earlier_and_each_has_its_row() {
    // Everything from the crystal of 8 MHz: half as fast as from the internal oscillator.
    let from_crystal = acquiring_after(&[(RCC, 1 << 16 | 0x83), (RCC + 0x08, 1)]);
    let [right, off] = [0.0, 900.0].map(|ppm| {
        let mut bench = bench(&from_crystal);
        bench.run.stimulus = (0..800).map(|i| [i, 4095 - i, 0, 0]).collect();
        bench.run.sample_period_ns = 200_000;
        bench.run.tail_ns = 2_000_000;
        bench.run.hse_ppm = ppm;
        bench.run.execute().unwrap()
    });
    let rows: Vec<u8> = (0..800u16)
        .flat_map(|i| [i, 4095 - i])
        .flat_map(u16::to_le_bytes)
        .collect();
    assert_eq!(right.uart[..rows.len()], rows);
    assert_eq!(off.uart[..rows.len()], rows);
    let sampled = |outcome: &Outcome| outcome.virtual_ns - outcome.sampling.unwrap().first_ns;
    // 160 ms of rows; the tail is in true time.
    assert_eq!(sampled(&right), 162_000_000);
    assert_eq!(sampled(&off) - 2_000_000, 160_000_000 * 1_000_000 / 1_000_900);
    assert_eq!(noted(&off), [""; 0]);
}

/// Everything from the crystal of 8 MHz, with the clock security system or not.
fn on_crystal(css: u32) -> [(u32, u32); 2] {
    [(RCC, css << 19 | 1 << 16 | 0x83), (RCC + 0x08, 1)]
}

#[test]
fn a_crystal_that_stops_is_an_nmi_with_css_and_without_it_only_the_watchdog_goes_on() {
    const NMI_VECTOR: u32 = 2;
    let outcome = |css: u32| {
        // The watchdog runs out after 1 ms. The NMI moves PC0 and clears CSSF.
        let mut main = on_crystal(css).to_vec();
        main.extend([(RCC + 0x30, 1 << 2), (0x4002_0800, 1)]);
        main.extend([(IWDG, 0x5555), (IWDG + 0x08, 7), (IWDG, 0xcccc)]);
        let handler = [(0x4002_0818, 1), (RCC + 0x0c, 1 << 23)];
        let mut bench = bench(&image(&main, BRANCH_TO_SELF, &handler));
        bench.run.pokes = vec![Poke {
            at_ns: 0,
            address: FLASH + 4 * NMI_VECTOR,
            bytes: (HANDLER_AT | 1).to_le_bytes().to_vec(),
        }];
        bench.run.faults = vec![Fault::after_power_up(500_000, FaultKind::CrystalStops)];
        bench.run.sampling_deadline_ns = 1_200_000;
        bench.run.execute().unwrap()
    };
    let safe = outcome(1);
    assert_eq!(safe.pins.iter().map(|pin| pin.edges).sum::<u64>(), 1);
    assert_eq!(noted(&safe), [""; 0]);
    let bare = outcome(0);
    assert_eq!(bare.pins, []);
    assert_eq!(noted(&bare).len(), 1, "{:?}", bare.unmodelled);
    for outcome in [&safe, &bare] {
        assert_eq!(outcome.resets.len(), 1);
        assert_eq!(outcome.resets[0].cause, ResetCause::Watchdog);
    }
    // 1.2 ms of `b .` but for the time between the crystal's end and the watchdog's, half a millisecond.
    let [safe, bare] = [safe, bare].map(|outcome| outcome.instructions.unwrap().total);
    assert!((149_900..=150_010).contains(&safe), "{safe}");
    assert!((safe - 64_000..safe - 62_000).contains(&bare), "{bare} of {safe}");
}

#[test]
fn the_shift_says_how_long_an_instruction_takes() {
    let total = |shift: Option<u8>| {
        let mut bench = bench(&image(&[], BRANCH_TO_SELF, &[]));
        bench.run.shift = shift;
        bench.run.execute().unwrap().instructions.unwrap().total
    };
    let [eight, sixteen, thirty_two] = [3, 4, 5].map(|shift| total(Some(shift)));
    assert_eq!(total(None), eight, "8 ns if nothing is said");
    assert!((125_000..125_100).contains(&eight), "{eight} in 1 ms");
    assert!(eight.abs_diff(2 * sixteen) < 100, "{sixteen}");
    assert!(eight.abs_diff(4 * thirty_two) < 100, "{thirty_two}");
    let mut bench = bench(&image(&[], SLEEP, &[]));
    bench.run.shift = Some(11);
    let refused = bench.run.execute().unwrap_err().to_string();
    assert!(refused.contains("\"11\"; give 0 to 10"), "{refused}");
}

#[test]
fn the_functions_of_an_image_are_found_by_a_part_of_their_name() {
    let bench = bench(&image(&[], SLEEP, &[]));
    let found = functions(&bench.run.elf, "andle").unwrap();
    let found: Vec<_> = found
        .iter()
        .map(|f| (f.name.as_str(), f.address, f.bytes))
        .collect();
    assert_eq!(found, [("handler", HANDLER_AT, 20)]);
    assert_eq!(functions(&bench.run.elf, "nothing").unwrap(), []);
}

const SYST_CSR: u32 = 0xe000_e010;
const SYST_RVR: u32 = 0xe000_e014;
const SYST_CVR: u32 = 0xe000_e018;
const SYSTICK_VECTOR: u32 = 15;
const GPIOC: u32 = 0x4002_0800;

/// PC0 to PC15 as outputs.
const OUTPUTS: [(u32, u32); 2] = [(RCC + 0x30, 1 << 22 | 0b111), (GPIOC, 0x5555_5555)];

/// A run in which an exception has the image's handler.
fn with_vector(bench: &mut ImageBench, vector: u32) {
    bench.run.pokes.push(Poke {
        at_ns: 0,
        address: FLASH + 4 * vector,
        bytes: (HANDLER_AT | 1).to_le_bytes().to_vec(),
    });
}

fn edges(outcome: &Outcome) -> u64 {
    outcome.pins.iter().map(|pin| pin.edges).sum()
}

#[test]
fn systick_follows_hclk_and_runs_from_a_reload_value_that_comes_late() {
    // PC0 up and down at each tick: 1000 ticks of 16 MHz, or of the crystal's 8 MHz, in 1 ms.
    let handler = [(GPIOC + 0x18, 1), (GPIOC + 0x18, 1 << 16)];
    let ticks = |first: Writes<'_>, start: [(u32, u32); 3]| {
        let main = [&OUTPUTS[..], first, &start].concat();
        let mut bench = bench(&image(&main, SLEEP, &handler));
        with_vector(&mut bench, SYSTICK_VECTOR);
        edges(&bench.run.execute().unwrap()) / 2
    };
    let usual = [(SYST_RVR, 999), (SYST_CVR, 0), (SYST_CSR, 0b111)];
    let reload_last = [(SYST_CSR, 0b111), (SYST_CVR, 0), (SYST_RVR, 999)];
    assert_eq!([usual, reload_last].map(|start| ticks(&[], start)), [15, 15]);
    assert_eq!(ticks(&on_crystal(0), usual), 7);
}

/// Runs live with a stop every `step_ns`; returns the sent bytes, the last time and the outcome.
fn live(run: &Run, step_ns: u64, until_ns: u64, mut rows: &[[u16; 4]]) -> (Uart, u64, Outcome) {
    let mut live = run.start().unwrap();
    let (mut sent, mut instructions) = (Uart::default(), 0);
    while live.now_ns() < until_ns {
        let to = (live.now_ns() + step_ns).min(until_ns);
        // Some more than are needed.
        let (next, rest) = rows.split_at(rows.len().min(2 + (step_ns / run.sample_period_ns) as usize));
        rows = rest;
        let inputs = Inputs {
            codes: next.to_vec(),
            ..Inputs::default()
        };
        let passed = live.advance(to, inputs).unwrap();
        assert!((to..to + 8).contains(&passed.now_ns), "{to} {}", passed.now_ns);
        instructions += passed.work.instructions;
        for uart in passed.uarts {
            sent.bytes.extend(uart.bytes);
            sent.ns.extend(uart.ns);
        }
    }
    (sent, instructions, live.finish().unwrap())
}

#[test]
fn a_live_run_gives_the_same_bytes_times_and_counts_wherever_it_stops() {
    let mut bench = bench(&acquiring());
    bench.run.stimulus = (0..80).map(|i| [i, 4095 - i, 0, 0]).collect();
    bench.run.sample_period_ns = 100_000;
    bench.run.tail_ns = 700_000;
    let whole = bench.run.execute().unwrap();
    assert_eq!(whole.uart.len(), 320);
    let rows = std::mem::take(&mut bench.run.stimulus);
    for step_ns in [33_333, 1_000_000, 1_000_000_000] {
        let (sent, instructions, outcome) = live(&bench.run, step_ns, whole.virtual_ns, &rows);
        assert_eq!(
            (&sent.bytes, &sent.ns),
            (&whole.uart, &whole.uart_ns),
            "{step_ns}"
        );
        assert_eq!(
            Some(instructions),
            whole.instructions.as_ref().map(|all| all.total)
        );
        assert_eq!(outcome.instructions, whole.instructions);
        assert_eq!((outcome.sampling, outcome.end), (whole.sampling, RunEnd::Over));
        assert!(outcome.uart.is_empty(), "what was handed over is kept nowhere");
    }
}

#[test]
fn what_comes_too_late_for_a_live_run_is_refused_and_no_time_passes() {
    let bench = bench(&acquiring());
    let mut live = bench.run.start().unwrap();
    let now_ns = live.advance(500_000, Inputs::default()).unwrap().now_ns;
    let byte = Inputs {
        uart: vec![UartInput::usart1(now_ns - 1, [1])],
        ..Inputs::default()
    };
    let edge = Inputs {
        levels: vec![Level {
            pin: "PA15".into(),
            at_ns: 3,
            high: true,
        }],
        ..Inputs::default()
    };
    let row = Inputs {
        codes: vec![[0; 4]],
        ..Inputs::default()
    };
    for (to_ns, inputs, what) in [
        (600_000, byte, "a byte for USART1 is to come at 49"),
        (
            600_000,
            edge,
            "an edge on PA15 is to come at 3 ns, and the image is at 50",
        ),
        (600_000, row, "the next row of codes is to come"),
        (400_000, Inputs::default(), "time does not go back to 400000 ns"),
    ] {
        let refused = live.advance(to_ns, inputs).unwrap_err().to_string();
        assert!(refused.contains(what), "{refused}");
        assert_eq!(live.now_ns(), now_ns);
    }
    assert_eq!(live.finish().unwrap().virtual_ns, now_ns);
}

#[test]
fn a_live_image_that_ends_the_run_says_how_and_one_that_hangs_is_stopped() {
    let ends = bench(&image(&[], 0xbe01, &[]));
    let mut live = ends.run.start().unwrap();
    assert!(live.advance(1_000_000, Inputs::default()).unwrap().ended);
    assert!(live.advance(2_000_000, Inputs::default()).unwrap().ended);
    assert!(matches!(live.finish().unwrap().end, RunEnd::LockedUp(_)));

    let mut hangs = bench(&image(&[], BRANCH_TO_SELF, &[]));
    hangs.run.timeout = Duration::from_millis(300);
    let mut live = hangs.run.start().unwrap();
    let stopped = live.advance(1_000_000_000_000, Inputs::default()).unwrap_err();
    assert!(matches!(stopped, RunError::Timeout(..)), "{stopped}");
    assert!(live.finish().is_err());
}
