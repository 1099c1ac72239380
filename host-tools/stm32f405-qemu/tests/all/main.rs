//! Tests of the emulator, one program.

mod cases;
mod chips;
mod ci;
mod cycles;
mod images;
mod machine;
mod qemu;
mod registers;
