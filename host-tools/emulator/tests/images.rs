//! Images in Rust (`images/`), built here for the part and run whole: what they do, how they end, and how the
//! run says so.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;
use std::time::Instant;

use stm32f405_qemu::{End, Outcome, Run, RunError};

/// Where the images are built, once for all tests. With the image's own profile, so that what both need is
/// compiled once.
fn image(name: &str) -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let folder = BUILT.get_or_init(|| {
        let workspace = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
        let target = "thumbv7em-none-eabihf";
        // The others would miss the vectors that embassy's device brings.
        for what in [
            &["--bins"][..],
            &["--features", "embassy", "--bin", "default-time-driver"],
        ] {
            let built = Command::new(env!("CARGO"))
                .current_dir(&workspace)
                .args([
                    "build",
                    "--quiet",
                    "-p",
                    "stm32f405-qemu-images",
                    "--profile",
                    "firmware",
                ])
                .args(["--target", target])
                .args(what)
                .status()
                .unwrap();
            assert!(
                built.success(),
                "the images do not build; is the target {target} installed?"
            );
        }
        let folder = std::env::var_os("CARGO_TARGET_DIR").map_or(workspace.join("target"), PathBuf::from);
        folder.join(target).join("firmware")
    });
    folder.join(name)
}

fn run_of(name: &str) -> Run {
    let mut run = Run::new(image(name));
    run.count_instructions = false;
    run
}

/// The run of an image, which has to end in ten seconds of real time.
fn result(run: &Run) -> Result<Outcome, RunError> {
    let began = Instant::now();
    let result = run.execute();
    assert!(began.elapsed().as_secs() < 10, "it took {:?}", began.elapsed());
    result
}

fn lines(outcome: &Outcome) -> Vec<&str> {
    outcome.log.iter().map(|line| line.text.as_str()).collect()
}

#[test]
fn an_image_on_embassys_default_time_driver_comes_through() {
    let outcome = result(&run_of("default-time-driver")).unwrap();
    assert_eq!(outcome.verdict(), Ok(()), "{:?}", lines(&outcome));
    assert_eq!(lines(&outcome), ["50 ms for 5 times 10 ms"]);
    assert!(matches!(outcome.end, End::Breakpoint(_)), "{:?}", outcome.end);
    assert_eq!(outcome.pins.iter().map(|pin| pin.edges).sum::<u64>(), 5);
}

#[test]
fn an_image_that_panics_ends_with_its_words() {
    let outcome = result(&run_of("panics")).unwrap();
    assert_eq!(outcome.end, End::Panicked);
    assert_eq!(outcome.panics.len(), 1);
    let said = outcome.verdict().unwrap_err();
    assert!(said.contains("panicked at 0.00"), "{said}");
    assert!(said.ends_with("the answer is 42"), "{said}");
    assert!(outcome.virtual_ns < 100_000_000, "{}", outcome.virtual_ns);
}

#[test]
fn an_image_that_faults_ends_with_where_and_why() {
    let outcome = result(&run_of("faults")).unwrap();
    assert_eq!(outcome.end, End::Faulted);
    assert_eq!(lines(&outcome), ["looking"]);
    let [fault] = &outcome.exceptions[..] else {
        panic!("{:?}", outcome.exceptions)
    };
    assert_eq!(
        (fault.number, fault.cfsr, fault.address),
        (3, 0x8200, Some(0xb000_0000))
    );
    let function = fault.pc.as_ref().unwrap().function.as_deref();
    assert!(
        function.is_some_and(|name| name.ends_with("look_at")),
        "{function:?}"
    );
    assert!(fault.lr.is_some());
    let said = outcome.verdict().unwrap_err();
    assert!(
        said.contains("no memory at the data's address, 0xb0000000; PC 0x08"),
        "{said}"
    );
}

#[test]
fn an_image_that_waits_for_a_missing_peripheral_is_stopped_with_its_register() {
    let error = result(&run_of("polls")).unwrap_err();
    let said = error.to_string();
    assert!(matches!(error, RunError::Stuck(_)), "{said}");
    assert!(said.contains("wait_for_number"), "{said}");
    assert!(said.contains("busy with RNG_SR"), "{said}");
    let outcome = error.outcome().unwrap();
    assert_eq!(lines(outcome), ["waiting for a random number"]);
    assert_eq!(outcome.end, End::Stuck("RNG_SR".into()));
}

#[test]
fn a_log_without_a_pause_is_whole() {
    for count_instructions in [false, true] {
        let mut run = run_of("logs");
        run.count_instructions = count_instructions;
        let outcome = result(&run).unwrap();
        assert_eq!(outcome.log.len(), 1000);
        assert_eq!(outcome.log.last().unwrap().text, "line 999");
        assert_eq!(outcome.verdict(), Ok(()));
    }
}

#[test]
fn the_processors_own_registers_are_as_the_part_has_them() {
    let outcome = result(&run_of("core-registers")).unwrap();
    assert_eq!(
        lines(&outcome),
        [
            // Four bits each; SHPR3 has no debug monitor's and no reserved byte.
            "priorities 0xf0100000",
            "priorities 0xf0100000",
            "pending 0x0",
            "cycles without TRCENA: false",
            "cycles with TRCENA: true",
            "SysTick as fast as CYCCNT: true",
            "trace port ready: false",
        ]
    );
    let unknown: Vec<_> = outcome
        .unknown_registers
        .iter()
        .map(|register| register.name.as_str())
        .collect();
    assert_eq!(unknown, ["ITM+0x00"]);
}
