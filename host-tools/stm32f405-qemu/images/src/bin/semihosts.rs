//! Prints to the host by semihosting, and exits with a status.
#![no_std]
#![no_main]

use core::arch::asm;

use stm32f405_qemu_images as _;

const SYS_WRITE0: usize = 0x04;
const SYS_OPEN: usize = 0x01;
const SYS_WRITE: usize = 0x05;
const SYS_GET_CMDLINE: usize = 0x15;
/// The mode of SYS_OPEN that is standard output for the name `:tt`.
const WRITE_TRUNCATE: usize = 4;
const SYS_EXIT_EXTENDED: usize = 0x20;
/// ADP_Stopped_ApplicationExit: the status that follows is the program's.
const APPLICATION_EXIT: usize = 0x2_0026;

#[cortex_m_rt::entry]
fn main() -> ! {
    call(SYS_WRITE0, c"hello, host\n".as_ptr().expose_provenance());
    // As `hprintln!` does it.
    let [name, text] = [c":tt".to_bytes(), b"hello, standard output\n"];
    let address = |bytes: &[u8]| bytes.as_ptr().expose_provenance();
    let output = call(
        SYS_OPEN,
        [address(name), WRITE_TRUNCATE, name.len()]
            .as_ptr()
            .expose_provenance(),
    );
    call(
        SYS_WRITE,
        [output, address(text), text.len()].as_ptr().expose_provenance(),
    );
    let mut words = [0u8; 64];
    let line = [words.as_mut_ptr().expose_provenance(), words.len()];
    call(SYS_GET_CMDLINE, line.as_ptr().expose_provenance());
    words[words.len() - 1] = 0;
    call(SYS_WRITE0, address(&words));
    call(SYS_WRITE0, c"\n".as_ptr().expose_provenance());
    let status = [APPLICATION_EXIT, 7];
    call(SYS_EXIT_EXTENDED, status.as_ptr().expose_provenance());
    panic!("the host let it go on");
}

#[allow(unsafe_code, reason = "a call to the host is an instruction")]
fn call(operation: usize, argument: usize) -> usize {
    let answer;
    // SAFETY: the host reads and writes what the argument points to.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => answer, in("r1") argument) }
    answer
}
