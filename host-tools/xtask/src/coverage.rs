//! Lines of the flash image that all its tests in QEMU together execute.
//!
//! # Design
//! Nothing is compiled for it: the tests run the image that is flashed, and the emulator notes the half-words
//! that it executes (`STM32F405_QEMU_COVERAGE`, docs/emulator.md). A line belongs to the image if the
//! compiler has made code of it, in any place, and is reached if an instruction of that code was executed.
//! For inlined code, both the line inside and the lines that call it count. The images for all boards count
//! together: they are one program with other pins.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::code_lines::{Code, FLASH, Place};
use crate::files::{below, bytes, cannot, entries, make, write};
use crate::setup::{Need, setup};
use crate::step::{Steps, Stop};
use crate::suite::Job;
use crate::{boards, image, suite, test};

/// The packages whose tests run the image, and their jobs in `cargo xtask test`.
const PACKAGES: &str = "-p bead-tests -p absorber-bead -p bead-fuzz -p stm32f405-qemu";
const RUN_THE_IMAGE: [&str; 3] = [
    "-p bead-tests --test all",
    "-p absorber-bead --test all",
    "-p bead-fuzz --test campaign",
];
/// Least share of the image's own lines.
const LEAST: f64 = 0.9;
/// The image's own sources. Below them, `examples` and `tests` are in no image.
const OWN: &str = "firmware/";

/// Runs the tests and reports, or reports only on the runs that are there.
///
/// # Errors
/// A test fails, or the share of lines is too small.
pub(crate) fn measure(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    let folder = steps.target.join("coverage");
    let runs = folder.join("runs");
    match words {
        [] => run(steps, &runs)?,
        [join] if *join == "join" => {}
        _ => return Err(Stop::failed("give nothing, or `join`")),
    }
    let mut lines = Lines::default();
    for elf in images(steps, &runs)? {
        let code = Code::of_elf(&bytes(&elf)?).map_err(cannot("read", &elf))?;
        lines.add(&code, &executed(&elf)?);
    }
    write(&folder.join("image.lcov"), lines.lcov())?;
    write(&folder.join("unreached.txt"), lines.unreached())?;
    let share = share(lines.table());
    steps.announce(&format!(
        "the lines and functions are in {} and unreached.txt next to it",
        folder.join("image.lcov").display()
    ));
    if share < LEAST {
        let what = "of the image's own lines are reached, but 90 % are required";
        return Err(Stop::failed(format!("{:.1} % {what}", 100.0 * share)));
    }
    Ok(())
}

/// Runs the tests.
fn run(steps: &Steps, runs: &Path) -> Result<(), Stop> {
    setup(steps, Need::Run)?;
    boards::build_images(steps)?;
    image::build(steps)?;
    let mut jobs = test::programs(steps, PACKAGES)?;
    jobs.retain(|job| RUN_THE_IMAGE.iter().any(|part| job.title.contains(part)));
    jobs.extend(test::slow_core(steps, &jobs));
    jobs.push(test::silent_strikes(steps));
    let _ = fs::remove_dir_all(runs);
    make(runs)?;
    let runs = runs.to_string_lossy();
    let noted = |Job { title, mut line }: Job| {
        line = line.env("STM32F405_QEMU_COVERAGE", &runs);
        // Counts of instructions belong to `test`; they would reach nothing more.
        if title.contains("-p bead-tests ") {
            line = line.words("--skip budget::");
        }
        Job { title, line }
    };
    let passed = suite::run(steps, jobs.into_iter().map(noted).collect())?;
    steps.announce(&format!("{passed} tests passed"));
    Ok(())
}

/// Returns copies of the images as they are built now, each beside the files of its runs. Tests run other
/// images too, which they change or make.
fn images(steps: &Steps, runs: &Path) -> Result<Vec<PathBuf>, Stop> {
    let first = steps.root.join(image::path(steps));
    let boards = entries(&steps.target.join("boards")).unwrap_or_default();
    let built = boards.into_iter().chain([first]);
    let built: BTreeSet<_> = built.filter_map(|path| fs::read(path).ok()).collect();
    let is_image = |path: &PathBuf| {
        path.extension().is_some_and(|end| end == "elf")
            && fs::read(path).is_ok_and(|elf| built.contains(&elf))
    };
    let mut found = below(runs, &|_| true).unwrap_or_default();
    found.retain(is_image);
    if found.is_empty() {
        return Err(Stop::failed(format!(
            "{} has no run of the current image; `cargo xtask coverage` runs the tests",
            runs.display()
        )));
    }
    Ok(found)
}

