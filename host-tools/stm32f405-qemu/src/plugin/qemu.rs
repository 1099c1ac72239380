//! QEMU's functions that the plugin calls.
//!
//! # Design
//!
//! QEMU's own functions are looked up by name when the plugin is loaded. They are not linked, so this crate
//! links into host programs, and a QEMU that does not export them causes a clear error. They are QEMU's
//! internal interface. Debian's and Ubuntu's builds export them. As used here they are the same in 7.2.22,
//! 10.0.2 and 11.1.3, which were tried. The self-test checks each effect that the overlay relies on.
//!
//! # Safety
//!
//! The overlay never looks into QEMU's structures. It reserves space ([`room`]) that is larger than in any
//! known version, and QEMU fills it in. The two exceptions are small structures that a caller fills in,
//! [`Ops`] and [`Notifier`]. Every call is made with QEMU's big lock held, or from the processor's own thread
//! between two of its instructions.
#![allow(unsafe_code)]

use std::ffi::{c_char, c_int, c_void};
use std::fs::{File, OpenOptions};
use std::os::fd::{AsRawFd, FromRawFd};
use std::path::Path;
use std::ptr::null_mut;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicPtr, AtomicU32, Ordering::Relaxed};

use super::idle::IdleSchedule;
use super::pace::Pace;
use crate::chip::Chip;
use crate::exchange::LINE_PREFIX;
use crate::machine::{INTERRUPTS, NMI, SYSTICK};
use crate::memory::FLASH;
use crate::thumb::Registers;

const _: () = assert!(SPARE_LINE >= INTERRUPTS);

pub(super) type Pointer = *mut c_void;

/// Declares QEMU's functions as fields that are looked up by name, or by their earlier name.
macro_rules! functions {
    ($(#[$meta:meta])* $all:ident: $($name:ident $(| $before:ident)?: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        $(#[$meta])*
        pub(super) struct $all { $(pub(super) $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)* }

        impl $all {
            /// Looks the functions up. The error is the name that QEMU does not export.
            pub(super) fn find() -> Result<Self, &'static str> {
                Ok(Self { $($name: {
                    let names = [concat!(stringify!($name), "\0") $(, concat!(stringify!($before), "\0"))?];
                    let found = names.map(symbol);
                    let found = found.into_iter().reduce(Result::or).expect("there is a name")?;
                    // SAFETY: the symbol of this name has this type in QEMU 7.2 to 11.1.
                    unsafe { std::mem::transmute::<Pointer, unsafe extern "C" fn($($argument),*) $(-> $result)?>(found) }
                },)* })
            }
        }
    };
}

