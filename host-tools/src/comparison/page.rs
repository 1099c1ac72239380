//! The HTML page of a comparison: one file that needs nothing from outside.

use std::collections::BTreeSet;

use bead_model::settings::Settings;
use bead_wire::{Counters, Identity, SettingsSource, Status};
use hertz_charts::Error;
use hertz_charts::{escape, style};

use crate::bench::emulation::EmulatorReport;
use crate::comparison::pictures::{residual_chart, strike_chart};
use crate::comparison::spread::Spread;
use crate::comparison::statistics::{picture, section};
use crate::comparison::strike::{StrikeComparison, percent};
use crate::recording::json::hex;

/// What the page shows.
#[derive(Debug)]
pub struct Page<'a> {
    /// The scenario's title.
    pub title: &'a str,
    /// The recording's name.
    pub recording: &'a str,
    /// The bead that sensed.
    pub bead: usize,
    /// Every strike.
    pub strikes: &'a [StrikeComparison],
    /// Mean and scatter of A and of B against their goals.
    pub spread: &'a [Spread; 2],
    /// Why the comparison failed, if it did.
    pub failure: Option<&'a str>,
    /// Counts of what was received.
    pub counters: &'a Counters,
    /// The bead's identity.
    pub identity: Option<&'a Identity>,
    /// The bead's last status.
    pub status: Option<&'a Status>,
    /// The settings of the first strike.
    pub settings: Option<&'a Settings>,
    /// What the emulator measured, for an emulated run.
    pub emulator: Option<&'a EmulatorReport>,
    /// How the page was made: command, versions, date.
    pub made: &'a [Fact],
    /// The scenario, as its author wrote it.
    pub scenario: &'a str,
}

/// A fact of the run: its name and its value.
pub type Fact = (&'static str, String);

/// Strikes up to this many are shown in full. Of more, the first, the worst and the first that failed are.
const IN_FULL: usize = 3;
/// Strikes that have a line each.
const LINES: usize = 1000;

pub(super) const PAGE_STYLE: &str = "\
*{box-sizing:border-box}\
body{margin:0;background:var(--paper);color:var(--text);\
font:16px/1.55 system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}\
main{max-width:908px;margin:0 auto;padding:40px 24px 72px}\
h1{font-size:1.9rem;line-height:1.2;margin:.15em 0 .5em;letter-spacing:-.01em}\
h2{font-size:1.2rem;margin:2.6em 0 .5em}p{margin:.5em 0 1em;max-width:72ch}\
.above{color:var(--faint);font-size:.9rem;margin:0}\
.verdict{display:inline-block;padding:.2em .8em;border-radius:1em;font-weight:600;font-size:.92rem;\
border:1.5px solid currentColor}\
.pass{color:var(--sensed)}.fail{color:var(--predicted)}\
.key{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:12px;margin:1.6em 0}\
.key div{border:1px solid var(--grid);border-radius:10px;padding:12px 14px}\
.key b{display:block;font-size:1.45rem;line-height:1.25;font-variant-numeric:tabular-nums}\
.key span{color:var(--faint);font-size:.86rem}\
.scroll{overflow-x:auto}.scroll+.scroll{margin-top:1.4em}\
table{border-collapse:collapse;width:100%;font-size:.93rem;font-variant-numeric:tabular-nums}\
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
tr,svg.chart,.key div{break-inside:avoid}.key{grid-template-columns:repeat(5,1fr)}.key b{font-size:1.1rem;white-space:nowrap}\
tbody tr:nth-child(-n+3){break-after:avoid}tbody tr:nth-last-child(-n+3){break-before:avoid}\
h2,h2+p,thead,summary{break-after:avoid}}";

