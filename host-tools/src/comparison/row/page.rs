//! The HTML page of a row: one file that needs nothing from outside.

use hertz_charts::Error;
use hertz_charts::{escape, style};

use crate::comparison::page::{Fact, PAGE_STYLE};
use crate::comparison::row::arrivals::Speed;
use crate::comparison::row::chain::Chain;
use crate::comparison::row::compare::RowComparison;
use crate::comparison::row::energy::{After, Fit};
use crate::comparison::row::later::Wave;
use crate::comparison::row::member::{BeadOfRow, Pair};
use crate::comparison::row::pictures::{details, overview};
use crate::comparison::row::strikes::Row;
use crate::comparison::spread::Spread;
use crate::comparison::statistics::picture;
use crate::comparison::strike::percent;

/// What the page shows.
pub struct Page<'a> {
    /// The recording's name.
    pub recording: &'a str,
    /// What came from the beads.
    pub row: &'a Row,
    /// The chain that they are held against.
    pub chain: &'a Chain,
    /// What came out.
    pub told: &'a RowComparison,
    /// How the page was made: command, versions, date.
    pub made: &'a [Fact],
    /// The scenario, as its author wrote it.
    pub scenario: &'a str,
}

/// A deviation in percent, without its unit.
fn bare(part: f64) -> String {
    percent(part).trim_end_matches(" %").to_owned()
}

/// Nothing known.
const DASH: &str = "–";