functions! {
    /// Functions that the overlay requires.
    Functions:
    qemu_add_machine_init_done_notifier: fn(*mut Notifier);
    get_system_memory: fn() -> Pointer;
    memory_region_init_io: fn(Pointer, Pointer, *const Ops, Pointer, *const c_char, u64);
    memory_region_init_ram: fn(Pointer, Pointer, *const c_char, u64, Pointer);
    memory_region_init_rom_device: fn(Pointer, Pointer, *const Ops, Pointer, *const c_char, u64, Pointer);
    memory_region_init_alias: fn(Pointer, Pointer, *const c_char, Pointer, u64, u64);
    memory_region_present: fn(Pointer, u64) -> bool;
    memory_region_add_subregion_overlap: fn(Pointer, u64, Pointer, c_int);
    memory_region_dispatch_read: fn(Pointer, u64, *mut u64, c_int, u64) -> c_int;
    memory_region_dispatch_write: fn(Pointer, u64, u64, c_int, u64) -> c_int;
    object_resolve_path: fn(*const c_char, *mut bool) -> Pointer;
    object_resolve_path_type: fn(*const c_char, *const c_char, *mut bool) -> Pointer;
    qdev_get_gpio_in: fn(Pointer, c_int) -> Pointer;
    qdev_get_gpio_in_named: fn(Pointer, *const c_char, c_int) -> Pointer;
    qdev_connect_gpio_out_named: fn(Pointer, *const c_char, c_int, Pointer);
    qemu_allocate_irq: fn(extern "C" fn(Pointer, c_int, c_int), Pointer, c_int) -> Pointer;
    qemu_set_irq: fn(Pointer, c_int);
    qemu_get_cpu: fn(c_int) -> Pointer;
    cpu_interrupt: fn(Pointer, c_int);
    cpu_memory_rw_debug: fn(Pointer, u64, Pointer, usize, bool) -> c_int;
    cpu_dump_state: fn(Pointer, *mut libc::FILE, c_int);
    timer_init_full: fn(Pointer, Pointer, c_int, c_int, c_int, extern "C" fn(Pointer), Pointer);
    timer_mod: fn(Pointer, i64);
    timer_del: fn(Pointer);
    qemu_clock_get_ns: fn(c_int) -> i64;
    qemu_register_reset: fn(extern "C" fn(Pointer), Pointer);
    qemu_system_reset_request: fn(c_int);
    qemu_system_shutdown_request: fn(c_int);
    address_space_rw: fn(Pointer, u64, u64, Pointer, u64, bool) -> u32;
    address_space_write_rom: fn(Pointer, u64, u64, *const c_void, u64) -> u32;
    address_space_map: fn(Pointer, u64, *mut u64, bool, u64) -> Pointer;
    qemu_plugin_register_vcpu_tb_trans_cb: fn(u64, extern "C" fn(Pointer, Pointer), Pointer);
    qemu_plugin_register_vcpu_tb_exec_cb: fn(Pointer, extern "C" fn(u32, Pointer), c_int, Pointer);
    qemu_plugin_register_atexit_cb: fn(u64, extern "C" fn(Pointer, Pointer), Pointer);
    qemu_plugin_tb_vaddr: fn(Pointer) -> u64;
    qemu_plugin_tb_n_insns: fn(Pointer) -> usize;
    qemu_plugin_tb_get_insn: fn(Pointer, usize) -> Pointer;
    qemu_plugin_insn_vaddr: fn(Pointer) -> u64;
    qemu_plugin_insn_size: fn(Pointer) -> usize;
    qemu_plugin_register_vcpu_insn_exec_cb: fn(Pointer, extern "C" fn(u32, Pointer), c_int, Pointer);
    qemu_plugin_register_vcpu_mem_cb: fn(Pointer, extern "C" fn(u32, u32, u64, Pointer), c_int, c_int, Pointer);
    qemu_plugin_mem_size_shift: fn(u32) -> u32;
}

functions! {
    /// Functions that pass the time in which the processor waits: see [`Qemu::pass_wait`].
    Waits:
    async_run_on_cpu: fn(Pointer, extern "C" fn(Pointer, Pointer), Pointer);
    all_cpu_threads_idle: fn() -> bool;
    icount_start_warp_timer: fn();
    qemu_clock_run_timers: fn(c_int) -> bool;
    runstate_is_running: fn() -> bool;
    // QEMU's big lock.
    bql_lock_impl | qemu_mutex_lock_iothread_impl: fn(*const c_char, c_int);
    bql_unlock | qemu_mutex_unlock_iothread: fn();
}

functions! {
    /// Functions that read and write the processor's registers: see [`Qemu::registers_of_processor`].
    ProcessorAccess:
    arm_cpu_gdb_read_register: fn(Pointer, *mut ByteArray, c_int) -> c_int;
    arm_cpu_gdb_write_register: fn(Pointer, *mut u8, c_int) -> c_int;
    g_byte_array_new: fn() -> *mut ByteArray;
    g_byte_array_set_size: fn(*mut ByteArray, u32) -> *mut ByteArray;
}

/// The public part of GLib's `GByteArray`.
#[repr(C)]
pub(super) struct ByteArray {
    data: *const u8,
    length: u32,
}

/// A range of guest memory and its place in the host's memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    start: u32,
    bytes: u32,
    host: *mut u8,
}

