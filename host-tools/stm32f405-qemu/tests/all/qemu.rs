//! Images of a few instructions in real QEMU. The overlay fits QEMU, and each way to fail has its own error.
//!
//! The images are made here. Each is a loop that copies values from a table into registers and then sleeps,
//! and a handler that does the same. So every test shows everything that its image does.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use stm32f405_qemu::{
    Fault, FaultKind, Inputs, Level, Outcome, Poke, ResetCause, Run, RunEnd, RunError, Uart, UartInput,
    functions,
};

use super::machine::bench::{
    ADC1, ADON_DMA_BY_TIM3, DMA2, FLASH as FLASH_REGISTERS, GPIOB, GPIOC, IWDG, RCC, SRAM, STREAM0, TIM3,
    USART1, stream,
};
use super::{emulator, said};

const FLASH: u32 = 0x0800_0000;
/// The first word of sector 10.
const SECTOR_10: u32 = 0x080c_0000;
const VECTORS: usize = 16 + 82;
const RESET_AT: u32 = FLASH + 4 * VECTORS as u32;
const HANDLER_AT: u32 = RESET_AT + 20;
const TABLES_AT: u32 = HANDLER_AT + 20;

const STREAM7: u32 = stream(DMA2, 7);
const NVIC_ISER1: u32 = 0xe000_e104;
const DMA2_STREAM0: usize = 56;

/// AIRCR: the key, and SYSRESETREQ.
const RESET_REQUEST: (u32, u32) = (0xe000_ed0c, 0x05fa_0004);
/// The watchdog after 1 ms: prescaler 4 and reload 7 of the 32 kHz clock.
const WATCHDOG: [(u32, u32); 3] = [(IWDG, 0x5555), (IWDG + 0x08, 7), (IWDG, 0xcccc)];
/// TIM3 at 10 kHz of 16 MHz, with its update as TRGO.
const TRIGGERS: [(u32, u32); 3] = [(TIM3 + 0x2c, 1599), (TIM3 + 0x04, 0b010 << 4), (TIM3, 1)];
/// Clocks of TIM3 and ADC1, which waits for TIM3.
const CONVERTER: [(u32, u32); 3] = [
    (RCC + 0x40, 1 << 1),
    (RCC + 0x44, 1 << 8),
    (ADC1 + 0x08, 0b01 << 28 | 0b1000 << 24 | 1),
];
/// USART1 at 1 Mbit/s by DMA, with PB6 as its transmitter (AF7).
const TRANSMITTER: [(u32, u32); 7] = [
    (RCC + 0x30, 1 << 22 | 1 << 1),
    (RCC + 0x44, 1 << 4 | 1 << 8),
    (GPIOB, 0x0280 | 0b10 << 12),
    (GPIOB + 0x20, 7 << 24),
    (USART1 + 0x08, 16),
    (USART1 + 0x0c, 1 << 13 | 1 << 3),
    (USART1 + 0x14, 1 << 7),
];
const UNLOCK: [(u32, u32); 2] = [
    (FLASH_REGISTERS + 0x04, 0x4567_0123),
    (FLASH_REGISTERS + 0x04, 0xcdef_89ab),
];
/// CR: words, and PG.
const PROGRAM: (u32, u32) = (FLASH_REGISTERS + 0x10, 0b10 << 8 | 1);

type Writes<'a> = &'a [(u32, u32)];

/// Sends bytes over USART1.
const fn send(from: u32, bytes: u32) -> [(u32, u32); 4] {
    [
        (STREAM7 + 0x04, bytes),
        (STREAM7 + 0x08, USART1 + 0x04),
        (STREAM7 + 0x0c, from),
        (STREAM7, 4 << 25 | 1 << 10 | 1 << 6 | 1),
    ]
}

/// Instruction at the end of the loop's table.
const SLEEP: u16 = 0xbf30;
const RETURN: u16 = 0x4770;
const BRANCH_TO_SELF: u16 = 0xe7fe;

/// The table of vectors: a stack, and a start address behind the table.
pub(super) fn vectors() -> [u32; VECTORS] {
    let mut vectors = [0; VECTORS];
    (vectors[0], vectors[1]) = (SRAM + 0x1_0000, RESET_AT | 1);
    vectors
}

/// An image that makes the writes of `main` and then executes `then`. The handler of DMA2 stream 0 makes the
/// writes of `handler`.
fn image(main: Writes<'_>, then: u16, handler: Writes<'_>) -> Vec<u8> {
    let handler_table = TABLES_AT + 8 * (main.len() as u32 + 1);
    let mut vectors = vectors();
    vectors[16 + DMA2_STREAM0] = HANDLER_AT | 1;

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
    elf(&code, &[("handler", HANDLER_AT | 1, 20, 2)])
}

