//! Images in Rust (`images/`), built here for the part and run whole: what they do, how they end, and how the
//! run reports it.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use stm32f405_qemu::{
    AnalogInput, AnalogWire, Device, Fault, FaultKind, Inputs, Outcome, PinInput, Poke, ResetCause, Run,
    RunEnd, RunError, Since, SpiFrame, UartInput,
};

use super::sensor::Sensor;
use super::{emulator, said};

/// Path of an image. The images are built once for all tests, with the profile of the flash image, so that
/// common dependencies are compiled once.
pub(super) fn image(name: &str) -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let folder = BUILT.get_or_init(|| {
        let workspace = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
        let target = "thumbv7em-none-eabihf";
        // With this feature the other images would lack the vectors that embassy's device provides.
        let embassy = [
            "default-time-driver",
            "ports",
            "converters",
            "clocks",
            "buses",
            "storms",
        ];
        let embassy = embassy.map(|name| ["--bin", name]);
        let embassy = [&["--features", "embassy"], embassy.as_flattened()].concat();
        for what in [&["--bins"][..], &embassy] {
            let mut cargo = Command::new(env!("CARGO"));
            cargo.args(["build", "--quiet", "-p", "stm32f405-qemu-images"]);
            cargo
                .args(["--profile", "firmware", "--target", target])
                .args(what);
            let built = cargo.current_dir(&workspace).status().unwrap();
            assert!(built.success(), "is the target {target} installed?");
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

/// Runs an image, which must end within ten seconds of real time.
fn result(run: &Run) -> Result<Outcome, RunError> {
    let began = Instant::now();
    let result = run.execute();
    assert!(began.elapsed().as_secs() < 10, "it took {:?}", began.elapsed());
    result
}

/// The outcome of an image that passes.
fn passed(run: &Run) -> Outcome {
    let outcome = result(run).unwrap();
    assert_eq!(outcome.verdict(), Ok(()), "{:?}", lines(&outcome));
    outcome
}

/// The outcome of an image that fails, and its verdict.
fn failed(name: &str) -> (Outcome, String) {
    let outcome = result(&run_of(name)).unwrap();
    let said = outcome.verdict().unwrap_err();
    (outcome, said)
}

fn lines(outcome: &Outcome) -> Vec<&str> {
    outcome.log.iter().map(|line| line.text.as_str()).collect()
}

/// The outcome of an image that passes, equal in two runs.
fn passed_again(run: &Run) -> Outcome {
    let outcome = passed(run);
    assert_eq!(passed(run), outcome);
    outcome
}

/// The outcome of a run with shortened loops, equal to that of QEMU alone.
fn shortened(mut run: Run) -> Outcome {
    let [short, long] = [true, false].map(|shorten| {
        run.shorten_waits = shorten;
        let mut outcome = result(&run).unwrap();
        outcome.busy_with = None;
        outcome
    });
    assert_eq!(short, long);
    short
}

#[test]
fn an_image_on_embassys_default_time_driver_comes_through_and_sleeps_in_wfe() {
    let mut run = run_of("default-time-driver");
    run.record_pins = true;
    let outcome = passed(&run);
    assert_eq!(lines(&outcome), ["50 ms for 5 times 10 ms"]);
    assert!(matches!(outcome.end, RunEnd::Breakpoint(_)), "{:?}", outcome.end);
    assert!(!outcome.unmodelled.iter().any(|what| what.contains("WFE")));
    // The pin goes high at first, and then toggles every 10 ms, by a clock of 32 768 Hz with ticks
    // 30.5 us apart.
    assert_eq!(outcome.pins.len(), 1);
    let light = &outcome.pins[0];
    assert_eq!(light.edges, 1 + 5);
    let apart: Vec<u64> = light
        .changes
        .windows(2)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    let even = apart.iter().all(|ns| ns.abs_diff(10_000_000) < 100_000);
    assert!(even && apart.len() == 5, "{apart:?}");
}

#[test]
fn the_dac_plays_from_flash_and_from_memory_to_the_inputs_at_its_wires() {
    let mut run = run_of("plays");
    run.analog_wires = vec![AnalogWire::new("PA4", "PA0"), AnalogWire::new("PA5", "PA2")];
    let outcome = passed(&run);
    assert_eq!(lines(&outcome), ["flash: 1030 1970", "RAM: 1530 2470"]);
    run.analog_wires = vec![AnalogWire::new("PA5", "PA0"), AnalogWire::new("PA4", "PA2")];
    assert_eq!(lines(&passed(&run)), ["flash: 1970 1030", "RAM: 2470 1530"]);
    for (from, to, why) in [
        ("PA6", "PA0", "begins at PA6"),
        ("PA4", "PA8", "leads to PA8"),
        ("PA4", "PX0", "no pin"),
    ] {
        run.analog_wires = vec![AnalogWire::new(from, to)];
        let refused = run.execute().unwrap_err().to_string();
        assert!(refused.contains(why), "{refused}");
    }
}

#[test]
fn ports_echo_by_interrupt_and_talk_over_a_wire_by_dma() {
    let mut run = run_of("ports");
    let (port, bytes) = ("USART3".into(), b"echo".to_vec());
    let at_ns = 10_000_000;
    run.uart_input = vec![UartInput { port, at_ns, bytes }];
    run.wires = vec![("PA2".into(), "PC7".into())];
    let outcome = passed_again(&run);
    assert_eq!(lines(&outcome), ["received b\"over a wire\""]);
    let sent = [0, 1].map(|n| (&*outcome.uarts[n].port, &*outcome.uarts[n].bytes));
    assert_eq!(sent, [("USART2", &b"over a wire"[..]), ("USART3", b"echo")]);
    assert_eq!(outcome.unknown_registers, []);
    let interrupts = &outcome.interrupts;
    let taken = |name: &str| {
        let of_name = interrupts.iter().filter(|interrupt| interrupt.name == name);
        of_name.map(|interrupt| interrupt.taken).sum::<u64>()
    };
    // At least two interrupts per byte: it is received, and its echo leaves the register.
    assert!((8..=16).contains(&taken("USART3")), "{interrupts:?}");
    assert_eq!((taken("DMA1_STREAM6"), taken("USART2")), (1, 0), "{interrupts:?}");
}

#[test]
fn the_advanced_timer_a_capture_over_a_wire_and_the_other_converters_work_as_embassys_users_know_them() {
    let analog = |(pin, code): (&str, u16)| AnalogInput {
        pin: pin.into(),
        since: Since::PowerUp,
        period_ns: 1,
        codes: vec![code],
    };
    let mut run = run_of("converters");
    run.record_pins = true;
    run.wires = vec![("PC0".into(), "PB6".into())];
    run.analog_inputs = [("PC4", 444), ("PC1", 111), ("PC2", 222)].map(analog).into();
    let outcome = passed(&run);
    let lines = lines(&outcome);
    assert_eq!(lines[0], "a period of 1600 clocks");
    // By a clock of 32 768 Hz, with ticks 30.5 us apart.
    let apart: u32 = lines[1].split(' ').next().unwrap().parse().unwrap();
    assert!(apart.abs_diff(20_000) <= 70, "{apart}");
    assert_eq!(lines[2], "ADC2 reads 444 at PC4");
    assert_eq!(lines[3..], ["ADC3 reads [111, 222, 111, 222]"]);
    assert_eq!(outcome.unknown_registers, []);
    let dead_time = "TIM1 BDTR.DTG: dead time is not modelled: both outputs move at once".to_owned();
    assert!(
        outcome.unmodelled.contains(&dead_time),
        "{:?}",
        outcome.unmodelled
    );
    // 10 kHz, almost from the beginning: two edges in a period of 100 us, on both pins at once.
    let periods = outcome.virtual_ns / 100_000;
    let pin = |name: &str| outcome.pins.iter().find(|pin| pin.name == name).unwrap();
    let [edges, complement] = ["PA8", "PA7"].map(|name| &pin(name).changes);
    assert!(edges.len().abs_diff(2 * periods as usize) < 8, "{edges:?}");
    for [up, down, next_up] in edges.array_windows().step_by(2).skip(1).take(20) {
        assert_eq!((down.0 - up.0, next_up.0 - up.0), (25_000, 100_000));
        let of_complement = [(up.0, false), (down.0, true)];
        assert!(
            of_complement.iter().all(|edge| complement.contains(edge)),
            "{complement:?}"
        );
    }
}

#[test]
fn an_image_that_faults_ends_with_where_and_why() {
    let (outcome, said) = failed("faults");
    assert_eq!(lines(&outcome), ["looking"]);
    assert_eq!(outcome.end, RunEnd::Faulted);
    assert_eq!(outcome.exceptions.len(), 1);
    let fault = &outcome.exceptions[0];
    assert_eq!((fault.number, fault.cfsr), (3, 0x8200));
    assert_eq!(fault.address, Some(0xb000_0000));
    let function = fault.pc.as_ref().unwrap().function.as_deref();
    assert!(function.unwrap().ends_with("look_at"), "{function:?}");
    assert!(fault.lr.is_some());
    let cause = "no memory at the data's address, 0xb0000000; PC 0x08";
    assert!(said.contains(cause), "{said}");
}

#[test]
fn an_image_that_waits_for_a_missing_peripheral_is_stopped_with_its_register() {
    let error = result(&run_of("polls")).unwrap_err();
    let said = error.to_string();
    assert!(matches!(error, RunError::Stuck(_)), "{said}");
    assert!(said.contains("wait_for_controller"), "{said}");
    assert!(said.contains("busy with CAN1_MSR"), "{said}");
    let outcome = error.outcome().unwrap();
    assert_eq!(lines(outcome), ["waiting for the controller"]);
    assert_eq!(outcome.end, RunEnd::Stuck("CAN1_MSR".into()));
}

#[test]
fn random_numbers_a_checksum_the_calendar_and_the_window_watchdog_work_by_embassys_drivers() {
    let mut run = run_of("clocks");
    run.sampling_deadline_ns = 10_000_000_000;
    let outcome = passed_again(&run);
    let said = lines(&outcome);
    assert_eq!(said[0], "random: different true");
    // CRC-32/MPEG-2 of "12345678", from another program.
    assert_eq!(said[2], "checksum 0x49e3c2fb");
    assert_eq!(said[3..5], ["3-1 0:0:0", "fed"]);
    // 127 ms after the feeds began. Seconds continue across the reset.
    assert_eq!(said[5..], ["again at 2026-3-1 0:0:0, window watchdog 1"]);
    // The last feed is the twentieth, 6 ms after the one before, and it lasts 10 ms: 103 counts of 97.5 us.
    let causes: Vec<_> = outcome.resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(causes, [ResetCause::WindowWatchdog]);
    let mut other = run;
    other.random_seed = 1;
    assert_ne!(lines(&passed(&other))[1], said[1], "another seed");
}

/// A flash memory: its identity, and its contents: each byte is the low byte of its address.
#[derive(Default)]
struct Memory {
    command: Vec<u16>,
    commands: Vec<Vec<u16>>,
    last: Option<SpiFrame>,
}

impl Device for Memory {
    fn select(&mut self, selected: bool, _at_ns: u64) {
        if !selected {
            self.commands.push(std::mem::take(&mut self.command));
        }
    }

    fn exchange(&mut self, frame: SpiFrame, _at_ns: u64) -> u16 {
        self.last = Some(frame);
        self.command.push(frame.word);
        let n = self.command.len();
        match self.command[..] {
            [0x9f, ..] => [0xff, 0xef, 0x40, 0x18][(n - 1).min(3)],
            [0x03, _, _, low, ..] if n > 4 => low + n as u16 - 5,
            _ => 0xff,
        }
    }
}

#[test]
fn a_sensor_and_a_memory_of_the_test_answer_embassys_drivers() {
    let [outcome, again] = [(); 2].map(|()| {
        let mut run = run_of("buses");
        let sensor = Sensor {
            registers: [10, 11, 12, 13, 14, 15, 16, 17],
            ..Sensor::default()
        };
        let sensor = run.devices.on_i2c("I2C1", 0x48, sensor);
        let memory = run.devices.on_spi("SPI1", "PA4", Memory::default());
        let outcome = passed(&run);
        let sensor = sensor.lock().unwrap();
        assert_eq!(
            (&sensor.registers[6..], sensor.reads),
            (&[60, 61][..], 4 + 4 + 1 + 1)
        );
        let memory = memory.lock().unwrap();
        assert_eq!(memory.commands[1].len(), 36);
        let last = SpiFrame {
            word: 0x1234,
            bits: 16,
            mode: 0,
            hz: 1_000_000,
        };
        assert_eq!(memory.last, Some(last));
        outcome
    });
    let expected = [
        "blocking [10, 11, 12, 13]",
        "by DMA [14, 15, 60, 61]",
        "one byte [61]",
        "nobody there: true true",
        "identity [0xef, 0x40, 0x18]",
        "page [16, 17, 18, 19]",
    ];
    assert_eq!(lines(&outcome), expected);
    let mut live = run_of("buses");
    let thermometer = live.devices.on_i2c("I2C1", 0x48, Memory::default());
    let mut live = live.start().unwrap();
    let passed = live.advance(5_000_000, Inputs::default()).unwrap();
    assert_eq!(passed.log[0].text, "blocking [255, 255, 255, 255]");
    live.finish().unwrap();
    assert_eq!(thermometer.lock().unwrap().commands.len(), 0);

    assert_eq!(again, outcome);
    assert_eq!(outcome.unknown_registers, []);
    let unmodelled = &outcome.unmodelled;
    assert!(
        !unmodelled.iter().any(|what| what.contains("C1")),
        "{unmodelled:?}"
    );
}

#[test]
fn a_device_at_a_place_that_the_part_lacks_is_refused_and_one_that_panics_fails_its_test() {
    let on_i2c = |places: &[(&str, u8)]| {
        let mut run = run_of("buses");
        for (bus, address) in places {
            run.devices.on_i2c(*bus, *address, Memory::default());
        }
        run
    };
    let on_spi = |bus, select| {
        let mut run = run_of("buses");
        run.devices.on_spi(bus, select, Memory::default());
        run
    };
    for (run, why) in [
        (on_i2c(&[("I2C4", 0x48)]), "give one of I2C1, I2C2, I2C3"),
        (on_i2c(&[("I2C1", 0x90)]), "0x08 to 0x77"),
        (on_i2c(&[("I2C1", 0x48); 2]), "two devices"),
        (on_spi("I2C1", "PA4"), "give one of SPI1"),
        (on_spi("SPI1", "PX4"), "no pin"),
    ] {
        let refused = run.execute().unwrap_err().to_string();
        assert!(refused.contains(why), "{refused}");
    }

    struct Broken;
    impl Device for Broken {
        fn start(&mut self, _read: bool, _at_ns: u64) -> bool {
            panic!("the sensor is broken")
        }
    }
    let mut run = run_of("buses");
    run.devices.on_i2c("I2C1", 0x48, Broken);
    let panic = std::panic::catch_unwind(|| run.execute()).unwrap_err();
    assert_eq!(panic.downcast_ref(), Some(&"the sensor is broken"));
}

/// The example of the README, for three images: each uses its part of the inputs.
#[test]
fn the_scenario_of_the_readme_reaches_images_and_what_never_came_is_said() {
    let readme = include_str!("../../README.md");
    let (_, example) = readme.split_once("```toml\n").unwrap();
    let (example, _) = example.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("example.toml");
    std::fs::write(&path, example).unwrap();
    std::fs::write(folder.path().join("level.csv"), "t,x\n0,1\n0.010,4.44\n").unwrap();
    let option = ["--scenario", path.to_str().unwrap()];
    let run = |image: &str| {
        let (status, said) = program(image, &option);
        assert_eq!(status, Some(0), "{image}: {said}");
        said
    };
    let said = run("ports");
    assert!(
        said.contains("4 bytes from USART3") && said.contains("over a wire"),
        "{said}"
    );
    assert!(
        said.contains("fault PowerCut at 1.500000 s"),
        "what never came: {said}"
    );
    let said = run("converters");
    assert!(said.contains("ADC2 reads 444 at PC4"), "{said}");
    assert!(said.contains("the waveform at PC4 ended at 0.020000 s"), "{said}");
    let said = run("buttons");
    let presses = said.matches("pressed true").count() + said.matches("pressed false").count();
    assert_eq!(presses, 4, "{said}");

    std::fs::write(&path, example.replace("PC13", "PX13")).unwrap();
    let (status, said) = program("buttons", &option);
    assert_eq!(status, Some(2), "{said}");
    let place = format!("{}:18:7: there is no pin \"PX13\"", path.display());
    assert!(said.contains(&place), "{said}");
}

/// Runs the program on an image. Returns its exit status and its output.
fn program(image_name: &str, options: &[&str]) -> (Option<i32>, String) {
    let image = image(image_name);
    let began = Instant::now();
    let ran = emulator().args(options).arg(image).output().unwrap();
    assert!(began.elapsed().as_secs() < 10, "it took {:?}", began.elapsed());
    (ran.status.code(), said(&ran))
}

#[test]
fn the_program_ends_with_a_status_for_each_end_of_an_image() {
    let missing = "no line of the log, a UART or semihosting matches \"line 1000$\"";
    let faulted = "the image is in a fault handler: HardFault";
    for (image, options, status, words) in [
        ("logs", &["--until", "line 999"][..], 0, "line 999"),
        ("logs", &["--until", "line 1000$"], 7, missing),
        (
            "logs",
            &["--strict"],
            0,
            "no clock: TIM5_CNT (clock off) (1 reads, 0 writes)",
        ),
        (
            "spins",
            &["--for", "10ms"],
            5,
            "the image hangs: it is in an endless loop at",
        ),
        ("spins", &["--until", "("], 2, "unclosed group"),
        ("logs", &["--version"], 0, env!("CARGO_PKG_VERSION")),
        ("logs", &["-h"], 0, "Exit status"),
        (
            "logs",
            &["--uart", "USART9=stdout"],
            2,
            "USART9 is not a UART; give one of USART1",
        ),
        (
            "polls",
            &["--strict", "--until", "waiting"],
            6,
            "the image accessed CAN1_MCR and 1 more",
        ),
        ("panics", &[], 1, "the answer is 42"),
        ("faults", &[], 4, faulted),
        ("locks-up", &[], 4, "INFO  and again in the handler"),
        ("locks-up", &[], 4, "_HardFault): a fault in a fault handler"),
        ("polls", &[], 5, "busy with CAN1_MSR"),
        ("semihosts", &["--semihosting"], 1, "hello, host"),
        ("polls", &["--nonsense"], 2, "Usage"),
        ("no-such-image", &[], 3, "cannot read the firmware image"),
    ] {
        let (found, said) = program(image, options);
        assert_eq!(found, Some(status), "{image}: {said}");
        assert!(said.contains(words), "{image}: {said}");
    }
}

#[test]
fn the_program_ends_at_a_pattern_and_stops_when_nobody_reads() {
    let (found, said) = program("sleeps", &["--until", "^INFO +clock", "--for", "10s", "--strict"]);
    assert_eq!(found, Some(0), "{said}");
    assert!(said.contains("\n0.010000 s of the image's time"), "{said}");
    // A pipe whose other end is closed.
    let (_, output) = std::io::pipe().unwrap();
    let mut host = emulator().arg(image("logs")).stdout(output).spawn().unwrap();
    assert_eq!(host.wait().unwrap().code(), Some(141));
}

#[test]
fn an_output_that_is_an_input_is_refused_before_it_is_emptied() {
    let folder = tempfile::tempdir().unwrap();
    let [copy, scenario, wave] = ["image.elf", "x.toml", "ramp.csv"].map(|name| folder.path().join(name));
    std::fs::copy(image("logs"), &copy).unwrap();
    let text = "[[waveform]]\npin = \"PA0\"\nfile = \"ramp.csv\"\n";
    std::fs::write(&scenario, text).unwrap();
    std::fs::write(&wave, "t,x\n0,1\n0.001,2\n0.002,3\n").unwrap();
    let here = folder.path().to_str().unwrap();
    for (outputs, words) in [
        (
            ["--json", "x.out", "--vcd", "x.out"],
            "x.out is given for two outputs",
        ),
        (
            ["--json", "none/x", "--for", "1s"],
            "the folder of none/x does not exist; make it first",
        ),
        (
            ["--vcd", here, "--for", "1s"],
            "is a folder; give the name of a file in it",
        ),
    ] {
        let ran = emulator().args(outputs).arg(&copy).output().unwrap();
        assert_eq!(ran.status.code(), Some(2));
        assert!(said(&ran).contains(words), "{}", said(&ran));
    }
    for input in [&copy, &scenario, &wave] {
        let bytes = std::fs::read(input).unwrap();
        let path = input.display();
        for output in [
            ["--uart".to_owned(), format!("USART2=file:{path}")],
            ["--json".to_owned(), path.to_string()],
        ] {
            let mut host = emulator();
            host.args(output).arg("--scenario").arg(&scenario).arg(&copy);
            let ran = host.output().unwrap();
            assert!(said(&ran).contains("is an input of this run"), "{}", said(&ran));
            assert_eq!(ran.status.code(), Some(2));
            assert_eq!(std::fs::read(input).unwrap(), bytes);
        }
    }
}

/// Limits that no run reaches.
const ENDLESS: [&str; 4] = ["--for", "100000s", "--timeout", "100000s"];
/// With an input that may come at any time.
const WITH_INPUT: [&str; 2] = ["--uart", "USART1=pty"];

#[test]
fn a_line_is_shown_while_the_image_runs() {
    let mut host = emulator();
    host.args(ENDLESS)
        .args(WITH_INPUT)
        .arg(image("sleeps"))
        .stdout(Stdio::piped());
    let mut host = host.spawn().unwrap();
    let mut first = String::new();
    let mut output = BufReader::new(host.stdout.take().unwrap());
    output.read_line(&mut first).unwrap();
    assert_eq!(first, "INFO  clock source 1\n");
    host.kill().unwrap();
    host.wait().unwrap();
}

#[test]
fn a_program_talks_to_a_uart_by_tcp_and_its_text_ends_the_run() {
    let mut host = emulator();
    host.args(ENDLESS).args(["--uart", "USART3=tcp:127.0.0.1:0"]);
    host.args(["--uart", "USART3=stdout", "--until", "^echo$"]);
    host.arg(image("ports"))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut host = host.spawn().unwrap();
    let mut said = String::new();
    let mut errors = BufReader::new(host.stderr.take().unwrap());
    errors.read_line(&mut said).unwrap();
    let (_, address) = said.trim_end().rsplit_once(' ').unwrap();
    let mut line = TcpStream::connect(address).unwrap();
    line.write_all(b"echo").unwrap();
    let mut echo = [0; 4];
    line.read_exact(&mut echo).unwrap();
    assert_eq!(&echo, b"echo");
    let ended = host.wait_with_output().unwrap();
    let shown = String::from_utf8(ended.stdout).unwrap();
    assert_eq!(ended.status.code(), Some(0), "{shown}");
    assert!(
        shown.contains("USART3: echo\n") && shown.contains("4 bytes from USART3\n"),
        "{shown}"
    );
}

#[test]
fn a_report_says_for_other_programs_what_came_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let [json, junit] = ["x.json", "x.xml"].map(|name| folder.path().join(name));
    let paths = [&json, &junit].map(|path| path.to_str().unwrap());
    let (found, _) = program("panics", &["--json", paths[0], "--junit", paths[1]]);
    assert_eq!(found, Some(1));
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(
        (&json["status"], &json["outcome"]["end"]),
        (&1.into(), &"Panicked".into())
    );
    let junit = std::fs::read_to_string(&junit).unwrap();
    assert!(
        junit.contains("failures=\"1\"") && junit.contains("the image panicked at"),
        "{junit}"
    );
}

#[test]
fn the_program_carries_the_overlay_wherever_it_is_put() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("elsewhere");
    std::fs::copy(env!("CARGO_BIN_EXE_stm32-emu"), &program).unwrap();
    let ran = Command::new(program).arg(image("logs")).output().unwrap();
    assert!(ran.status.success(), "{}", said(&ran));
}

/// The processes whose parent is this one.
fn children(parent: u32) -> Vec<String> {
    let text = std::fs::read_to_string(format!("/proc/{parent}/task/{parent}/children"));
    let text = text.unwrap_or_default();
    text.split_whitespace().map(str::to_owned).collect()
}

#[test]
fn qemu_ends_with_its_host_whatever_ends_the_host() {
    let mut host = emulator()
        .args(ENDLESS)
        .args(WITH_INPUT)
        .arg(image("spins"))
        .spawn()
        .unwrap();
    let patience = Instant::now();
    let of_qemu = |pid: &String| {
        let name = std::fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
        // The query of `--version` has ended once the plugin's folder is an argument.
        let line = std::fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        name.starts_with("qemu") && line.contains("-plugin")
    };
    let qemu = loop {
        if let Some(qemu) = children(host.id()).into_iter().find(of_qemu) {
            break qemu;
        }
        assert!(patience.elapsed().as_secs() < 10, "QEMU was not started");
        std::thread::sleep(Duration::from_millis(20));
    };
    // SIGKILL: the host cannot react.
    host.kill().unwrap();
    host.wait().unwrap();
    while of_qemu(&qemu) {
        assert!(patience.elapsed().as_secs() < 20, "QEMU {qemu} goes on");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn of_an_image_without_symbols_the_program_says_that_its_log_cannot_be_told() {
    // Stack, reset, a branch to itself.
    let words = [0x2002_0000_u32, 0x0800_0009, 0xe7fe].map(u32::to_le_bytes);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stripped");
    std::fs::write(&path, super::qemu::elf(&words.concat(), &[])).unwrap();
    let ran = emulator().arg(path).output().unwrap();
    assert!(said(&ran).contains("no symbols"), "{}", said(&ran));
    assert!(!program("sleeps", &["--for", "10ms"]).1.contains("no symbols"));
}

#[test]
fn a_log_without_a_pause_is_whole() {
    for count_instructions in [false, true] {
        let mut run = run_of("logs");
        run.count_instructions = count_instructions;
        let outcome = passed(&run);
        assert_eq!((outcome.log.len(), &*outcome.log[999].text), (1000, "line 999"));
    }
}

#[test]
fn the_processors_own_registers_are_as_the_part_has_them() {
    let outcome = passed(&run_of("core-registers"));
    let expected = [
        // Four bits each; SHPR3 lacks the debug monitor's byte and a reserved one.
        "priorities 0xf0100000",
        "priorities 0xf0100000",
        "pending 0x0",
        "cycles without TRCENA: false",
        "cycles with TRCENA: true",
        "SysTick as fast as CYCCNT: true",
        "trace port ready: false",
    ];
    assert_eq!(lines(&outcome), expected);
    let unknown = outcome.unknown_registers.iter().map(|register| &*register.name);
    assert_eq!(unknown.collect::<Vec<_>>(), ["ITM+0x00"]);
}

#[test]
fn edges_on_a_pin_and_of_the_voltage_detector_interrupt() {
    let mut run = run_of("buttons");
    let changes_ns = vec![5_000_000, 6_000_000, 7_000_000];
    run.pin_inputs = vec![PinInput::new("PC13", Since::PowerUp, changes_ns)];
    let supply = |at_ns, millivolts| Fault::after_power_up(at_ns, FaultKind::Supply { millivolts });
    // Rising: when the supply falls below the threshold, not when it recovers.
    run.faults = vec![supply(6_500_000, 2800), supply(6_600_000, 3300)];
    let outcome = passed(&run);
    let expected = [
        "interrupt 40, lines 0x2000, pressed true",
        "interrupt 40, lines 0x2000, pressed false",
        "interrupt 1, lines 0x10000, pressed false",
        "interrupt 40, lines 0x2000, pressed true",
    ];
    assert_eq!(lines(&outcome), expected);
    let ended_ns = outcome.virtual_ns;
    assert!((7_000_000..7_100_000).contains(&ended_ns), "{ended_ns}");
    assert_eq!(outcome.never_came, [""; 0]);
}

#[test]
fn stop_ends_with_an_edge_on_the_internal_oscillator_and_standby_with_a_reset() {
    let mut run = run_of("sleeps");
    let changes_ns = vec![5_000_000, 6_000_000, 9_000_000, 50_000_000];
    run.pin_inputs = vec![PinInput::new("PA0", Since::PowerUp, changes_ns)];
    let outcome = passed(&run);
    let woken = "woken from STOP, clock source 0, 0 ticks";
    assert_eq!(lines(&outcome), ["clock source 1", woken, "woken from STANDBY"]);
    let resets: Vec<_> = outcome
        .resets
        .iter()
        .map(|reset| (reset.at_ns, reset.cause))
        .collect();
    assert_eq!(resets.len(), 1);
    assert_eq!(resets[0].1, ResetCause::Standby);
    assert!((9_000_000..9_000_000 + super::qemu::WAKES_WITHIN_NS).contains(&resets[0].0));
    assert_eq!(outcome.never_came, ["1 changes of the level on PA0"]);
    // From the start of STOP to its end, and of STANDBY: the part is hardly ever awake.
    let asleep = outcome.hclk_ns.iter().find(|(hz, _)| *hz == 0).unwrap().1;
    assert!((8_700_000..9_000_000).contains(&asleep), "{asleep}");
}

#[test]
fn a_log_of_text_that_waits_for_the_host_is_whole_also_beside_defmt() {
    let outcome = passed(&run_of("texts"));
    let last = &*outcome.log[199].text;
    assert_eq!((outcome.log.len(), last), (200, "a line of text, number 199"));
}

#[test]
fn what_never_came_is_listed() {
    let mut run = run_of("logs");
    run.pin_inputs = vec![PinInput::new("PB7", Since::FirstScan, vec![1, 2])];
    run.faults = vec![Fault::after_power_up(1_000_000_000, FaultKind::AdcOverrun)];
    let levels = "2 changes of the level on PB7: there was no triggered scan to count from";
    assert_eq!(
        passed(&run).never_came,
        [levels, "fault AdcOverrun at 1.000000 s"]
    );
}

#[test]
fn a_run_that_is_stopped_says_where_the_image_was() {
    let mut run = run_of("spins");
    run.sampling_deadline_ns = u64::MAX;
    // On a busy machine most of this may pass before the image is in `main`.
    run.timeout = Duration::from_secs(1);
    let error = result(&run).unwrap_err();
    let said = error.to_string();
    assert!(matches!(error, RunError::Timeout(..)), "{said}");
    let names = ["(main)", "__cortex_m_rt_main"];
    assert!(names.iter().any(|name| said.contains(name)), "{said}");
}

#[test]
fn an_image_calls_the_host_only_if_it_may() {
    let (refused, said) = failed("semihosts");
    assert_eq!(refused.end, RunEnd::Faulted);
    let hint = "a semihosting call, which --semihosting (Run::semihosting) allows";
    assert!(said.contains(hint), "{said}");
    let mut run = run_of("semihosts");
    run.semihosting = true;
    run.semihosting_arguments = ["run_addr", "8,9"].map(Into::into).into();
    let outcome = result(&run).unwrap();
    assert_eq!(outcome.end, RunEnd::Exited(7));
    assert_eq!(
        outcome.semihosting,
        "hello, host\nhello, standard output\nrun_addr 8,9\n"
    );
    assert!(outcome.verdict().unwrap_err().contains("status 7"));
}

#[test]
fn a_run_that_ends_early_ends_at_the_same_instruction_every_time() {
    for name in ["panics", "faults", "texts", "sleeps"] {
        let run = Run::new(image(name));
        let [a, b] = [(); 2].map(|()| result(&run).unwrap());
        assert_eq!(a, b, "{name}");
    }
}

/// A run of `waits` or `storms`: the image finds these words at the beginning of CCM.
fn chosen(name: &str, words: &[u32]) -> Run {
    let mut run = Run::new(image(name));
    for (address, word) in (0x1000_0000..).step_by(4).zip(words) {
        run.pokes.push(Poke::word(0, address, *word));
    }
    run
}

#[test]
fn a_loop_that_waits_does_the_same_in_the_interpreter_as_in_qemu() {
    for way in (0..12).chain([14]) {
        let mut run = chosen("waits", &[way, 2]);
        // A change of level is played between two turns, and its edge is an additional event.
        let changes_ns: Vec<_> = (1..20).map(|n| n * 333_333).collect();
        run.pin_inputs = vec![PinInput::new("PA3", Since::PowerUp, changes_ns)];
        let outcome = shortened(run);
        // The loop with all kinds of instructions also logs its sum.
        let logged = if way == 11 { 4 } else { 2 };
        assert_eq!(outcome.log.len(), logged, "way {way}: {:?}", lines(&outcome));
    }
    shortened(chosen("waits", &[1, 2, 1]));
}

#[test]
fn a_loop_is_shortened_with_memory_protection_too() {
    /// Least number of accesses by QEMU alone: each turn reads the counter, and takes less than a
    /// microsecond.
    const ACCESSES: u64 = 1000;
    let calls = |shorten| {
        let mut run = chosen("waits", &[1, 0, 1]);
        run.shorten_waits = shorten;
        let mut live = run.start().unwrap();
        let passed = live.advance(10_000_000, Inputs::default()).unwrap();
        passed.work.calls
    };
    assert!(calls(false) > 10 * ACCESSES && calls(true) < ACCESSES);
}

#[test]
fn a_loop_of_a_handler_that_reads_a_register_after_it_is_left_in_time() {
    let mut run = chosen("waits", &[13, 1]);
    run.stop_when_hung = false;
    run.sampling_deadline_ns = 60_000_000;
    shortened(run);
}

#[test]
fn turns_that_repeat_cost_nothing() {
    // A flag in RAM, WFE, and an empty loop: QEMU alone takes ten times as long.
    for way in [8, 9, 12] {
        let mut run = chosen("waits", &[way, 0]);
        run.sampling_deadline_ns = 20_000_000_000;
        let outcome = result(&run).unwrap();
        assert_eq!(outcome.virtual_ns / 1_000_000_000, 20, "way {way}");
    }
}

#[test]
fn an_interrupt_is_an_event_that_ends_the_next_wfe_too() {
    // All vectors share its handler. Round 1 ends with the interrupt, round 2 with that interrupt's event.
    let outcome = passed(&chosen("waits", &[9, 4]));
    let ticks = lines(&outcome)
        .into_iter()
        .map(|line| line.rsplit_once(", ").unwrap().1);
    assert!(ticks.eq(["1 ticks", "1 ticks", "2 ticks", "2 ticks"]));
}

#[test]
fn a_handler_whose_interrupt_stays_up_does_the_same_in_the_interpreter_as_in_qemu() {
    for way in 0..9 {
        let mut run = chosen("storms", &[way, 4]);
        run.sampling_deadline_ns = 20_000_000;
        assert_eq!(shortened(run).log.len(), 1, "way {way}");
    }
}

#[test]
fn a_handler_whose_interrupt_stays_up_is_shortened_and_goes_on_for_ever() {
    /// Least number of register accesses of the handlers per millisecond.
    const ACCESSES: u64 = 5000;
    // The handler reads; it sets up a DMA stream, also with the stream's interrupt pending; a line rises now
    // and then; its sum never repeats.
    for way in [0, 1, 2, 3, 5] {
        let mut live = chosen("storms", &[way, 0]).start().unwrap();
        let calls = live.advance(20_000_000, Inputs::default()).unwrap().work.calls;
        assert!(calls < 20 * ACCESSES / 4, "way {way}: {calls}");
        let outcome = live.finish().unwrap();
        assert_eq!(outcome.end, RunEnd::Over, "way {way}");
    }
}

#[test]
fn a_record_that_comes_in_pieces_is_whole_though_it_holds_the_end_of_a_line() {
    // The records contain way 10, a byte that is also a new line.
    let run = chosen("waits", &[10, 2]);
    let whole = passed(&run).log;
    let mut live = run.start().unwrap();
    let (mut now, mut log, mut ended) = (0, Vec::new(), false);
    while !ended {
        now += 400;
        let passed = live.advance(now, Inputs::default()).unwrap();
        log.extend(passed.log);
        ended = passed.ended;
    }
    log.extend(live.finish().unwrap().log);
    assert_eq!(whole.len(), 2);
    assert_eq!(log, whole);
}
