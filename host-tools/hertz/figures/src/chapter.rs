//! The results of the figures as pages: the Markdown table of the validation chapter, and the HTML page
//! beside the files.

use std::fmt::Write;

use crate::check::{FigureCheck, Relation};
use crate::plan::FigureOutcome;
use hertz_charts::{escape, raised, style};

const PAGE_STYLE: &str = "\
body{margin:0;background:var(--paper);color:var(--text);font:16px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,sans-serif}\
main{max-width:1280px;margin:0 auto;padding:32px 20px}h1{font-size:1.6rem}\
nav{columns:3 280px;font-size:.9rem}nav a{display:block;color:var(--measured);text-decoration:none;padding:.1em 0}\
section{display:grid;grid-template-columns:minmax(280px,520px) 1fr;gap:8px 28px;align-items:start;\
border-top:1px solid var(--grid);padding:20px 0}\
section h2{grid-column:1/-1;font-size:1.05rem;margin:0}section p{grid-column:1/-1;margin:0;color:var(--faint);font-size:.9rem}\
section p a{color:var(--measured)}img{width:100%;height:auto}th{text-align:left;font-weight:600;padding:.3em .6em .3em 0}table{border-collapse:collapse;font-size:.86rem;font-variant-numeric:tabular-nums}\
td{padding:.3em .6em .3em 0;border-bottom:1px solid var(--grid);vertical-align:top}td+td{white-space:nowrap}\
.fail{color:var(--predicted);font-weight:600}\
@media(max-width:760px){section{grid-template-columns:minmax(0,1fr)}}\
@media(max-width:520px){tr{display:grid;grid-template-columns:1fr 1.4fr auto;border-bottom:1px solid var(--grid)}\
th:first-child{display:none}td{border:0;padding:.1em .6em .1em 0;white-space:normal}td:first-child{grid-column:1/-1;color:var(--faint)}}";

/// A number for people: six digits, which is more than any tolerance needs.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.2e}");
    }
    let decimals = (5 - value.abs().log10().floor() as i32).clamp(0, 8) as usize;
    let text = format!("{value:.decimals$}");
    if !text.contains('.') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Expectation of a check, for people.
pub fn expectation(check: &FigureCheck) -> String {
    match check.relation {
        Relation::Near if check.tolerance == 0.0 => number(check.expected),
        Relation::Near => format!("{} ± {:.1e}", number(check.expected), check.tolerance),
        Relation::AtMost => format!("≤ {}", number(check.expected)),
        Relation::AtLeast => format!("≥ {}", number(check.expected)),
    }
}

fn with_unit(text: String, unit: &str) -> String {
    if unit.is_empty() {
        text
    } else {
        format!("{text} {unit}")
    }
}

fn verdict(check: &FigureCheck) -> &'static str {
    if check.pass { "ok" } else { "FAILED" }
}

/// All checks in one Markdown table. Each conservation law has one row, with its worst value over all
/// figures.
pub fn markdown(outcomes: &[FigureOutcome]) -> String {
    let mut text = String::from(
        "| figure | what | value | expected | |\n\
         |---|---|---|---|---|\n",
    );
    let mut laws: Vec<&FigureCheck> = Vec::new();
    for outcome in outcomes {
        for check in &outcome.checks {
            if check.law.is_some() {
                match laws.iter_mut().find(|law| law.law == check.law) {
                    Some(worst) if worst.value < check.value => *worst = check,
                    Some(_) => {}
                    None => laws.push(check),
                }
                continue;
            }
            push_row(&mut text, outcome.name, &what_of(check), check);
        }
    }
    for law in laws {
        let what = format!("{}, worst of every run", law.law.unwrap_or_default());
        push_row(&mut text, "all", &what, law);
    }
    text
}

/// Quantity of a check, with the paper's own value where it differs.
fn what_of(check: &FigureCheck) -> String {
    let paper = check.paper.map(|says| format!(" (the paper: {says})"));
    format!("{}{}", check.what, paper.unwrap_or_default())
}

fn push_row(text: &mut String, figure: &str, what: &str, check: &FigureCheck) {
    text.push_str(&format!(
        "| {figure} | {} | {} | {} | {} |\n",
        raised(what, |plain| plain.replace('|', "\\|")),
        with_unit(number(check.value), check.unit),
        with_unit(expectation(check), check.unit),
        verdict(check)
    ));
}

