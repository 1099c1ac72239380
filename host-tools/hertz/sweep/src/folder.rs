//! A plan on disk, with a part for each finished chunk.
//!
//! # Design
//! `plan.toml` holds the whole sweep with its scenario, so a folder may be copied to another machine. A part
//! is a Parquet file that gets its name when it is complete, and notes its plan and chunk: the parts are the
//! journal. Any number of programs may compute chunks of one folder, even the same chunks, since their bytes
//! are equal.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use hertz_chain::{TomlFile, read_text};
use serde::{Deserialize, Serialize};

use crate::compute::compute;
use crate::definition::Definition;
use crate::plan::Plan;
use bead_tables::whole::{Target, is_unfinished};
use bead_tables::{Cell, Reader, Writer};

/// A plan on disk.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    plan: Plan,
    chunks: u64,
}

/// The content of `plan.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Page {
    /// The plan's hash.
    plan: String,
    made_by: String,
    points: u64,
    chunks: u64,
    sweep: String,
}

const PAGE: &str = "plan.toml";
/// Chunks of a plan at most: each is a file with a number of five digits.
pub const MOST_CHUNKS: u64 = 99_999;
/// Name and version of this program in a plan.
const PROGRAM: &str = concat!("bead ", env!("CARGO_PKG_VERSION"));

impl Folder {
    /// Makes a folder for a plan of `chunks` chunks, limited to the number of points and to
    /// [`MOST_CHUNKS`]. A folder that holds the plan already is opened as it is.
    ///
    /// # Errors
    /// The folder holds another plan or other files, or cannot be made.
    pub fn create(path: &Path, plan: Plan, chunks: u64) -> anyhow::Result<Self> {
        let place = path.display();
        if path.join(PAGE).exists() {
            let there = Self::open(path)?;
            if there.plan.hash() == plan.hash() {
                return Ok(there);
            }
            let [other, this] = [&there.plan, &plan].map(|plan| short(plan.hash()));
            bail!(
                "{place} holds the parts of another sweep (plan {other}; this is plan {this}); give another place, or \
                 remove that folder"
            );
        }
        let cannot =
            |error: std::io::Error| anyhow!("cannot make the folder {place}: {error}; give another place");
        let was_there = path.exists();
        fs::create_dir_all(path).map_err(cannot)?;
        // A program that was killed while it wrote the plan left an unfinished file.
        let is_other = |entry: &fs::DirEntry| !is_unfinished(&entry.file_name().to_string_lossy());
        let mut entries = fs::read_dir(path).map_err(cannot)?.flatten();
        if entries.any(|entry| is_other(&entry)) {
            bail!("{place} holds files that do not belong to a sweep; give another place");
        }
        let page = Page {
            plan: plan.hash().to_owned(),
            made_by: PROGRAM.to_owned(),
            points: plan.points(),
            chunks: chunks.clamp(1, plan.points().min(MOST_CHUNKS)),
            sweep: plan.definition().to_toml(),
        };
        let chunks = page.chunks;
        let text = toml::to_string(&page).expect("numbers and strings are TOML");
        let written = Target::new(path.join(PAGE)).replacing(true).write_bytes(text);
        if written.is_err() && !was_there {
            // The folder is empty. The error to report is that of the plan.
            let _ = fs::remove_dir(path);
        }
        written?;
        Ok(Self {
            path: path.to_owned(),
            plan,
            chunks,
        })
    }

    /// Opens a folder.
    ///
    /// # Errors
    /// The folder holds no plan, or one that was edited or made by another version.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let file = path.join(PAGE);
        if !file.exists() {
            let place = path.display();
            bail!("{place} holds no plan; make one with: bead sweep plan SWEEP.toml --dir {place}");
        }
        let name = file.display().to_string();
        let text = read_text(&file, "a folder that bead sweep plan has made")?;
        let page: Page = TomlFile::parse(&text, &name)?.read()?;
        if page.made_by != PROGRAM {
            bail!(
                "{name} was made by {}, and this is {PROGRAM}, whose last digits may differ; make the plan anew",
                page.made_by
            );
        }
        let plan = Plan::new(Definition::from_toml(&page.sweep, &name)?)?;
        if plan.hash() != page.plan || plan.points() != page.points {
            bail!("{name} was changed after it was made; make the plan anew from the sweep's file");
        }
        if !(1..=plan.points().min(MOST_CHUNKS)).contains(&page.chunks) {
            let Page { points, chunks, .. } = page;
            bail!(
                "{name} divides {points} points into {chunks} chunks; a plan has 1 to {MOST_CHUNKS}, none of them empty; make \
                 the plan anew"
            );
        }
        Ok(Self {
            path: path.to_owned(),
            plan,
            chunks: page.chunks,
        })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Number of chunks. They are counted from 1.
    pub fn chunks(&self) -> u64 {
        self.chunks
    }