/// An ELF with one segment in flash and a symbol table: name, address, size, type.
pub(super) fn elf(code: &[u8], symbols: &[(&str, u32, u32, u8)]) -> Vec<u8> {
    elf_at(FLASH, code, symbols)
}

/// Upper bound of the delay of QEMU's calls of the overlay at 16 MHz. They come at whole ns of QEMU's clock,
/// each of which is 63/8 ns of the overlay's.
pub(super) const WAKES_WITHIN_NS: u64 = 8;

/// An ELF with one segment at an address.
fn elf_at(start: u32, code: &[u8], symbols: &[(&str, u32, u32, u8)]) -> Vec<u8> {
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
    file.extend(words(&[1, code_at, start, start, size, size, 5, 4]));
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

fn result(image: &[u8], change: impl FnOnce(&mut Run)) -> Result<Outcome, RunError> {
    let mut bench = bench(image);
    change(&mut bench.run);
    bench.run.execute()
}

pub(super) fn outcome(image: &[u8], change: impl FnOnce(&mut Run)) -> Outcome {
    result(image, change).unwrap()
}

/// Returns the error of a run of an image that does nothing.
fn error(change: impl FnOnce(&mut Run)) -> RunError {
    result(&image(&[], SLEEP, &[]), change).unwrap_err()
}

/// Scans of both channels at 10 kHz into a ring of 8, each full ring sent over USART1 at 1 Mbit/s; all at 16
/// MHz, after some other writes.
fn acquiring(first: Writes<'_>) -> Vec<u8> {
    let main = [
        (NVIC_ISER1, 1 << (DMA2_STREAM0 - 32)),
        (STREAM0 + 0x04, 16),
        (STREAM0 + 0x08, ADC1 + 0x4c),
        (STREAM0 + 0x0c, SRAM),
        (STREAM0, 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 1 << 4 | 1),
        (ADC1 + 0x04, 1 << 8),
        (ADC1 + 0x2c, 1 << 20),
        (ADC1 + 0x34, 1 << 5),
        (RCC + 0x40, 1 << 1),
        (ADC1 + 0x08, ADON_DMA_BY_TIM3 & !(1 << 10)),
    ];
    let main = [first, &TRANSMITTER, &main, &TRIGGERS].concat();
    let clear = [(DMA2 + 0x08, 0x3f), (DMA2 + 0x0c, 0x3f << 22)];
    image(&main, SLEEP, &[&clear[..], &send(SRAM, 32)].concat())
}

fn run_acquiring(change: impl FnOnce(&mut Run)) -> Outcome {
    outcome(&acquiring(&[]), |run| {
        run.stimulus = (0..80).map(|i| [i, 4095 - i, 0, 0]).collect();
        run.sample_period_ns = 100_000;
        run.tail_ns = 700_000;
        change(run);
    })
}

/// The bytes of rows as [`acquiring`] sends them.
fn bytes_of_rows(rows: u16) -> Vec<u8> {
    let codes = (0..rows).flat_map(|i| [i, 4095 - i]);
    codes.flat_map(u16::to_le_bytes).collect()
}

/// Notes of the run, without the note on the core: at 16 MHz an instruction takes longer than 8 ns.
fn noted(outcome: &Outcome) -> Vec<&str> {
    let noted = outcome.unmodelled.iter().map(String::as_str);
    noted
        .filter(|what| !what.starts_with("processor an instruction"))
        .collect()
}

#[test]
fn every_row_of_the_stimulus_comes_out_of_the_uart_in_order() {
    let outcome = run_acquiring(|_| {});
    assert_eq!(outcome.uart, bytes_of_rows(80));
    // A full ring is sent back to back: at 1 Mbit/s a byte takes 10 us.
    let mut apart = outcome.uart_ns[..32].windows(2).map(|pair| pair[1] - pair[0]);
    assert!(apart.all(|ns| ns == 10_000));
    assert_eq!(outcome.uart_ns.len(), outcome.uart.len());
    // 8 ms of rows and 0.7 ms of tail, both ends included.
    assert_eq!(outcome.sampling.unwrap().scans, 88);
    assert_eq!((outcome.overruns, outcome.triggers_ignored), (0, 0));
    assert_eq!(outcome.resets, []);
    assert_eq!(outcome.unknown_registers, []);
    assert_eq!(noted(&outcome), [""; 0]);
    assert_eq!(run_acquiring(|_| {}), outcome);
}

#[test]
fn instructions_are_counted_by_function_and_by_block() {
    let counted = |function: &str, pattern: &str, work: &str| {
        let outcome = run_acquiring(|run| {
            let functions = [(function, pattern), ("none", "no_such")];
            run.functions = functions.map(|(label, part)| (label.into(), part.into())).into();
            run.work = vec![work.into()];
        });
        outcome.instructions.unwrap()
    };
    let instructions = counted("block", "handler", "block");
    // A load, six turns of five, the last of three, and the return.
    let one_handler = 1 + 6 * 5 + 3 + 1;
    let counts = instructions
        .functions
        .iter()
        .map(|f| (f.calls, f.instructions, f.symbols));
    let counts: Vec<_> = counts.collect();
    assert_eq!(counts, [(10, 10 * one_handler, 1), (0, 0, 0)]);
    // From one full ring to the next: the stream does not interrupt at the half. The block contains the
    // handler, and the branch and the WFI of the loop to which it returns.
    let worst = instructions.worst_block.unwrap();
    assert_eq!((worst.scans, worst.instructions), (8, one_handler + 2));
    // Every block contains the handler, and the last handler is in no block.
    let working = instructions.working.unwrap();
    assert_eq!(working.scans, 9 * 8);
    assert_eq!(working.instructions, 9 * (one_handler + 2));
    assert_eq!(instructions.idle, None);
    // For an image without such a function every block is idle.
    assert_eq!(counted("other", "no_such", "none").idle, instructions.working);
    let uncounted = run_acquiring(|run| run.count_instructions = false);
    assert_eq!(uncounted.instructions, None);
}

#[test]
fn an_image_that_never_samples_ends_at_the_deadline_and_says_so() {
    let outcome = outcome(&image(&[], SLEEP, &[]), |_| {});
    assert_eq!(outcome.sampling, None);
    assert!((1_000_000..1_000_000 + WAKES_WITHIN_NS).contains(&outcome.virtual_ns));
}

#[test]
fn a_firmware_that_resets_itself_is_counted_at_the_same_times_in_every_run() {
    let image = image(&[RESET_REQUEST], SLEEP, &[]);
    let [a, b] = [(); 2].map(|()| outcome(&image, |run| run.sampling_deadline_ns = 16_000));
    assert!(a.resets.len() > 20, "{:?}", a.resets);
    assert!(a.resets.iter().all(|r| r.cause == ResetCause::Software));
    assert_eq!(a, b);
}

#[test]
fn a_fault_handler_that_is_a_loop_takes_no_longer_than_other_code_and_the_watchdog_ends_it() {
    // 800 periods of 125 us, and then a store outside memory.
    let mut main = WATCHDOG.to_vec();
    main[1].1 = 799;
    main.push((0xa000_0000, 0));
    let mut image = image(&main, BRANCH_TO_SELF, &[]);
    // The vector of HardFault, in the segment: the instruction after the loop over the table.
    let hard_fault = 52 + 32 + 4 * 3;
    image[hard_fault..hard_fault + 4].copy_from_slice(&((RESET_AT + 12) | 1).to_le_bytes());
    let outcome = outcome(&image, |run| {
        run.sampling_deadline_ns = 150_000_000;
        // The run takes a tenth of a second. Reading the registers at each of 19 million turns would take a
        // minute.
        run.timeout = Duration::from_secs(20);
    });
    let resets: Vec<_> = outcome.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(resets, [ResetCause::Watchdog]);
    assert_eq!(outcome.exceptions.len(), 2);
}

#[test]
fn a_qemu_that_its_debugger_ends_is_no_timeout_and_what_it_said_is_passed_on() {
    let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = free.local_addr().unwrap().port();
    let taken = error(|run| run.gdb = Some(port));
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
    let ended = error(|run| run.gdb = Some(port));
    debugger.join().unwrap();
    let said = matches!(&ended, RunError::QemuEnded(how, _) if how.contains("GDBstub"));
    assert!(said, "{ended}");
}

#[test]
fn images_qemus_and_overlays_that_are_missing_and_files_that_are_none_are_told_apart() {
    let missing = Run::new("/no/such/image").execute().unwrap_err();
    assert!(matches!(missing, RunError::ImageMissing { .. }), "{missing}");
    let foreign = Run::new(std::env::current_exe().unwrap()).execute().unwrap_err();
    assert!(matches!(foreign, RunError::NotArmElf { .. }), "{foreign}");
    let empty = result(&elf(&[], &[]), |_| {}).unwrap_err();
    assert!(matches!(empty, RunError::NotArmElf { .. }), "{empty}");
    let functions = vec![("a".into(), "b".into())];
    let stripped = result(&elf(&[0; 8], &[]), |run| run.functions = functions).unwrap_err();
    assert!(matches!(stripped, RunError::NoSymbols { .. }), "{stripped}");

    let missing = error(|run| run.qemu = Some("/no/such/qemu".into()));
    assert!(matches!(missing, RunError::QemuMissing { .. }), "{missing}");
    let other = error(|run| run.qemu = Some("true".into()));
    assert!(matches!(other, RunError::QemuVersion { .. }), "{other}");
    let unusable =
        |error: &RunError, part: &str| matches!(error, RunError::QemuUnusable(_, why) if why.contains(part));
    let folder = error(|run| run.qemu = Some(std::env::temp_dir()));
    assert!(unusable(&folder, "denied"), "{folder}");
    let old = error(|run| run.qemu = Some(script(run, "echo QEMU emulator version 6.2.0")));
    assert!(unusable(&old, "6.2.0"), "{old}");

    let missing = error(|run| run.overlay = Some("/no/such/overlay.so".into()));
    assert!(matches!(missing, RunError::OverlayMissing { .. }), "{missing}");
    let other = error(|run| run.overlay = Some(run.elf.clone()));
    assert!(matches!(other, RunError::OverlayOdd { .. }), "{other}");
}

/// A shell script in place of QEMU. Another process writes it: a file cannot be executed while this process,
/// or a child that it just forked, has it open for writing.
fn script(run: &Run, text: &str) -> PathBuf {
    let path = run.elf.with_file_name("qemu.sh");
    let write = "printf '#!/bin/sh\\n%s\\n' \"$1\" > \"$0\" && chmod +x \"$0\"";
    let mut shell = Command::new("sh");
    let status = shell.args(["-c", write]).arg(&path).arg(text).status();
    assert!(status.unwrap().success());
    path
}

/// A script that prints a version, and otherwise executes `otherwise`.
fn qemu_of(run: &Run, version: &str, otherwise: &str) -> PathBuf {
    let said = format!("[ \"$1\" = --version ] && echo 'QEMU emulator version {version}' && exit");
    script(run, &format!("{said}\n{otherwise}"))
}

#[test]
fn a_qemu_of_unknown_version_is_asked_again_with_the_plugin_version_that_it_names() {
    let real = std::env::var("STM32F405_QEMU").unwrap_or_else(|_| "qemu-system-arm".into());
    let newer = |run: &Run| qemu_of(run, "99.0.0", &format!("exec {real} \"$@\""));
    let outcome = run_acquiring(|run| run.qemu = Some(newer(run)));
    assert!(outcome.sampling.is_some());
}

#[test]
fn what_a_qemu_that_fails_says_is_passed_on() {
    let error = |said: &str, status: i32| {
        let otherwise = format!("echo '{said}' >&2; exit {status}");
        error(|run| run.qemu = Some(qemu_of(run, "7.2.0", &otherwise)))
    };
    let odd = error("no such machine", 1);
    assert!(matches!(&odd, RunError::Qemu(_, line) if line == "no such machine"));
    let misfit = error("stm32f405-qemu: FLASH_ACR is odd", 86);
    assert!(matches!(&misfit, RunError::SelfTest(line) if line == "FLASH_ACR is odd"));
    let refused = error("stm32f405-qemu: this QEMU does not export timer_mod", 1);
    assert!(matches!(refused, RunError::OverlayRefused { .. }), "{refused}");
}

#[test]
fn codes_beyond_the_adc_and_blocks_beyond_flash_are_refused() {
    let refused = |change: fn(&mut Run)| error(change).to_string();
    let code = refused(|run| run.stimulus = vec![[0, 4096, 0, 0]]);
    assert!(code.starts_with("stimulus row 0 is [0, 4096, 0, 0]"), "{code}");
    let pin = refused(|run| run.wires = vec![("PA0".into(), "PA16".into())]);
    assert!(pin.starts_with("there is no pin \"PA16\""), "{pin}");
    let crystal = refused(|run| run.hse_ppm = 1000.0);
    assert!(crystal.contains("off by 1000 ppm"), "{crystal}");
    let block = refused(|run| run.flash = vec![(0x080f_ffff, vec![0; 2])]);
    assert!(block.contains("are outside 0x08000000..0x08100000"), "{block}");
    let shift = refused(|run| run.shift = Some(11));
    assert!(shift.contains("\"11\"; give 0 to 10"), "{shift}");
}

fn sector_10(outcome: &Outcome) -> &[u8] {
    let (start, bytes) = &outcome.flash;
    assert_eq!((*start, bytes.len()), (0x0800_8000, 992 << 10));
    &bytes[(SECTOR_10 - start) as usize..][..128 << 10]
}

#[test]
fn what_the_image_programs_can_be_read_clears_bits_only_and_is_there_at_the_end() {
    let words = [(0, b"flas"), (4, b"h\xff\xff\xff"), (4, b"\xffed!")];
    let words = words.map(|(at, word)| (SECTOR_10 + at, u32::from_le_bytes(*word)));
    let sending = [&TRANSMITTER[..], &send(SECTOR_10, 8)].concat();
    let main = [&UNLOCK[..], &[PROGRAM], &words, &sending].concat();
    let programmed = outcome(&image(&main, SLEEP, &[]), |_| {});
    assert_eq!(programmed.uart, b"flashed!");
    assert_eq!(noted(&programmed), [""; 0]);
    assert_eq!(sector_10(&programmed)[..9], *b"flashed!\xff");
    let operations = &programmed.flash_operations;
    assert_eq!(operations.len(), 3);
    let [first, second] = [0, 1].map(|n| operations[n]);
    // 16 us, besides the five instructions of the loop from one store to the next.
    let between_ns = second.at_ns - first.at_ns - 5 * 63;
    assert!(
        (16_000..16_000 + WAKES_WITHIN_NS).contains(&between_ns),
        "{between_ns}"
    );
    assert_eq!((first.address, first.bytes, first.erase), (SECTOR_10, 4, false));
    // The same flash, with an image that only reads it.
    let read = outcome(&image(&sending, SLEEP, &[]), |run| {
        run.flash = vec![(SECTOR_10, sector_10(&programmed).to_vec())];
    });
    assert_eq!(read.uart, b"flashed!");
}

#[test]
fn flash_outlives_a_reset_and_a_poke_does_not() {
    // Each start clears one bit and resets: 0x7f, which later starts leave as it is.
    let programming = [PROGRAM, (SECTOR_10, 0xffff_ff7f), RESET_REQUEST];
    let main = [&TRANSMITTER[..], &send(SECTOR_10, 4), &UNLOCK, &programming].concat();
    let outcome = outcome(&image(&main, SLEEP, &[]), |run| {
        run.sampling_deadline_ns = 200_000;
        // QEMU loads a block anew at each reset, over the programmed contents: the block must not stay.
        run.flash = vec![(SECTOR_10, vec![0xff; 4])];
        run.pokes = vec![Poke::word(100_000, SECTOR_10 + 8, 0)];
    });
    assert!(outcome.resets.len() > 5, "{:?}", outcome.resets);
    // A start takes less time than the four bytes on the line.
    let (first, others) = outcome.uart.split_first().unwrap();
    assert_eq!(*first, 0xff);
    assert!(others.iter().all(|byte| *byte == 0x7f), "{others:?}");
    let (first, others) = sector_10(&outcome).split_first().unwrap();
    assert!(*first == 0x7f && others.iter().all(|byte| *byte == 0xff));
}

/// Rows of zeros every 100 us.
fn zeros(run: &mut Run, rows: usize) {
    run.stimulus = vec![[0; 4]; rows];
    run.sample_period_ns = 100_000;
}

#[test]
fn a_power_cut_restarts_the_image_and_leaves_a_word_half_programmed_every_time_alike() {
    // The image samples, and programs the words of sector 10 in order.
    let words: Vec<_> = (0..40).map(|n| (SECTOR_10 + 4 * n, 0)).collect();
    let main = [&UNLOCK[..], &CONVERTER, &TRIGGERS, &[PROGRAM], &words].concat();
    let (after, percent) = (3, 50);
    let cut = FaultKind::PowerCutInFlash { after, percent };
    let [a, b] = [(); 2].map(|()| {
        outcome(&image(&main, SLEEP, &[]), |run| {
            zeros(run, 20);
            run.faults = vec![Fault::after_first_scan(0, cut)];
        })
    });
    assert_eq!(a.resets.len(), 1);
    let reset = a.resets[0];
    let next = a.flash_operations.len() - 40;
    let (cut_short, next) = (a.flash_operations[next - 1], a.flash_operations[next]);
    assert_eq!(next.address, SECTOR_10, "from the start again");
    assert_eq!(reset.cause, ResetCause::PowerCut);
    let after_ns = reset.at_ns - cut_short.at_ns;
    assert!((8_000..8_000 + WAKES_WITHIN_NS).contains(&after_ns), "{after_ns}");
    assert_eq!(a, b);
}

#[test]
fn a_power_cut_at_a_time_loses_ram_and_a_reset_does_not() {
    const WORD: u32 = SRAM + 0x400;
    // The word in RAM is sent at once, and then replaced by a value for the next start.
    let sent_after = |faults: Vec<Fault>, watchdog: Writes<'_>| {
        let sending = [&TRANSMITTER[..], &send(WORD, 4), &[(WORD, 0x0403_0201)]].concat();
        let converting = [&CONVERTER[..1], &CONVERTER[2..], &TRIGGERS].concat();
        let main = [sending, converting, watchdog.to_vec()].concat();
        let outcome = outcome(&image(&main, SLEEP, &[]), |run| {
            zeros(run, 7);
            run.faults = faults;
        });
        assert_eq!(outcome.resets.len(), 1);
        outcome.uart[4..].to_vec()
    };
    let power_cut = Fault::after_first_scan(500_000, FaultKind::PowerCut);
    // Prescaler 4 and reload 3: 0.5 ms.
    let watchdog = [WATCHDOG[0], (IWDG + 0x08, 3), WATCHDOG[2]];
    assert_eq!(sent_after(vec![], &watchdog), [1, 2, 3, 4]);
    let noise = sent_after(vec![power_cut], &[]);
    assert!(noise.len() == 4 && noise != [1, 2, 3, 4], "{noise:?}");
}

