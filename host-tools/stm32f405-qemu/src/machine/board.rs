//! Services that a machine needs from outside.

use crate::device::{BusAnswer, BusCall};

/// Interrupt lines of the STM32F405 (RM0090 table 61).
pub const INTERRUPTS: usize = 82;

/// The number that stands for the processor's NMI input, after those of the interrupt lines.
pub const NMI: usize = INTERRUPTS;

/// The number that stands for the processor's SysTick exception. It is not a level: each rise is an
/// exception.
pub const SYSTICK: usize = INTERRUPTS + 1;

/// Services that a machine needs from outside.
pub trait Exterior {
    /// Reads SRAM or flash.
    fn read_memory(&mut self, address: u32, bytes: &mut [u8]);
    /// Writes SRAM.
    fn write_memory(&mut self, address: u32, bytes: &[u8]);
    /// Writes flash behind the processor's back, until the next reset.
    fn overwrite_flash(&mut self, address: u32, bytes: &[u8]);
    /// The firmware changed the contents of `WRITABLE`.
    fn flash_changed(&mut self, address: u32, bytes: &[u8]);
    /// The processor stands still from now on, or goes on: flash cannot be read while it is written.
    fn stall(&mut self, stalled: bool);
    /// The power was off: RAM loses what it held.
    fn lose_memory(&mut self);
    /// An interrupt line of the NVIC, [`NMI`] or [`SYSTICK`], changed its level.
    fn set_interrupt(&mut self, number: usize, level: bool);
    /// A frame of 7 to 9 data bits left a transmitter at this time: USART1 is 0, USART6 is 5.
    fn sent(&mut self, usart: usize, data: u16, at: u64);
    /// Asks a device at a bus. Virtual time stands still until it answers.
    fn ask(&mut self, call: BusCall) -> BusAnswer;
    /// The DMA stream of the sampling converter filled a part of its buffer that it interrupts for. `scans`
    /// were started since the last part, 0 if the interrupt of that part is not served yet.
    fn acquired(&mut self, scans: u64);
    /// The watchdog ran out, or the power went. Reset the processor, and call `Machine::reset` when that
    /// happens.
    fn reset_wanted(&mut self);
}
