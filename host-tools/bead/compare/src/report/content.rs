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
    /// The heading.
    pub title: String,
    /// The good news, or the reason for the failure.
    pub verdict: Result<&'static str, String>,
    /// The most important values, each with its name.
    pub tiles: Vec<(String, String)>,
    /// The sections, in order. Those without content are left out.
    pub sections: Vec<Chapter>,
}

/// A part of a report under a heading of its own, which only the page shows.
#[derive(Debug)]
pub struct Chapter {
    pub(super) heading: String,
    pub(super) content: Vec<Passage>,
}

/// A piece of a section. All but lines and tables are only for the page.
#[derive(Debug)]
pub enum Passage {
    /// A paragraph.
    Text(String),
    /// A paragraph about something that failed.
    Failure(String),
    /// Lines with a mark before each.
    List(Vec<String>),
    /// A line below the table before it.
    Line(String),
    /// A table.
    Grid(Grid),
    /// A chart. It is drawn for a wide window, and once more for a narrow one.
    Chart(Box<Chart>),
    /// Text that keeps its lines, such as a scenario.
    Verbatim(String),
    /// Content that a click opens and closes.
    Folded {
        /// The line that stands for it.
        summary: &'static str,
        /// True if it begins open.
        open: bool,
        /// The content.
        content: Vec<Passage>,
    },
}

/// Renderers that show a piece of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Medium {
    /// The terminal and the page.
    Both,
    /// The terminal, and the page in wide windows.
    Wide,
    /// Only the page.
    Page,
    /// Only the terminal.
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
pub struct Grid {
    /// The renderers that show it; [`Medium::Wide`] counts as [`Medium::Both`].
    pub(super) medium: Medium,
    /// The name of the group of its rows. The page shows it in place of the first heading. The terminal shows
    /// it in a separate row, with the group indented below, and joins tables with equal columns.
    pub(super) group: Option<String>,
    /// The headings; empty for a table without headings.
    pub(super) columns: Vec<GridColumn>,
    /// The rows. One that is shorter than the headings ends in empty cells.
    pub(crate) rows: Vec<Vec<GridCell>>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct GridColumn {
    pub(super) name: String,
    pub(super) medium: Medium,
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum GridCell {
    /// A name or a number.
    Text(String),
    /// A value, and whether it is within its goal.
    Judged(String, bool),
    /// A histogram, only on the page: the counts of its bins.
    Histogram(Vec<usize>),
    /// A bar, only on the page: its length as a part of the column's width.
    Bar(f64),
}

impl Chapter {
    /// An empty section under a heading.
    pub fn new(heading: impl Into<String>) -> Self {
        Self {
            heading: heading.into(),
            content: Vec::new(),
        }
    }

    /// Appends content.
    #[must_use]
    pub fn with(mut self, content: impl IntoIterator<Item = Passage>) -> Self {
        self.content.extend(content);
        self
    }

    /// Appends a paragraph.
    #[must_use]
    pub fn text(self, text: impl Into<String>) -> Self {
        self.with([Passage::Text(text.into())])
    }

    /// Appends a table.
    #[must_use]
    pub fn table(self, table: Grid) -> Self {
        self.with([Passage::Grid(table)])
    }

    /// Appends a chart.
    #[must_use]
    pub fn chart(self, chart: Chart) -> Self {
        self.with([Passage::Chart(Box::new(chart))])
    }

    /// Appends a line, if there is one.
    #[must_use]
    pub fn line(self, line: Option<String>) -> Self {
        self.with(line.map(Passage::Line))
    }

    /// A section of facts: a table of names and values, only for the page.
    pub fn facts(heading: &str, facts: impl IntoIterator<Item = Fact>) -> Self {
        let facts = facts.into_iter();
        let rows = facts.map(|(name, value)| vec![name.into(), value.into()]);
        Self::new(heading).table(Grid::new("", rows).on(Medium::Page))
    }

    /// The scenario, as its author wrote it.
    pub(crate) fn scenario(text: &str) -> Self {
        Self::new("The scenario").with([Passage::Folded {
            summary: "as it was given",
            open: true,
            content: vec![Passage::Verbatim(text.to_owned())],
        }])
    }
}

impl Grid {
    /// A table for both renderers. `|` separates the headings. A mark before one says which renderers show
    /// its column: `~` the page in wide windows only, `^` only the terminal, `#` only the page.
    pub fn new(headings: &str, rows: impl IntoIterator<Item = Vec<GridCell>>) -> Self {
        let headings = headings.split('|').filter(|_| !headings.is_empty());
        Self {
            medium: Medium::Both,
            group: None,
            columns: headings.map(GridColumn::marked).collect(),
            rows: rows.into_iter().collect(),
        }
    }

    /// Shows the table only in these renderers.
    #[must_use]
    pub fn on(self, medium: Medium) -> Self {
        Self { medium, ..self }
    }

    /// Makes the table a named group of rows.
    #[must_use]
    pub fn group(self, name: impl Into<String>) -> Self {
        let group = Some(name.into());
        Self { group, ..self }
    }
}

impl GridColumn {
    fn marked(heading: &str) -> Self {
        let marks = [('~', Medium::Wide), ('^', Medium::Terminal), ('#', Medium::Page)];
        let strip = |&(mark, medium)| Some((heading.trim().strip_prefix::<char>(mark)?, medium));
        let (name, medium) = marks
            .iter()
            .find_map(strip)
            .unwrap_or((heading.trim(), Medium::Both));
        let name = name.to_owned();
        Self { name, medium }
    }
}

impl GridCell {
    /// A value, and whether it is within its goal if it has one.
    pub fn judged(text: impl Into<String>, met: Option<bool>) -> Self {
        match met {
            Some(met) => Self::Judged(text.into(), met),
            None => Self::Text(text.into()),
        }
    }

    /// `met` or `missed`; empty without a goal.
    pub(crate) fn verdict(met: Option<bool>) -> Self {
        let text = met.map_or("", |met| if met { "met" } else { "missed" });
        Self::judged(text, met)
    }

    pub(crate) fn known(text: Option<String>) -> Self {
        Self::Text(text.unwrap_or_else(|| DASH.to_owned()))
    }
}

impl<T: Into<String>> From<T> for GridCell {
    fn from(text: T) -> Self {
        Self::Text(text.into())
    }
}
