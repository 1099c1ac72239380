//! The HTML page of a comparison: one file that needs nothing from outside.

use std::fmt::Write;

use bead_model::settings::Settings;
use bead_wire::{Counters, Identity, SettingsSource, Status};
use hertz_figures::chart::{STYLE, escape};
use hertz_figures::error::Error;

use crate::bench::emulation::EmulatorReport;
use crate::comparison::pictures::{residual_chart, strike_chart};
use crate::comparison::strike::{StrikeComparison, percent};

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
}

const PAGE_STYLE: &str = "\
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
.scroll{overflow-x:auto}\
table{border-collapse:collapse;width:100%;font-size:.93rem;font-variant-numeric:tabular-nums}\
th,td{text-align:right;padding:.42em .7em;border-bottom:1px solid var(--grid);white-space:nowrap}\
th:first-child,td:first-child{text-align:left;padding-left:0}\
thead th{color:var(--faint);font-weight:500}\
.facts td{white-space:normal;text-align:left}.facts td:first-child{color:var(--faint);width:34%}\
svg.chart{display:block;width:100%;min-width:640px;height:auto;margin:.6em 0 0}\
.bar{height:9px;border-radius:5px;background:var(--grid);min-width:180px;overflow:hidden}\
.bar i{display:block;height:100%;background:var(--measured);border-radius:5px}\
pre{overflow-x:auto;font:13px/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;\
border:1px solid var(--grid);border-radius:10px;padding:12px 14px}\
details summary{cursor:pointer;color:var(--faint)}\
@media print{main{max-width:none}}";

