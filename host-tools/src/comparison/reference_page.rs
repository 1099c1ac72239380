//! The HTML page of a strike against the record of another instrument: one file that needs nothing from
//! outside.

use hertz_charts::Error;
use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH, escape, style};

use crate::comparison::page::{Fact, PAGE_STYLE};
use crate::comparison::reference::{Absorbed, AgainstReference, Aligned, Point, Sides};
use crate::comparison::statistics::picture;
use crate::comparison::strike::percent;

/// What the page shows.
#[derive(Debug)]
pub struct ReferencePage<'a> {
    /// The recording's name.
    pub recording: &'a str,
    /// The reference's name.
    pub reference: &'a str,
    /// The strike, as its bead counts it.
    pub strike: u32,
    /// The comparison.
    pub against: &'a AgainstReference,
    /// Why it failed, if it did.
    pub failure: Option<&'a str>,
    /// How the page was made: command, versions, date.
    pub made: &'a [Fact],
}

/// A quantity of the comparison as tables have it: name, bead, reference, off.
pub type Row = [String; 4];

/// The rows of one quantity. `scale` and `unit` are those of its values.
pub fn rows(aligned: &Aligned, unit: &str) -> Vec<Row> {
    let row = |name: &str, cells: [String; 3]| {
        let [bead, reference, off] = cells;
        [name.to_owned(), bead, reference, off]
    };
    let none = String::new;
    // Five digits, with a true minus.
    let shown = |value: f64| {
        let digits = (4.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
        format!("{value:.digits$}").replace('-', "−")
    };
    let energy = match unit {
        "N" => "energy ∫F² dt (N²·s)".to_owned(),
        _ => "energy ∫a² dt (m²/s³)".to_owned(),
    };
    let sides = |name: &str, sides: &Sides| {
        let [bead, reference] = [sides.bead, sides.reference].map(shown);
        row(name, [bead, reference, percent(sides.off())])
    };
    let arrival = [aligned.arrival.bead, aligned.arrival.reference]
        .map(|time| format!("{:.5}", time * 1e3).replace('-', "−"));
    let [bead, reference] = arrival;
    vec![
        row(
            "correlation",
            [format!("{:.6}", aligned.correlation), none(), none()],
        ),
        row(
            "gain: bead = gain × reference",
            [format!("{:.5}", aligned.gain), none(), none()],
        ),
        row(
            "arrival: since the trigger, in the file (ms)",
            [
                bead,
                reference,
                format!("{:+.3} µs", aligned.arrival_off * 1e6).replace('-', "−"),
            ],
        ),
        sides(&format!("peak ({unit})"), &aligned.peak),
        sides(&energy, &aligned.energy),
        row(
            &format!("residual, rms ({unit})"),
            [
                format!("{:.5}", aligned.residual_rms),
                none(),
                format!("{:.3} % of the peak", aligned.residual_part * 100.0),
            ],
        ),
    ]
}

/// The row of an estimate.
pub fn absorbed_row(name: &str, absorbed: &Absorbed) -> Row {
    let shown = |joule: f64| format!("{:.3}", joule * 1e9);
    let (reference, off) = match absorbed.reference.filter(|joule| *joule > 0.0) {
        Some(joule) => (shown(joule), percent(absorbed.bead / joule - 1.0)),
        None => ("-".to_owned(), "-".to_owned()),
    };
    [name.to_owned(), shown(absorbed.bead), reference, off]
}

impl ReferencePage<'_> {
    /// The page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn html(&self) -> Result<String, Error> {
        let body = [self.head(), self.pictures()?, self.tables(), self.facts()].concat();
        let title = escape(&format!("{} against {}", self.recording, self.reference));
        let sheet = style();
        Ok(format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>{title}</title><style>{sheet}{PAGE_STYLE}</style></head>\n<body><main>{body}</main></body></html>\n"
        ))
    }

    fn quantities(&self) -> impl Iterator<Item = (&'static str, &'static str, &Aligned)> {
        let both = [
            ("force", "N", &self.against.force),
            ("acceleration", "m/s²", &self.against.acceleration),
        ];
        both.into_iter()
            .filter_map(|(name, unit, aligned)| Some((name, unit, aligned.as_ref()?)))
    }

    fn head(&self) -> String {
        let (class, verdict) = match self.failure {
            None => ("pass", "Replay is identical"),
            Some(why) => ("fail", why),
        };
        let tiles = |(name, _, aligned): (&str, &str, &Aligned)| {
            let tiles = [
                (
                    format!("{:.5}", aligned.correlation),
                    format!("correlation of the {name}"),
                ),
                (format!("{:.4}", aligned.gain), format!("gain of the {name}")),
                (
                    format!("{:.2} %", aligned.residual_part * 100.0),
                    format!("residual of the {name}, rms, of its peak"),
                ),
            ];
            let tiles = tiles.map(|(value, what)| format!("<div><b>{value}</b><span>{what}</span></div>"));
            format!("<div class=\"key\">{}</div>", tiles.concat())
        };
        let tiles: String = self.quantities().map(tiles).collect();
        format!(
            "<p class=\"above\">{} · strike {}</p><h1>The bead against {}</h1>\
             <p><span class=\"verdict {class}\">{}</span></p>{tiles}",
            escape(self.recording),
            self.strike,
            escape(self.reference),
            escape(verdict)
        )
    }

    fn pictures(&self) -> Result<String, Error> {
        let mut out = String::from(
            "<h2>One over the other</h2><p>The reference is shifted by the delay and scaled by the gain that fit best. Below \
             is what is left of the bead’s samples when it is subtracted.</p>",
        );
        for (name, unit, aligned) in self.quantities() {
            out += &picture(&chart(name, unit, &aligned.points))?;
        }
        Ok(out)
    }

    fn tables(&self) -> String {
        let mut out = String::from("<h2>In numbers</h2>");
        let table = |name: &str, rows: &[Row]| {
            let rows: String = rows
                .iter()
                .map(|row| {
                    let cells: String = row
                        .iter()
                        .map(|cell| format!("<td>{}</td>", escape(cell)))
                        .collect();
                    format!("<tr>{cells}</tr>")
                })
                .collect();
            format!(
                "<div class=\"scroll\"><table><thead><tr><th>{name}</th><th>bead</th><th>reference</th><th>bead off by</th></tr>\
                 </thead><tbody>{rows}</tbody></table></div>"
            )
        };
        for (name, unit, aligned) in self.quantities() {
            out += &table(name, &rows(aligned, unit));
        }
        out += &table(
            "absorbed energy",
            &[
                absorbed_row("A, measured (nJ)", &self.against.absorbed_measured),
                absorbed_row("B, predicted (nJ)", &self.against.absorbed_predicted),
            ],
        );
        out + "<p>The reference’s energies are those of the same estimators in floating point on the reference’s values, \
               without the gain.</p>"
    }

    fn facts(&self) -> String {
        let row = |(name, value): &Fact| format!("<tr><td>{name}</td><td>{}</td></tr>", escape(value));
        let rows: String = self.made.iter().map(row).collect();
        format!("<h2>How it was made</h2><table class=\"facts\"><tbody>{rows}</tbody></table>")
    }
}

