//! Entry points for QEMU: the plugin's entry, and the callbacks for memory, time, resets and instructions.
//!
//! # Safety
//!
//! QEMU holds its big lock in the callbacks for memory, timers and reset, and at the end of machine creation.
//! The callbacks for translation, blocks and instructions run without it, in the processor's thread. They
//! touch counters, which are atomics, and [`Sites`], which has its own lock. For the log, a fault or a panic
//! they lock the overlay, but only to use RAM and QEMU's timers, which have locks of their own.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::fs::File;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::Sender;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use super::count::{InstructionCounters, Site, Sites};
use super::coverage::Coverage;
use super::failures::{self, Sighting};
use super::handlers;
use super::idle::IdleSchedule;
use super::overlay::Overlay;
use super::pace::Pace;
use super::qemu::{
    AccessSizes, DEVICE_LITTLE_ENDIAN, Functions, LOADS_AND_STORES, LOG_SEEN, NEVER, NO_REGISTERS, Notifier,
    Ops, PRIORITY, Pointer, ProcessorAccess, QEMU_CLOCK_REALTIME, QEMU_CLOCK_VIRTUAL, Qemu, READS_REGISTERS,
    SCALE_NS, SPARE_LINE, ValidAccess, WAITED_FOR_EVENT, WAITS, WAITS_AT, Waits, exit, leave, log_moved,
    on_signal_of_abort, repeats, room, say, symbol, take_no_signals, take_standard_streams,
};
use super::recorder::Outside;
use super::self_test::self_test;
use super::{priorities, stops, waiting};
use crate::chip::Chip;
use crate::ending::RunEnd;
use crate::exchange::{self, SELF_TEST_STATUS, TimeStep};
use crate::machine::Machine;
use crate::memory::{CCM, FLASH, MOST_SRAM, PERIPHERALS, SRAM, is_beyond_every_bus, is_ram};

static QEMU: OnceLock<Qemu> = OnceLock::new();
static OVERLAY: OnceLock<Mutex<Overlay>> = OnceLock::new();
static COUNTERS: OnceLock<(&'static InstructionCounters, Mutex<Sites>)> = OnceLock::new();
static COVERAGE: OnceLock<Coverage> = OnceLock::new();
/// Thumb's WFI, WFE and SEV, narrow, and wide with the second halfword above the first.
const WFI: u32 = 0xbf30;
const WFE: u32 = 0xbf20;
const SEV: u32 = 0xbf40;
const WFI_WIDE: u32 = 0x8003_f3af;
const WFE_WIDE: u32 = 0x8002_f3af;
const SEV_WIDE: u32 = 0x8004_f3af;

/// `b .`, narrow and wide.
const BRANCH_TO_SELF: u32 = 0xe7fe;
const BRANCH_TO_SELF_WIDE: u32 = 0xbffe_f7ff;

/// CPSID i, CPSIE i, and MSR PRIMASK from R0 to R15.
const CPSID_I: u32 = 0xb672;
const CPSIE_I: u32 = 0xb662;
const MSR_PRIMASK: RangeInclusive<u32> = 0x8810_f380..=0x8810_f38f;
/// MSR BASEPRI and BASEPRI_MAX.
const MSR_BASEPRI: [RangeInclusive<u32>; 2] = [0x8811_f380..=0x8811_f38f, 0x8812_f380..=0x8812_f38f];

static FUNCTIONS: OnceLock<Functions> = OnceLock::new();
/// First addresses of the handlers of faults, and of the functions that a panic enters.
static ENTRIES: OnceLock<[Vec<u32>; 2]> = OnceLock::new();

/// The overlay and QEMU. `None` only while QEMU sets up its memory.
fn running() -> Option<(MutexGuard<'static, Overlay>, &'static Qemu)> {
    let overlay = OVERLAY.get()?.lock().unwrap_or_else(PoisonError::into_inner);
    Some((overlay, QEMU.get()?))
}

static OPS: Ops = ops(on_read, on_write, false);
/// Operations of flash. QEMU reads flash as memory, so only stores arrive here.
static FLASH_OPS: Ops = ops(on_read, on_store, true);
/// Operations of the priorities of interrupts and exceptions.
static PRIORITY_OPS: Ops = ops(on_priority_read, on_priority_write, true);

/// QEMU's operations for accesses of 1 to 4 bytes.
const fn ops(
    read: extern "C" fn(Pointer, u64, u32) -> u64,
    write: extern "C" fn(Pointer, u64, u64, u32),
    unaligned: bool,
) -> Ops {
    const fn sizes(unaligned: bool) -> AccessSizes {
        AccessSizes {
            min: 1,
            max: 4,
            unaligned,
        }
    }
    Ops {
        read,
        write,
        read_with_attrs: 0,
        write_with_attrs: 0,
        endianness: DEVICE_LITTLE_ENDIAN,
        valid: ValidAccess {
            sizes: sizes(unaligned),
            accepts: on_accept,
        },
        implemented: sizes(unaligned),
    }
}

/// QEMU loads a plugin only if this is QEMU's own interface version. The host sets the version in a copy of
/// this file.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
pub(super) static qemu_plugin_version: c_int = 1;

/// Called by QEMU once, before it makes the machine. Arguments are `name=value`.
///
/// # Safety
/// Only QEMU may call this.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn qemu_plugin_install(
    id: u64,
    _info: *const c_void,
    argc: c_int,
    argv: *const *const c_char,
) -> c_int {
    let count = usize::try_from(argc).unwrap_or(0);
    let argument = |i: usize| {
        // SAFETY: QEMU gives `argc` terminated strings.
        unsafe { CStr::from_ptr(*argv.add(i)) }
            .to_string_lossy()
            .into_owned()
    };
    match install(id, &(0..count).map(argument).collect::<Vec<_>>()) {
        Ok(()) => 0,
        Err(line) => {
            say(&line);
            -1
        }
    }
}

