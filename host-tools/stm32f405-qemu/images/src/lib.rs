//! Code that the images share: registers by address, a log, and an end.
//!
//! # Design
//!
//! Each image shows one thing that firmware does and that an emulator may get wrong. It logs its
//! observations, and ends with a breakpoint. The tests on the host check them. The images use no peripheral
//! crate: they access registers by address.
//!
//! To add one, put a file in `src/bin/`. One that uses embassy also gets its `[[bin]]` in `Cargo.toml`, and
//! its name in the list of `tests/all/images.rs`, which builds them.
#![no_std]

use core::panic::PanicInfo;

use defmt_rtt as _;

/// The RCC's registers.
pub const RCC: usize = 0x4002_3800;
/// RCC_AHB1ENR, the clocks of the ports.
pub const AHB1ENR: usize = RCC + 0x30;
/// RCC_APB1ENR.
pub const APB1ENR: usize = RCC + 0x40;
/// RCC_APB2ENR.
pub const APB2ENR: usize = RCC + 0x44;
/// The set-enable registers of the interrupt controller.
pub const NVIC_ISER: usize = 0xe000_e100;

/// Reads a register.
#[allow(
    unsafe_code,
    reason = "registers and memory by address are what the images are about"
)]
pub fn read(address: usize) -> u32 {
    // SAFETY: a word that exists, or a bus fault, which is then what the image shows.
    unsafe { core::ptr::with_exposed_provenance::<u32>(address).read_volatile() }
}

/// Writes a register.
#[allow(unsafe_code, reason = "as above")]
pub fn write(address: usize, value: u32) {
    // SAFETY: as above; no image writes over memory that Rust uses.
    unsafe { core::ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(value) }
}

/// Changes bits of a register.
pub fn modify(address: usize, change: impl FnOnce(u32) -> u32) {
    write(address, change(read(address)));
}

/// Enables an interrupt.
pub fn enable_interrupt(number: usize) {
    write(NVIC_ISER + number / 32 * 4, 1 << (number % 32));
}

/// Ends an image that passes.
pub fn done() -> ! {
    cortex_m::asm::bkpt();
    loop {
        cortex_m::asm::nop();
    }
}

/// Logs the panic, and stays in a loop, as most panic handlers do.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    loop {
        cortex_m::asm::nop();
    }
}
