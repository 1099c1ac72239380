//! Passes on where the emulator's overlay is built, so that `bead` can carry it.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let built = std::env::var("DEP_STM32F405_QEMU_BUILT").expect("the emulator's build script says it");
    println!("cargo::rustc-env=STM32F405_QEMU_BUILT={built}");
}