fn install(id: u64, arguments: &[String]) -> Result<(), String> {
    let folder = arguments.iter().find_map(|a| a.strip_prefix("run="));
    let folder = folder.ok_or("the plugin needs the argument run=DIRECTORY, with a run description in it")?;
    let functions = Functions::find().map_err(|name| {
        format!(
            "this QEMU does not export {name}; Debian's and Ubuntu's qemu-system-arm 7.2 or newer do, static builds do not"
        )
    })?;
    let mut overlay = Overlay::new(Path::new(folder))?;
    let said = Path::new(folder).join(exchange::SEMIHOSTING);
    let said = overlay.description.run.semihosting.then_some(said);
    let streams = take_standard_streams(said.as_deref());
    let (from, to) = streams.map_err(|e| format!("QEMU's standard streams cannot be taken over: {e}"))?;
    overlay.talk_to(to);
    let (counters, steps) = (overlay.counters(), overlay.steps.clone());
    if let Some(stem) = &overlay.description.coverage {
        let coverage = Coverage::new(stem)?;
        COVERAGE.get_or_init(|| coverage);
    }
    ENTRIES.get_or_init(|| overlay.entries());
    let functions = FUNCTIONS.get_or_init(|| functions);
    OVERLAY.get_or_init(|| Mutex::new(overlay));
    let folder = PathBuf::from(folder);
    std::thread::spawn(move || watch_host(from, &folder, steps.as_ref()));
    let notifier = Box::leak(Box::new(Notifier {
        notify: on_machine_ready,
        node: [0; 2],
    }));
    // SAFETY: the notifier is never freed.
    unsafe { (functions.qemu_add_machine_init_done_notifier)(notifier) };
    if let Some(counters) = counters {
        COUNTERS.get_or_init(|| (counters, Mutex::default()));
    }
    on_signal_of_abort(on_abort);
    // SAFETY: `id` is the number that QEMU gave this plugin.
    unsafe {
        (functions.qemu_plugin_register_vcpu_tb_trans_cb)(id, on_translate, null_mut());
        (functions.qemu_plugin_register_atexit_cb)(id, on_exit, null_mut());
    }
    Ok(())
}