/// `MemoryRegionOps`.
#[repr(C)]
pub(super) struct Ops {
    pub(super) read: extern "C" fn(Pointer, u64, u32) -> u64,
    pub(super) write: extern "C" fn(Pointer, u64, u64, u32),
    pub(super) read_with_attrs: usize,
    pub(super) write_with_attrs: usize,
    pub(super) endianness: c_int,
    pub(super) valid: ValidAccess,
    pub(super) implemented: AccessSizes,
}

#[repr(C)]
pub(super) struct ValidAccess {
    pub(super) sizes: AccessSizes,
    pub(super) accepts: extern "C" fn(Pointer, u64, u32, bool, u64) -> bool,
}

#[repr(C)]
pub(super) struct AccessSizes {
    pub(super) min: u32,
    pub(super) max: u32,
    pub(super) unaligned: bool,
}

/// `Notifier`: a function and its place in a list.
#[repr(C)]
pub(super) struct Notifier {
    pub(super) notify: extern "C" fn(*mut Notifier, Pointer),
    pub(super) node: [usize; 2],
}

/// Time of a timer that is not set.
pub(super) const NEVER: i64 = -1;
pub(super) const DEVICE_LITTLE_ENDIAN: c_int = 2;
pub(super) const QEMU_CLOCK_REALTIME: c_int = 0;
pub(super) const QEMU_CLOCK_VIRTUAL: c_int = 1;
/// Time that the main thread stays awake between two rests, and its wait while the machine is paused, ns.
const LOOKS_AROUND_NS: i64 = 100_000;
const RESTS_AGAIN_NS: i64 = 20_000_000;
pub(super) const SCALE_NS: c_int = 1;
const SHUTDOWN_CAUSE_GUEST_SHUTDOWN: c_int = 6;
const SHUTDOWN_CAUSE_GUEST_RESET: c_int = 7;
/// `CPU_INTERRUPT_HALT`: the processor stands still until there is work.
const HALT: c_int = 0x20;
/// `CPU_INTERRUPT_EXITTB`: wakes the processor, and has no other effect.
const GO_ON: c_int = 0x04;
/// `enum qemu_plugin_cb_flags`: a callback's use of the processor's registers.
pub(super) const NO_REGISTERS: c_int = 0;
pub(super) const READS_REGISTERS: c_int = 1;
/// `QEMU_PLUGIN_MEM_RW`.
pub(super) const LOADS_AND_STORES: c_int = 3;
/// First address of the interrupt controller's region.
const NVIC_START: u32 = 0xe000_e000;
/// `MEMTXATTRS_UNSPECIFIED`.
const UNSPECIFIED: u64 = 1;
/// Priority of our regions, above QEMU's own devices, which are at 0.
pub(super) const PRIORITY: c_int = 10;

/// QEMU, as the overlay uses it.
pub(super) struct Qemu {
    pub(super) functions: &'static Functions,
    pub(super) address_space: Pointer,
    pub(super) timer: Pointer,
    /// Time for which the timer is set, by QEMU's clock. Setting the timer anew takes the processor's thread
    /// out of its work.
    pub(super) timer_at: AtomicI64,
    pub(super) interrupts: Vec<Pointer>,
    pub(super) nmi: Pointer,
    pub(super) systick: Pointer,
    pub(super) nvic: Pointer,
    /// `None` if QEMU does not export them: its main thread passes the time, and the run takes longer.
    pub(super) waits: Option<Waits>,
    /// Called in the processor's thread for [`Self::pass_wait`]. Must call [`Self::pass_time`].
    pub(super) on_wait: extern "C" fn(Pointer, Pointer),
    /// `None` if QEMU does not export them: loops that wait are not shortened.
    pub(super) processor: Option<ProcessorAccess>,
    /// SRAM, CCM and flash.
    pub(super) windows: Vec<Window>,
    pub(super) rest_timer: Pointer,
    pub(super) rest: IdleSchedule,
    pub(super) reset_requested: AtomicBool,
    pub(super) pace: Pace,
}

