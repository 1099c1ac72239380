//! Says something to the host by semihosting, and ends itself with a status.
#![no_std]
#![no_main]

use core::arch::asm;

use stm32f405_qemu_images as _;

const SYS_WRITE0: usize = 0x04;
const SYS_EXIT_EXTENDED: usize = 0x20;
/// ADP_Stopped_ApplicationExit: the status that follows is the program's.
const APPLICATION_EXIT: usize = 0x2_0026;

#[cortex_m_rt::entry]
fn main() -> ! {
    call(SYS_WRITE0, c"hello, host\n".as_ptr().expose_provenance());
    let status = [APPLICATION_EXIT, 7];
    call(SYS_EXIT_EXTENDED, status.as_ptr().expose_provenance());
    panic!("the host let it go on");
}

#[allow(unsafe_code, reason = "a call to the host is an instruction")]
fn call(operation: usize, argument: usize) {
    // SAFETY: the host reads what the argument points to, and changes no memory.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => _, in("r1") argument) }
}