/// Waits for the host's request for a report, or for the end of standard input, which the host holds open:
/// then the host is gone, and nobody reads a report.
fn watch_host(from: File, folder: &Path, steps: Option<&Sender<TimeStep>>) {
    take_no_signals();
    if stops::listen(from, steps) {
        // On a busy computer the request may come before QEMU is ready. The host gives up in the end.
        loop {
            if let Some((mut overlay, qemu)) = running() {
                overlay.stop(RunEnd::Stopped, qemu);
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    } else {
        // The host would have removed it.
        exchange::remove(folder);
    }
    leave(0);
}

/// Writes the report when QEMU aborts, as it does when the processor locks up. Writes none if QEMU aborts
/// while one of our locks is held. QEMU does not continue after this.
extern "C" fn on_abort(_signal: c_int) {
    if let (Some(overlay), Some(qemu)) = (OVERLAY.get(), QEMU.get())
        && let Ok(mut overlay) = overlay.try_lock()
    {
        overlay.lock_up(qemu);
        leave(0);
    }
}

/// Writes the report when QEMU ends before the run does. With semihosting the image has requested the end.
extern "C" fn on_exit(_: Pointer, _: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        // The host adds the exit status.
        let ended = RunEnd::QemuEnded(String::new());
        let exits = overlay.description.run.semihosting;
        overlay.stop(if exits { RunEnd::Exited(0) } else { ended }, qemu);
    }
}

extern "C" fn on_machine_ready(_: *mut Notifier, _: Pointer) {
    let Some(functions) = FUNCTIONS.get() else { return };
    let Some(overlay) = OVERLAY.get() else { return };
    let chip = overlay
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .description
        .run
        .chip;
    let mut qemu = lay_over(functions, chip).unwrap_or_else(|line| exit(SELF_TEST_STATUS, &line));
    qemu.map_windows(chip);
    qemu.poke(WAITS_AT, &WAITS);
    let qemu = QEMU.get_or_init(|| qemu);
    if let Err(line) = self_test(qemu, chip) {
        exit(SELF_TEST_STATUS, &line);
    }
    if let Some((overlay, qemu)) = running()
        && let Some(address) = overlay.log_offset().filter(|address| chip.is_ram(*address, 4))
    {
        qemu.watch_log(address);
    }
}

/// Lays our regions over the machine, and looks up the objects of QEMU that the overlay uses.
fn lay_over(f: &'static Functions, chip: Chip) -> Result<Qemu, String> {
    let none = null_mut();
    // SAFETY: QEMU's functions are used as QEMU does when it makes a machine; names are terminated and
    // static, the regions and the timer are never freed, and callbacks get the address of the region's start
    // as their argument.
    unsafe {
        let system = (f.get_system_memory)();
        let container = (f.object_resolve_path)(c"armv7m-container[0]".as_ptr(), null_mut());
        let processor = (f.object_resolve_path_type)(c"".as_ptr(), c"armv7m".as_ptr(), null_mut());
        let nvic = (f.object_resolve_path)(c"nvic_sysregs[0]".as_ptr(), null_mut());
        if container.is_null() || processor.is_null() || nvic.is_null() {
            return Err("this machine has no ARMv7-M processor; run it with -M netduinoplus2".into());
        }
        for (parent, addresses, ops) in [
            (system, PERIPHERALS, &OPS),
            // The bootloader, factory words and option bytes.
            (system, 0x1fff_0000..0x2000_0000, &OPS),
            // ITM, DWT and FPB; SysTick; SCR; the debug registers; TPIU, ETM and DBGMCU.
            (container, 0xe000_0000..0xe000_3000, &OPS),
            (container, 0xe000_e010..0xe000_e020, &OPS),
            (container, 0xe000_ed10..0xe000_ed14, &OPS),
            (container, 0xe000_edf0..0xe000_ee00, &OPS),
            (container, 0xe004_0000..0xe004_2400, &OPS),
            (container, 0xe000_e400..0xe000_e500, &PRIORITY_OPS),
            (container, 0xe000_ed18..0xe000_ed24, &PRIORITY_OPS),
        ] {
            let (region, start, size) = (room(), addresses.start, addresses.len() as u64);
            let (name, base) = (c"stm32f405".as_ptr(), start as usize as Pointer);
            (f.memory_region_init_io)(region, none, &raw const *ops, base, name, size);
            (f.memory_region_add_subregion_overlap)(parent, start.into(), region, PRIORITY);
        }
        for (addresses, name, there) in memory_of(chip) {
            let (region, start, size) = (room(), addresses.start, addresses.len() as u64);
            match there {
                _ if size == 0 => continue,
                RangeContent::Memory if (f.memory_region_present)(system, start.into()) => continue,
                RangeContent::Memory => (f.memory_region_init_ram)(region, none, name.as_ptr(), size, none),
                RangeContent::Nothing => {
                    let base = start as usize as Pointer;
                    (f.memory_region_init_io)(region, none, &raw const OPS, base, name.as_ptr(), size);
                }
            }
            (f.memory_region_add_subregion_overlap)(system, start.into(), region, PRIORITY);
        }
        let waits = room();
        (f.memory_region_init_ram)(waits, none, c"stm32f405.waits".as_ptr(), 0x1000, none);
        (f.memory_region_add_subregion_overlap)(system, WAITS_AT.into(), waits, PRIORITY);
        // QEMU's own flash cannot be written. Flash is also mapped at 0, where the processor looks for its
        // vectors.
        let (flash, bytes) = (room(), chip.flash_space().len() as u64);
        let start = FLASH.start as Pointer;
        let name = c"stm32f405.flash".as_ptr();
        (f.memory_region_init_rom_device)(flash, none, &raw const FLASH_OPS, start, name, bytes, none);
        (f.memory_region_add_subregion_overlap)(system, FLASH.start.into(), flash, PRIORITY);
        let alias = room();
        (f.memory_region_init_alias)(alias, none, c"stm32f405.boot".as_ptr(), flash, 0, bytes);
        (f.memory_region_add_subregion_overlap)(system, 0, alias, PRIORITY);
        let timer = room();
        (f.timer_init_full)(timer, none, QEMU_CLOCK_VIRTUAL, SCALE_NS, 0, on_timer, none);
        let rest_timer = room();
        (f.timer_init_full)(rest_timer, none, QEMU_CLOCK_REALTIME, SCALE_NS, 0, on_rest, none);
        (f.timer_mod)(rest_timer, 0);
        (f.qemu_register_reset)(on_reset, none);
        let request = (f.qemu_allocate_irq)(on_reset_request, none, 0);
        (f.qdev_connect_gpio_out_named)(processor, c"SYSRESETREQ".as_ptr(), 0, request);
        let interrupts = (0..=SPARE_LINE)
            .map(|n| (f.qdev_get_gpio_in)(processor, n as c_int))
            .collect();
        let nmi = (f.qdev_get_gpio_in_named)(processor, c"NMI".as_ptr(), 0);
        let controller = (f.object_resolve_path_type)(c"".as_ptr(), c"armv7m_nvic".as_ptr(), null_mut());
        let systick = (f.qdev_get_gpio_in_named)(controller, c"systick-trigger".as_ptr(), 0);
        let address_space = symbol("address_space_memory\0")?;
        Ok(Qemu {
            functions: f,
            address_space,
            timer,
            timer_at: AtomicI64::new(NEVER),
            interrupts,
            nmi,
            systick,
            nvic,
            waits: Waits::find().ok(),
            on_wait,
            processor: ProcessorAccess::find().ok(),
            windows: Vec::new(),
            rest_timer,
            rest: IdleSchedule::default(),
            reset_requested: AtomicBool::new(false),
            pace: Pace::new(),
        })
    }
}

/// RAM that QEMU's machine may lack, and RAM that the part lacks, where an access is a bus fault.
fn memory_of(chip: Chip) -> [(Range<u32>, &'static CStr, RangeContent); 4] {
    let (sram, ccm) = (chip.sram(), chip.ccm());
    [
        (
            SRAM.end..sram.end.max(SRAM.end),
            c"stm32f405.sram",
            RangeContent::Memory,
        ),
        (
            sram.end..MOST_SRAM.end,
            c"stm32f405.no-sram",
            RangeContent::Nothing,
        ),
        (ccm.clone(), c"stm32f405.ccm", RangeContent::Memory),
        (ccm.end..CCM.end, c"stm32f405.no-ccm", RangeContent::Nothing),
    ]
}

/// Content of a range of addresses at which parts may have RAM.
#[derive(Clone, Copy)]
enum RangeContent {
    Memory,
    Nothing,
}

/// Accepts an access. A refused one is a bus fault: RAM addresses reach this only where the part has none.
extern "C" fn on_accept(start: Pointer, offset: u64, _bytes: u32, _write: bool, _attributes: u64) -> bool {
    let address = address_of(start, offset);
    !is_ram(address, 1) && !is_beyond_every_bus(address)
}

/// The part has 4 bits of priority, the upper ones of each byte (RM0090 section 12.1.1). QEMU 7.2 has 8.
const PRIORITY_BITS: u64 = 0xf0f0_f0f0;

/// The address of an access to a region that begins at `start`.
fn address_of(start: Pointer, offset: u64) -> u32 {
    start as usize as u32 + offset as u32
}

extern "C" fn on_priority_read(start: Pointer, offset: u64, bytes: u32) -> u64 {
    QEMU.get()
        .map_or(0, |qemu| qemu.read_nvic(address_of(start, offset), bytes))
}

extern "C" fn on_priority_write(start: Pointer, offset: u64, value: u64, bytes: u32) {
    if let Some(qemu) = QEMU.get() {
        qemu.write_nvic(address_of(start, offset), value & PRIORITY_BITS, bytes);
    }
}

extern "C" fn on_read(start: Pointer, offset: u64, bytes: u32) -> u64 {
    let address = address_of(start, offset);
    read_or_moved_pins();
    running()
        .map_or(0, |(mut overlay, qemu)| overlay.read(address, bytes, qemu))
        .into()
}

extern "C" fn on_write(start: Pointer, offset: u64, value: u64, bytes: u32) {
    let (address, value) = (address_of(start, offset), value as u32);
    let only_moves_pins = access(|machine, now, outside| {
        machine.write(address, bytes, value, now, outside);
        bytes == 4 && machine.only_moves_pins(address)
    });
    if only_moves_pins {
        read_or_moved_pins();
    } else {
        waiting::WATCH.written();
    }
}

/// Counts an access that may belong to a loop that waits or moves pins.
fn read_or_moved_pins() {
    if waiting::WATCH.read()
        && let Some(qemu) = QEMU.get()
    {
        qemu.call_between_instructions(on_loop);
    }
}

extern "C" fn on_store(start: Pointer, offset: u64, value: u64, bytes: u32) {
    let (address, value) = (address_of(start, offset), value as u32);
    access(|machine, now, outside| machine.store(address, bytes, value, now, outside));
}

/// Passes an access to a register or a store to flash on to the machine.
fn access<T: Default>(access: impl FnOnce(&mut Machine, u64, &mut Outside<'_>) -> T) -> T {
    running().map_or_else(T::default, |(mut overlay, qemu)| overlay.access(qemu, access))
}

extern "C" fn on_timer(_: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        qemu.forget_timer();
        overlay.wake(qemu);
    }
}

extern "C" fn on_rest(_: Pointer) {
    if let Some(qemu) = QEMU.get() {
        qemu.rest();
    }
}

extern "C" fn on_wait(_processor: Pointer, _: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        overlay.halted(qemu);
        drop(overlay);
        qemu.pass_time();
    }
}

/// Resets the machine: the firmware has written SYSRESETREQ.
extern "C" fn on_reset_request(_: Pointer, _number: c_int, level: c_int) {
    if let Some(qemu) = QEMU.get().filter(|_| level != 0) {
        qemu.request_reset();
    }
}

extern "C" fn on_reset(_: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        qemu.reset_requested.store(false, Relaxed);
        qemu.rest.need(false);
        overlay.reset(qemu);
    }
}