impl Page<'_> {
    /// The page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn html(&self) -> Result<String, Error> {
        let body = [
            self.head(),
            section(self.strikes, self.spread)?,
            self.agreement(),
            self.pictures()?,
            self.cost(),
            self.facts(),
            self.log(),
            self.scenario(),
        ];
        let title = escape(&format!("Bead {}: {}", self.bead, self.title));
        let (body, sheet) = (body.concat(), style());
        Ok(format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>{title}</title><style>{sheet}{PAGE_STYLE}</style></head>\n<body><main>{body}</main></body></html>\n"
        ))
    }

    fn head(&self) -> String {
        let (class, verdict) = match self.failure {
            None => ("pass", "Every check passed"),
            Some(why) => ("fail", why),
        };
        let title = Some(self.title).filter(|title| !title.is_empty());
        let title = title.unwrap_or("A strike");
        let head = format!(
            "<p class=\"above\">Bead {} · {}</p><h1>{}</h1><p><span class=\"verdict {class}\">{}</span></p>",
            self.bead,
            escape(self.recording),
            escape(title),
            escape(verdict),
        );
        let Some(strike) = self.strikes.first() else {
            return head;
        };
        let identical = self.strikes.iter().filter(|strike| strike.replay_identical);
        let gone = self.counters.lost + self.counters.rejected.total();
        let absorbed = strike.f64_chain.absorbed_measured * 1e9;
        let identical = format!("{} of {}", identical.count(), self.strikes.len());
        let gone = format!("{gone} of {}", self.counters.frames + self.counters.lost);
        let mean = |of: fn(&StrikeComparison) -> f64| {
            percent(self.strikes.iter().map(of).sum::<f64>() / self.strikes.len() as f64)
        };
        let [measured, predicted] = match self.strikes.len() {
            1 => ["A, measured by the acceleration", "B, predicted from the force"],
            _ => [
                "A, measured: mean of all strikes",
                "B, predicted: mean of all strikes",
            ],
        };
        let tiles = [
            (format!("{absorbed:.1} nJ"), "absorbed, by the full simulation"),
            (mean(|strike| strike.deviation.absorbed_measured), measured),
            (mean(|strike| strike.deviation.absorbed_predicted), predicted),
            (identical, "strikes replayed bit for bit"),
            (gone, "frames lost or corrupt"),
        ];
        let tiles = tiles.map(|(value, what)| format!("<div><b>{value}</b><span>{what}</span></div>"));
        format!("{head}<div class=\"key\">{}</div>", tiles.concat())
    }

    /// Why a strike is shown in full, among many.
    fn shown_as(&self, at: usize) -> &'static str {
        match (self.strikes.len() > IN_FULL, self.strikes[at].replay_identical) {
            (true, false) => ", whose replay differs",
            (true, true) if self.worst() == Some(at) => ", the furthest off",
            _ => "",
        }
    }

    fn agreement(&self) -> String {
        let mut out = String::from(
            "<h2>Agreement</h2><p>From right to left each column adds one source of error. The first adds sampling, \
             twelve bits, noise and the reduced chain. The second adds fixed point. The last adds nothing: device and \
             replay must agree in every bit.</p>",
        );
        for at in self.in_full() {
            let strike = &self.strikes[at];
            let rows: Vec<_> = strike.rows().into_iter().chain(strike.shape_rows()).collect();
            // Strikes among others are judged together.
            let judged = rows.iter().any(|row| row.goal.is_some());
            out += &format!(
                "<div class=\"scroll\"><table><thead><tr><th>Strike {}{}, sample {}</th><th>device</th>\
                 <th class=\"more\">replay</th><th class=\"more\">f64, same samples</th><th>f64 chain</th><th>device off by</th>{}\
                 </tr></thead><tbody>",
                strike.strike,
                self.shown_as(at),
                strike.sample_index,
                if judged { "<th>goal</th>" } else { "" },
            );
            for row in rows {
                let class = row.met().map_or("", |met| if met { "pass" } else { "fail" });
                let goal = row.goal.map(|goal| format!("±{:.1} %", goal * 100.0));
                let goal = judged.then(|| format!("<td>{}</td>", goal.as_deref().unwrap_or("–")));
                let [device, replay, f64_samples, f64_chain] =
                    row.cells.map(|cell| cell.unwrap_or_else(|| "–".to_owned()));
                out += &format!(
                    "<tr><td>{}</td><td>{device}</td><td class=\"more\">{replay}</td><td class=\"more\">{f64_samples}</td>\
                     <td>{f64_chain}</td>\
                     <td class=\"{class}\">{}</td>{}</tr>",
                    row.name,
                    row.off.map_or_else(|| "–".to_owned(), percent),
                    goal.unwrap_or_default(),
                );
            }
            out += "</tbody></table></div>";
            if !strike.flags.is_empty() {
                out += &format!("<p>Flags: {}</p>", escape(&strike.flags.join(", ")));
            }
            if let Some(what) = &strike.first_difference {
                out += &format!("<p class=\"fail\">{}</p>", escape(what));
            }
        }
        out + &self.lines()
    }

    /// The places of the strikes that are shown in full.
    fn in_full(&self) -> BTreeSet<usize> {
        let strikes = self.strikes;
        if strikes.len() <= IN_FULL {
            return (0..strikes.len()).collect();
        }
        let failed = strikes.iter().position(|strike| !strike.replay_identical);
        [Some(0), self.worst(), failed].into_iter().flatten().collect()
    }

    /// Where the strike is whose estimates are furthest off.
    fn worst(&self) -> Option<usize> {
        let off = |at: &usize| {
            let off = self.strikes[*at].deviation;
            f64::max(off.absorbed_measured.abs(), off.absorbed_predicted.abs())
        };
        (0..self.strikes.len()).max_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// A line for each strike, if they are not all shown in full.
    fn lines(&self) -> String {
        if self.strikes.len() <= IN_FULL {
            return String::new();
        }
        let line = |strike: &StrikeComparison| {
            let off = strike.deviation;
            format!(
                "<tr><td>{}</td><td class=\"more\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
                 <td class=\"more\">{}</td></tr>",
                strike.strike,
                strike.sample_index,
                percent(off.absorbed_measured),
                percent(off.absorbed_predicted),
                percent(off.peak_force),
                if strike.replay_identical {
                    "identical"
                } else {
                    "differs"
                },
                escape(&strike.flags.join(", "))
            )
        };
        let lines: String = self.strikes.iter().take(LINES).map(line).collect();
        let left = match self.strikes.len().saturating_sub(LINES) {
            0 => String::new(),
            left => format!("<p>and {left} more: <code>bead compare --format json</code> has them all.</p>"),
        };
        format!(
            "<details><summary>Every strike, a line each</summary><div class=\"scroll\"><table><thead><tr><th>strike</th>\
             <th class=\"more\">sample</th><th>A off by</th><th>B off by</th><th>peak off by</th><th>replay</th>\
             <th class=\"more\">flags</th></tr></thead><tbody>{lines}</tbody></table></div>{left}</details>"
        )
    }

    fn pictures(&self) -> Result<String, Error> {
        let Some(traces) = self.strikes.iter().find_map(|strike| strike.traces.as_ref()) else {
            return Ok(String::new());
        };
        Ok(format!(
            "<h2>The strike</h2><p>Each dot is one sample, turned back into its unit with the bead’s own calibration. \
             Rings and discs are the running energies that the bead sent, one of each for a chunk of samples.</p>\
             {}<h2>What is left when the simulation is subtracted</h2><p>For the sensors: noise, and the steps of the \
             twelve bits. For the energies: the error of each estimate on its way. f64 is the same estimate in \
             floating point from the same samples.</p>{}",
            picture(&strike_chart(traces))?,
            picture(&residual_chart(traces))?
        ))
    }

    fn cost(&self) -> String {
        let Some(emulator) = self.emulator else {
            return String::new();
        };
        let available = emulator.instructions_available;
        let rows = emulator.instructions_per_sample.rows().into_iter();
        let known = rows.filter_map(|(name, count)| Some((name, count?)));
        let row = |(name, count): (&str, f64)| {
            let part = count / available * 100.0;
            format!(
                "<tr><td>{name}</td><td>{count:.0}</td><td>{part:.1} %</td><td style=\"width:45%\">\
                 <div class=\"bar\"><i style=\"width:{:.1}%\"></i></div></td></tr>",
                part.clamp(0.0, 100.0)
            )
        };
        let rows: String = known.map(row).collect();
        format!(
            "<h2>What it costs</h2><p>Instructions for each sample. The emulator executes {available:.0} in a sample \
             period; the core at 168 MHz has 1680 cycles.</p><div class=\"scroll\"><table><tbody>{}</tbody></table></div>",
            rows
        )
    }

    fn facts(&self) -> String {
        let facts = [
            self.made.to_vec(),
            self.identity.map_or_else(Vec::new, of_identity),
            self.settings.map_or_else(Vec::new, of_settings),
            self.received(),
            self.status.map_or_else(Vec::new, of_status),
            self.emulator.map_or_else(Vec::new, of_emulator),
        ];
        let row = |(name, value): Fact| format!("<tr><td>{name}</td><td>{}</td></tr>", escape(&value));
        let rows: String = facts.into_iter().flatten().map(row).collect();
        format!("<h2>The run</h2><table class=\"facts\"><tbody>{rows}</tbody></table>")
    }

    fn received(&self) -> Vec<Fact> {
        let noise = self.strikes.first().map(|strike| {
            let noise = format!("{:.1} mN rms", strike.force_noise * 1e3);
            ("force noise before the strike", noise)
        });
        let frames = format!(
            "{} received in {} bytes, {} lost, {} refused",
            self.counters.frames,
            self.counters.bytes,
            self.counters.lost,
            self.counters.rejected.total()
        );
        noise.into_iter().chain([("frames", frames)]).collect()
    }

    fn scenario(&self) -> String {
        let text = escape(self.scenario);
        format!(
            "<h2>The scenario</h2><details open><summary>as it was given</summary><pre>{text}</pre></details>"
        )
    }

    fn log(&self) -> String {
        let log = self.emulator.map(|emulator| &emulator.log);
        log.filter(|log| !log.is_empty()).map_or_else(String::new, |log| {
            let log = escape(&log.join("\n"));
            format!("<h2>The image’s own log</h2><pre>{log}</pre>")
        })
    }
}