    /// The points of a chunk. The sizes of two chunks differ by one point at most.
    pub fn points(&self, chunk: u64) -> Range<u64> {
        // The product has up to 70 bits. The quotient is the number of a point.
        let end = |chunk: u64| {
            (u128::from(self.plan.points()) * u128::from(chunk) / u128::from(self.chunks)) as u64
        };
        end(chunk - 1)..end(chunk)
    }

    /// Points of the largest chunk.
    pub fn most_points(&self) -> u64 {
        self.plan.points().div_ceil(self.chunks)
    }

    /// True for a file among the parts.
    pub fn has_within(&self, file: &Path) -> bool {
        // The target of a link is the file that would be replaced.
        let file = fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
        let beside = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        let beside = fs::canonicalize(beside.unwrap_or(Path::new(".")));
        beside.is_ok_and(|beside| fs::canonicalize(&self.path).is_ok_and(|own| own == beside))
    }

    fn part(&self, chunk: u64) -> PathBuf {
        self.path.join(format!("part-{chunk:05}.parquet"))
    }

    /// True if a chunk is finished.
    ///
    /// # Errors
    /// The file with the chunk's name does not hold this chunk of this plan.
    pub fn finished(&self, chunk: u64) -> anyhow::Result<bool> {
        let path = self.part(chunk);
        if !path.exists() {
            return Ok(false);
        }
        let strange = |why: String| {
            anyhow!(
                "{} is not chunk {chunk} of this plan: {why}; move it away and run the chunk again",
                path.display()
            )
        };
        let part = Reader::open(&path).map_err(|error| strange(format!("it {error}")))?;
        let plan = part.note("plan").unwrap_or_default();
        if plan != self.plan.hash() {
            return Err(strange(format!("it belongs to plan {}", short(plan))));
        }
        let points = self.points(chunk);
        let (rows, note) = (part.rows(), part.note("chunk").unwrap_or("?"));
        if note != self.signature(chunk) || rows != points.end - points.start {
            return Err(strange(format!("it has {rows} rows of chunk {note}")));
        }
        if part.columns() != self.plan.columns() {
            return Err(strange("it has other columns".to_owned()));
        }
        Ok(true)
    }

    /// The note of a chunk in its part: `K/N`.
    fn signature(&self, chunk: u64) -> String {
        format!("{chunk}/{}", self.chunks())
    }

    /// The unfinished chunks.
    ///
    /// # Errors
    /// As [`finished`](Self::finished).
    pub fn missing(&self) -> anyhow::Result<Vec<u64>> {
        let mut missing = Vec::new();
        for chunk in 1..=self.chunks() {
            if !self.finished(chunk)? {
                missing.push(chunk);
            }
        }
        Ok(missing)
    }

    /// Computes a chunk in the current pool. `progress` gets the number of points done.
    ///
    /// # Errors
    /// The part cannot be written; the finished ones stay.
    pub fn run(&self, chunk: u64, progress: &(dyn Fn(f64) + Sync)) -> anyhow::Result<()> {
        let target = Target::new(self.part(chunk)).replacing(true);
        let signature = self.signature(chunk);
        let notes = [("plan", self.plan.hash()), ("chunk", &signature)];
        Ok(target.write(|file| {
            let mut table = Writer::parquet(file, "sweep", &self.plan.columns(), &notes)?;
            compute(&self.plan, self.points(chunk), progress, |row| table.push(row))?;
            table.finish()
        })?)
    }

    /// Writes the table of all parts. `progress` gets the number of chunks done.
    ///
    /// # Errors
    /// A chunk is missing or of another plan, or the file cannot be written.
    pub fn merge(&self, target: &Target, progress: &dyn Fn(u64)) -> anyhow::Result<Merged> {
        let missing = self.missing()?;
        if !missing.is_empty() {
            bail!(
                "{} of {} chunks are missing: {}; run them with: bead sweep run {}",
                missing.len(),
                self.chunks(),
                ranges(&missing),
                self.path.display()
            );
        }
        let definition = self.plan.definition().to_toml();
        let notes = [
            ("made_by", PROGRAM),
            ("plan", self.plan.hash()),
            ("sweep", &definition),
        ];
        let mut merged = Merged::default();
        target.write(|file| {
            let mut table = Writer::parquet(file, "sweep", &self.plan.columns(), &notes)?;
            for chunk in 1..=self.chunks() {
                let path = self.part(chunk);
                let named = || path.display().to_string();
                let part = Reader::open(&path).with_context(named)?;
                for batch in part.all_batches() {
                    for row in batch.with_context(named)?.into_rows() {
                        if let Some(Cell::Text(error)) = row.last() {
                            merged.failed += 1;
                            merged.first.get_or_insert_with(|| error.to_string());
                        }
                        table.push(row)?;
                    }
                }
                progress(chunk);
            }
            table.finish()
        })?;
        Ok(merged)
    }

