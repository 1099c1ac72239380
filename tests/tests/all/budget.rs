//! Cost of a sample, in instructions and in cycles, and size of the image, against the committed tables of
//! `docs/budget.md`.

use std::fs;
use std::path::PathBuf;

use bead_bench::counted_cycles::{BUSIEST_BLOCK, IDLE_BLOCK, MASKED};
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_testing::block;
use bead_tests::{RunFrames, execute, image, paper, scenario, solved, workspace};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Object, ObjectSymbol};
use stm32f405_qemu::{BlockCost, Cycles, Instructions, Run};

use super::company;

/// Relative difference that is allowed between a figure and the table: the effect of another build path or
/// commit name on the compiler's choices. A gain is a difference too, so that the table stays true.
const MARGIN: f64 = 0.03;
/// Margin of cycles that wait for each line of flash: code may be moved within its lines.
const MARGIN_OF_LINES: f64 = 0.06;
/// Cycles between two samples.
const CYCLES: f64 = 1680.0;
/// Samples of a block, which the load frame counts by.
const SCANS_PER_BLOCK: f64 = 200.0;
/// Columns of a row with instructions and cycles.
const INSTRUCTIONS: usize = 0;
const CACHED: usize = 2;
const MOST: usize = 4;
/// Row, column, and the bound that the value must stay below.
const TARGETS: [(&str, usize, f64); 10] = [
    ("all, while a strike is measured", INSTRUCTIONS, 500.0),
    ("all, in the busiest block", INSTRUCTIONS, 560.0),
    ("all, in the busiest block", CACHED, 0.45 * CYCLES),
    ("all, in the busiest block", MOST, 0.70 * CYCLES),
    ("the busiest block in company", MOST, 0.85 * CYCLES),
    ("all, while none is", INSTRUCTIONS, 60.0),
    ("all, while none is", CACHED, 0.05 * CYCLES),
    // Of 256 KiB that `memory.x` gives: uncertainties, the judge of the wave form and the detector of waves
    // within a window took 30 KiB, most of it f64 arithmetic when settings are taken;
    // followers that are unlike the host took 8.
    // Updates took 21: signature and hash, their requests, and the loader. The bench took 5.
    ("flash", 0, 212.0 * 1024.0),
    // Of 64 KiB, for buffers that the DMA reaches.
    ("variables in SRAM", 0, 48.0 * 1024.0),
    ("variables beside the stack", 0, 34.0 * 1024.0),
];
/// Instructions a sample in the busiest block of any settings: 2.72 cycles each, their upper bound, fill the
/// time between two samples.
const BUSIEST_OF_ANY: f64 = 617.0;
/// The host of the row of ten whose strike takes most.
const BUSIEST_HOST: usize = 10;

/// Set by `cargo xtask numbers`: the page is written instead of compared with the measurement.
const WRITE: &str = "BEAD_NUMBERS_WRITE";

/// The figures of the tables: name and values of every row whose second cell is a number.
fn committed(text: &str) -> Vec<(String, Vec<f64>)> {
    text.lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix('|')?.split('|').map(str::trim);
            let name = cells.next()?.to_owned();
            let values: Vec<f64> = cells
                .map_while(|cell| cell.replace(' ', "").parse().ok())
                .collect();
            (!values.is_empty()).then_some((name, values))
        })
        .collect()
}

/// Bytes of flash, of SRAM and of core-coupled memory that an image's loaded segments take, and of stack
/// below its start and above its fence.
fn sizes(elf: &[u8]) -> [f64; 4] {
    let elf: ElfFile32<'_> = ElfFile32::parse(elf).expect("the image is an ELF file");
    let [mut flash, mut sram, mut coupled] = [0; 3];
    for segment in elf.elf_program_headers() {
        let endian = elf.endian();
        if segment.p_type(endian) != object::elf::PT_LOAD {
            continue;
        }
        if segment.p_paddr(endian) < 0x1000_0000 {
            flash += segment.p_filesz(endian);
        }
        match segment.p_vaddr(endian) {
            0x2000_0000.. => sram += segment.p_memsz(endian),
            0x1000_0000.. => coupled += segment.p_memsz(endian),
            _ => {}
        }
    }
    let symbol = |name: &str| {
        let symbol = elf.symbols().find(|symbol| symbol.name() == Ok(name));
        symbol.expect("`link.x` defines it").address()
    };
    // `stack.rs`: the fence is the first 8 KiB, at a multiple of their size.
    let stack = symbol("_stack_start") - (symbol("_stack_end").next_multiple_of(8192) + 8192);
    [
        f64::from(flash),
        f64::from(sram),
        f64::from(coupled),
        stack as f64,
    ]
}

