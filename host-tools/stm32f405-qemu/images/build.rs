//! Hands the linker its scripts.

use std::path::PathBuf;
use std::{env, fs};

/// The whole part: 1 MiB of flash, 128 KiB of SRAM (RM0090 section 2.3).
const MEMORY: &str = "MEMORY
{
  FLASH : ORIGIN = 0x08000000, LENGTH = 1024K
  RAM   : ORIGIN = 0x20000000, LENGTH = 128K
}
";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    if env::var("TARGET").is_ok_and(|target| target.starts_with("thumb")) {
        fs::write(out.join("memory.x"), MEMORY).expect("cargo made OUT_DIR");
        println!("cargo::rustc-link-search={}", out.display());
        for script in ["link.x", "defmt.x"] {
            println!("cargo::rustc-link-arg-bins=-T{script}");
        }
    }
}