/// Up to plugin interface 6 the arguments are the plugin's number and the block. From 7 they are the block
/// and the pointer given at registration, which is null here. In this calling convention an additional
/// argument at registration does no harm.
extern "C" fn on_translate(first: Pointer, second: Pointer) {
    let block = if second.is_null() { first } else { second };
    let (Some(f), Some([faults, panics])) = (FUNCTIONS.get(), ENTRIES.get()) else {
        return;
    };
    // SAFETY: the block and its instructions are valid during this call; a site is never freed.
    unsafe {
        let start = (f.qemu_plugin_tb_vaddr)(block) as usize as Pointer;
        (f.qemu_plugin_register_vcpu_tb_exec_cb)(block, on_block, NO_REGISTERS, start);
        let instructions = (f.qemu_plugin_tb_n_insns)(block);
        if COVERAGE.get().is_some() && instructions > 0 {
            let last = (f.qemu_plugin_tb_get_insn)(block, instructions - 1);
            let end = (f.qemu_plugin_insn_vaddr)(last) + (f.qemu_plugin_insn_size)(last) as u64;
            // Start and length, in one word of 64 bits.
            let extent = start as u64 | (end - start as u64) << 32;
            let watch = f.qemu_plugin_register_vcpu_tb_exec_cb;
            watch(block, on_covered, NO_REGISTERS, extent as usize as Pointer);
        }
        for i in 0..instructions {
            let instruction = (f.qemu_plugin_tb_get_insn)(block, i);
            let address = (f.qemu_plugin_insn_vaddr)(instruction) as u32;
            let at = address as usize as Pointer;
            let watch = f.qemu_plugin_register_vcpu_insn_exec_cb;
            if address == WAITS_AT {
                watch(instruction, on_own_wait, NO_REGISTERS, null_mut());
                continue;
            }
            let word = QEMU.get().map(|qemu| qemu.instruction(address));
            if faults.contains(&address) {
                let loops = matches!(word, Some(BRANCH_TO_SELF | BRANCH_TO_SELF_WIDE));
                let entered = if loops { on_fault_in_loop } else { on_fault };
                watch(instruction, entered, READS_REGISTERS, at);
            }
            match word {
                Some(WFI | WFI_WIDE) => watch(instruction, on_wait_for_interrupt, NO_REGISTERS, null_mut()),
                Some(SEV | SEV_WIDE) => watch(instruction, on_send_event, NO_REGISTERS, null_mut()),
                Some(WFE | WFE_WIDE) => watch(instruction, on_wait_for_event, NO_REGISTERS, null_mut()),
                Some(CPSID_I) => watch(instruction, on_mask, NO_REGISTERS, at),
                Some(CPSIE_I) => watch(instruction, on_unmask, NO_REGISTERS, null_mut()),
                Some(word) if MSR_PRIMASK.contains(&word) => {
                    watch(instruction, on_restore_mask, NO_REGISTERS, null_mut());
                }
                Some(word) if MSR_BASEPRI.iter().any(|words| words.contains(&word)) => {
                    watch(instruction, on_base_priority, NO_REGISTERS, at);
                }
                _ => {}
            }
            if panics.contains(&address) {
                watch(instruction, on_panic, NO_REGISTERS, at);
            }
            if handlers::begins_at(address) {
                // Entry to an exception, and the return from it, are events.
                watch(instruction, on_send_event, NO_REGISTERS, null_mut());
            }
            if let Some(count) = handlers::count_at(address) {
                let count = (&raw const *count).cast_mut().cast();
                watch(instruction, on_handler, NO_REGISTERS, count);
            }
            if let Some((counters, sites)) = COUNTERS.get() {
                let mut sites = sites.lock().unwrap_or_else(PoisonError::into_inner);
                let site = sites.get(address, counters, word);
                if counters.times() {
                    let watch = f.qemu_plugin_register_vcpu_mem_cb;
                    watch(instruction, on_data, NO_REGISTERS, LOADS_AND_STORES, null_mut());
                }
                let site = site.map_or(null_mut(), |site| (&raw const *site).cast_mut().cast());
                watch(instruction, on_instruction, NO_REGISTERS, site);
            }
        }
    }
}