/// The page with its figures replaced by what was measured.
fn rewritten(text: &str, measured: &[(&str, Vec<f64>)]) -> String {
    let grouped = |bytes: f64| {
        let digits = format!("{bytes:.0}");
        let (thousands, rest) = digits.split_at(digits.len().saturating_sub(3));
        format!("{thousands} {rest}").trim_start().to_owned()
    };
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split('|').map(str::to_owned).collect();
        let (name, values) = measured
            .iter()
            .find(|(name, _)| cells.get(1).is_some_and(|cell| cell.trim() == *name))?;
        let bytes = *name == "flash" || ["variables", "stack"].iter().any(|what| name.starts_with(what));
        for (cell, value) in cells[2..].iter_mut().zip(values) {
            let value = if bytes {
                grouped(*value)
            } else {
                format!("{value:.1}")
            };
            *cell = format!(" {value} ");
        }
        Some(cells.join("|"))
    };
    text.lines()
        .map(|line| row(line).unwrap_or_else(|| line.to_owned()) + "\n")
        .collect()
}

#[test]
fn the_image_names_no_folder_of_the_computer_that_built_it() {
    let image = fs::read(image()).unwrap();
    let home = std::env::var_os("HOME").map(PathBuf::from);
    let cargo = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let cargo = cargo.or(home.map(|home| home.join(".cargo")));
    for folder in [Some(workspace().to_owned()), cargo].into_iter().flatten() {
        let name = folder.as_os_str().as_encoded_bytes();
        let there = image.windows(name.len()).any(|bytes| bytes == name);
        assert!(
            !there,
            "{} is in the image, debug information included; `cargo xtask build` builds it without (a plain cargo \
             does after it)",
            folder.display()
        );
    }
}

#[test]
fn the_longest_window_makes_no_block_busier_than_any_settings_may() {
    let longest = Capture {
        history: 2.56e-3,
        length: 10.24e-3,
        ..Capture::default()
    };
    let settings = derive(&Bead::paper(), &FrontEnd::reference(), &longest).unwrap();
    assert_eq!((settings.window.history, settings.window.length), (256, 1024));
    let mut run = paper(2, 0.05, Some(1));
    run.block = block(&settings);
    let busiest = run
        .run()
        .unwrap()
        .report
        .instructions_per_sample
        .worst_block
        .unwrap();
    println!("{busiest:.1} instructions a sample");
    assert!(busiest < BUSIEST_OF_ANY, "{busiest:.1}");
}

/// A run that counts cycles, and what it counted.
fn counted(mut machine: Run) -> (u64, Instructions) {
    machine.count_cycles = true;
    let outcome = execute(&machine);
    let scans = outcome.sampling.expect("it samples").scans;
    (scans, outcome.instructions.expect("they are counted"))
}

/// Instructions, and the four sums of cycles, per sample.
fn row(instructions: u64, cycles: Option<Cycles>, samples: f64) -> Vec<f64> {
    let cycles = cycles.expect("they are counted");
    [
        instructions,
        cycles.ideal,
        cycles.cached,
        cycles.uncached,
        cycles.most,
    ]
    .map(|count| count as f64 / samples)
    .to_vec()
}

