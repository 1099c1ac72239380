//! Publishes the path of the overlay: this crate as a shared object. Programs include it (`carry_overlay!`).

use std::env;
use std::fs::OpenOptions;
use std::path::PathBuf;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    // PROFILE/build/CRATE-HASH/out
    let profile = out
        .ancestors()
        .nth(3)
        .expect("OUT_DIR lies in the target directory");
    let name = format!(
        "{}stm32f405_qemu{}",
        env::consts::DLL_PREFIX,
        env::consts::DLL_SUFFIX
    );
    let built = profile.join("deps").join(name);
    // A check builds no shared object, but a program that includes it must compile. An existing file stays.
    let _ = OpenOptions::new().write(true).create_new(true).open(&built);
    println!("cargo::rustc-env=STM32F405_QEMU_BUILT={}", built.display());
    // For the build scripts of what depends on this crate: DEP_STM32F405_QEMU_BUILT.
    println!("cargo::metadata=BUILT={}", built.display());
}
