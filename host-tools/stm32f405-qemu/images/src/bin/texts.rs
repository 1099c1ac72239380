//! Logs text instead of defmt, though it has defmt too, and waits for the host whenever the buffer is full.
#![no_std]
#![no_main]

use stm32f405_qemu_images::{done, read, write};

#[allow(
    unsafe_code,
    reason = "the control block is defmt-rtt's, by the name that probes look for"
)]
unsafe extern "C" {
    static _SEGGER_RTT: [u32; 12];
}

#[cortex_m_rt::entry]
fn main() -> ! {
    for number in 0..200u8 {
        let digits = [100, 10, 1].map(|unit| b'0' + number / unit % 10);
        say(b"a line of text, number ");
        say(&digits);
        say(b"\n");
    }
    done();
}

/// Writes to up-channel 0: buffer, size, write and read offset are words 7 to 10 of the control block.
fn say(text: &[u8]) {
    let block = (&raw const _SEGGER_RTT).expose_provenance();
    let [buffer, size, write_at, read_at] = [7, 8, 9, 10].map(|word| block + 4 * word);
    for byte in text {
        let at = read(write_at);
        let next = (at + 1) % read(size);
        while read(read_at) == next {}
        put(read(buffer) as usize + at as usize, *byte);
        write(write_at, next);
    }
}

#[allow(unsafe_code, reason = "the buffer is the host's to read")]
fn put(address: usize, byte: u8) {
    // SAFETY: within the buffer of the channel, which nothing else uses here.
    unsafe { core::ptr::with_exposed_provenance_mut::<u8>(address).write_volatile(byte) }
}