/// Everything from the crystal of 8 MHz, with the clock security system or not.
fn on_crystal(css: u32) -> [(u32, u32); 2] {
    [(RCC, css << 19 | 1 << 16 | 0x83), (RCC + 0x08, 1)]
}

#[test]
fn a_crystal_that_is_off_makes_every_scan_earlier_and_each_has_its_row() {
    // The clock is half that of the internal oscillator.
    let image = acquiring(&on_crystal(0));
    let [right, off] = [0.0, 900.0].map(|ppm| {
        outcome(&image, |run| {
            run.stimulus = (0..800).map(|i| [i, 4095 - i, 0, 0]).collect();
            run.sample_period_ns = 200_000;
            run.tail_ns = 2_000_000;
            run.hse_ppm = ppm;
        })
    });
    let rows = bytes_of_rows(800);
    assert!(right.uart.starts_with(&rows) && off.uart.starts_with(&rows));
    let sampled = |outcome: &Outcome| outcome.virtual_ns - outcome.sampling.unwrap().first_ns;
    // 160 ms of rows; the tail is in true time, and ends with an instruction.
    let ends = |outcome, ns: u64| (ns..ns + 2 * WAKES_WITHIN_NS).contains(&sampled(outcome));
    assert!(ends(&right, 162_000_000));
    assert!(ends(&off, 2_000_000 + 160_000_000 * 1_000_000 / 1_000_900));
    assert_eq!(noted(&off), [""; 0]);
}

