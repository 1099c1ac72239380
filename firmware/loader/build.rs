//! Hands the linker its scripts. It runs in the workspace's root and takes the `memory.x` there, in which a
//! program that starts at a reset has a different flash region from the bead.

fn main() {
    println!("cargo::rerun-if-changed=../../memory.x");
    if std::env::var("TARGET").is_ok_and(|target| target.starts_with("thumb")) {
        println!("cargo::rustc-link-arg-bins=--defsym=_at_reset=1");
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
    }
}
