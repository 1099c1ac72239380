//! Points of a shaker from a table or from a folder of tones, which a simulated bead may have to fill first.

use std::collections::BTreeMap;
use std::fs;

use bead_calibrate::calibration::LeftOut;
use bead_calibrate::points::{self, Channel, Measured, Points};
use bead_calibrate::simulated::SimulatedBead;
use bead_calibrate::simulated::sines::{self, Shaken};
use bead_instrument::Choice;

use crate::cli::commands::prelude::*;
use crate::cli::provenance::name_of;

/// Beginning of the names of the two files of a tone.
const SCANS: &str = "scans-";
const REFERENCE: &str = "reference-";
/// Duration of a simulated tone, s.
const SECONDS: f64 = 0.5;

/// Points, the files that they came from, and what was left out.
pub(super) struct Gathered {
    pub(super) points: Points,
    pub(super) files: Vec<PathBuf>,
    pub(super) left_out: Vec<LeftOut>,
}

/// Reads a table, or the tones of a folder. `pole`, in Hz, is that of the filter before the converter.
pub(super) fn gather(path: &Path, choice: &Choice, channel: Channel, pole: f64) -> Result<Gathered, Failure> {
    if !path.is_dir() {
        let points = points::table(path).map_err(Failure::input)?.without_pole(pole);
        let files = vec![path.to_owned()];
        return Ok(Gathered {
            points,
            files,
            left_out: Vec::new(),
        });
    }
    let shown = path.display();
    let (scans, references, mut left_out) = sorted(path)?;
    let (mut found, mut files) = (Vec::new(), Vec::new());
    let progress = output::progress(scans.len() as u64).with_message("tones");
    for (name, scan) in &scans {
        progress.inc(1);
        let subject = name_of(scan);
        let Some(reference) = references.get(name) else {
            let why = format!("there is no {REFERENCE}{name}.csv, .wav or .parquet next to it");
            left_out.push(LeftOut { subject, why });
            continue;
        };
        match points::pair(scan, reference, choice, channel) {
            Ok(point) => {
                found.push(point);
                files.extend([scan.clone(), reference.clone()]);
            }
            Err(why) => left_out.push(LeftOut { subject, why }),
        }
    }
    progress.finish_and_clear();
    if found.is_empty() {
        let why = left_out.first();
        let why = why.map_or(String::new(), |out| format!(" ({}: {})", out.subject, out.why));
        bail!(
            Input,
            "{shown} has no tone{why}; a tone is {SCANS}NAME.csv of `bead command raw` and {REFERENCE}NAME.csv"
        );
    }
    let points = Points {
        points: found,
        measured: Measured::Codes,
    };
    Ok(Gathered {
        points: points.without_pole(pole),
        files,
        left_out,
    })
}

type ByName = BTreeMap<String, PathBuf>;

/// The scans and the references of a folder by their names, and its other files as left out.
fn sorted(folder: &Path) -> Result<(ByName, ByName, Vec<LeftOut>), Failure> {
    let (mut scans, mut references, mut left_out) = (ByName::new(), ByName::new(), Vec::new());
    let shown = folder.display();
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {shown}"))?;
    for entry in entries {
        let path = entry.with_context(|| format!("cannot read {shown}"))?.path();
        let stem = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if let Some(name) = stem.strip_prefix(SCANS) {
            scans.insert(name.to_owned(), path);
        } else if let Some(name) = stem.strip_prefix(REFERENCE) {
            references.insert(name.to_owned(), path);
        } else {
            left_out.push(LeftOut {
                subject: name_of(&path),
                why: format!("its name begins neither with {SCANS} nor with {REFERENCE}"),
            });
        }
    }
    left_out.sort_by(|a, b| a.subject.cmp(&b.subject));
    Ok((scans, references, left_out))
}

/// Writes a tone for each of these motions, the records of a reference whose gain is off by the factor
/// `gain`.
pub(super) fn simulate(
    folder: &Path,
    overwrite: Overwrite,
    bead: &SimulatedBead,
    motions: &[Shaken],
    (gain, seed): (f64, u64),
) -> Result<(), Failure> {
    let name = |number: usize, motion: &Shaken| format!("{number:02}-{:.0}hz.csv", motion.frequency);
    let files: Vec<_> = motions
        .iter()
        .enumerate()
        .flat_map(|(number, motion)| [SCANS, REFERENCE].map(|start| start.to_owned() + &name(number, motion)))
        .map(|name| (name, FileKind::Table))
        .collect();
    let targets = place::targets(folder, files, &[], overwrite)?;
    place::make_directory(folder)?;
    let progress = output::progress(motions.len() as u64).with_message("shaking");
    for ((number, motion), pair) in (0..).zip(motions).zip(targets.chunks_exact(2)) {
        let seed = seed.wrapping_mul(1000).wrapping_add(number);
        pair[0].write_bytes(sines::scans(bead, motion, SECONDS, seed))?;
        pair[1].write_bytes(sines::reference(motion, gain, SECONDS, seed))?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(())
}