// SAFETY: the pointers are to QEMU's objects, which live as long as it does, and are used under its big lock.
unsafe impl Send for Qemu {}
// SAFETY: as above.
unsafe impl Sync for Qemu {}

impl Qemu {
    pub(super) fn now(&self) -> u64 {
        self.pace.time(self.own_now())
    }

    fn own_now(&self) -> u64 {
        // SAFETY: takes a clock's number.
        let ns = unsafe { (self.functions.qemu_clock_get_ns)(QEMU_CLOCK_VIRTUAL) };
        ns.max(0) as u64
    }

    /// Sets the processor's clock to `hclk` Hz, while QEMU's clock advances by `instruction_ns` with an
    /// instruction. Call [`Self::wake_at`] afterwards.
    pub(super) fn follow_clock(&self, hclk: u32, instruction_ns: u64) {
        self.pace.follow(hclk, instruction_ns, || self.own_now());
    }

    /// Requests a call of `Overlay::wake` at this time, in place of the time requested before.
    pub(super) fn wake_at(&self, ns: u64) {
        if self.reset_requested.load(Relaxed) {
            return;
        }
        let at = i64::try_from(self.pace.qemu_time(ns)).unwrap_or(i64::MAX);
        if self.timer_at.swap(at, Relaxed) != at {
            // SAFETY: the timer was initialised by `lay_over`.
            unsafe { (self.functions.timer_mod)(self.timer, at) }
        }
    }

    /// Marks the timer as not set: it has run out, or was stopped.
    pub(super) fn forget_timer(&self) {
        self.timer_at.store(NEVER, Relaxed);
    }

    pub(super) fn read_memory(&self, address: u32, bytes: &mut [u8]) {
        self.access(address, bytes.as_mut_ptr().cast(), bytes.len(), false);
    }

    pub(super) fn write_memory(&self, address: u32, bytes: &[u8]) {
        self.access(address, bytes.as_ptr().cast_mut().cast(), bytes.len(), true);
    }

    fn access(&self, address: u32, bytes: Pointer, length: usize, write: bool) {
        let (access, space, length) = (self.functions.address_space_rw, self.address_space, length as u64);
        // SAFETY: the buffer has this length, and is only read from when `write` is set.
        unsafe { access(space, address.into(), UNSPECIFIED, bytes, length, write) };
    }

    /// Writes memory of any kind, including flash.
    pub(super) fn poke(&self, address: u32, bytes: &[u8]) {
        let (write, space) = (self.functions.address_space_write_rom, self.address_space);
        let (bytes, length) = (bytes.as_ptr().cast(), bytes.len() as u64);
        // SAFETY: the buffer has this length and is only read.
        unsafe { write(space, address.into(), UNSPECIFIED, bytes, length) };
    }

    pub(super) fn set_interrupt(&self, number: usize, level: bool) {
        let line = match number {
            NMI => self.nmi,
            SYSTICK => self.systick,
            _ => self.interrupts[number],
        };
        // SAFETY: the line is an input of the NVIC, found by `lay_over`.
        unsafe { (self.functions.qemu_set_irq)(line, c_int::from(level)) }
    }

    /// Stops the processor until it is resumed, takes an interrupt, or is reset. While nothing runs, virtual
    /// time jumps to the next timer.
    pub(super) fn stall(&self, stalled: bool) {
        let request = if stalled { HALT } else { GO_ON };
        // SAFETY: processor 0 exists once the machine is made; the request is one of QEMU's.
        unsafe { (self.functions.cpu_interrupt)((self.functions.qemu_get_cpu)(0), request) }
        if stalled {
            self.pass_wait();
        }
    }

    /// Lets the processor's own thread pass the time, instead of QEMU's main thread, while the processor
    /// waits. Call this when the wait begins.
    pub(super) fn pass_wait(&self) {
        self.call_between_instructions(self.on_wait);
    }