/// A poke that makes the image's handler that of an exception.
fn vector(number: u32) -> Poke {
    Poke::word(0, FLASH + 4 * number, HANDLER_AT | 1)
}

fn edges(outcome: &Outcome) -> u64 {
    outcome.pins.iter().map(|pin| pin.edges).sum()
}

/// PC0 to PC15 as outputs.
const OUTPUTS: [(u32, u32); 2] = [(RCC + 0x30, 1 << 22 | 0b111), (GPIOC, 0x5555_5555)];

#[test]
fn a_crystal_that_stops_is_an_nmi_with_css_and_without_it_only_the_watchdog_goes_on() {
    const NMI_VECTOR: u32 = 2;
    let [safe, bare] = [1, 0].map(|css| {
        // The NMI moves PC0 and clears CSSF.
        let main = [&on_crystal(css)[..], &OUTPUTS, &WATCHDOG].concat();
        let handler = [(GPIOC + 0x18, 1), (RCC + 0x0c, 1 << 23)];
        let outcome = outcome(&image(&main, BRANCH_TO_SELF, &handler), |run| {
            run.pokes = vec![vector(NMI_VECTOR)];
            run.faults = vec![Fault::after_power_up(500_000, FaultKind::CrystalStops)];
            run.sampling_deadline_ns = 1_200_000;
        });
        let resets: Vec<_> = outcome.resets.iter().map(|reset| reset.cause).collect();
        assert_eq!(resets, [ResetCause::Watchdog]);
        assert!(outcome.crystal_started, "before the reset");
        outcome
    });
    // By the NMI, and by the reset.
    assert_eq!((edges(&safe), noted(&safe).len()), (2, 0));
    assert_eq!((edges(&bare), noted(&bare).len()), (0, 1));
    // `b .` of 125 ns for 0.5 ms, and of 63 ns for 0.7 ms. Without CSS the core stands still from the
    // crystal's stop to the watchdog's reset, half a millisecond.
    let [safe, bare] = [safe, bare].map(|outcome| outcome.instructions.unwrap().total);
    assert!((15_050..=15_150).contains(&safe), "{safe}");
    assert!((safe - 8_000..safe - 7_750).contains(&bare), "{bare} of {safe}");
}

