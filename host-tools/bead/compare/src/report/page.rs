//! A report as one HTML file that needs nothing from outside.

use hertz_charts::{COLUMN, Chart, Error, style};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::report::content::{Chapter, Grid, GridCell, GridColumn, Medium, Passage, Report};

const PAGE_STYLE: &str = "\
*{box-sizing:border-box}\
body{margin:0;background:var(--paper);color:var(--text);\
font:16px/1.55 system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}\
main{max-width:1060px;margin:0 auto;padding:40px 24px 72px}\
h1{font-size:1.9rem;line-height:1.2;margin:.15em 0 .5em;letter-spacing:-.01em}\
h2{font-size:1.2rem;margin:2.6em 0 .5em}p{margin:.5em 0 1em;max-width:72ch}\
.above{color:var(--faint);font-size:.9rem;margin:0}\
.verdict{display:inline-block;padding:.2em .8em;border-radius:1em;font-weight:600;font-size:.92rem;\
border:1.5px solid currentColor}\
.pass{color:var(--sensed)}.fail{color:var(--predicted)}\
.key{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:12px;margin:1.6em 0}\
.key div{border:1px solid var(--grid);border-radius:10px;padding:12px 14px}\
.key b{display:block;font-size:1.25rem;line-height:1.45;white-space:nowrap;font-variant-numeric:tabular-nums}\
.key span{color:var(--faint);font-size:.86rem}\
.scroll{overflow-x:auto}.scroll+.scroll{margin-top:1.4em}\
table{border-collapse:collapse;width:100%;font-size:.89rem;font-variant-numeric:tabular-nums}\
th,td{text-align:right;padding:.42em .7em;border-bottom:1px solid var(--grid);white-space:nowrap}\
th:first-child,td:first-child{text-align:left;padding-left:0}\
thead th{color:var(--faint);font-weight:500}\
.facts td{white-space:normal;text-align:left;overflow-wrap:anywhere}.facts td:first-child{color:var(--faint);width:25%}\
svg.chart{display:block;width:100%;height:auto;margin:.6em 0 0}.narrow{display:none}\
.bins{display:inline-flex;align-items:flex-end;height:22px;width:84px;gap:1px}\
.bins i{flex:1;min-height:1px;background:var(--measured)}\
.bar{height:9px;border-radius:5px;background:var(--grid);min-width:180px;overflow:hidden}\
.bar i{display:block;height:100%;background:var(--measured);border-radius:5px}\
pre{overflow-x:auto;font:13px/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;\
border:1px solid var(--grid);border-radius:10px;padding:12px 14px}\
details summary{cursor:pointer;color:var(--faint)}\
@media(max-width:640px){main{padding:22px 14px 48px}h1{font-size:1.45rem}.wide,.more{display:none}\
.narrow{display:block}table{font-size:.8rem}th,td{padding:.35em .25em}.bins{width:44px;gap:0}th:first-child,td:first-child{white-space:normal}\
.key{grid-template-columns:1fr 1fr}.bar{min-width:70px}}\
@media print{main{max-width:none;padding:0}.scroll{overflow:visible}table{font-size:.78rem}\
th,td{padding:.25em .4em;white-space:normal}pre{white-space:pre-wrap}\
tr,svg.chart,.key div{break-inside:avoid}.key{grid-template-columns:repeat(5,1fr)}.key b{font-size:1.1rem}\
tbody tr:nth-child(-n+3){break-after:avoid}tbody tr:nth-last-child(-n+3){break-before:avoid}\
h2,h2+p,thead,summary{break-after:avoid}}";

impl Report {
    /// The report as an HTML page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn page(&self) -> Result<String, Error> {
        let (class, verdict) = match &self.verdict {
            Ok(verdict) => ("pass", *verdict),
            Err(why) => ("fail", &why[..]),
        };
        let sections = self.sections.iter().filter(|section| section.is_on_page());
        let sections: Vec<Markup> = sections.map(section).collect::<Result<_, _>>()?;
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width,initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(style())) (PreEscaped(PAGE_STYLE)) }
                }
                body {
                    main {
                        p.above { (self.above) }
                        h1 { (self.title) }
                        p { span.verdict.(class) { (verdict) } }
                        @if !self.tiles.is_empty() {
                            div.key {
                                @for (value, name) in &self.tiles { div { b { (value) } span { (name) } } }
                            }
                        }
                        @for section in sections { (section) }
                    }
                }
            }
        };
        Ok(page.into_string())
    }
}

impl Chapter {
    fn is_on_page(&self) -> bool {
        self.content.iter().any(|block| match block {
            Passage::Grid(table) => table.medium.is_page() && !table.rows.is_empty(),
            _ => true,
        })
    }
}

fn section(section: &Chapter) -> Result<Markup, Error> {
    let blocks = blocks(&section.content)?;
    Ok(html! { h2 { (section.heading) } (blocks) })
}

fn blocks(blocks: &[Passage]) -> Result<Markup, Error> {
    let blocks: Vec<Markup> = blocks.iter().map(block).collect::<Result<_, _>>()?;
    Ok(html! { @for block in blocks { (block) } })
}