/// Handles the start of a block of instructions. Log bytes written since the last block are taken at once, so
/// that the log's buffer never gets full.
extern "C" fn on_block(_processor: u32, start: Pointer) {
    if waiting::WATCH.block(start as usize as u32)
        && let Some(qemu) = QEMU.get()
    {
        qemu.call_between_instructions(on_loop);
    }
    if let Some(offset) = log_moved(start as usize as u32)
        && let Some((mut overlay, qemu)) = running()
        && overlay.drain_log(qemu)
    {
        LOG_SEEN.store(offset, Relaxed);
    }
}

/// Tries to shorten a loop that waits.
extern "C" fn on_loop(_processor: Pointer, _: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        let counts = overlay.shorten_wait(qemu);
        for (address, times) in &counts {
            if let Some(taken) = handlers::count_at(*address) {
                taken.fetch_add(*times, Relaxed);
                // As when QEMU executes the handler's first instruction.
                waiting::EVENT.store(true, Relaxed);
            }
        }
        if let Some((counters, sites)) = COUNTERS.get() {
            let mut sites = sites.lock().unwrap_or_else(PoisonError::into_inner);
            for (address, times) in counts {
                counters.executed_times(sites.get(address, counters, None), times);
            }
        }
    }
}

extern "C" fn on_covered(_processor: u32, extent: Pointer) {
    if let Some(coverage) = COVERAGE.get() {
        let extent = extent as u64;
        coverage.executed(extent as u32, (extent >> 32) as u32);
    }
}

