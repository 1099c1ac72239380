//! Groups of packages of the workspace.

/// The host's packages that the demo needs. The figures are not among them, since they bring a third of all
/// that is compiled.
pub(crate) const DEMO: &str = "-p absorber-bead -p stm32f405-qemu";

/// All programs of the host.
pub(crate) const PROGRAMS: &str = "-p absorber-bead -p stm32f405-qemu -p bead-figures";

/// All packages except those built for the part, the benchmark, which brings other solvers, and the Python
/// package, which `cargo xtask wheel` builds.
pub(crate) const HOST: &str = "--workspace --exclude bead-firmware --exclude bead-loader --exclude stm32f405-qemu-images --exclude stm32f405-qemu-cases \
    --exclude hertz-benchmarks --exclude hertz-chain-python";

/// The packages that others can use, for crates.io: each may depend on those before it.
pub(crate) const PUBLISHED: &str = "-p bead-crc -p hertz-chain -p stm32f405-qemu -p bead-model -p bead-wire \
    -p bead-store -p bead-update -p hertz-charts -p hertz-figures -p hertz-sweep -p bead-tables -p bead-recording -p bead-line -p bead-monitor \
    -p bead-instrument -p bead-compare -p bead-spectra -p bead-logbook -p bead-limits -p bead-calibrate -p bead-identify \
    -p bead-bench -p bead-console -p hertz-commands -p absorber-bead";

/// The flash image, as cargo builds it.
pub(crate) const IMAGE: &str = "--profile firmware --target thumbv7em-none-eabihf -p bead-firmware";

/// The images of the emulator's own tests.
pub(crate) const IMAGES: &str = "--profile firmware --target thumbv7em-none-eabihf -p stm32f405-qemu-images";

/// The test cases that the emulator's runner runs.
pub(crate) const CASES: &str =
    "--profile firmware --target thumbv7em-none-eabihf -p stm32f405-qemu-cases --tests";

/// Those of the images that use embassy. The others would miss the vectors that its device brings.
pub(crate) const ON_EMBASSY: &str = "--features embassy --bin default-time-driver --bin ports --bin converters \
                                     --bin buses --bin clocks --bin storms";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_images_on_embassy_are_those_that_ask_for_it() {
        let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../stm32f405-qemu/images/Cargo.toml");
        let manifest = std::fs::read_to_string(manifest).unwrap();
        let programs = manifest.split("[[bin]]\nname = \"").skip(1);
        let mut asked = "--features embassy".to_owned();
        for program in programs.filter(|program| program.contains("required-features = [\"embassy\"]")) {
            asked += &format!(" --bin {}", program.split('"').next().unwrap());
        }
        assert_eq!(asked, ON_EMBASSY);
    }
}