#[test]
fn of_a_crystal_that_nobody_named_the_program_says_what_it_was_taken_for() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("clock.toml");
    std::fs::write(&scenario, "[clock]\ncrystal_hz = 12_000_000\n").unwrap();
    let says = |main: &[(u32, u32)], scenario: Option<&Path>| {
        let bench = bench(&image(main, BRANCH_TO_SELF, &[]));
        let mut program = emulator();
        program.args(["--for", "1ms"]);
        program.args(scenario.iter().flat_map(|path| [Path::new("--scenario"), path]));
        said(&program.arg(&bench.run.elf).output().unwrap()).contains("8 MHz")
    };
    assert!(says(&on_crystal(0), None));
    assert!(!says(&on_crystal(0), Some(&scenario)) && !says(&[], None));
}

#[test]
fn an_instruction_takes_the_time_of_the_shift_and_a_cycle_at_least() {
    /// 168 MHz from the internal oscillator: M = 16, N = 336, P = 2.
    const FULL_SPEED: [(u32, u32); 3] = [
        (RCC + 0x04, 336 << 6 | 16),
        (RCC, 1 << 24 | 0x83),
        (RCC + 0x08, 0b100 << 13 | 0b101 << 10 | 2),
    ];
    let took = |clock: &[(u32, u32)], shift| {
        let outcome = outcome(&image(clock, BRANCH_TO_SELF, &[]), |run| run.shift = shift);
        let total = outcome.instructions.unwrap().total;
        let ns = outcome.virtual_ns / total;
        assert!(ns.abs_diff(outcome.instruction_ns.into()) <= 1, "{ns}");
        outcome.instruction_ns
    };
    let half = [(RCC + 0x08, 0b1000 << 4)];
    assert_eq!(
        [&FULL_SPEED[..], &[], &half].map(|clock| took(clock, None)),
        [8, 63, 125]
    );
    assert_eq!(
        [2, 4, 7].map(|shift| took(&FULL_SPEED, Some(shift))),
        [6, 16, 128]
    );
    assert_eq!([6, 7].map(|shift| took(&[], Some(shift))), [64, 128]);
}