/// Rows of the table of instructions and cycles.
fn costs() -> Vec<(&'static str, Vec<f64>)> {
    let strike = paper(1, 0.1, Some(1));
    let cost = strike.run().expect("it runs").report.instructions_per_sample;
    let (scans, all) = counted(strike.machine());
    let function = |label: &str, each: Option<f64>| {
        let found = all.functions.iter().find(|function| function.label == label);
        let found = found.unwrap_or_else(|| panic!("nothing was counted for {label}"));
        // For each sample that the run's report counts instructions for.
        row(
            found.instructions,
            found.cycles,
            found.instructions as f64 / each.expect("it ran"),
        )
    };
    let block = |block: Option<BlockCost>| {
        let block = block.expect("there is one");
        row(block.instructions, block.cycles, block.scans as f64)
    };
    let scenario = scenario("ten-intruders");
    let solution = solved(&scenario);
    let company = company::emulation(&scenario, &solution, BUSIEST_HOST, Some(1)).machine();
    let masked = all.masked.as_ref().expect("some are");
    vec![
        ("estimate A, observer", function("observer", cost.observer)),
        (
            "estimate B, reduced chain",
            function("reduced_chain", cost.reduced_chain),
        ),
        (
            "calibration, peaks, chunks of a window",
            function("window", cost.window),
        ),
        ("frames, by sample of a window", function("framing", cost.framing)),
        ("trigger", function("trigger", cost.trigger)),
        ("all, while a strike is measured", block(all.working)),
        ("all, in the busiest block", block(all.slowest_block)),
        (
            "the busiest block in company",
            block(counted(company).1.slowest_block),
        ),
        ("all, while none is", block(all.idle)),
        ("all, over the run", row(all.total, all.cycles, scans as f64)),
        (
            "longest without interrupts",
            row(masked.instructions, masked.cycles, 1.0),
        ),
    ]
}

#[test]
fn what_a_sample_costs_is_what_the_budget_says_and_within_its_targets() {
    // Many strikes, close together, fill the stack most.
    let stream = paper(20, 0.02, Some(1)).run().unwrap().stream;
    let status = RunFrames::new(stream).status();
    assert_eq!(status.strikes, 20);
    let [flash, sram, coupled, stack] = sizes(&fs::read(image()).unwrap());

    let mut measured = costs();
    measured.extend([
        ("flash", vec![flash]),
        ("variables in SRAM", vec![sram]),
        ("variables beside the stack", vec![coupled]),
        (
            "stack, deepest",
            vec![stack - f64::from(status.stack_free_min), stack],
        ),
    ]);
    let page = workspace().join("docs/budget.md");
    let text = fs::read_to_string(&page).expect("the table is committed");
    if std::env::var_os(WRITE).is_some() {
        fs::write(&page, rewritten(&text, &measured)).unwrap();
        return;
    }
    let committed = committed(&text);
    let names = committed.iter().map(|(name, _)| name.as_str());
    assert!(names.eq(measured.iter().map(|(name, _)| *name)), "{committed:?}");
    for ((name, committed), (_, measured)) in committed.iter().zip(&measured) {
        for (column, (committed, measured)) in committed.iter().zip(measured).enumerate() {
            let margin = if column > CACHED { MARGIN_OF_LINES } else { MARGIN };
            assert!(
                (measured / committed - 1.0).abs() <= margin,
                "{name}: {measured:.1}, and docs/budget.md says {committed}; `cargo xtask numbers` writes it anew"
            );
        }
    }
    // `bead command status` shows these beside the bead's own.
    for (name, samples, shown) in [
        ("all, in the busiest block", SCANS_PER_BLOCK, BUSIEST_BLOCK),
        ("all, while none is", SCANS_PER_BLOCK, IDLE_BLOCK),
        ("longest without interrupts", 1.0, MASKED),
    ] {
        let (_, values) = committed
            .iter()
            .find(|(row, _)| row == name)
            .expect("it is in the table");
        for (column, shown) in [(CACHED, shown.cached), (MOST, shown.at_most)] {
            let off = f64::from(shown) / (values[column] * samples) - 1.0;
            assert!(
                off.abs() < MARGIN,
                "{name}: counted_cycles.rs is off by {off:.3}; mend it"
            );
        }
    }
    let missed: Vec<_> = TARGETS
        .iter()
        .filter_map(|(name, column, most)| {
            let (_, values) = measured.iter().find(|(row, _)| row == name)?;
            (values[*column] >= *most)
                .then(|| format!("{name}, column {column}: {:.1} of {most:.1}", values[*column]))
        })
        .collect();
    assert!(missed.is_empty(), "{missed:#?}");
}
