//! Tests of the emulator, one program.

mod images;
mod machine;
mod qemu;
mod registers;