#[test]
fn the_functions_of_an_image_are_found_by_a_part_of_their_name() {
    let bench = bench(&image(&[], SLEEP, &[]));
    let found = functions(&bench.run.elf, "andle").unwrap();
    assert_eq!(found.len(), 1);
    let function = &found[0];
    assert_eq!((function.address, function.bytes), (HANDLER_AT, 20));
    assert_eq!(function.name, "handler");
    assert_eq!(functions(&bench.run.elf, "nothing").unwrap(), []);
}

#[test]
fn systick_follows_hclk_and_runs_from_a_reload_value_that_comes_late() {
    const SYST: u32 = 0xe000_e010;
    const SYSTICK_VECTOR: u32 = 15;
    // PC0 up and down at each tick: 1000 ticks of 16 MHz, or of the crystal's 8 MHz, in 1 ms.
    let handler = [(GPIOC + 0x18, 1), (GPIOC + 0x18, 1 << 16)];
    let ticks = |first: Writes<'_>, start: [(u32, u32); 3]| {
        let start = start.map(|(offset, value)| (SYST + offset, value));
        let main = [&OUTPUTS[..], first, &start].concat();
        let outcome = outcome(&image(&main, SLEEP, &handler), |run| {
            run.pokes = vec![vector(SYSTICK_VECTOR)]
        });
        edges(&outcome) / 2
    };
    let usual = [(4, 999), (8, 0), (0, 0b111)];
    let reload_last = [(0, 0b111), (8, 0), (4, 999)];
    assert_eq!([usual, reload_last].map(|start| ticks(&[], start)), [15, 15]);
    assert_eq!(ticks(&on_crystal(0), usual), 7);
}

