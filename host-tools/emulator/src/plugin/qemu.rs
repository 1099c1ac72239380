//! QEMU's inside: the only file with `unsafe`.
//!
//! # Design
//!
//! QEMU's own functions are looked up by name when the plugin is loaded, not linked, so that this crate links into host
//! programs and a QEMU that does not export them gets a clear line. They are QEMU's internal interface: Debian's and
//! Ubuntu's builds export them, and as used here they are the same in 7.2.22, 10.0.2 and 11.1.3, which were tried.
//! [`self_test`] and [`interrupt_test`] try each effect that the overlay rests on, so that a QEMU that differs says so.
//!
//! # Safety
//!
//! QEMU's structures are never looked into. They are given room ([`room`]) larger than in any known version and filled
//! in by QEMU itself, but for two small ones that a caller fills in, [`Ops`] and [`Notifier`]. Every call in is made with
//! QEMU's big lock held, in its callbacks for memory, timers, reset and the end of machine creation. The callbacks for
//! translation and instructions run without it: they touch counters, which are atomics, and [`Sites`], which has its
//! own lock, and never the overlay.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use super::count::{Counters, Site, Sites};
use super::{Overlay, say};
use crate::exchange::SELF_TEST_STATUS;
use crate::machine::{FLASH, INTERRUPTS};

const _: () = assert!(SPARE_LINE >= INTERRUPTS);

type Pointer = *mut c_void;

/// Declares QEMU's functions as fields that are filled in by name.
macro_rules! functions {
    ($($name:ident: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions { $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)* }

        impl Functions {
            /// The error is the name that QEMU does not export.
            fn find() -> Result<Self, &'static str> {
                Ok(Self { $($name: {
                    let found = symbol(concat!(stringify!($name), "\0"))?;
                    // SAFETY: the symbol of this name has this type in QEMU 7.2 to 11.1.
                    unsafe { std::mem::transmute::<Pointer, unsafe extern "C" fn($($argument),*) $(-> $result)?>(found) }
                },)* })
            }
        }
    };
}

functions! {
    qemu_add_machine_init_done_notifier: fn(*mut Notifier);
    get_system_memory: fn() -> Pointer;
    memory_region_init_io: fn(Pointer, Pointer, *const Ops, Pointer, *const c_char, u64);
    memory_region_init_ram: fn(Pointer, Pointer, *const c_char, u64, Pointer);
    memory_region_init_rom_device: fn(Pointer, Pointer, *const Ops, Pointer, *const c_char, u64, Pointer);
    memory_region_init_alias: fn(Pointer, Pointer, *const c_char, Pointer, u64, u64);
    memory_region_present: fn(Pointer, u64) -> bool;
    memory_region_add_subregion_overlap: fn(Pointer, u64, Pointer, c_int);
    object_resolve_path: fn(*const c_char, *mut bool) -> Pointer;
    object_resolve_path_type: fn(*const c_char, *const c_char, *mut bool) -> Pointer;
    qdev_get_gpio_in: fn(Pointer, c_int) -> Pointer;
    qdev_connect_gpio_out_named: fn(Pointer, *const c_char, c_int, Pointer);
    qemu_allocate_irq: fn(extern "C" fn(Pointer, c_int, c_int), Pointer, c_int) -> Pointer;
    qemu_set_irq: fn(Pointer, c_int);
    qemu_get_cpu: fn(c_int) -> Pointer;
    cpu_interrupt: fn(Pointer, c_int);
    cpu_memory_rw_debug: fn(Pointer, u64, Pointer, usize, bool) -> c_int;
    timer_init_full: fn(Pointer, Pointer, c_int, c_int, c_int, extern "C" fn(Pointer), Pointer);
    timer_mod: fn(Pointer, i64);
    timer_del: fn(Pointer);
    qemu_clock_get_ns: fn(c_int) -> i64;
    qemu_register_reset: fn(extern "C" fn(Pointer), Pointer);
    qemu_system_reset_request: fn(c_int);
    qemu_system_shutdown_request: fn(c_int);
    address_space_rw: fn(Pointer, u64, u64, Pointer, u64, bool) -> u32;
    address_space_write_rom: fn(Pointer, u64, u64, *const c_void, u64) -> u32;
    qemu_plugin_register_vcpu_tb_trans_cb: fn(u64, extern "C" fn(Pointer, Pointer), Pointer);
    qemu_plugin_tb_n_insns: fn(Pointer) -> usize;
    qemu_plugin_tb_get_insn: fn(Pointer, usize) -> Pointer;
    qemu_plugin_insn_vaddr: fn(Pointer) -> u64;
    qemu_plugin_register_vcpu_insn_exec_cb: fn(Pointer, extern "C" fn(u32, Pointer), c_int, Pointer);
}

