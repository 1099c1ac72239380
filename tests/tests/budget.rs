//! What a sample costs, and what the image takes, against the committed table of `docs/budget.md`.

use std::fs;

use bead_tests::{Heard, image, paper, workspace};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Object, ObjectSymbol};

/// A figure may differ from the table by this part of it: the margin for what another build path or commit name does
/// to the compiler's choices. A gain is a difference too, so that the table stays true.
const MARGIN: f64 = 0.03;
/// Instructions a sample, all in all, while a strike is measured, and while none is.
const TARGETS: [(&str, f64); 3] = [
    ("all, while a strike is measured", 500.0),
    ("all, in the busiest block", 500.0),
    ("all, while none is", 80.0),
];

/// The figures of the table: name and value of every row whose second cell is a number.
fn committed() -> Vec<(String, f64)> {
    let text = fs::read_to_string(workspace().join("docs/budget.md")).expect("the table is committed");
    text.lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix('|')?.split('|').map(str::trim);
            let (name, value) = (cells.next()?, cells.next()?);
            Some((name.to_owned(), value.replace(' ', "").parse().ok()?))
        })
        .collect()
}

/// Bytes of flash and of RAM that an image's loaded segments take, and of stack below its start and above its fence.
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
    // `stack.rs`: the fence is the first 4 KiB, at a multiple of their size, above the variables.
    let stack = symbol("_stack_start") - (symbol("_stack_end").next_multiple_of(4096) + 4096);
    [f64::from(flash), f64::from(variables), stack as f64]
}

#[test]
fn what_a_sample_costs_is_what_the_budget_says_and_within_its_targets() {
    let report = paper(1, 0.1, Some(1)).run().unwrap().report;
    let cost = report.instructions_per_sample;
    // Many strikes, close together, are what fills the stack.
    let stream = paper(20, 0.02, Some(1)).run().unwrap().stream;
    let status = Heard::new(stream).status();
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
    for (name, value) in measured {
        println!("| {name} | {value:.1} |");
    }
    let committed = committed();
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
            "{name}: {measured:.1}, and docs/budget.md says {committed}"
        );
    }
    for (name, most) in TARGETS {
        let (_, value) = measured.iter().find(|(row, _)| *row == name).unwrap();
        assert!(*value < most, "{name}: {value:.1} of {most}");
    }
}
