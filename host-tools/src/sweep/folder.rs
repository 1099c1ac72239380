//! A plan on disk, with a part for each chunk that is finished.
//!
//! # Design
//! `plan.toml` is the whole sweep, with the scenario in it: a folder needs nothing beside it and may be
//! copied to another machine. A part is a Parquet file that takes its name when it is complete, and it names
//! its plan, so the parts are the journal. Any number of programs may compute chunks of one folder, the same
//! ones too: their bytes are the same.

use std::fs::{self, File};
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::Context;
use hertz_chain::{InputError, TomlFile, text_of};
use serde::{Deserialize, Serialize};

use crate::export::read::Reading;
use crate::export::table::{Parquet, Table};
use crate::recording::whole::{Target, WriteError, is_unfinished};
use crate::sweep::compute::compute;
use crate::sweep::definition::Definition;
use crate::sweep::plan::Plan;

/// What is wrong with a folder of a sweep, in one line.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The plan is not in order.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// What is there is not what should be.
    #[error("{0}")]
    Other(String),
}

/// A plan on disk.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    plan: Plan,
    chunk: u64,
}

/// `plan.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Page {
    /// The plan's hash.
    plan: String,
    made_by: String,
    points: u64,
    /// Points of a chunk; the last has the rest.
    chunk_points: u64,
    sweep: String,
}

const PAGE: &str = "plan.toml";
/// Chunks of a plan at most: each is a file, with a number of five digits.
pub const MOST_CHUNKS: u64 = 99_999;
/// The program, as it signs a plan.
const PROGRAM: &str = concat!("bead ", env!("CARGO_PKG_VERSION"));

impl Folder {
    /// Makes a folder for a plan, or opens the one that is there if it has the same plan; its chunks stay as
    /// they are. A chunk has more points than asked for where these would be more than [`MOST_CHUNKS`].
    ///
    /// # Errors
    /// [`FolderError`]: it holds another plan or other files, or cannot be made.
    pub fn create(path: &Path, plan: Plan, chunk: u64) -> Result<Self, FolderError> {
        if path.join(PAGE).exists() {
            let there = Self::open(path)?;
            if there.plan.hash() == plan.hash() {
                return Ok(there);
            }
            return Err(FolderError::Other(format!(
                "{} holds the parts of another sweep (plan {}, this is {}); give another place, or remove it",
                path.display(),
                short(there.plan.hash()),
                short(plan.hash())
            )));
        }
        let cannot = |error: std::io::Error| {
            FolderError::Other(format!(
                "cannot make the folder {}: {error}; give another place",
                path.display()
            ))
        };
        fs::create_dir_all(path).map_err(cannot)?;
        if fs::read_dir(path).map_err(cannot)?.next().is_some() {
            return Err(FolderError::Other(format!(
                "{} holds files that are not of a sweep; give another place",
                path.display()
            )));
        }
        let page = Page {
            plan: plan.hash().to_owned(),
            made_by: PROGRAM.to_owned(),
            points: plan.points(),
            chunk_points: chunk.clamp(plan.points().div_ceil(MOST_CHUNKS), plan.points()),
            sweep: plan.definition().to_toml(),
        };
        let chunk = page.chunk_points;
        let text = toml::to_string(&page).expect("numbers and strings are TOML");
        Target::new(path.join(PAGE)).replacing(true).write_bytes(text)?;
        Ok(Self {
            path: path.to_owned(),
            plan,
            chunk,
        })
    }