/// The half-words that runs of an image executed, as bits: those of all files beside it with its name.
fn executed(elf: &Path) -> Result<Vec<u8>, Stop> {
    let stem = elf.with_extension("");
    let stem = format!("{}.", stem.file_name().unwrap_or_default().to_string_lossy());
    let mut all = vec![0; FLASH.len() / 16];
    for path in entries(elf.parent().unwrap_or(elf))? {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(&stem) && name.ends_with(".bits") {
            for (all, byte) in all.iter_mut().zip(bytes(&path)?) {
                *all |= byte;
            }
        }
    }
    Ok(all)
}

/// True if any half-word of these addresses was executed.
fn is_reached(bits: &[u8], addresses: &Range<u32>) -> bool {
    let half_words = (addresses.start - FLASH.start) / 2..(addresses.end - FLASH.start).div_ceil(2);
    half_words
        .into_iter()
        .any(|at| bits[at as usize / 8] >> (at % 8) & 1 == 1)
}

/// Lines, and how many of them were reached.
type Sums = [usize; 2];

fn share([lines, reached]: Sums) -> f64 {
    reached as f64 / lines.max(1) as f64
}

/// The image's own lines and functions, and whether each was reached.
#[derive(Debug, Default)]
struct Lines {
    files: BTreeMap<String, BTreeMap<u32, bool>>,
    /// Functions by name, each with its first line and whether it was reached.
    functions: BTreeMap<String, (Place, bool)>,
}

impl Lines {
    /// Adds the code of an image and what was executed of it.
    fn add(&mut self, code: &Code, bits: &[u8]) {
        let mut begins = BTreeMap::new();
        for (addresses, place) in &code.pieces {
            // The last line at an address is that of the function itself, around all that was inlined.
            begins.insert(addresses.start, place);
            if !place.file.starts_with(OWN) {
                continue;
            }
            let lines = self.files.entry(place.file.clone()).or_default();
            *lines.entry(place.line).or_default() |= is_reached(bits, addresses);
        }
        for (name, ranges) in &code.functions {
            // A function is the image's own if its first line is.
            let place = ranges.iter().find_map(|range| begins.get(&range.start));
            let Some(&place) = place.filter(|place| place.file.starts_with(OWN)) else {
                continue;
            };
            let functions = self.functions.entry(name.clone());
            let function = functions.or_insert((place.clone(), false));
            function.1 |= ranges.iter().any(|range| is_reached(bits, range));
        }
    }

    /// The lines in the format of lcov (geninfo's manual page).
    fn lcov(&self) -> String {
        let mut text = String::new();
        for (file, lines) in &self.files {
            let _ = writeln!(text, "TN:\nSF:{file}");
            let functions = || {
                self.functions
                    .iter()
                    .filter(|(_, (place, _))| place.file == *file)
            };
            for (name, (place, _)) in functions() {
                let _ = writeln!(text, "FN:{},{name}", place.line);
            }
            for (name, (_, reached)) in functions() {
                let _ = writeln!(text, "FNDA:{},{name}", u8::from(*reached));
            }
            let reached = functions().filter(|(_, (_, reached))| *reached).count();
            let _ = writeln!(text, "FNF:{}\nFNH:{reached}", functions().count());
            for (line, reached) in lines {
                let _ = writeln!(text, "DA:{line},{}", u8::from(*reached));
            }
            let [lines, reached] = sums(lines);
            let _ = writeln!(text, "LF:{lines}\nLH:{reached}\nend_of_record");
        }
        text
    }

    /// Functions and lines that nothing reached, by file.
    fn unreached(&self) -> String {
        let mut text = String::new();
        for (file, lines) in &self.files {
            let missing = lines.iter().filter(|(_, reached)| !**reached);
            let missing: Vec<u32> = missing.map(|(line, _)| *line).collect();
            if missing.is_empty() {
                continue;
            }
            let _ = writeln!(text, "{file}: {}", ranges(&missing));
            for (name, (place, reached)) in &self.functions {
                if place.file == *file && !reached {
                    let _ = writeln!(text, "    {}: {name}", place.line);
                }
            }
        }
        text
    }

