//! Cost of a sample and size of the image, against the committed table of `docs/budget.md`.

use std::fs;
use std::path::PathBuf;

use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_testing::block;
use bead_tests::{RunFrames, image, paper, workspace};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Object, ObjectSymbol};

/// A figure may differ from the table by this part of it: the margin for what another build path or commit
/// name does to the compiler's choices. A gain is a difference too, so that the table stays true.
const MARGIN: f64 = 0.03;
/// Instructions a sample, all in all, while a strike is measured, and while none is; bytes.
const TARGETS: [(&str, f64); 5] = [
    ("all, while a strike is measured", 500.0),
    ("all, in the busiest block", BUSIEST),
    ("all, while none is", 60.0),
    // Of 640 KiB that `memory.x` gives: uncertainties, the judge of the wave form and the detector of waves
    // within a window took 30 KiB, most of it f64 arithmetic when settings are taken.
    ("flash", 176.0 * 1024.0),
    ("variables", 65.0 * 1024.0),
];
/// At 2.72 cycles each, the worst that an instruction of this core may take, 617 fit the 1680 cycles of a
/// sample.
const BUSIEST: f64 = 560.0;
/// In any settings.
const BUSIEST_OF_ANY: f64 = 617.0;

/// Set by `cargo xtask numbers`: the page is written instead of held to what was measured.
const WRITE: &str = "BEAD_NUMBERS_WRITE";

/// The figures of the table: name and value of every row whose second cell is a number.
fn committed(text: &str) -> Vec<(String, f64)> {
    text.lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix('|')?.split('|').map(str::trim);
            let (name, value) = (cells.next()?, cells.next()?);
            Some((name.to_owned(), value.replace(' ', "").parse().ok()?))
        })
        .collect()
}

/// Bytes of flash and of RAM that an image's loaded segments take, and of stack below its start and above its
/// fence.
fn sizes(elf: &[u8]) -> [f64; 3] {
    let elf: ElfFile32<'_> = ElfFile32::parse(elf).expect("the image is an ELF file");
    let [mut flash, mut variables] = [0, 0];
    for segment in elf.elf_program_headers() {
        let endian = elf.endian();
        if segment.p_type(endian) != object::elf::PT_LOAD {
            continue;
        }
        if segment.p_paddr(endian) < 0x1000_0000 {
            flash += segment.p_filesz(endian);
        }
        if segment.p_vaddr(endian) >= 0x2000_0000 {
            variables += segment.p_memsz(endian);
        }
    }
    let symbol = |name: &str| {
        let symbol = elf.symbols().find(|symbol| symbol.name() == Ok(name));
        symbol.expect("`link.x` defines it").address()
    };
    // `stack.rs`: the fence is the first 8 KiB, at a multiple of their size.
    let stack = symbol("_stack_start") - (symbol("_stack_end").next_multiple_of(8192) + 8192);
    [f64::from(flash), f64::from(variables), stack as f64]
}

/// The page with its figures replaced by what was measured.
fn rewritten(text: &str, measured: &[(&str, f64)], stack: f64) -> String {
    let grouped = |bytes: f64| {
        let digits = format!("{bytes:.0}");
        let (thousands, rest) = digits.split_at(digits.len().saturating_sub(3));
        format!("{thousands} {rest}").trim_start().to_owned()
    };
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split('|').map(str::to_owned).collect();
        let (name, value) = measured
            .iter()
            .find(|(name, _)| cells.get(1).is_some_and(|cell| cell.trim() == *name))?;
        let bytes = ["flash", "variables", "stack, deepest"].contains(name);
        let value = if bytes {
            grouped(*value)
        } else {
            format!("{value:.1}")
        };
        cells[2] = format!(" {value} ");
        if *name == "stack, deepest" {
            cells[3] = format!(" {} ", grouped(stack));
        }
        Some(cells.join("|"))
    };
    text.lines()
        .map(|line| row(line).unwrap_or_else(|| line.to_owned()) + "\n")
        .collect()
}

#[test]
fn the_page_is_rewritten_in_its_figures_and_nowhere_else() {
    let page = "| trigger | 8.7 | | what |\n| stack, deepest | 7 016 | 41 984 | how |\nother\n";
    let figures = [("trigger", 9.04), ("stack, deepest", 912.0)];
    assert_eq!(
        rewritten(page, &figures, 40_960.0),
        "| trigger | 9.0 | | what |\n| stack, deepest | 912 | 40 960 | how |\nother\n"
    );
    assert_eq!(
        committed(page),
        [("trigger".into(), 8.7), ("stack, deepest".into(), 7016.0)]
    );
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

#[test]
fn what_a_sample_costs_is_what_the_budget_says_and_within_its_targets() {
    let report = paper(1, 0.1, Some(1)).run().unwrap().report;
    let cost = report.instructions_per_sample;
    // Many strikes, close together, are what fills the stack.
    let stream = paper(20, 0.02, Some(1)).run().unwrap().stream;
    let status = RunFrames::new(stream).status();
    assert_eq!(status.strikes, 20);
    let [flash, variables, stack] = sizes(&fs::read(image()).unwrap());

    let measured = [
        ("estimate A, observer", cost.observer),
        ("estimate B, reduced chain", cost.reduced_chain),
        ("calibration, peaks, chunks of a window", cost.window),
        ("frames, by sample of a window", cost.framing),
        ("trigger", cost.trigger),
        ("all, while a strike is measured", cost.total),
        ("all, in the busiest block", cost.worst_block),
        ("all, while none is", cost.idle),
        ("all, over the run", Some(cost.run)),
        ("flash", Some(flash)),
        ("variables", Some(variables)),
        ("stack, deepest", Some(stack - f64::from(status.stack_free_min))),
    ]
    .map(|(name, value)| {
        (
            name,
            value.unwrap_or_else(|| panic!("nothing was counted for {name}")),
        )
    });
    let page = workspace().join("docs/budget.md");
    let text = fs::read_to_string(&page).expect("the table is committed");
    if std::env::var_os(WRITE).is_some() {
        fs::write(&page, rewritten(&text, &measured, stack)).unwrap();
        return;
    }
    let committed = committed(&text);
    assert_eq!(
        committed
            .iter()
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>(),
        measured.map(|(name, _)| name)
    );
    for ((name, committed), (_, measured)) in committed.iter().zip(measured) {
        assert!(
            (measured / committed - 1.0).abs() <= MARGIN,
            "{name}: {measured:.1}, and docs/budget.md says {committed}; `cargo xtask numbers` writes it anew"
        );
    }
    for (name, most) in TARGETS {
        let (_, value) = measured.iter().find(|(row, _)| *row == name).unwrap();
        assert!(*value < most, "{name}: {value:.1} of {most}");
    }
}