    /// Has a function called in the processor's thread, between two instructions and with QEMU's big lock
    /// held. Returns `false` if this QEMU cannot do so.
    pub(super) fn call_between_instructions(&self, function: extern "C" fn(Pointer, Pointer)) -> bool {
        if let Some(waits) = &self.waits {
            // SAFETY: processor 0 exists once the machine is made.
            unsafe { (waits.async_run_on_cpu)((self.functions.qemu_get_cpu)(0), function, null_mut()) };
        }
        self.waits.is_some()
    }

    /// The processor's registers. Valid between two instructions.
    pub(super) fn registers_of_processor(&self) -> Option<Registers> {
        let access = self.processor.as_ref()?;
        let mut registers = Registers::default();
        // SAFETY: processor 0 exists once the machine is made. GLib's array is never freed, and a register of
        // 32 bits puts four bytes at its end.
        unsafe {
            let cpu = (self.functions.qemu_get_cpu)(0);
            let array = GUEST_REGISTERS.get_or_init(|| AtomicPtr::new((access.g_byte_array_new)()));
            let array = array.load(Relaxed);
            let word = |number: c_int| {
                (access.g_byte_array_set_size)(array, 0);
                let bytes = (access.arm_cpu_gdb_read_register)(cpu, array, number);
                (bytes == 4 && (*array).length == 4).then(|| (*array).data.cast::<u32>().read_unaligned())
            };
            for (number, register) in (0..).zip(&mut registers.r) {
                *register = word(number)?;
            }
            registers.xpsr = word(XPSR)?;
        }
        Some(registers)
    }

    pub(super) fn set_registers_of_processor(&self, registers: &Registers) {
        let Some(access) = &self.processor else { return };
        let words = (0..).zip(registers.r).chain([(XPSR, registers.xpsr)]);
        for (number, value) in words {
            let mut bytes = value.to_le_bytes();
            // SAFETY: as above; a register of 32 bits is taken from four bytes.
            unsafe {
                let cpu = (self.functions.qemu_get_cpu)(0);
                (access.arm_cpu_gdb_write_register)(cpu, bytes.as_mut_ptr(), number);
            }
        }
    }

    /// Sends the processor to the WFI at [`WAITS_AT`], from where it continues elsewhere.
    pub(super) fn send_to_wait(&self, registers: &Registers) {
        let mut r = registers.r;
        r[15] = WAITS_AT;
        // Out of any IT block.
        let xpsr = registers.xpsr & !0x0600_fc00;
        self.set_registers_of_processor(&Registers { r, xpsr });
    }

    /// Maps SRAM, CCM and flash into the host's memory.
    pub(super) fn map_windows(&mut self, chip: Chip) {
        for (range, writable) in [
            (chip.sram(), true),
            (chip.ccm(), true),
            (chip.flash_space(), false),
        ] {
            let mut start = range.start;
            // SRAM may consist of two pieces: QEMU's and ours.
            while start < range.end {
                let mut length = (range.end - start).into();
                let (map, space) = (self.functions.address_space_map, self.address_space);
                // SAFETY: takes an address space and a length, which it may make less; memory stays where it
                // is.
                let host = unsafe { map(space, start.into(), &raw mut length, writable, UNSPECIFIED) };
                if host.is_null() || length == 0 {
                    break;
                }
                let bytes = length as u32;
                self.windows.push(Window {
                    start,
                    bytes,
                    host: host.cast(),
                });
                start += bytes;
            }
        }
    }

    /// The part's RAM: first addresses and lengths.
    pub(super) fn ram(&self) -> impl Iterator<Item = (u32, u32)> {
        let ram = self.windows.iter().filter(|window| window.start != FLASH.start);
        ram.map(|window| (window.start, window.bytes))
    }

    /// The place of 1, 2 or 4 aligned bytes in the host's memory.
    fn in_window(&self, address: u32, bytes: u32) -> Option<*mut u8> {
        let within = |window: &&Window| address.wrapping_sub(window.start) <= window.bytes - bytes;
        let window = self.windows.iter().find(within)?;
        // SAFETY: the bytes lie in the window.
        Some(unsafe { window.host.add((address - window.start) as usize) })
    }