impl Page<'_> {
    /// The page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn html(&self) -> Result<String, Error> {
        let mut body = String::new();
        self.head(&mut body);
        self.agreement(&mut body);
        if let Some(traces) = self.strikes.iter().find_map(|strike| strike.traces.as_ref()) {
            body.push_str("<h2>The strike</h2><p>Each dot is one sample, turned back into its unit with the bead’s own calibration. Rings and discs are the \
                running energies that the bead sent, one of each a chunk of samples.</p>");
            push(
                &mut body,
                format_args!(
                    "<div class=\"scroll\">{}</div>",
                    strike_chart(traces).inline_svg()?
                ),
            );
            body.push_str(
                "<h2>What is left when the simulation is subtracted</h2><p>Noise and the steps of the \
                twelve bits for the sensors; for the energies, the error of each estimate \
                on its way: f64 is the same estimate in floating point from the same samples.</p>",
            );
            push(
                &mut body,
                format_args!(
                    "<div class=\"scroll\">{}</div>",
                    residual_chart(traces).inline_svg()?
                ),
            );
        }
        self.cost(&mut body);
        self.facts(&mut body);
        self.log(&mut body);
        let title = escape(&format!("Bead {}: {}", self.bead, self.title));
        Ok(format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>{title}</title><style>{STYLE}{PAGE_STYLE}</style></head>\n<body><main>{body}</main></body></html>\n"
        ))
    }

    fn head(&self, out: &mut String) {
        let (class, verdict) = match self.failure {
            None => ("pass", "Every check passed".to_owned()),
            Some(why) => ("fail", why.to_owned()),
        };
        push(
            out,
            format_args!(
                "<p class=\"above\">Bead {} · {}</p><h1>{}</h1><p><span class=\"verdict {class}\">{}</span></p>",
                self.bead,
                escape(self.recording),
                escape(if self.title.is_empty() {
                    "A strike"
                } else {
                    self.title
                }),
                escape(&verdict),
            ),
        );
        let Some(strike) = self.strikes.first() else {
            return;
        };
        let tile = |out: &mut String, value: String, what: &str| {
            push(out, format_args!("<div><b>{value}</b><span>{what}</span></div>"));
        };
        out.push_str("<div class=\"key\">");
        tile(
            out,
            format!("{:.1} nJ", strike.f64_chain.absorbed_measured * 1e9),
            "absorbed, by the full simulation",
        );
        tile(
            out,
            percent(strike.deviation.absorbed_measured),
            "A, measured by the acceleration",
        );
        tile(
            out,
            percent(strike.deviation.absorbed_predicted),
            "B, predicted from the force",
        );
        let identical = self
            .strikes
            .iter()
            .filter(|strike| strike.replay_identical)
            .count();
        tile(
            out,
            format!("{identical} of {}", self.strikes.len()),
            "strikes replayed bit for bit",
        );
        let gone = self.counters.lost + self.counters.rejected.total();
        tile(
            out,
            format!("{gone} of {}", self.counters.frames + self.counters.lost),
            "frames lost or corrupt",
        );
        out.push_str("</div>");
    }

    fn agreement(&self, out: &mut String) {
        out.push_str(
            "<h2>Agreement</h2><p>From right to left each column adds one source of error: sampling, twelve bits, \
             noise and the reduced chain; then fixed point; then nothing, for device and replay must agree in every \
             bit.</p>",
        );
        for strike in self.strikes {
            push(
                out,
                format_args!(
                    "<div class=\"scroll\"><table><thead><tr><th>Strike {}, sample {}</th><th>device</th><th>replay</th>\
                 <th>f64, same samples</th><th>f64 chain</th><th>device off by</th><th>goal</th></tr></thead><tbody>",
                    strike.strike, strike.sample_index,
                ),
            );
            for row in strike.rows() {
                let class = row.met().map_or("", |met| if met { "pass" } else { "fail" });
                let [device, replay, f64_samples, f64_chain] =
                    row.cells.map(|cell| cell.unwrap_or_else(|| "–".to_owned()));
                push(
                    out,
                    format_args!(
                        "<tr><td>{}</td><td>{device}</td><td>{replay}</td><td>{f64_samples}</td><td>{f64_chain}</td>\
                         <td class=\"{class}\">{}</td><td>{}</td></tr>",
                        row.name,
                        percent(row.off),
                        row.goal
                            .map_or_else(|| "–".to_owned(), |goal| format!("±{:.1} %", goal * 100.0)),
                    ),
                );
            }
            out.push_str("</tbody></table></div>");
            if !strike.flags.is_empty() {
                push(
                    out,
                    format_args!("<p>Flags: {}</p>", escape(&strike.flags.join(", "))),
                );
            }
            if let Some(what) = &strike.first_difference {
                push(out, format_args!("<p class=\"fail\">{}</p>", escape(what)));
            }
        }
    }

    fn cost(&self, out: &mut String) {
        let Some(emulator) = self.emulator else { return };
        let available = emulator.instructions_available;
        push(
            out,
            format_args!(
                "<h2>What it costs</h2><p>Instructions for each sample. The emulator executes {available:.0} in a sample \
             period; the core at 168 MHz has 1680 cycles.</p><div class=\"scroll\"><table><tbody>"
            ),
        );
        for (name, count) in emulator.instructions_per_sample.rows() {
            let Some(count) = count else { continue };
            let part = count / available * 100.0;
            push(
                out,
                format_args!(
                    "<tr><td>{name}</td><td>{count:.0}</td><td>{part:.1} %</td><td style=\"width:45%\">\
                 <div class=\"bar\"><i style=\"width:{:.1}%\"></i></div></td></tr>",
                    part.clamp(0.0, 100.0)
                ),
            );
        }
        out.push_str("</tbody></table></div>");
    }

    fn facts(&self, out: &mut String) {
        out.push_str("<h2>The run</h2><table class=\"facts\"><tbody>");
        let mut fact = |name: &str, value: String| {
            push(
                out,
                format_args!("<tr><td>{name}</td><td>{}</td></tr>", escape(&value)),
            );
        };
        if let Some(identity) = self.identity {
            fact("firmware", format!("{} ({})", identity.firmware, identity.git));
            fact(
                "device",
                identity.uid.iter().map(|byte| format!("{byte:02x}")).collect(),
            );
            fact(
                "boot",
                format!(
                    "{}, reset by {}",
                    identity.boot,
                    identity.reset_cause.names().collect::<Vec<_>>().join(", ")
                ),
            );
            fact(
                "sampling",
                format!("{} channels at {} Hz", identity.channels, identity.sample_rate_hz),
            );
        }
        if let Some(settings) = self.settings {
            let rate = f64::from(settings.sample_rate_hz);
            let window = &settings.window;
            let per_code = settings.force.sensitive.per_code.to_num::<f64>();
            fact(
                "window",
                format!(
                    "{:.2} ms, {:.2} ms of it before the trigger, which is a rise of {:.3} N in {:.2} ms",
                    f64::from(window.length) / rate * 1e3,
                    f64::from(window.history) / rate * 1e3,
                    f64::from(window.threshold) * per_code,
                    f64::from(window.lookback) / rate * 1e3,
                ),
            );
            fact(
                "resolution",
                format!(
                    "{:.2} mN and {:.3} m/s² a code; at the low gain {:.2} N and {:.1} m/s²",
                    per_code * 1e3,
                    settings.acceleration.sensitive.per_code.to_num::<f64>(),
                    settings.force.wide.per_code.to_num::<f64>(),
                    settings.acceleration.wide.per_code.to_num::<f64>(),
                ),
            );
        }
        if let Some(strike) = self.strikes.first() {
            fact(
                "force noise before the strike",
                format!("{:.1} mN rms", strike.force_noise * 1e3),
            );
        }
        let counters = self.counters;
        fact(
            "frames",
            format!(
                "{} received in {} bytes, {} lost, {} refused",
                counters.frames,
                counters.bytes,
                counters.lost,
                counters.rejected.total()
            ),
        );
        if let Some(status) = self.status {
            fact(
                "settings came from",
                match status.settings_source {
                    SettingsSource::Stored => "flash, written over the link".to_owned(),
                    SettingsSource::Flash => "flash, put there by a probe".to_owned(),
                    SettingsSource::BuiltIn => "the image: flash has none".to_owned(),
                    SettingsSource::FlashRefused => "the image: those in flash were refused".to_owned(),
                    SettingsSource::Unknown(number) => format!("source {number}, of a later version"),
                },
            );
            fact(
                "acquisition",
                format!(
                    "{} samples in epoch {}, {} overruns, {} blocks dropped",
                    status.samples, status.epoch, status.overruns, status.blocks_dropped
                ),
            );
            fact(
                "frames dropped by the bead",
                format!(
                    "{} for a full queue, {} too long",
                    status.frames_dropped_queue_full, status.frames_dropped_too_long
                ),
            );
            fact("least free stack", format!("{} bytes", status.stack_free_min));
        }
        if let Some(emulator) = self.emulator {
            fact("image", emulator.image.clone());
            fact(
                "emulator",
                format!(
                    "{}: {:.2} s of virtual time in {:.2} s; {} resets; {} overruns seen by the converter",
                    emulator.qemu.as_deref().unwrap_or("QEMU"),
                    emulator.virtual_seconds,
                    emulator.real_seconds,
                    emulator.resets,
                    emulator.overruns
                ),
            );
            fact(
                "registers without a model",
                match emulator.unknown_registers.is_empty() {
                    true => "none touched".to_owned(),
                    false => emulator.unknown_registers.join(", "),
                },
            );
        }
        out.push_str("</tbody></table>");
    }

    fn log(&self, out: &mut String) {
        let Some(emulator) = self.emulator.filter(|emulator| !emulator.log.is_empty()) else {
            return;
        };
        push(
            out,
            format_args!(
                "<h2>The image’s own log</h2><pre>{}</pre>",
                escape(&emulator.log.join("\n"))
            ),
        );
    }
}

fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = out.write_fmt(text);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::strike::FullChain;
    use crate::comparison::testing::recorded_strike;
    use hertz_chain::Scenario;

    fn page(failure: Option<&str>) -> String {
        let strike = recorded_strike();
        let comparison = FullChain::run(&Scenario::paper(), 8).unwrap().compare(&strike);
        let page = Page {
            title: "One <absorber> & more",
            recording: "bead-8.mcap",
            bead: 8,
            strikes: &[comparison],
            failure,
            counters: &Counters::default(),
            identity: None,
            status: None,
            settings: strike.settings.as_ref(),
            emulator: None,
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
