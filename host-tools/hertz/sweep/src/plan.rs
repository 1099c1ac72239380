//! The points of a sweep by number.

use std::hash::Hasher;
use std::path::Path;

use hertz_chain::{EnsembleOutcome, InputError, Scenario, plain_words};
use siphasher::sip128::{Hasher128, SipHasher24};

use crate::axis::SweepAxis;
use crate::definition::Definition;
use bead_tables::{Cell, CellKind, Column};

/// All points of a sweep.
#[derive(Debug, Clone)]
pub struct Plan {
    definition: Definition,
    /// Distance in number between two places of each axis.
    strides: Vec<u64>,
    points: u64,
    hash: String,
}

/// Points beyond this can neither be numbered nor waited for.
const MOST_POINTS: u64 = 1 << 53;

impl Plan {
    /// Reads a sweep's file.
    ///
    /// # Errors
    /// The file, or the scenario that it names, is wrong.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::new(Definition::load(path)?)
    }

    /// The points of a definition.
    ///
    /// # Errors
    /// The axes have more points than can be numbered.
    pub fn new(definition: Definition) -> Result<Self, InputError> {
        let axes = &definition.axes;
        let product = axes
            .iter()
            .try_fold(1_u64, |points, axis| points.checked_mul(axis.count));
        let Some(points) = product.filter(|points| *points <= MOST_POINTS) else {
            let what = "the grid has more points than can be counted";
            let advice = "give the axes fewer values, or draw points with quasirandom";
            return Err(InputError::at("axis", what, advice));
        };
        let mut strides = vec![1; axes.len()];
        for axis in (1..axes.len()).rev() {
            strides[axis - 1] = strides[axis] * axes[axis].count;
        }
        let mut hasher = SipHasher24::new();
        // The version is part of the hash, since another version may compute other last digits.
        hasher.write(concat!("bead ", env!("CARGO_PKG_VERSION"), "\n").as_bytes());
        hasher.write(definition.to_toml().as_bytes());
        let hash = format!("{:032x}", hasher.finish128().as_u128());
        Ok(Self {
            definition,
            strides,
            points,
            hash,
        })
    }

    /// The sweep.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// Number of points.
    pub fn points(&self) -> u64 {
        self.points
    }

    /// Hash of the scenario, axes, outputs and version of this program: 32 hexadecimal digits.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// The axes; the last turns fastest.
    pub fn axes(&self) -> &[SweepAxis] {
        &self.definition.axes
    }

    /// The place of a point on an axis.
    pub fn place(&self, point: u64, axis: usize) -> u64 {
        point / self.strides[axis] % self.axes()[axis].count
    }

    /// The place of a point on each axis.
    pub fn places(&self, point: u64) -> Vec<u64> {
        (0..self.strides.len())
            .map(|axis| self.place(point, axis))
            .collect()
    }

    /// The scenario of a point.
    ///
    /// # Errors
    /// The reason why the point has no scenario.
    pub fn scenario(&self, point: u64) -> Result<Scenario, String> {
        let mut table = self.definition.scenario().clone();
        for (axis, place) in self.axes().iter().zip(self.places(point)) {
            for along in &axis.along {
                let set = along.key.set(&mut table, along.value(place));
                set.map_err(|error| format!("{}; {}", error.what, error.advice))?;
            }
        }
        table
            .try_into()
            .map_err(|error: toml::de::Error| plain_words(&error.message().replace('\n', " ")))
    }

    /// The columns of the table.
    pub fn columns(&self) -> Vec<Column> {
        let mut columns = vec![Column::new("point", CellKind::Whole)];
        for axis in self.axes() {
            columns.extend(axis.name.iter().map(|name| Column::new(name, CellKind::Whole)));
            let along = axis.along.iter();
            columns.extend(along.map(|along| Column::new(along.key.column(), along.kind())));
        }
        columns.extend(self.definition.outputs.columns());
        columns.push(Column::new("error", CellKind::Text));
        columns
    }

    /// The row of a point.
    pub fn row(&self, point: u64, result: &Result<EnsembleOutcome, String>) -> Vec<Cell> {
        let mut row = vec![Cell::whole(point)];
        for (axis, place) in self.axes().iter().zip(self.places(point)) {
            row.extend(axis.name.iter().map(|_| Cell::whole(place)));
            row.extend(axis.along.iter().map(|along| along.cell(place)));
        }
        let outputs = &self.definition.outputs;
        match result {
            Ok(outcome) => row.extend(outputs.cells(outcome).into_iter().chain([Cell::Null])),
            Err(why) => {
                row.extend(std::iter::repeat_n(Cell::Null, outputs.columns().len()));
                row.push(Cell::Text(why.as_str().into()));
            }
        }
        row
    }

    /// A line of Python that makes a cube of the table.
    pub fn xarray(&self, path: &Path) -> String {
        let index: Vec<String> = self.axes().iter().map(|axis| quoted(&axis.index())).collect();
        format!(
            "pandas.read_parquet({}).set_index([{}]).to_xarray()",
            quoted(&path.display().to_string()),
            index.join(", ")
        )
    }
}

/// A string literal of Python. Invisible characters are written by their numbers.
fn quoted(text: &str) -> String {
    let one = |c: char| match c.escape_debug().to_string() {
        by_number if by_number.starts_with("\\u") => format!("\\U{:08x}", u32::from(c)),
        other => other,
    };
    format!("\"{}\"", text.chars().map(one).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::definition;

    #[test]
    fn a_file_of_any_name_is_quoted_as_python_reads_it() {
        let odd = "a\u{301} \u{200b}\\\"\n";
        assert_eq!(quoted(odd), r#""a\U00000301 \U0000200b\\\"\n""#);
    }

    #[test]
    fn a_grid_that_cannot_be_counted_is_refused() {
        let axis = |key: &str| format!("[[axis]]\nkey = \"{key}\"\nlinspace = [1.0, 2.0, 1e9]\n");
        let definition = definition(&(axis("duration") + &axis("chain.young"))).unwrap();
        let refusal = Plan::new(definition).unwrap_err();
        assert_eq!(refusal.what, "the grid has more points than can be counted");
    }
}