/// `MemoryRegionOps`.
#[repr(C)]
struct Ops {
    read: extern "C" fn(Pointer, u64, u32) -> u64,
    write: extern "C" fn(Pointer, u64, u64, u32),
    read_with_attrs: usize,
    write_with_attrs: usize,
    endianness: c_int,
    valid: ValidAccess,
    implemented: AccessSizes,
}

#[repr(C)]
struct ValidAccess {
    sizes: AccessSizes,
    accepts: usize,
}

#[repr(C)]
struct AccessSizes {
    min: u32,
    max: u32,
    unaligned: bool,
}

/// `Notifier`: a function and its place in a list.
#[repr(C)]
struct Notifier {
    notify: extern "C" fn(*mut Notifier, Pointer),
    node: [usize; 2],
}

const DEVICE_LITTLE_ENDIAN: c_int = 2;
const QEMU_CLOCK_VIRTUAL: c_int = 1;
const SCALE_NS: c_int = 1;
const SHUTDOWN_CAUSE_GUEST_SHUTDOWN: c_int = 6;
const SHUTDOWN_CAUSE_GUEST_RESET: c_int = 7;
/// `CPU_INTERRUPT_HALT`: the processor stands still until it has work.
const HALT: c_int = 0x20;
/// `CPU_INTERRUPT_EXITTB`: work that is none.
const GO_ON: c_int = 0x04;
/// `MEMTXATTRS_UNSPECIFIED`.
const UNSPECIFIED: u64 = 1;
/// Above QEMU's own devices, which are at 0.
const PRIORITY: c_int = 10;

static OPS: Ops = Ops {
    read: on_read,
    write: on_write,
    read_with_attrs: 0,
    write_with_attrs: 0,
    endianness: DEVICE_LITTLE_ENDIAN,
    valid: ValidAccess {
        sizes: UP_TO_WORDS,
        accepts: 0,
    },
    implemented: UP_TO_WORDS,
};
/// Flash is read as memory; what is stored comes here.
static FLASH_OPS: Ops = Ops {
    read: on_read,
    write: on_store,
    read_with_attrs: 0,
    write_with_attrs: 0,
    endianness: DEVICE_LITTLE_ENDIAN,
    valid: ValidAccess {
        sizes: ANY_UP_TO_WORDS,
        accepts: 0,
    },
    implemented: ANY_UP_TO_WORDS,
};
const ANY_UP_TO_WORDS: AccessSizes = AccessSizes {
    min: 1,
    max: 4,
    unaligned: true,
};
const UP_TO_WORDS: AccessSizes = AccessSizes {
    min: 1,
    max: 4,
    unaligned: false,
};

/// QEMU, as the overlay uses it.
pub(super) struct Qemu {
    functions: &'static Functions,
    address_space: Pointer,
    timer: Pointer,
    interrupts: Vec<Pointer>,
    reset_requested: AtomicBool,
}

// SAFETY: the pointers are to objects of QEMU's that live as long as it does, used under its big lock.
unsafe impl Send for Qemu {}
// SAFETY: as above.
unsafe impl Sync for Qemu {}