fn of_identity(identity: &Identity) -> Vec<Fact> {
    let causes: Vec<_> = identity.reset_cause.names().collect();
    let (channels, rate) = (identity.channels, identity.sample_rate_hz);
    vec![
        ("firmware", format!("{} ({})", identity.firmware, identity.git)),
        ("device", hex(&identity.uid)),
        (
            "boot",
            format!("{}, reset by {}", identity.boot, causes.join(", ")),
        ),
        ("sampling", format!("{channels} channels at {rate} Hz")),
    ]
}

fn of_settings(settings: &Settings) -> Vec<Fact> {
    let (force, acceleration, window) = (&settings.force, &settings.acceleration, &settings.window);
    let per_code = force.sensitive.per_code.to_num::<f64>();
    let ms = |samples: u16| f64::from(samples) / f64::from(settings.sample_rate_hz) * 1e3;
    let window = format!(
        "{:.2} ms, {:.2} ms of it before the trigger, which is a rise of {:.3} N in {:.2} ms",
        ms(window.length),
        ms(window.history),
        f64::from(window.threshold) * per_code,
        ms(window.lookback),
    );
    let resolution = format!(
        "{:.2} mN and {:.3} m/s² a code; at the low gain {:.2} N and {:.1} m/s²",
        per_code * 1e3,
        acceleration.sensitive.per_code.to_num::<f64>(),
        force.wide.per_code.to_num::<f64>(),
        acceleration.wide.per_code.to_num::<f64>(),
    );
    let bead = &settings.bead;
    let physics = format!(
        "M = {:.3} g, m = {:.3} g, k = {:.1} kN/m, c = {:.2} N·s/m, κ = {:.4e} N/m^1.5, τ = {:.2} µs",
        bead.mass * 1e3,
        bead.intruder_mass * 1e3,
        bead.stiffness * 1e-3,
        bead.damping,
        bead.contact_stiffness,
        bead.relaxation * 1e6,
    );
    vec![
        ("settings: bead", physics),
        ("window", window),
        ("resolution", resolution),
    ]
}

