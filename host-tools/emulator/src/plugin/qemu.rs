//! What the plugin calls in QEMU.
//!
//! # Design
//!
//! QEMU's own functions are looked up by name when the plugin is loaded. They are not linked, so this crate
//! links into host programs, and a QEMU that does not export them gets a clear line. They are QEMU's internal
//! interface. Debian's and Ubuntu's builds export them. As used here they are the same in 7.2.22, 10.0.2 and
//! 11.1.3, which were tried. The self-test tries each effect that the overlay rests on.
//!
//! # Safety
//!
//! The overlay never looks into QEMU's structures. It gives them room ([`room`]) that is larger than in any
//! known version, and QEMU fills it in. The two exceptions are small structures that a caller fills in,
//! [`Ops`] and [`Notifier`]. Every call is made with QEMU's big lock held.
#![allow(unsafe_code)]

use std::ffi::{c_char, c_int, c_void};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use crate::exchange::LINE_PREFIX;
use crate::machine::{INTERRUPTS, NMI};

const _: () = assert!(SPARE_LINE >= INTERRUPTS);

pub(super) type Pointer = *mut c_void;

/// Declares QEMU's functions as fields that are filled in by name.
macro_rules! functions {
    ($($name:ident: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        pub(super) struct Functions { $(pub(super) $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)* }

        impl Functions {
            /// The error is the name that QEMU does not export.
            pub(super) fn find() -> Result<Self, &'static str> {
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
    qdev_get_gpio_in_named: fn(Pointer, *const c_char, c_int) -> Pointer;
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
    pub(super) accepts: usize,
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

pub(super) const DEVICE_LITTLE_ENDIAN: c_int = 2;
pub(super) const QEMU_CLOCK_VIRTUAL: c_int = 1;
pub(super) const SCALE_NS: c_int = 1;
const SHUTDOWN_CAUSE_GUEST_SHUTDOWN: c_int = 6;
const SHUTDOWN_CAUSE_GUEST_RESET: c_int = 7;
/// `CPU_INTERRUPT_HALT`: the processor stands still until there is work.
const HALT: c_int = 0x20;
/// `CPU_INTERRUPT_EXITTB`: wakes the processor, and has no other effect.
const GO_ON: c_int = 0x04;
/// `MEMTXATTRS_UNSPECIFIED`.
const UNSPECIFIED: u64 = 1;
/// Above QEMU's own devices, which are at 0.
pub(super) const PRIORITY: c_int = 10;

/// QEMU, as the overlay uses it.
pub(super) struct Qemu {
    pub(super) functions: &'static Functions,
    pub(super) address_space: Pointer,
    pub(super) timer: Pointer,
    pub(super) interrupts: Vec<Pointer>,
    pub(super) nmi: Pointer,
    pub(super) reset_requested: AtomicBool,
}

// SAFETY: the pointers are to objects of QEMU's that live as long as it does, used under its big lock.
unsafe impl Send for Qemu {}
// SAFETY: as above.
unsafe impl Sync for Qemu {}

impl Qemu {
    /// Virtual time in ns since power-up.
    pub(super) fn now(&self) -> u64 {
        // SAFETY: takes a clock's number.
        let ns = unsafe { (self.functions.qemu_clock_get_ns)(QEMU_CLOCK_VIRTUAL) };
        ns.max(0) as u64
    }

    /// Calls `Overlay::wake` at this time, and not at the time asked for before.
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

    /// Writes memory of any kind, also flash.
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
        let line = if number == NMI {
            self.nmi
        } else {
            self.interrupts[number]
        };
        // SAFETY: the line is an input of the NVIC, found by `lay_over`.
        unsafe { (self.functions.qemu_set_irq)(line, c_int::from(level)) }
    }

    /// Stops the processor until it is told to go on, an interrupt that it takes, or a reset. While nothing
    /// runs, virtual time goes straight to the next timer.
    pub(super) fn stall(&self, stalled: bool) {
        let request = if stalled { HALT } else { GO_ON };
        // SAFETY: processor 0 exists once the machine is made; the request is one of QEMU's.
        unsafe { (self.functions.cpu_interrupt)((self.functions.qemu_get_cpu)(0), request) }
    }

    pub(super) fn request_shutdown(&self) {
        // SAFETY: takes a cause.
        unsafe { (self.functions.qemu_system_shutdown_request)(SHUTDOWN_CAUSE_GUEST_SHUTDOWN) }
    }

    /// The reset comes a little later, from another thread. Until then no timer may be set. The processor is
    /// stopped, so virtual time could jump to the timer or not, depending on which thread runs first.
    pub(super) fn request_reset(&self) {
        self.reset_requested.store(true, Relaxed);
        // SAFETY: the timer was initialised by `lay_over`; the other takes a cause.
        unsafe {
            (self.functions.timer_del)(self.timer);
            (self.functions.qemu_system_reset_request)(SHUTDOWN_CAUSE_GUEST_RESET);
        }
    }

    /// Reads a word as the processor sees it, also of its private peripherals.
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

/// Ends QEMU at once. Its clean-up would wait for threads that hold our lock.
pub(super) fn exit(status: c_int, line: &str) -> ! {
    say(line);
    // SAFETY: ends the process.
    unsafe { libc::_exit(status) }
}

/// An exported symbol of the process. The error is its name. The name given ends with a zero.
pub(super) fn symbol(name: &'static str) -> Result<Pointer, &'static str> {
    // SAFETY: the name is terminated.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr().cast()) };
    if found.is_null() {
        Err(name.trim_end_matches('\0'))
    } else {
        Ok(found)
    }
}

/// Zeroed room for a structure of QEMU's, never freed.
pub(super) fn room() -> Pointer {
    Box::leak(Box::new([0u128; 256])).as_mut_ptr().cast()
}

pub(super) fn say(line: &str) {
    eprintln!("{LINE_PREFIX}{line}");
}

/// An interrupt line for the self-test. QEMU's controller has 96 lines and the device 82: firmware cannot
/// enable this one.
pub(super) const SPARE_LINE: usize = 95;