extern "C" fn on_handler(_processor: u32, count: Pointer) {
    // SAFETY: the pointer is to a count that is never freed.
    if let Some(count) = unsafe { count.cast::<AtomicU64>().as_ref() } {
        count.fetch_add(1, Relaxed);
    }
    if waiting::WATCH.entry(count as usize)
        && let Some(qemu) = QEMU.get()
    {
        qemu.call_between_instructions(on_loop);
    }
}

extern "C" fn on_base_priority(_processor: u32, at: Pointer) {
    waiting::BASE_PRIORITY.written(at as usize as u32);
}

extern "C" fn on_fault(_processor: u32, at: Pointer) {
    /// The exception that was active at the last call.
    static SEEN: AtomicU32 = AtomicU32::new(0);
    let Some(qemu) = QEMU.get() else { return };
    // A handler that is a loop begins at every turn. Asking QEMU for the registers takes hundreds of times as
    // long as a turn. A handler that faults and so enters itself runs as another exception.
    let active = priorities::active(qemu);
    if SEEN.swap(active, Relaxed) == active && repeats(at as usize as u32) {
        return;
    }
    if let Some(exception) = failures::exception(&qemu.registers(), qemu) {
        note_sighting(Sighting::Exception(exception));
    }
}

/// Notes a fault whose handler is `b .`, which cannot fault itself: only its first turn counts.
extern "C" fn on_fault_in_loop(processor: u32, at: Pointer) {
    if !repeats(at as usize as u32) {
        on_fault(processor, at);
    }
}

