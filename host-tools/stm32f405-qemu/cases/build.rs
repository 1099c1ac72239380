//! Passes the linker its scripts. It runs in the workspace's root and uses the `memory.x` there.

fn main() {
    // The macros of embedded-test require it.
    println!("cargo::rustc-check-cfg=cfg(rust_analyzer)");
    println!("cargo::rerun-if-changed=../../../memory.x");
    if std::env::var("TARGET").is_ok_and(|target| target.starts_with("thumb")) {
        println!("cargo::rustc-link-arg-tests=--defsym=_at_reset=1");
        for script in ["link.x", "defmt.x", "embedded-test.x"] {
            println!("cargo::rustc-link-arg-tests=-T{script}");
        }
    }
}