    /// Removes the folder's files, and the folder if nothing else is in it.
    pub fn remove(self) {
        // The result is whole, so a file that cannot be removed is no error.
        for chunk in 1..=self.chunks() {
            let _ = fs::remove_file(self.part(chunk));
        }
        let _ = fs::remove_file(self.path.join(PAGE));
        // Unfinished files of killed programs: all chunks are finished, so nobody writes them.
        for left in fs::read_dir(&self.path).into_iter().flatten().flatten() {
            if is_unfinished(&left.file_name().to_string_lossy()) {
                let _ = fs::remove_file(left.path());
            }
        }
        let _ = fs::remove_dir(&self.path);
    }

    /// Size of the parts so far, bytes.
    pub fn size(&self) -> u64 {
        let parts = (1..=self.chunks).map(|chunk| fs::metadata(self.part(chunk)));
        parts.flatten().map(|file| file.len()).sum()
    }
}

/// The failed points of a merged table.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Merged {
    /// Number of points that could not be run.
    pub failed: u64,
    /// Error of the first of them.
    pub first: Option<String>,
}

/// The first letters of a hash.
fn short(hash: &str) -> &str {
    hash.get(..8).unwrap_or("unknown")
}

/// Writes sorted numbers as `1,3,5-9`.
pub fn ranges(numbers: &[u64]) -> String {
    let runs = numbers.chunk_by(|one, next| one + 1 == *next);
    let shown = runs.map(|run| match run {
        [one] => one.to_string(),
        _ => format!("{}-{}", run[0], run[run.len() - 1]),
    });
    shown.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(points: u64) -> Plan {
        crate::testing::plan(&format!(
            "[[axis]]\nkey = \"duration\"\nlinspace = [1e-3, 2e-3, {points}]"
        ))
    }

    #[test]
    fn a_plan_has_as_many_chunks_as_were_asked_for_and_each_point_is_in_one() {
        for (points, asked, chunks) in [
            (250, 100, 100),
            (7, 100, 7),
            (7, 3, 3),
            (999_999_999_989, 99_999, 99_999),
        ] {
            let place = tempfile::tempdir().unwrap();
            Folder::create(place.path(), plan(points), asked).unwrap();
            let folder = Folder::open(place.path()).unwrap();
            assert_eq!(folder.chunks(), chunks);
            let (mut next, mut most) = (0, 0);
            for chunk in 1..=chunks {
                let range = folder.points(chunk);
                assert!(range.start == next && range.end > next, "{range:?}");
                most = most.max(range.end - range.start);
                next = range.end;
            }
            assert_eq!((next, most), (points, folder.most_points()));
        }
    }

    #[test]
    fn what_a_killed_program_left_of_a_plan_is_none_of_anothers_files() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join(".bead-a1B2c3"), "").unwrap();
        assert!(is_unfinished(".bead-a1B2c3"));
        Folder::create(place.path(), plan(2), 1).unwrap();
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("mine"), "").unwrap();
        assert!(Folder::create(place.path(), plan(2), 1).is_err());
    }

    #[test]
    fn a_file_among_the_parts_is_known_by_any_of_its_names() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::create(&place.path().join("d"), plan(2), 1).unwrap();
        let at = |name: &str| place.path().join(name);
        std::os::unix::fs::symlink(at("d"), at("link")).unwrap();
        fs::write(at("d/part-00001.parquet"), "").unwrap();
        std::os::unix::fs::symlink(at("d/part-00001.parquet"), at("a.parquet")).unwrap();
        for inside in ["d/new.parquet", "link/part-00001.parquet", "a.parquet"] {
            assert!(folder.has_within(&at(inside)), "{inside}");
        }
        for outside in ["b.parquet", "nowhere/b.parquet"] {
            assert!(!folder.has_within(&at(outside)), "{outside}");
        }
    }
}