fn block(block: &Passage) -> Result<Markup, Error> {
    Ok(match block {
        Passage::Text(text) | Passage::Line(text) => html! { p { (text) } },
        Passage::Failure(text) => html! { p.fail { (text) } },
        Passage::List(lines) => html! { ul { @for line in lines { li { (line) } } } },
        Passage::Grid(shown) if shown.medium.is_page() && !shown.rows.is_empty() => table(shown),
        Passage::Grid(_) => html! {},
        Passage::Chart(wide) => {
            let narrow = Chart {
                width: COLUMN,
                ..Chart::clone(wide)
            };
            let [wide, narrow] = [wide.inline_svg()?, narrow.inline_svg()?];
            html! { div.wide { (PreEscaped(wide)) } div.narrow { (PreEscaped(narrow)) } }
        }
        Passage::Verbatim(text) => html! { pre { (text) } },
        Passage::Folded {
            summary,
            open,
            content: hidden,
        } => {
            let hidden = blocks(hidden)?;
            html! { details open[*open] { summary { (summary) } (hidden) } }
        }
    })
}

fn table(table: &Grid) -> Markup {
    if table.columns.is_empty() {
        return html! {
            table.facts {
                tbody { @for row in &table.rows { tr { @for cell in row { (self::cell(cell, None)) } } } }
            }
        };
    }
    // A column that has a goal only for single strikes is empty for several.
    let has_cells = |place: usize| {
        let cells = table.rows.iter().filter_map(|row| row.get(place));
        table.rows.is_empty() || cells.into_iter().any(|cell| *cell != EMPTY)
    };
    let shown = |(place, column): &(usize, &GridColumn)| column.medium.is_page() && has_cells(*place);
    let columns = || table.columns.iter().enumerate().filter(shown);
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        @for (place, column) in columns() {
                            @let group = table.group.as_ref().filter(|_| place == 0);
                            th class=[class(column, None)] { (group.unwrap_or(&column.name)) }
                        }
                    }
                }
                tbody {
                    @for row in &table.rows {
                        tr { @for (place, column) in columns() { (cell(row.get(place).unwrap_or(&EMPTY), Some(column))) } }
                    }
                }
            }
        }
    }
}

const EMPTY: GridCell = GridCell::Text(String::new());

fn class(column: &GridColumn, met: Option<bool>) -> Option<&'static str> {
    let judged = met.map(|met| if met { "pass" } else { "fail" });
    match (column.medium, judged) {
        (Medium::Wide, None) => Some("more"),
        (Medium::Wide, Some("pass")) => Some("more pass"),
        (Medium::Wide, Some(_)) => Some("more fail"),
        (_, judged) => judged,
    }
}

fn cell(cell: &GridCell, column: Option<&GridColumn>) -> Markup {
    let met = match cell {
        GridCell::Judged(_, met) => Some(*met),
        _ => None,
    };
    let class = column.and_then(|column| class(column, met));
    html! {
        td class=[class] {
            @match cell {
                GridCell::Text(text) | GridCell::Judged(text, _) => (text),
                GridCell::Histogram(counts) => {
                    @let most = counts.iter().copied().max().unwrap_or(1).max(1);
                    span.bins {
                        @for count in counts { i style=(format!("height:{:.0}%", 100.0 * *count as f64 / most as f64)) {} }
                    }
                }
                GridCell::Bar(part) => {
                    div.bar { i style=(format!("width:{:.1}%", 100.0 * part.clamp(0.0, 1.0))) {} }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_needs_nothing_from_outside_and_escapes_its_text() {
        let table = Grid::new(
            "<a> | <b> | empty",
            [vec!["<c>".into(), GridCell::judged("<d>", Some(true)), "".into()]],
        );
        let report = Report {
            above: "<above>".to_owned(),
            title: "<title>".to_owned(),
            verdict: Err("<why>".to_owned()),
            tiles: vec![("<1>".to_owned(), "<tile>".to_owned())],
            sections: vec![
                Chapter::new("<heading>")
                    .text("<text>")
                    .with([Passage::Failure("<failure>".to_owned())])
                    .with([Passage::List(vec!["<line>".to_owned()])])
                    .table(table.group("<group>")),
                Chapter::facts("facts", [("name", "<fact>".to_owned())]),
                Chapter::scenario("title = \"<scenario>\""),
            ],
        };
        let page = report.page().unwrap();
        for outside in ["<script", "<link", "<img", "src=", "@import", "url(", "http"] {
            assert!(!page.contains(outside), "{outside}");
        }
        let all = "above title why 1 tile heading text failure line group b c d fact scenario";
        for text in all.split(' ') {
            let escaped = format!("&lt;{text}&gt;");
            assert!(page.contains(&escaped), "{text} is missing");
        }
        assert!(!page.contains("empty"), "a column without cells is shown");
        for raw in ["<why>", "<title><", "<c>", "<fact>", "<scenario>"] {
            assert!(!page.contains(raw), "{raw} is not escaped");
        }
    }
}