impl Page<'_> {
    /// The page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn html(&self) -> Result<String, Error> {
        let body = [
            self.head(),
            self.notes(),
            format!(
                "<h2>The wave along the row</h2><p>Green is what the beads sensed, each at its place in the chain and on the \
                 time that their sync edges give them in common. Grey below it is the simulation. What is left after n \
                 intruders is what came to the first bead, less what the beads measured that their intruders took.</p>{}",
                picture(&overview(self.row, self.chain, self.told))?
            ),
            self.beads(),
            self.speeds(),
            self.later(),
            self.energy(),
            format!(
                "<h2>The intruders</h2><p>Their accelerations, and the part of the wave’s energy that each lets pass.</p>{}",
                picture(&details(self.row, self.chain, self.told))?
            ),
            self.facts(),
            format!(
                "<h2>The scenario</h2><details open><summary>as it was given</summary><pre>{}</pre></details>",
                escape(self.scenario)
            ),
        ];
        let title = escape(&self.title());
        let (body, sheet) = (body.concat(), style());
        Ok(format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>{title}</title><style>{sheet}{PAGE_STYLE}</style></head>\n<body><main>{body}</main></body></html>\n"
        ))
    }

    fn title(&self) -> String {
        match &self.chain.scenario.title[..] {
            "" => "A row of beads".to_owned(),
            title => title.to_owned(),
        }
    }

    fn head(&self) -> String {
        let (class, verdict) = match &self.told.failure {
            None => ("pass", "Every check passed"),
            Some(why) => ("fail", &why[..]),
        };
        let told = self.told;
        let identical = told
            .beads
            .iter()
            .filter(|bead| bead.replay_identical == Some(true));
        let identical = format!("{} of {}", identical.count(), told.beads.len());
        let worst = |which: usize| {
            let spreads = told.beads.iter().filter_map(|bead| bead.spread.get(which));
            let worst = spreads.max_by(|a, b| a.mean.abs().total_cmp(&b.mean.abs()));
            worst.map_or(DASH.to_owned(), |worst| percent(worst.mean))
        };
        let fit = |fit: Option<Fit>| fit.map_or(DASH.to_owned(), |fit| format!("{:.5}", fit.transmission));
        let rms = told.arrivals.off_rms_s;
        let in_simulation = format!(
            "T of an intruder, by the beads’ A; {} in the simulation",
            fit(told.energy.fit.f64_chain)
        );
        let tiles = [
            (fit(told.energy.fit.by_a), &in_simulation[..]),
            (worst(0), "A, where it is furthest off"),
            (worst(1), "B, where it is furthest off"),
            (
                rms.map_or(DASH.to_owned(), |rms| format!("{:.2} µs", rms * 1e6)),
                "arrivals off the simulation, rms",
            ),
            (identical, "beads replayed bit for bit"),
        ];
        let tiles = tiles.map(|(value, what)| format!("<div><b>{value}</b><span>{what}</span></div>"));
        let strikes = match told.strikes {
            1 => "one strike".to_owned(),
            count => format!("{count} strikes"),
        };
        format!(
            "<p class=\"above\">{} beads, {strikes} · {}</p><h1>{}</h1><p><span class=\"verdict {class}\">{}</span></p>\
             <div class=\"key\">{}</div>",
            told.beads.len(),
            escape(self.recording),
            escape(&self.title()),
            escape(verdict),
            tiles.concat()
        )
    }

    fn notes(&self) -> String {
        let notes: String = self
            .told
            .notes
            .iter()
            .map(|note| format!("<li>{}</li>", escape(note)))
            .collect();
        match notes.is_empty() {
            true => notes,
            false => format!("<h2>What is missing</h2><ul>{notes}</ul>"),
        }
    }

    fn beads(&self) -> String {
        let pair = |pair: Option<Pair>, scale: f64, digits: usize| match pair {
            None => format!("<td>{DASH}</td><td class=\"more\">{DASH}</td>"),
            Some(pair) => format!(
                "<td>{:.digits$}</td><td class=\"more\">{}</td>",
                pair.device * scale,
                bare(pair.off())
            ),
        };
        let judged = |spread: Option<&Spread>| match spread {
            None => format!("<td>{DASH}</td>"),
            Some(spread) => {
                let class = if spread.pass { "pass" } else { "fail" };
                format!("<td class=\"{class}\">{}</td>", bare(spread.mean))
            }
        };
        let row = |bead: &BeadOfRow| {
            let arrival = self.told.arrivals.at(bead.bead);
            let arrival = arrival.map_or([DASH.to_owned(), DASH.to_owned()], |arrival| {
                [
                    format!("{:.4}", arrival.device_s * 1e3),
                    format!("{:+.2}", arrival.off_s * 1e6).replace('-', "−"),
                ]
            });
            let replay = match bead.replay_identical {
                None => DASH,
                Some(true) => "identical",
                Some(false) => "differs",
            };
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td>{}{}{}{}<td class=\"more\">{replay}</td></tr>",
                bead.bead,
                arrival[0],
                arrival[1],
                pair(bead.peak_force, 1.0, 3),
                pair(bead.width, 1e6, 1),
                judged(bead.spread.first()),
                judged(bead.spread.get(1)),
            )
        };
        let rows: String = self.told.beads.iter().map(row).collect();
        let differ = self
            .told
            .beads
            .iter()
            .filter_map(|bead| bead.first_difference.as_ref());
        let differ: String = differ
            .map(|what| format!("<p class=\"fail\">{}</p>", escape(what)))
            .collect();
        let flagged = self.told.beads.iter().filter(|bead| !bead.flags.is_empty());
        let flagged: String = flagged
            .map(|bead| {
                format!(
                    "<p>Bead {} has flags: {}</p>",
                    bead.bead,
                    escape(&bead.flags.join(", "))
                )
            })
            .collect();
        format!(
            "<h2>Each bead</h2><p>The wave comes when the force has risen to half its height. Goals: A within 0.2 % of the \
             simulation, B within 0.5 %, every bit replayed.</p><div class=\"scroll\"><table><thead><tr><th>bead</th>\
             <th>arrival (ms)</th><th>off (µs)</th><th>peak (N)</th><th class=\"more\">off (%)</th><th>width (µs)</th>\
             <th class=\"more\">off (%)</th><th>A off (%)</th><th>B off (%)</th><th class=\"more\">replay</th></tr></thead><tbody>{rows}</tbody></table></div>{differ}{flagged}"
        )
    }

    fn speeds(&self) -> String {
        let speeds = &self.told.arrivals.speeds;
        if speeds.is_empty() {
            return String::new();
        }
        let row = |speed: &Speed| {
            format!(
                "<tr><td>{} to {}</td><td>{:.2}</td><td>{:.2}</td><td>{}</td></tr>",
                speed.from,
                speed.to,
                speed.device,
                speed.f64_chain,
                percent(speed.off())
            )
        };
        let rows: String = speeds.iter().map(row).collect();
        format!(
            "<h2>How fast the wave went</h2><div class=\"scroll\"><table><thead><tr><th>from bead</th><th>by the beads \
             (m/s)</th><th>f64 chain (m/s)</th><th>off by</th></tr></thead><tbody>{rows}</tbody></table></div>"
        )
    }

    fn later(&self) -> String {
        let cells = |wave: Option<Wave>| match wave {
            None => format!("<td>{DASH}</td><td class=\"more\">{DASH}</td>"),
            Some(wave) => format!(
                "<td>{:.1}</td><td class=\"more\">{:.2}</td>",
                wave.peak_force * 1e3,
                wave.after * 1e3
            ),
        };
        let row = |bead: &BeadOfRow| {
            let later = bead.later_wave?;
            Some(format!(
                "<tr><td>{}</td>{}{}</tr>",
                bead.bead,
                cells(later.device),
                cells(later.f64_chain)
            ))
        };
        let rows: String = self.told.beads.iter().filter_map(row).collect();
        if rows.is_empty() {
            return rows;
        }
        format!(
            "<h2>Later waves</h2><p>The strongest wave after the main one, where there is one.</p><div class=\"scroll\"><table>\
             <thead><tr><th>bead</th><th>peak by the bead (mN)</th><th class=\"more\">after (ms)</th><th>f64 chain (mN)</th>\
             <th class=\"more\">after (ms)</th></tr></thead><tbody>{rows}</tbody></table></div>"
        )
    }

    fn energy(&self) -> String {
        let energy = &self.told.energy;
        let (Some(incident), Some(at)) = (energy.incident, energy.incident_at) else {
            return String::new();
        };
        // Narrow windows have the two sides that are compared.
        let cells = |cells: [String; 4]| {
            let [a, b, chain, rows] = cells;
            format!("<td>{a}</td><td class=\"more\">{b}</td><td>{chain}</td><td class=\"more\">{rows}</td>")
        };
        let dashes = || [(); 4].map(|()| DASH.to_owned());
        let row = |after: &After| {
            let through = after.transmission.map_or_else(dashes, |through| {
                through
                    .each()
                    .map(|through| through.map_or(DASH.to_owned(), |through| format!("{through:.4}")))
            });
            format!(
                "<tr><td>{}</td><td class=\"more\">{}</td>{}{}</tr>",
                after.n,
                after.bead.map_or(DASH.to_owned(), |bead| bead.to_string()),
                cells(after.left.each().map(|left| format!("{:.2}", left * 100.0))),
                cells(through),
            )
        };
        let rows: String = energy.after.iter().map(row).collect();
        let names = ["the beads’ A", "their B", "the f64 chain", "rows of n"];
        let fits = energy
            .fit
            .each()
            .into_iter()
            .zip(names)
            .filter_map(|(fit, name)| {
                let Fit {
                    transmission,
                    uncertainty,
                    ..
                } = fit?;
                Some(format!("{transmission:.5} ± {uncertainty:.5} by {name}"))
            });
        let fits: Vec<String> = fits.collect();
        let fits = match fits.is_empty() {
            true => String::new(),
            false => format!(
                "<p>The line through ln E(n) gives one T for all: {}. What stands after ± is its standard error, from how \
                 far the energies are from the line.</p>",
                fits.join(", ")
            ),
        };
        let by = match energy.incident_by {
            "bead" => "by its own force",
            _ => "of the simulation, as its own force is not known whole",
        };
        format!(
            "<h2>Energy after n intruders</h2><p>What came to bead {at} is {:.2} µJ {by}, and {:.2} µJ in the simulation. From \
             it is taken what each bead measured, by A and by B; the column <em>f64 chain</em> is the same sum in the \
             simulation of this row. <em>Rows of n</em> is the paper’s Fig. 5: for each n a chain with n intruders, and the \
             energy that it has at the end. Heavy intruders send waves back to those before them, and then the two differ.</p>\
             <div class=\"scroll\"><table><thead><tr><th>n</th><th class=\"more\">bead</th><th>E(n) by A (%)</th>\
             <th class=\"more\">by B</th><th>f64 chain</th><th class=\"more\">rows of n</th><th>T by A</th>\
             <th class=\"more\">by B</th><th>f64 chain</th><th class=\"more\">rows of n</th></tr></thead>\
             <tbody>{rows}</tbody></table></div>{fits}",
            incident.device * 1e6,
            incident.f64_chain * 1e6,
        )
    }

    fn facts(&self) -> String {
        let sum = |of: fn(&BeadOfRow) -> u64| self.told.beads.iter().map(of).sum::<u64>();
        let frames = format!(
            "{} lost, {} refused",
            sum(|bead| bead.frames_lost),
            sum(|bead| bead.frames_corrupt)
        );
        let row =
            |(name, value): &(&str, String)| format!("<tr><td>{name}</td><td>{}</td></tr>", escape(value));
        let rows: String = self.made.iter().chain(&[("frames", frames)]).map(row).collect();
        format!("<h2>The run</h2><table class=\"facts\"><tbody>{rows}</tbody></table>")
    }
}
