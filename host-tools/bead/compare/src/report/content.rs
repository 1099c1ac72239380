//! The content of a report: tiles, sections, tables and cells.

use hertz_charts::Chart;

/// A fact of a run: its name and its value.
pub type Fact = (&'static str, String);

/// The cell of a value that is not known.
pub const DASH: &str = "–";

/// A result for people.
#[derive(Debug)]
pub struct Report {
    /// The subject, in one line above the heading.
    pub above: String,
    /// The heading and the page's title.
    pub title: String,
    /// The good news, or the reason of the failure.
    pub verdict: Result<&'static str, String>,
    /// The most important values, each with its name.
    pub tiles: Vec<(String, String)>,
    /// The sections, in order. Those without blocks are left out.
    pub sections: Vec<Section>,
}

/// A part of a report under a heading of its own.
#[derive(Debug)]
pub struct Section {
    /// The heading; only the page shows it.
    pub heading: String,
    /// The content, in order.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Debug)]
pub enum Block {
    /// A paragraph of the page.
    Text(String),
    /// A paragraph of the page about something that failed.
    Failure(String),
    /// A list of the page.
    List(Vec<String>),
    /// A line for both, below the table before it.
    Line(String),
    /// A table.
    Table(Table),
    /// A chart of the page. It is drawn for a wide window, and once more for a narrow one.
    Chart(Box<Chart>),
    /// Text of the page that keeps its lines, such as a scenario.
    Verbatim(String),
    /// Blocks of the page that a summary opens.
    Folded {
        /// The summary.
        summary: &'static str,
        /// True if it is open at first.
        open: bool,
        /// The hidden blocks.
        blocks: Vec<Block>,
    },
}

/// The renderers that show something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Medium {
    /// Terminal and page.
    Both,
    /// The terminal, and the page in wide windows.
    Wide,
    /// The page alone.
    Page,
    /// The terminal alone.
    Terminal,
}

impl Medium {
    pub(super) fn is_terminal(self) -> bool {
        self != Self::Page
    }

    pub(super) fn is_page(self) -> bool {
        self != Self::Terminal
    }
}

/// A table. Its first column has names, the others numbers.
#[derive(Debug)]
pub struct Table {
    /// The renderers that show it; [`Medium::Wide`] is as [`Medium::Both`].
    pub medium: Medium,
    /// The name of the group of its rows. The page has it in place of the first heading. On the terminal it
    /// is a row of its own, with the rows indented below it, and tables with equal columns are one.
    pub group: Option<String>,
    /// The headings. Without one, the table has none.
    pub(super) columns: Vec<Column>,
    /// The rows. One that is shorter than the headings ends in empty cells.
    pub rows: Vec<Vec<Cell>>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) medium: Medium,
}

/// A cell of a table.
#[derive(Debug, Clone)]
pub enum Cell {
    /// A value.
    Text(String),
    /// A value, and whether it is within its goal.
    Judged(String, bool),
    /// A histogram of the page: the counts of its bins.
    Histogram(Vec<usize>),
    /// A bar of the page, of this part of the column's width.
    Bar(f64),
}

impl Section {
    /// A section without blocks.
    pub fn new(heading: impl Into<String>) -> Self {
        Self {
            heading: heading.into(),
            blocks: Vec::new(),
        }
    }

    /// This section with one more block.
    #[must_use]
    pub fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// This section with a paragraph for the page.
    #[must_use]
    pub fn text(self, text: impl Into<String>) -> Self {
        self.with(Block::Text(text.into()))
    }

    /// This section with a table.
    #[must_use]
    pub fn table(self, table: Table) -> Self {
        self.with(Block::Table(table))
    }

    /// This section with a chart.
    #[must_use]
    pub fn chart(self, chart: Chart) -> Self {
        self.with(Block::Chart(Box::new(chart)))
    }

    /// This section with a line for terminal and page, if there is one.
    #[must_use]
    pub fn line(self, line: Option<String>) -> Self {
        match line {
            Some(line) => self.with(Block::Line(line)),
            None => self,
        }
    }

    /// A section of facts: a table of names and values, for the page alone.
    pub fn facts(heading: &str, facts: impl IntoIterator<Item = Fact>) -> Self {
        let facts = facts.into_iter();
        let rows = facts.map(|(name, value)| vec![name.into(), value.into()]);
        Self::new(heading).table(Table::new("", rows).on(Medium::Page))
    }

    /// The scenario, as its author wrote it.
    pub fn scenario(text: &str) -> Self {
        Self::new("The scenario").with(Block::Folded {
            summary: "as it was given",
            open: true,
            blocks: vec![Block::Verbatim(text.to_owned())],
        })
    }
}

impl Table {
    /// A table for both renderers. `|` separates the headings. A mark before one says which renderers show
    /// its column: `~` the page in wide windows only, `^` the terminal alone, `#` the page alone.
    pub fn new(headings: &str, rows: impl IntoIterator<Item = Vec<Cell>>) -> Self {
        let headings = headings.split('|').filter(|_| !headings.is_empty());
        let columns = headings.map(|heading| Column::marked(heading.trim())).collect();
        Self {
            medium: Medium::Both,
            group: None,
            columns,
            rows: rows.into_iter().collect(),
        }
    }

    /// This table for these renderers.
    #[must_use]
    pub fn on(self, medium: Medium) -> Self {
        Self { medium, ..self }
    }

    /// This table with its rows in a group.
    #[must_use]
    pub fn group(self, name: impl Into<String>) -> Self {
        Self {
            group: Some(name.into()),
            ..self
        }
    }
}

impl Column {
    fn marked(heading: &str) -> Self {
        let marks = [('~', Medium::Wide), ('^', Medium::Terminal), ('#', Medium::Page)];
        let strip = |&(mark, medium)| Some((heading.strip_prefix::<char>(mark)?, medium));
        let (name, medium) = marks.iter().find_map(strip).unwrap_or((heading, Medium::Both));
        Self {
            name: name.to_owned(),
            medium,
        }
    }
}

impl Cell {
    /// A value, and whether it is within its goal if it has one.
    pub fn judged(text: impl Into<String>, met: Option<bool>) -> Self {
        match met {
            Some(met) => Self::Judged(text.into(), met),
            None => Self::Text(text.into()),
        }
    }

    /// `met` or `missed`; empty without a goal.
    pub fn verdict(met: Option<bool>) -> Self {
        let text = met.map_or("", |met| if met { "met" } else { "missed" });
        Self::judged(text, met)
    }

    /// A value, or a dash.
    pub fn known(text: Option<String>) -> Self {
        Self::Text(text.unwrap_or_else(|| DASH.to_owned()))
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::Text(text.into())
    }
}