    /// Opens a folder.
    ///
    /// # Errors
    /// [`FolderError`]: it holds no plan, or one that was changed or made by another version.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let file = path.join(PAGE);
        if !file.exists() {
            return Err(FolderError::Other(format!(
                "{} holds no plan; make one with: bead sweep plan SWEEP.toml --dir {}",
                path.display(),
                path.display()
            )));
        }
        let name = file.display().to_string();
        let text = text_of(&file, "a folder that bead sweep plan has made")?;
        let page: Page = TomlFile::parse(&text, &name)?.read()?;
        if page.made_by != PROGRAM {
            return Err(FolderError::Other(format!(
                "{name} was made by {}, and this is {PROGRAM}, whose last digits may differ; make the plan anew",
                page.made_by
            )));
        }
        let plan = Plan::new(Definition::from_toml(&page.sweep, &name)?)?;
        if plan.hash() != page.plan || plan.points() != page.points || page.chunk_points == 0 {
            return Err(FolderError::Other(format!(
                "{name} was changed after it was made; make the plan anew from the sweep's file"
            )));
        }
        let chunks = plan.points().div_ceil(page.chunk_points);
        if chunks > MOST_CHUNKS {
            return Err(FolderError::Other(format!(
                "{name} has chunks of {} points, so {chunks} of them, and at most {MOST_CHUNKS} have a number; make the \
                 plan anew",
                page.chunk_points
            )));
        }
        Ok(Self {
            path: path.to_owned(),
            plan,
            chunk: page.chunk_points,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// How many chunks there are. They are counted from 1.
    pub fn chunks(&self) -> u64 {
        self.plan.points().div_ceil(self.chunk)
    }

    /// The points of a chunk.
    pub fn points(&self, chunk: u64) -> Range<u64> {
        let end = (chunk * self.chunk).min(self.plan.points());
        (chunk - 1) * self.chunk..end
    }

    fn part(&self, chunk: u64) -> PathBuf {
        self.path.join(format!("part-{chunk:05}.parquet"))
    }

    /// Whether a chunk is finished.
    ///
    /// # Errors
    /// [`FolderError`]: the file with its name is not a part of this plan.
    pub fn finished(&self, chunk: u64) -> Result<bool, FolderError> {
        let path = self.part(chunk);
        if !path.exists() {
            return Ok(false);
        }
        let strange = |why: String| {
            FolderError::Other(format!(
                "{} is not chunk {chunk} of this plan: {why}; move it away and run the chunk again",
                path.display()
            ))
        };
        let part = Reading::open(&path).map_err(|error| strange(format!("{error:#}")))?;
        let plan = part.said("plan").unwrap_or_default();
        if plan != self.plan.hash() {
            return Err(strange(format!("it is of plan {}", short(plan))));
        }
        let points = self.points(chunk);
        let rows = points.end - points.start;
        if part.said("chunk") != Some(&self.signature(chunk)) || part.rows() != rows {
            return Err(strange(format!(
                "it has {} rows of chunk {}",
                part.rows(),
                part.said("chunk").unwrap_or("?")
            )));
        }
        if part.columns() != self.plan.columns() {
            return Err(strange("it has other columns".to_owned()));
        }
        Ok(true)
    }

    /// `K/N`.
    fn signature(&self, chunk: u64) -> String {
        format!("{chunk}/{}", self.chunks())
    }

    /// The chunks that are not finished.
    ///
    /// # Errors
    /// As [`finished`](Self::finished).
    pub fn missing(&self) -> Result<Vec<u64>, FolderError> {
        let mut missing = Vec::new();
        for chunk in 1..=self.chunks() {
            if !self.finished(chunk)? {
                missing.push(chunk);
            }
        }
        Ok(missing)
    }

    /// Computes a chunk in the pool that this is called in. `tell` hears of the points done.
    ///
    /// # Errors
    /// [`FolderError`]: the part cannot be written; the finished ones stay.
    pub fn run(&self, chunk: u64, tell: &(dyn Fn(f64) + Sync)) -> Result<(), FolderError> {
        let target = Target::new(self.part(chunk)).replacing(true);
        let signature = self.signature(chunk);
        let said = [("plan", self.plan.hash()), ("chunk", &signature)];
        Ok(target.write(|file| {
            let mut table = Parquet::signed(file, "sweep", &self.plan.columns(), &said)?;
            compute(&self.plan, self.points(chunk), &mut table, tell)?;
            Box::new(table).finish()
        })?)
    }

    /// Writes the table of all parts. Gives how many points could not be run, and why the first could not.
    ///
    /// # Errors
    /// [`FolderError`]: a chunk is missing or of another plan, or the file cannot be written.
    pub fn merge(&self, target: &Target, tell: &dyn Fn(u64)) -> Result<Merged, FolderError> {
        let missing = self.missing()?;
        if !missing.is_empty() {
            return Err(FolderError::Other(format!(
                "{} of {} chunks are missing: {}; run them with: bead sweep run {}",
                missing.len(),
                self.chunks(),
                ranges(&missing),
                self.path.display()
            )));
        }
        let definition = self.plan.definition().to_toml();
        let said = [("plan", self.plan.hash()), ("sweep", &definition)];
        let mut merged = Merged::default();
        target.write(|file| {
            let mut table = Parquet::signed(file, "sweep", &self.plan.columns(), &said)?;
            for chunk in 1..=self.chunks() {
                let path = self.part(chunk);
                let named = || path.display().to_string();
                let part = Reading::open(&path).with_context(named)?;
                for group in part.groups() {
                    for row in group.with_context(named)?.into_rows() {
                        if let Some(crate::export::Cell::Text(why)) = row.last() {
                            merged.failed += 1;
                            merged.first.get_or_insert_with(|| why.to_string());
                        }
                        table.push(row)?;
                    }
                }
                tell(chunk);
            }
            Box::new(table).finish()
        })?;
        Ok(merged)
    }

    /// Removes the folder's files, and the folder if nothing else is in it.
    pub fn remove(self) {
        // What cannot be removed is left to its owner; the result is whole.
        for chunk in 1..=self.chunks() {
            let _ = fs::remove_file(self.part(chunk));
        }
        let _ = fs::remove_file(self.path.join(PAGE));
        // Of programs that were killed: all chunks are finished, so nobody writes them.
        for left in fs::read_dir(&self.path).into_iter().flatten().flatten() {
            if is_unfinished(&left.file_name().to_string_lossy()) {
                let _ = fs::remove_file(left.path());
            }
        }
        let _ = fs::remove_dir(&self.path);
    }

    /// A file of the folder that belongs to neither plan nor parts.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Bytes of the parts so far.
    pub fn size(&self) -> u64 {
        let part = |chunk| File::open(self.part(chunk)).and_then(|file| file.metadata());
        (1..=self.chunks())
            .filter_map(|chunk| Some(part(chunk).ok()?.len()))
            .sum()
    }
}

/// What came together in a table.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Merged {
    /// Points that could not be run.
    pub failed: u64,
    /// Why the first of them could not.
    pub first: Option<String>,
}

/// The beginning of a hash, for people.
fn short(hash: &str) -> &str {
    hash.get(..8).unwrap_or("unknown")
}

/// Numbers in order as `1,3,5-9`.
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

    #[test]
    fn numbers_are_told_as_ranges() {
        assert_eq!(ranges(&[1, 2, 3, 5, 7, 8]), "1-3,5,7-8");
        assert_eq!(ranges(&[]), "");
    }
}