extern "C" fn on_wait_for_interrupt(_processor: u32, _: Pointer) {
    let Some((overlay, qemu)) = running() else { return };
    let deep = overlay.machine.sleeps_deep();
    drop(overlay);
    if deep && !priorities::is_any_pending(qemu) {
        note_sighting(Sighting::DeepSleep);
    }
    qemu.pass_wait();
}

extern "C" fn on_own_wait(_processor: u32, _: Pointer) {
    if let Some(qemu) = QEMU.get() {
        qemu.pass_wait();
    }
}

/// Makes WFE wait: QEMU's own does not before version 11.
extern "C" fn on_wait_for_event(_processor: u32, _: Pointer) {
    let Some(qemu) = QEMU.get() else { return };
    if qemu_has_events() || waiting::EVENT.swap(false, Relaxed) {
        return;
    }
    if !qemu.call_between_instructions(on_halt) {
        WAITED_FOR_EVENT.store(true, Relaxed);
    }
}

/// Returns `true` if QEMU has the event register: from version 11.
fn qemu_has_events() -> bool {
    const FIRST: c_int = 6;
    qemu_plugin_version >= FIRST
}

/// Halts the processor: it has executed WFE, and no event has come.
extern "C" fn on_halt(_processor: Pointer, _: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        overlay.wait_for_event(qemu);
    }
}

extern "C" fn on_send_event(_processor: u32, _: Pointer) {
    waiting::EVENT.store(true, Relaxed);
}

fn with_counters(count: impl FnOnce(&InstructionCounters)) {
    if let Some((counters, _)) = COUNTERS.get() {
        count(counters);
    }
}

extern "C" fn on_mask(_processor: u32, at: Pointer) {
    with_counters(|counters| counters.masked(at as usize as u32));
}

extern "C" fn on_restore_mask(_processor: u32, _: Pointer) {
    with_counters(InstructionCounters::mask_restored);
}

extern "C" fn on_unmask(_processor: u32, _: Pointer) {
    with_counters(InstructionCounters::unmasked);
}

extern "C" fn on_panic(_processor: u32, at: Pointer) {
    // The panic's function may be `b .` too.
    if !repeats(at as usize as u32) {
        note_sighting(Sighting::Panic);
    }
}

fn note_sighting(sighting: Sighting) {
    if let Some((mut overlay, qemu)) = running() {
        overlay.note_sighting(sighting, qemu);
    }
}

extern "C" fn on_data(_processor: u32, info: u32, address: u64, _: Pointer) {
    if let Some(f) = FUNCTIONS.get() {
        // SAFETY: takes the description of an access that QEMU passed.
        let bytes = 1 << unsafe { (f.qemu_plugin_mem_size_shift)(info) };
        with_counters(|counters| counters.accessed(address as u32, bytes));
    }
}

extern "C" fn on_instruction(_processor: u32, site: Pointer) {
    // SAFETY: the pointer is null or to a site that `on_translate` leaked.
    let site = unsafe { site.cast::<Site>().as_ref() };
    with_counters(|counters| counters.executed(site));
}