fn of_status(status: &Status) -> Vec<Fact> {
    let source = match status.settings_source {
        SettingsSource::Stored => "flash, written over the link",
        SettingsSource::Flash => "flash, put there by a probe",
        SettingsSource::BuiltIn => "the image: flash has none",
        SettingsSource::FlashRefused => "the image: those in flash were refused",
        SettingsSource::Rescue => "the image: boots with those in flash failed",
        SettingsSource::Unknown(number) => &format!("source {number}, of a later version"),
    };
    let acquisition = format!(
        "{} samples in epoch {}, {} overruns, {} blocks dropped",
        status.samples, status.epoch, status.overruns, status.blocks_dropped
    );
    let dropped = format!(
        "{} for a full queue, {} too long",
        status.frames_dropped_queue_full, status.frames_dropped_too_long
    );
    vec![
        ("settings came from", source.to_owned()),
        ("acquisition", acquisition),
        ("frames dropped by the bead", dropped),
        ("least free stack", format!("{} bytes", status.stack_free_min)),
    ]
}

fn of_emulator(emulator: &EmulatorReport) -> Vec<Fact> {
    let run = format!(
        "{}: {:.2} s of virtual time; {} resets; {} overruns seen by the converter",
        emulator.qemu.as_deref().unwrap_or("QEMU"),
        emulator.virtual_seconds,
        emulator.resets,
        emulator.overruns
    );
    let registers = match emulator.unknown_registers.is_empty() {
        true => "none touched".to_owned(),
        false => emulator.unknown_registers.join(", "),
    };
    vec![
        ("image", emulator.image.clone()),
        ("emulator", run),
        ("registers without a model", registers),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::spread::Deviations;
    use crate::comparison::strike::FullChain;
    use crate::comparison::testing::recorded_strike;
    use hertz_chain::Scenario;

    fn page(failure: Option<&str>) -> String {
        page_of(1, failure)
    }

    fn page_of(strikes: usize, failure: Option<&str>) -> String {
        let strike = recorded_strike();
        let comparison = FullChain::run(&Scenario::paper(), 8).unwrap().compare(&strike);
        let mut deviations = Deviations::default();
        for _ in 0..strikes {
            deviations.push(&comparison.deviation);
        }
        let page = Page {
            title: "One <absorber> & more",
            recording: "bead-8.mcap",
            bead: 8,
            spread: &deviations.spread(),
            strikes: &vec![comparison; strikes],
            failure,
            counters: &Counters::default(),
            identity: None,
            status: None,
            settings: strike.settings.as_ref(),
            emulator: None,
            made: &[("command", "bead compare".to_owned())],
            scenario: "title = \"<x>\"",
        };
        page.html().unwrap()
    }

    #[test]
    fn the_page_needs_nothing_from_outside() {
        let page = page(None);
        for outside in ["<script", "<link", "<img", "src=", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        assert_eq!(
            page.matches("http").count(),
            page.matches("http://www.w3.org/2000/svg").count(),
            "only name spaces"
        );
        assert!(page.contains("One &lt;absorber&gt; &amp; more"));
    }

    #[test]
    fn the_page_says_what_failed() {
        assert!(page(None).contains("Every check passed"));
        let failed = page(Some("replay differs: strike 0"));
        assert!(failed.contains("replay differs: strike 0") && !failed.contains("Every check passed"));
    }

    #[test]
    fn one_strike_has_every_quantity_and_many_have_their_mean_and_a_line_each() {
        let one = page(None);
        for name in [
            "width at half height (µs)",
            "impulse (mN·s)",
            "so k is (kN/m)",
            "and c (N·s/m)",
        ] {
            assert_eq!(one.matches(name).count(), 1, "{name}");
        }
        assert!(!one.contains("All 1 strikes") && !one.contains("Every strike, a line each"));
        assert!(one.contains("title = &quot;&lt;x&gt;&quot;") || one.contains("title = \"&lt;x&gt;\""));
        let many = page_of(100, None);
        assert!(many.contains("All 100 strikes"));
        assert_eq!(many.matches("<td>identical</td>").count(), 100);
        // In full: the first and the worst.
        for shown in [">Strike 0, sample", ">Strike 0, the furthest off, sample"] {
            assert_eq!(many.matches(shown).count(), 1, "{shown}");
        }
        assert!(many.contains("mean ±0.2 %, scatter 0.5 %") && !one.contains("scatter"));
    }

    #[test]
    fn every_axis_names_its_quantity_and_unit() {
        let page = page(None);
        for label in [
            "force (N)",
            "acceleration (m/s²)",
            "absorbed energy (nJ)",
            "time since the striker hit (ms)",
            "force (mN)",
            "energy (% of final)",
        ] {
            assert!(page.contains(label), "{label}");
        }
    }
}