    /// Prints a row for each file and each package; returns the sum of all.
    fn table(&self) -> Sums {
        let mut packages: BTreeMap<&str, Sums> = BTreeMap::new();
        println!("{:<44} {:>7} {:>7} {:>7}", "file", "lines", "reached", "%");
        let row = |name: &str, sums: Sums| {
            let ([lines, reached], share) = (sums, 100.0 * share(sums));
            println!("{name:<44} {lines:>7} {reached:>7} {share:>7.1}");
        };
        for (file, lines) in &self.files {
            let package = file.split_once("/src/").map_or(&**file, |(package, _)| package);
            let package = packages.entry(package).or_default();
            *package = and(*package, sums(lines));
            row(file, sums(lines));
        }
        let all = packages.values().copied().fold([0, 0], and);
        for (package, sums) in packages {
            row(package, sums);
        }
        row("all", all);
        all
    }
}

fn sums(lines: &BTreeMap<u32, bool>) -> Sums {
    [lines.len(), lines.values().filter(|reached| **reached).count()]
}

fn and(one: Sums, other: Sums) -> Sums {
    [one[0] + other[0], one[1] + other[1]]
}

/// Ascending numbers, runs of them as `3-5`.
fn ranges(numbers: &[u32]) -> String {
    let runs = numbers.chunk_by(|one, next| one + 1 == *next);
    let run = |run: &[u32]| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first}-{last}"),
        [] => String::new(),
    };
    runs.map(run).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_reached_by_any_of_its_code_and_a_function_by_any_of_its_copies() {
        let place = |line| Place {
            file: "firmware/src/a.rs".to_owned(),
            line,
        };
        let other = Place {
            file: "library/core.rs".to_owned(),
            line: 1,
        };
        let at = |start: u32| FLASH.start + start..FLASH.start + start + 4;
        let code = Code {
            pieces: vec![
                (at(0), place(3)),
                (at(4), place(4)),
                (at(8), place(3)),
                (at(12), other),
                (at(16), place(5)),
            ],
            functions: [
                ("own", vec![at(0), at(4)]),
                ("dead", vec![at(16)]),
                ("core", vec![at(12)]),
            ]
            .map(|(name, ranges)| (name.to_owned(), ranges))
            .into(),
        };
        let mut lines = Lines::default();
        // The second half-word of the piece at 8.
        lines.add(&code, &[0b0010_0000, 0]);
        assert_eq!(
            lines.unreached(),
            "firmware/src/a.rs: 4-5\n    5: dead\n    3: own\n"
        );
        // Another image, with the rest.
        lines.add(&code, &[0b0000_1000, 0]);
        assert_eq!(lines.table(), [3, 2]);
        let lcov = "TN:\nSF:firmware/src/a.rs\nFN:5,dead\nFN:3,own\nFNDA:0,dead\nFNDA:1,own\nFNF:2\nFNH:1\n\
                    DA:3,1\nDA:4,1\nDA:5,0\nLF:3\nLH:2\nend_of_record\n";
        assert_eq!(lines.lcov(), lcov);
        assert_eq!(ranges(&[1, 3, 4, 5, 9]), "1, 3-5, 9");
    }

    #[test]
    fn files_of_runs_are_joined_by_the_name_of_their_image() {
        let folder = tempfile::tempdir().unwrap();
        for (name, byte) in [
            ("a.1-0.bits", 1),
            ("a.2-0.bits", 4),
            ("ab.1-0.bits", 8),
            ("a.elf", 16),
        ] {
            fs::write(folder.path().join(name), [0, byte]).unwrap();
        }
        let bits = executed(&folder.path().join("a.elf")).unwrap();
        assert_eq!((bits.len(), &bits[..3]), (1 << 16, &[0, 5, 0][..]));
        assert!(is_reached(&bits, &(FLASH.start + 16..FLASH.start + 18)));
        assert!(!is_reached(&bits, &(FLASH.start + 18..FLASH.start + 20)));
    }
}