/// A page that shows every figure with its checks. The pictures are the files beside it.
pub fn html(outcomes: &[FigureOutcome]) -> String {
    let failed = outcomes.iter().filter(|outcome| !outcome.pass).count();
    let mut body = String::new();
    // Writing to a String cannot fail.
    let mut push = |text: std::fmt::Arguments<'_>| body.write_fmt(text).unwrap_or_default();
    let checks: usize = outcomes.iter().map(|outcome| outcome.checks.len()).sum();
    push(format_args!(
        "<h1>Figures</h1><p>{} drawn with {checks} checks, {failed} out of tolerance.</p><nav>",
        outcomes.len()
    ));
    for outcome in outcomes {
        push(format_args!(
            "<a href=\"#{0}\">{0} · {1}{2}</a>",
            escape(outcome.name),
            raised(outcome.title, escape),
            if outcome.pass {
                ""
            } else {
                " <span class=\"fail\">FAILED</span>"
            },
        ));
    }
    push(format_args!("</nav>\n"));
    for outcome in outcomes {
        push(format_args!(
            "<section id=\"{0}\"><h2>{0} · {1}</h2><p>{2}. As <a href=\"figure-{0}.svg\">SVG</a>, \
             <a href=\"figure-{0}.png\">PNG</a>, <a href=\"figure-{0}.pdf\">PDF</a>, \
             <a href=\"figure-{0}.csv\">CSV</a>, <a href=\"figure-{0}.parquet\">Parquet</a>.{5}</p><img src=\"figure-{0}.{4}\" alt=\"{3}\"><table>\
             <tr><th>what</th><th>value</th><th>expected</th><th></th></tr>",
            escape(outcome.name),
            raised(outcome.title, escape),
            raised(outcome.setting, escape),
            escape(outcome.title),
            if outcome.animated { "gif" } else { "svg" },
            plate_link(outcome),
        ));
        for check in &outcome.checks {
            push(format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"{}\">{}</td></tr>",
                raised(&what_of(check), escape),
                escape(&with_unit(number(check.value), check.unit)),
                escape(&with_unit(expectation(check), check.unit)),
                if check.pass { "pass" } else { "fail" },
                verdict(check)
            ));
        }
        push(format_args!("</table></section>\n"));
    }
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>Figures</title>\
         <style>{}{PAGE_STYLE}</style></head>\n<body><main>{body}</main></body></html>\n",
        style()
    )
}

/// Links to the plate of a figure; empty if there is none.
fn plate_link(outcome: &FigureOutcome) -> String {
    let link = |path: &String| {
        let name = path.rsplit(['/', '\\']).next().unwrap_or(path);
        let kind = name.rsplit('.').next().unwrap_or(name).to_uppercase();
        format!("<a href=\"{}\">{kind}</a>", escape(name))
    };
    if outcome.plate_files.is_empty() {
        return String::new();
    }
    let links: Vec<String> = outcome.plate_files.iter().map(link).collect();
    format!(" The whole plate as {}.", links.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(checks: Vec<FigureCheck>) -> FigureOutcome {
        FigureOutcome {
            name: "2a",
            title: "force <at> contact",
            setting: "16 beads",
            pass: checks.iter().all(|check| check.pass),
            checks,
            files: Vec::new(),
            plate_files: Vec::new(),
            animated: false,
        }
    }

    #[test]
    fn a_number_keeps_six_digits_and_no_idle_zeros() {
        assert_eq!(number(0.0), "0");
        assert_eq!(number(7.6912344), "7.69123");
        assert_eq!(number(1607.0), "1607");
        assert_eq!(number(395_000.0), "395000");
        assert_eq!(number(2.46e-15), "2.46e-15");
    }

    #[test]
    fn the_conservation_laws_are_told_once_with_their_worst() {
        let law = |value| {
            FigureCheck::at_most("energy balance, worst of 1 runs", "", value, 1e-10).of_law("energy balance")
        };
        let text = markdown(&[outcome(vec![law(1e-12)]), outcome(vec![law(3e-12), law(2e-12)])]);
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(
            text.contains("| all | energy balance, worst of every run | 3.00e-12 |"),
            "{text}"
        );
    }

    #[test]
    fn a_page_escapes_its_text_and_marks_what_failed() {
        let page = html(&[outcome(vec![FigureCheck::at_most("x < y", "N", 2.0, 1.0)])]);
        assert!(page.contains("force &lt;at&gt; contact") && page.contains("x &lt; y"));
        assert!(
            page.contains("<td class=\"fail\">FAILED</td>")
                && page.contains("1 drawn with 1 checks, 1 out of tolerance")
        );
    }
}