    /// Reads 1, 2 or 4 aligned bytes of memory without calling QEMU.
    pub(super) fn peek(&self, address: u32, bytes: u32) -> Option<u32> {
        let place = self.in_window(address, bytes)?;
        // SAFETY: the bytes are guest memory, which lives as long as QEMU, aligned as the address is. Only
        // this thread writes them meanwhile.
        Some(unsafe {
            match bytes {
                1 => place.read_volatile().into(),
                2 => place.cast::<u16>().read_volatile().into(),
                _ => place.cast::<u32>().read_volatile(),
            }
        })
    }

    /// Advances time from timer to timer until the processor has something to do, as QEMU's main thread
    /// would.
    pub(super) fn pass_time(&self) {
        let Some(waits) = &self.waits else { return };
        // SAFETY: as in QEMU's main loop. The last call returns `false` if no timer was due: then time stands
        // still.
        unsafe {
            while (waits.all_cpu_threads_idle)() {
                (waits.icount_start_warp_timer)();
                if !(waits.qemu_clock_run_timers)(QEMU_CLOCK_VIRTUAL) {
                    break;
                }
            }
        }
    }

    /// Lets the main thread rest. Call this in the callback of `rest_timer`.
    pub(super) fn rest(&self) {
        let Some(waits) = &self.waits else { return };
        // SAFETY: the thread holds the big lock in a timer, and may give it up there for a while. The timer
        // was initialised by `lay_over`.
        unsafe {
            let running = (waits.runstate_is_running)();
            if running {
                (waits.bql_unlock)();
                self.rest.take();
                (waits.bql_lock_impl)(c"stm32f405".as_ptr(), 0);
            }
            let soon = if running { LOOKS_AROUND_NS } else { RESTS_AGAIN_NS };
            let now = (self.functions.qemu_clock_get_ns)(QEMU_CLOCK_REALTIME);
            (self.functions.timer_mod)(self.rest_timer, now + soon);
        }
    }

    pub(super) fn request_shutdown(&self) {
        self.rest.need(true);
        // SAFETY: takes a cause.
        unsafe { (self.functions.qemu_system_shutdown_request)(SHUTDOWN_CAUSE_GUEST_SHUTDOWN) }
    }

    /// Requests a reset. It comes a little later, from another thread, and until then no timer may be set:
    /// the processor is stopped, so virtual time might jump to that timer, depending on which thread runs
    /// first.
    pub(super) fn request_reset(&self) {
        self.reset_requested.store(true, Relaxed);
        self.rest.need(true);
        self.forget_timer();
        // SAFETY: the timer was initialised by `lay_over`; the other takes a cause.
        unsafe {
            (self.functions.timer_del)(self.timer);
            (self.functions.qemu_system_reset_request)(SHUTDOWN_CAUSE_GUEST_RESET);
        }
    }

    /// Reads 1, 2 or 4 bytes of the interrupt controller's own registers, below any region that covers them.
    pub(super) fn read_nvic(&self, address: u32, bytes: u32) -> u64 {
        let mut value = 0;
        let (offset, size) = (u64::from(address - NVIC_START), bytes.trailing_zeros() as c_int);
        let read = self.functions.memory_region_dispatch_read;
        // SAFETY: the region is the controller's, found by `lay_over`; the size is given by its logarithm.
        unsafe { read(self.nvic, offset, &raw mut value, size, UNSPECIFIED) };
        value
    }

    pub(super) fn write_nvic(&self, address: u32, value: u64, bytes: u32) {
        let (offset, size) = (u64::from(address - NVIC_START), bytes.trailing_zeros() as c_int);
        let write = self.functions.memory_region_dispatch_write;
        // SAFETY: as above.
        unsafe { write(self.nvic, offset, value, size, UNSPECIFIED) };
    }