static QEMU: OnceLock<Qemu> = OnceLock::new();
static OVERLAY: OnceLock<Mutex<Overlay>> = OnceLock::new();
static COUNTERS: OnceLock<(&'static Counters, Mutex<Sites>)> = OnceLock::new();
static FUNCTIONS: OnceLock<Functions> = OnceLock::new();

/// Both are set before QEMU can call back; `None` only in between, when QEMU sets up its memory.
fn running() -> Option<(MutexGuard<'static, Overlay>, &'static Qemu)> {
    let overlay = OVERLAY.get()?.lock().unwrap_or_else(PoisonError::into_inner);
    Some((overlay, QEMU.get()?))
}

impl Qemu {
    /// Virtual time in ns since power-up.
    pub(super) fn now(&self) -> u64 {
        // SAFETY: takes a clock's number.
        let ns = unsafe { (self.functions.qemu_clock_get_ns)(QEMU_CLOCK_VIRTUAL) };
        ns.max(0) as u64
    }

    /// Calls [`Overlay::wake`] at a time, in place of the one asked for before.
    pub(super) fn wake_at(&self, ns: u64) {
        if self.reset_requested.load(Relaxed) {
            return;
        }
        // SAFETY: the timer was initialised by `lay_over`.
        unsafe { (self.functions.timer_mod)(self.timer, i64::try_from(ns).unwrap_or(i64::MAX)) }
    }

    pub(super) fn read_memory(&self, address: u32, bytes: &mut [u8]) {
        self.access(address, bytes.as_mut_ptr().cast(), bytes.len(), false);
    }

    pub(super) fn write_memory(&self, address: u32, bytes: &[u8]) {
        self.access(address, bytes.as_ptr().cast_mut().cast(), bytes.len(), true);
    }

    fn access(&self, address: u32, bytes: Pointer, length: usize, write: bool) {
        let f = &self.functions;
        // SAFETY: the buffer has this length, and is only read from when `write` is set.
        unsafe {
            (f.address_space_rw)(
                self.address_space,
                address.into(),
                UNSPECIFIED,
                bytes,
                length as u64,
                write,
            )
        };
    }

    /// Writes memory of any kind, flash too.
    pub(super) fn poke(&self, address: u32, bytes: &[u8]) {
        let (f, length) = (&self.functions, bytes.len() as u64);
        // SAFETY: the buffer has this length and is only read.
        unsafe {
            (f.address_space_write_rom)(
                self.address_space,
                address.into(),
                UNSPECIFIED,
                bytes.as_ptr().cast(),
                length,
            )
        };
    }

    pub(super) fn set_interrupt(&self, number: usize, level: bool) {
        // SAFETY: the line is an input of the NVIC, found by `lay_over`.
        unsafe { (self.functions.qemu_set_irq)(self.interrupts[number], c_int::from(level)) }
    }

    /// The processor executes nothing more until [`Self::go_on`], an interrupt that it takes, or a reset; while nothing
    /// runs, virtual time goes straight to the next timer.
    pub(super) fn halt(&self) {
        self.interrupt_processor(HALT);
    }

    /// Ends [`Self::halt`].
    pub(super) fn go_on(&self) {
        self.interrupt_processor(GO_ON);
    }

    fn interrupt_processor(&self, request: c_int) {
        // SAFETY: processor 0 exists once the machine is made; the request is one of QEMU's.
        unsafe { (self.functions.cpu_interrupt)((self.functions.qemu_get_cpu)(0), request) }
    }

    pub(super) fn request_shutdown(&self) {
        // SAFETY: takes a cause.
        unsafe { (self.functions.qemu_system_shutdown_request)(SHUTDOWN_CAUSE_GUEST_SHUTDOWN) }
    }

    /// The reset comes a little later, from another thread. Until then no timer may stand: with the processor stopped,
    /// QEMU would let virtual time jump to it, or not, as the threads happen to run.
    pub(super) fn request_reset(&self) {
        self.reset_requested.store(true, Relaxed);
        // SAFETY: the timer was initialised by `lay_over`; the other takes a cause.
        unsafe {
            (self.functions.timer_del)(self.timer);
            (self.functions.qemu_system_reset_request)(SHUTDOWN_CAUSE_GUEST_RESET);
        }
    }

    /// Reads a word as the processor sees it, its private peripherals too.
    fn processor_word(&self, address: u32) -> u32 {
        let (f, mut word) = (&self.functions, 0u32);
        // SAFETY: processor 0 exists once the machine is made; the buffer is a word.
        unsafe {
            let cpu = (f.qemu_get_cpu)(0);
            (f.cpu_memory_rw_debug)(cpu, address.into(), (&raw mut word).cast(), 4, false);
        }
        word
    }
}

/// Ends QEMU without its clean-up, which would wait for threads that hold our lock.
pub(super) fn exit(status: c_int, line: &str) -> ! {
    say(line);
    // SAFETY: ends the process.
    unsafe { libc::_exit(status) }
}

/// An exported symbol of the process, or its name back. The name ends with a zero.
fn symbol(name: &'static str) -> Result<Pointer, &'static str> {
    // SAFETY: the name is terminated.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr().cast()) };
    if found.is_null() {
        Err(name.trim_end_matches('\0'))
    } else {
        Ok(found)
    }
}

/// Zeroed room for a structure of QEMU's, never freed.
fn room() -> Pointer {
    Box::leak(Box::new([0u128; 256])).as_mut_ptr().cast()
}

// What QEMU calls.

/// QEMU loads a plugin only if this is its own interface version; the host sets it to that in a copy of this file.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
pub(super) static qemu_plugin_version: c_int = 1;

/// Called by QEMU once, before it makes the machine. Arguments are `name=value`.
///
/// # Safety
/// For QEMU to call.
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
    let overlay = Overlay::new(Path::new(folder))?;
    let counters = overlay.recorder.counters;
    let functions = FUNCTIONS.get_or_init(|| functions);
    OVERLAY.get_or_init(|| Mutex::new(overlay));
    let notifier = Box::leak(Box::new(Notifier {
        notify: on_machine_ready,
        node: [0; 2],
    }));
    // SAFETY: the notifier is never freed.
    unsafe { (functions.qemu_add_machine_init_done_notifier)(notifier) };
    if let Some(counters) = counters {
        COUNTERS.get_or_init(|| (counters, Mutex::default()));
        // SAFETY: `id` is what QEMU gave to this plugin.
        unsafe { (functions.qemu_plugin_register_vcpu_tb_trans_cb)(id, on_translate, null_mut()) };
    }
    Ok(())
}

extern "C" fn on_machine_ready(_: *mut Notifier, _: Pointer) {
    let Some(functions) = FUNCTIONS.get() else { return };
    let qemu = match lay_over(functions) {
        Ok(qemu) => qemu,
        Err(line) => exit(SELF_TEST_STATUS, &line),
    };
    if let Err(line) = self_test(QEMU.get_or_init(|| qemu)) {
        exit(SELF_TEST_STATUS, &line);
    }
}

/// Lays our regions over the machine, and finds what the overlay needs.
fn lay_over(f: &'static Functions) -> Result<Qemu, String> {
    let none = null_mut();
    // SAFETY: QEMU's functions as it uses them itself when it makes a machine; names are terminated and static, the
    // regions and the timer are never freed, and callbacks get the address of the region's start as their argument.
    unsafe {
        let system = (f.get_system_memory)();
        let container = (f.object_resolve_path)(c"armv7m-container[0]".as_ptr(), null_mut());
        let processor = (f.object_resolve_path_type)(c"".as_ptr(), c"armv7m".as_ptr(), null_mut());
        if container.is_null() || processor.is_null() {
            return Err("this machine has no ARMv7-M processor; run it with -M netduinoplus2".into());
        }
        for (parent, start, size) in [
            (system, 0x4000_0000, 0x2000_0000),
            (system, 0x1fff_7800, 0x400),
            (container, 0xe000_1000, 0x1000),
            (container, 0xe004_2000, 0x400),
        ] {
            let region = room();
            (f.memory_region_init_io)(
                region,
                none,
                &raw const OPS,
                start as Pointer,
                c"stm32f405".as_ptr(),
                size,
            );
            (f.memory_region_add_subregion_overlap)(parent, start, region, PRIORITY);
        }
        if !(f.memory_region_present)(system, CCM.into()) {
            let region = room();
            (f.memory_region_init_ram)(region, none, c"stm32f405.ccm".as_ptr(), CCM_BYTES, none);
            (f.memory_region_add_subregion_overlap)(system, CCM.into(), region, PRIORITY);
        }
        // QEMU's own flash cannot be written; it is seen at 0 too, where the processor looks for its vectors.
        let (flash, bytes) = (room(), FLASH.len() as u64);
        let start = FLASH.start as Pointer;
        let name = c"stm32f405.flash".as_ptr();
        (f.memory_region_init_rom_device)(flash, none, &raw const FLASH_OPS, start, name, bytes, none);
        (f.memory_region_add_subregion_overlap)(system, FLASH.start.into(), flash, PRIORITY);
        let alias = room();
        (f.memory_region_init_alias)(alias, none, c"stm32f405.boot".as_ptr(), flash, 0, bytes);
        (f.memory_region_add_subregion_overlap)(system, 0, alias, PRIORITY);
        let timer = room();
        (f.timer_init_full)(timer, none, QEMU_CLOCK_VIRTUAL, SCALE_NS, 0, on_timer, none);
        (f.qemu_register_reset)(on_reset, none);
        let request = (f.qemu_allocate_irq)(on_reset_request, none, 0);
        (f.qdev_connect_gpio_out_named)(processor, c"SYSRESETREQ".as_ptr(), 0, request);
        let interrupts = (0..=SPARE_LINE)
            .map(|n| (f.qdev_get_gpio_in)(processor, n as c_int))
            .collect();
        let address_space = symbol("address_space_memory\0")?;
        Ok(Qemu {
            functions: f,
            address_space,
            timer,
            interrupts,
            reset_requested: AtomicBool::new(false),
        })
    }
}

/// QEMU's controller has 96 lines, the device 82: no firmware can enable this one.
const SPARE_LINE: usize = 95;
const CCM: u32 = 0x1000_0000;
const CCM_BYTES: u64 = 64 << 10;

/// Tries what the overlay rests on before the first instruction: our registers from QEMU's memory and from the
/// processor, and the added RAM. What it leaves behind goes with the reset that follows.
fn self_test(qemu: &Qemu) -> Result<(), String> {
    const FLASH_ACR: u32 = 0x4002_3c00;
    const DWT_CTRL: u32 = 0xe000_1000;

    let word = |address: u32| {
        let mut bytes = [0; 4];
        qemu.read_memory(address, &mut bytes);
        u32::from_le_bytes(bytes)
    };
    let check = |what: &str, found: u32, expected: u32| {
        let differs = || format!("{what} is {found:#010x} and not {expected:#010x}");
        (found == expected).then_some(()).ok_or_else(differs)
    };
    qemu.poke(FLASH.start, &vec![0xff; FLASH.len()]);
    check("a word of erased flash", word(FLASH.end - 4), u32::MAX)?;
    check(
        "the same word seen at 0",
        word((FLASH.end - FLASH.start) - 4),
        u32::MAX,
    )?;
    qemu.write_memory(FLASH_ACR, &5u32.to_le_bytes());
    check("FLASH_ACR after a write", word(FLASH_ACR), 5)?;
    qemu.write_memory(FLASH_ACR, &0u32.to_le_bytes());
    for (address, value) in [
        (CCM, 0x5a5a_a5a5u32),
        (CCM + CCM_BYTES as u32 - 4, 0x1234_5678),
        (CCM, 0),
    ] {
        qemu.write_memory(address, &value.to_le_bytes());
        check("a word of CCM RAM after a write", word(address), value)?;
    }
    check(
        "DWT_CTRL seen by the processor",
        qemu.processor_word(DWT_CTRL) & 0xf000_0000,
        0x4000_0000,
    )?;
    Ok(())
}

/// The other half, for which the interrupt controller must have been reset: a line raised is a line pending.
pub(super) fn interrupt_test(qemu: &Qemu) -> Result<(), String> {
    /// Set-pending bits of interrupts 64 to 95.
    const NVIC_ISPR2: u32 = 0xe000_e208;
    let pending = || (qemu.processor_word(NVIC_ISPR2) >> (SPARE_LINE - 64)) & 1 == 1;
    let before = pending();
    qemu.set_interrupt(SPARE_LINE, true);
    let raised = pending();
    qemu.set_interrupt(SPARE_LINE, false);
    match (before, raised) {
        (false, true) => Ok(()),
        _ => Err(format!(
            "an interrupt line was pending {before} before it was raised and {raised} after"
        )),
    }
}

extern "C" fn on_read(start: Pointer, offset: u64, bytes: u32) -> u64 {
    let address = start as u32 + offset as u32;
    running().map_or(0, |(mut overlay, qemu)| overlay.read(address, bytes, qemu).into())
}

extern "C" fn on_write(start: Pointer, offset: u64, value: u64, bytes: u32) {
    let address = start as u32 + offset as u32;
    if let Some((mut overlay, qemu)) = running() {
        overlay.write(address, bytes, value as u32, qemu);
    }
}

extern "C" fn on_store(start: Pointer, offset: u64, value: u64, bytes: u32) {
    let address = start as u32 + offset as u32;
    if let Some((mut overlay, qemu)) = running() {
        overlay.store(address, bytes, value as u32, qemu);
    }
}

extern "C" fn on_timer(_: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        overlay.wake(qemu);
    }
}