/// Runs live with a stop every `step_ns`; returns the sent bytes, the last time and the outcome.
fn live(run: &Run, step_ns: u64, until_ns: u64, mut rows: &[[u16; 4]]) -> (Uart, u64, Outcome) {
    let mut live = run.start().unwrap();
    let (mut sent, mut instructions) = (Uart::default(), 0);
    while live.now_ns() < until_ns {
        let to = (live.now_ns() + step_ns).min(until_ns);
        // A few more rows than needed.
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
    let whole = run_acquiring(|_| {});
    assert_eq!(whole.uart.len(), 320);
    let mut bench = bench(&acquiring(&[]));
    bench.run.stimulus.clear();
    bench.run.sample_period_ns = 100_000;
    let rows: Vec<_> = (0..80).map(|i| [i, 4095 - i, 0, 0]).collect();
    for step_ns in [33_333, 1_000_000, 1_000_000_000] {
        let (sent, instructions, outcome) = live(&bench.run, step_ns, whole.virtual_ns, &rows);
        assert!(sent.bytes == whole.uart && sent.ns == whole.uart_ns, "{step_ns}");
        assert_eq!(outcome.instructions.as_ref().unwrap().total, instructions);
        assert_eq!(outcome.instructions, whole.instructions);
        assert_eq!((outcome.sampling, outcome.end), (whole.sampling, RunEnd::Over));
        assert!(outcome.uart.is_empty(), "what was handed over is kept nowhere");
    }
}

#[test]
fn an_image_in_ram_is_started_there_with_its_own_vectors() {
    let code_at = SRAM + 4 * VECTORS as u32;
    let mut vectors = vectors();
    (vectors[1], vectors[3]) = (code_at | 1, (code_at + 4) | 1);
    let mut bytes: Vec<u8> = vectors.iter().flat_map(|v| v.to_le_bytes()).collect();
    // nop; bkpt; and the handler of the HardFault that follows.
    for instruction in [0xbf00, 0xbe00, BRANCH_TO_SELF] {
        bytes.extend(instruction.to_le_bytes());
    }
    let outcome = outcome(&elf_at(SRAM, &bytes, &[]), |_| {});
    let RunEnd::Breakpoint(at) = outcome.end else {
        panic!("{:?}", outcome.end)
    };
    assert_eq!(at.address, code_at + 2);
}

#[test]
fn what_comes_too_late_for_a_live_run_is_refused_and_no_time_passes() {
    let bench = bench(&acquiring(&[]));
    let mut live = bench.run.start().unwrap();
    let now_ns = live.advance(500_000, Inputs::default()).unwrap().now_ns;
    let [mut byte, mut edge, mut row] = [(); 3].map(|()| Inputs::default());
    byte.uart.push(UartInput::usart1(499_999, [1]));
    let (pin, at_ns, high) = ("PA15".into(), 3, true);
    edge.levels.push(Level { pin, at_ns, high });
    row.codes.push([0; 4]);
    for (to_ns, inputs, what) in [
        (600_000, byte, "a byte for USART1 should come at 49"),
        (600_000, edge, "an edge on PA15 should come at 3 ns, but"),
        (600_000, row, "the next row of codes should come"),
        (400_000, Inputs::default(), "time cannot go back to 400000 ns"),
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
    // On a busy machine most of this may pass before the first instruction.
    hangs.run.timeout = Duration::from_secs(1);
    let mut live = hangs.run.start().unwrap();
    // Two centuries: even a shortened wait takes some time.
    let stopped = live
        .advance(7_000_000_000_000_000_000, Inputs::default())
        .unwrap_err();
    assert!(matches!(stopped, RunError::Timeout(..)), "{stopped}");
    assert!(live.finish().is_err());
}

#[test]
fn a_run_leaves_the_half_words_that_it_executed_and_its_image_in_the_folder_that_is_asked_for() {
    let image = image(&[], SLEEP, &[]);
    let (bench, folder) = (bench(&image), tempfile::tempdir().unwrap());
    let mut program = emulator();
    program.env("STM32F405_QEMU_COVERAGE", folder.path());
    let ran = program.args(["--seconds", "0.001"]).arg(&bench.run.elf).status();
    assert!(ran.unwrap().success());
    let files = std::fs::read_dir(folder.path()).unwrap();
    let mut files: Vec<_> = files
        .map(|file| std::fs::read(file.unwrap().path()).unwrap())
        .collect();
    files.sort_by_key(Vec::len);
    assert_eq!((files.len(), &files[1]), (2, &image));
    let bits = files[0].iter().enumerate().flat_map(|(byte, bits)| {
        let of_byte = (0..8).filter(move |bit| bits >> bit & 1 == 1);
        of_byte.map(move |bit| 8 * byte as u32 + bit)
    });
    // The first address in the table is 0, so nothing is stored and the loop has no second turn.
    let executed = [0, 1, 2, 3, 6].map(|at| (RESET_AT - FLASH) / 2 + at);
    assert_eq!(bits.collect::<Vec<_>>(), executed);
}