/// Both curves, and below them what is left.
fn chart(name: &str, unit: &str, points: &[Point]) -> Chart {
    let series = |name: &str, ink, mark, of: fn(&Point) -> f64| Series {
        name: name.to_owned(),
        ink,
        mark,
        points: points.iter().map(|point| (point.time * 1e3, of(point))).collect(),
    };
    let range = match (points.first(), points.last()) {
        (Some(first), Some(last)) => first.time * 1e3..last.time * 1e3,
        _ => 0.0..1.0,
    };
    let panels = vec![
        Panel::new(
            format!("{name} ({unit})"),
            vec![
                series("gain × reference", Ink::Chain, Mark::Broad, |point| {
                    point.reference
                }),
                series("bead", Ink::Sensed, Mark::Dots, |point| point.bead),
            ],
        )
        .height(230),
        Panel::new(
            format!("residual ({unit})"),
            vec![series(
                "bead − gain × reference",
                Ink::Sensed,
                Mark::Dots,
                |point| point.bead - point.reference,
            )],
        )
        .height(140),
    ];
    Chart {
        description: format!("The {name} by the bead and by the reference over time, and their difference"),
        width: WIDTH,
        ..Chart::new(Axis::new("time since the bead’s trigger (ms)", range), panels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::reference::compare;
    use crate::comparison::testing::recorded_strike;
    use crate::recording::signal::Signal;
    use crate::waveform::{Trace, Waveform};

    #[test]
    fn the_page_needs_nothing_from_outside_and_escapes_names() {
        let strike = recorded_strike();
        let signal = Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
        let waveform = Waveform {
            force: Some(Trace::even(signal.force, 1e5)),
            acceleration: None,
            start: 0.0,
            remarks: Vec::new(),
        };
        let against = compare(&strike, &waveform).unwrap();
        let page = ReferencePage {
            recording: "<r>.mcap",
            reference: "<scope>.csv",
            strike: 3,
            against: &against,
            failure: None,
            made: &[("command", "bead compare".to_owned())],
        };
        let page = page.html().unwrap();
        for outside in ["<script", "<link", "<img", "src=", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        assert!(page.contains("&lt;scope&gt;.csv") && !page.contains("<scope>"));
        for said in [
            "force (N)",
            "residual (N)",
            "time since the bead’s trigger (ms)",
            "A, measured (nJ)",
        ] {
            assert!(page.contains(said) || page.contains(&escape(said)), "{said}");
        }
        assert!(!page.contains("acceleration (m/s²)"));
    }
}