/// The firmware wrote SYSRESETREQ.
extern "C" fn on_reset_request(_: Pointer, _number: c_int, level: c_int) {
    if let Some(qemu) = QEMU.get().filter(|_| level != 0) {
        qemu.request_reset();
    }
}

extern "C" fn on_reset(_: Pointer) {
    if let Some((mut overlay, qemu)) = running() {
        qemu.reset_requested.store(false, Relaxed);
        overlay.reset(qemu);
    }
}

/// Up to plugin interface 6 the arguments are the plugin's number and the block, from 7 on the block and what was given
/// at registration, which is null here; an argument too many at registration does no harm in this calling convention.
extern "C" fn on_translate(first: Pointer, second: Pointer) {
    let block = if second.is_null() { first } else { second };
    let (Some((counters, sites)), Some(f)) = (COUNTERS.get(), FUNCTIONS.get()) else {
        return;
    };
    let mut sites = sites.lock().unwrap_or_else(PoisonError::into_inner);
    // SAFETY: the block and its instructions are QEMU's for the time of this call; a site is never freed.
    unsafe {
        for i in 0..(f.qemu_plugin_tb_n_insns)(block) {
            let instruction = (f.qemu_plugin_tb_get_insn)(block, i);
            let address = (f.qemu_plugin_insn_vaddr)(instruction) as u32;
            let site = sites
                .get(address, counters)
                .map_or(null_mut(), |s| (&raw const *s).cast_mut().cast());
            (f.qemu_plugin_register_vcpu_insn_exec_cb)(instruction, on_instruction, 0, site);
        }
    }
}

extern "C" fn on_instruction(_processor: u32, site: Pointer) {
    // SAFETY: the pointer is null or to a site that `on_translate` leaked.
    let site = unsafe { site.cast::<Site>().as_ref() };
    if let Some((counters, _)) = COUNTERS.get() {
        counters.executed(site);
    }
}