    /// The Thumb instruction at an address: a halfword, or two with the first in the low half.
    pub(super) fn instruction(&self, address: u32) -> u32 {
        let mut bytes = [0; 4];
        self.read_memory(address, &mut bytes);
        let word = u32::from_le_bytes(bytes);
        // 11101, 11110 and 11111 begin a wide instruction.
        let is_wide = word >> 11 & 0x1f >= 0b11101;
        if is_wide { word } else { word & 0xffff }
    }

    /// The processor's registers, as QEMU prints them: `R13=20010000` and so on, and `XPSR=`.
    pub(super) fn registers(&self) -> String {
        let (mut text, mut length) = (std::ptr::null_mut::<c_char>(), 0);
        // SAFETY: the stream is closed before its text is read, which then has this length and is freed once;
        // processor 0 exists once the machine is made.
        unsafe {
            let stream = libc::open_memstream(&raw mut text, &raw mut length);
            if stream.is_null() {
                return String::new();
            }
            (self.functions.cpu_dump_state)((self.functions.qemu_get_cpu)(0), stream, 0);
            libc::fclose(stream);
            let said = std::slice::from_raw_parts(text.cast::<u8>(), length);
            let said = String::from_utf8_lossy(said).into_owned();
            libc::free(text.cast());
            said
        }
    }

    /// Makes [`log_moved`] watch a word of RAM: the write offset of the image's log.
    pub(super) fn watch_log(&self, address: u32) {
        let mut length = 4;
        let (map, space) = (self.functions.address_space_map, self.address_space);
        // SAFETY: takes an address space and a length, which it may make less; RAM stays where it is.
        let word = unsafe { map(space, address.into(), &raw mut length, true, UNSPECIFIED) };
        if length == 4 {
            LOG_OFFSET.store(word.cast(), Relaxed);
        }
    }

    /// Reads a word as the processor sees it, including its private peripherals.
    pub(super) fn processor_word(&self, address: u32) -> u32 {
        let (f, mut word) = (&self.functions, 0u32);
        // SAFETY: processor 0 exists once the machine is made; the buffer is a word.
        unsafe {
            let cpu = (f.qemu_get_cpu)(0);
            (f.cpu_memory_rw_debug)(cpu, address.into(), (&raw mut word).cast(), 4, false);
        }
        word
    }
}

/// Address of the overlay's own WFI, in a page where the part has nothing. QEMU passes time only while the
/// processor waits, and the processor waits only in an instruction.
pub(super) const WAITS_AT: u32 = 0x1ffe_f000;
/// The WFI, and a branch back to it.
pub(super) const WAITS: [u8; 4] = [0x30, 0xbf, 0xfd, 0xe7];

/// Number of xPSR in the register list of a debugger.
const XPSR: c_int = 25;
/// GLib's array for [`Qemu::registers_of_processor`].
static GUEST_REGISTERS: OnceLock<AtomicPtr<ByteArray>> = OnceLock::new();

/// The write offset of the log, in guest memory, and its value when the log was last read.
static LOG_OFFSET: AtomicPtr<AtomicU32> = AtomicPtr::new(std::ptr::null_mut());
pub(super) static LOG_SEEN: AtomicU32 = AtomicU32::new(0);
/// Address of the block of instructions begun last.
static LAST_BLOCK: AtomicU32 = AtomicU32::new(0);
/// Address of the block before that.
static BLOCK_BEFORE: AtomicU32 = AtomicU32::new(0);

/// Records the start of a block. Returns the write offset of the log if the image has moved it.
pub(super) fn log_moved(block: u32) -> Option<u32> {
    // Only the processor's thread writes here.
    if block == WAITS_AT {
        return None;
    }
    BLOCK_BEFORE.store(LAST_BLOCK.load(Relaxed), Relaxed);
    LAST_BLOCK.store(block, Relaxed);
    let word = LOG_OFFSET.load(Relaxed);
    // SAFETY: null, or a word of guest RAM, which lives as long as QEMU.
    let offset = unsafe { word.as_ref() }?.load(Relaxed);
    (offset != LOG_SEEN.load(Relaxed)).then_some(offset)
}

