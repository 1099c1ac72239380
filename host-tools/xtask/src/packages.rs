//! Which packages of the workspace belong together.

/// The host's packages that the demo needs. The figures, which bring a third of all that is compiled, are
/// none of them.
pub(crate) const DEMO: &str = "-p bead -p stm32f405-qemu";

/// All but what is built for the part, and but the benchmark, which brings other solvers.
pub(crate) const HOST: &str =
    "--workspace --exclude bead-firmware --exclude stm32f405-qemu-images --exclude hertz-benchmarks";

/// The flash image, as cargo builds it.
pub(crate) const IMAGE: &str = "--profile firmware --target thumbv7em-none-eabihf -p bead-firmware";

/// The images of the emulator's own tests.
pub(crate) const IMAGES: &str = "--profile firmware --target thumbv7em-none-eabihf -p stm32f405-qemu-images";