/// True if WFE was executed.
pub(super) static WAITED_FOR_EVENT: AtomicBool = AtomicBool::new(false);

/// Returns the address of the block begun last.
pub(super) fn last_block() -> Option<u32> {
    Some(LAST_BLOCK.load(Relaxed)).filter(|address| *address != 0)
}

/// Returns `true` if the block at this address was begun twice in a row.
pub(super) fn repeats(block: u32) -> bool {
    [&LAST_BLOCK, &BLOCK_BEFORE].map(|of| of.load(Relaxed)) == [block; 2]
}

/// Has the function called when QEMU aborts itself.
pub(super) fn on_signal_of_abort(function: extern "C" fn(c_int)) {
    // SAFETY: the function is of the type of a handler. It is called in the thread that aborts, outside of
    // any other code that a signal interrupts.
    unsafe { libc::signal(libc::SIGABRT, function as *const () as libc::sighandler_t) };
}

/// Takes over the process's standard input and output, which lead to the host. The image gets others by
/// semihosting: nothing to read, and a file to write to, or nothing.
pub(super) fn take_standard_streams(output: Option<&Path>) -> std::io::Result<(File, File)> {
    let nothing = OpenOptions::new().read(true).write(true).open("/dev/null")?;
    let output = output.map(|path| OpenOptions::new().create(true).append(true).open(path));
    let output = output.transpose()?;
    let output = output.as_ref().unwrap_or(&nothing);
    // SAFETY: the first two calls make descriptors that nobody else has; the others replace those of the
    // process by open ones.
    unsafe {
        let taken = [libc::STDIN_FILENO, libc::STDOUT_FILENO]
            .map(|stream| libc::fcntl(stream, libc::F_DUPFD_CLOEXEC, 3));
        if taken.contains(&-1) {
            return Err(std::io::Error::last_os_error());
        }
        libc::dup2(nothing.as_raw_fd(), libc::STDIN_FILENO);
        libc::dup2(output.as_raw_fd(), libc::STDOUT_FILENO);
        let [from, to] = taken.map(|stream| File::from_raw_fd(stream));
        Ok((from, to))
    }
}

/// Blocks all signals in this thread: QEMU handles them in its own.
pub(super) fn take_no_signals() {
    // SAFETY: the set is filled before it is used.
    unsafe {
        let mut all = std::mem::zeroed();
        libc::sigfillset(&raw mut all);
        libc::pthread_sigmask(libc::SIG_SETMASK, &raw const all, null_mut());
    }
}

/// Ends QEMU at once. Its clean-up would wait for threads that hold our lock.
pub(super) fn exit(status: c_int, line: &str) -> ! {
    say(line);
    leave(status)
}

pub(super) fn leave(status: c_int) -> ! {
    // SAFETY: ends the process.
    unsafe { libc::_exit(status) }
}

/// Finds an exported symbol of the process. The error is its name. The name given ends with a zero.
pub(super) fn symbol(name: &'static str) -> Result<Pointer, &'static str> {
    // SAFETY: the name is terminated.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr().cast()) };
    (!found.is_null())
        .then_some(found)
        .ok_or(name.trim_end_matches('\0'))
}

/// Allocates zeroed space for one of QEMU's structures, never freed.
pub(super) fn room() -> Pointer {
    Box::leak(Box::new([0u128; 256])).as_mut_ptr().cast()
}

pub(super) fn say(line: &str) {
    eprintln!("{LINE_PREFIX}{line}");
}

/// An interrupt line for the self-test. QEMU's controller has 96 lines and the device 82, so firmware cannot
/// enable this one.
pub(super) const SPARE_LINE: usize = 95;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_that_branches_to_itself_is_seen_to_repeat() {
        let begin = |block| {
            log_moved(block);
            repeats(0x0800_0100)
        };
        let repeats = [0x200, 0x100, 0x100, 0x200, 0x100].map(|block| begin(0x0800_0000 + block));
        assert_eq!(repeats, [false, false, true, false, false]);
    }
}
