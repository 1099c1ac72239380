//! The HTML report of a comparison: one file, nothing from outside it.

use std::fmt::Write;

use bead_model::settings::Settings;
use bead_wire::{Counters, SettingsSource, Status};

use crate::bench::emulation::EmulatorReport;
use crate::cli::failure::Failure;
use crate::comparison::strike::{Absorbed, Sensed, StrikeComparison, Traces, Values};
use crate::recording::frames::{Identity, reset_causes};
use hertz_figures::chart::{Axis, Chart, Ink, Mark, Panel, STYLE, Scale, Series, WIDTH, escape};

/// What a report tells.
#[derive(Debug)]
pub struct Report<'a> {
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
    /// What was received.
    pub counters: &'a Counters,
    /// Who spoke.
    pub identity: Option<&'a Identity>,
    /// What the bead said of itself last.
    pub status: Option<&'a Status>,
    /// The settings of the first strike.
    pub settings: Option<&'a Settings>,
    /// What the emulator measured, for a run in it.
    pub emulator: Option<&'a EmulatorReport>,
}

/// What the sensors delivered and what came of it, over one time axis: the picture of a strike.
pub fn strike_chart(traces: &Traces) -> Chart {
    let sensed = |points: &[Sensed], y_label: &str, [simulated, sensed]: [&str; 2]| Panel {
        y_label: y_label.to_owned(),
        height: 165,
        series: vec![
            series(
                simulated,
                Ink::Chain,
                Mark::Broad,
                points.iter().map(|p| (p.time, p.simulated)),
                1.0,
            ),
            series(
                sensed,
                Ink::Sensed,
                Mark::Dots,
                points.iter().map(|p| (p.time, p.sensed)),
                1.0,
            ),
        ],
        ..Panel::default()
    };
    let chain = traces.f64_samples[1].iter().map(|p| (p.time, p.chain));
    let [measured, predicted] = traces.device.each_ref().map(|curve| energies(curve));
    let absorbed = vec![
        series("", Ink::Chain, Mark::Broad, chain, 1e9),
        series(
            "A, measured by the acceleration",
            Ink::Measured,
            Mark::Rings,
            measured,
            1e9,
        ),
        series(
            "B, predicted from the force",
            Ink::Predicted,
            Mark::Discs,
            predicted,
            1e9,
        ),
    ];
    Chart {
        description:
            "Force and acceleration that the bead senses, and the energy that its intruder absorbs, over time"
                .to_owned(),
        x: time_axis(traces),
        width: WIDTH,
        panels: vec![
            sensed(&traces.force, "force (N)", ["simulated", "sensed by the bead"]),
            sensed(&traces.acceleration, "acceleration (m/s²)", ["", ""]),
            Panel {
                y_label: "absorbed energy (nJ)".to_owned(),
                height: 230,
                series: absorbed,
                ..Panel::default()
            },
        ],
    }
}

/// What is left when the simulation is taken away.
pub fn residual_chart(traces: &Traces) -> Chart {
    let residual = |points: &[Sensed], name: &str, y_label: &str, scale: f64| Panel {
        y_label: y_label.to_owned(),
        height: 140,
        series: vec![series(
            name,
            Ink::Sensed,
            Mark::Dots,
            points.iter().map(|p| (p.time, p.sensed - p.simulated)),
            scale,
        )],
        ..Panel::default()
    };
    let last = traces.f64_samples[1].last().map_or(1.0, |last| last.chain);
    let off = |points: &[Absorbed]| {
        points
            .iter()
            .map(|p| (p.time, p.estimate - p.chain))
            .collect::<Vec<_>>()
    };
    let mut absorbed = Vec::new();
    for (which, ink, name) in [(0, Ink::Measured, "A"), (1, Ink::Predicted, "B")] {
        let f64_name = format!("{name}, f64");
        absorbed.push(series(
            &f64_name,
            ink,
            Mark::Dashed,
            off(&traces.f64_samples[which]),
            100.0 / last,
        ));
        absorbed.push(series(
            &format!("{name}, replay"),
            ink,
            Mark::Line,
            off(&traces.replay[which]),
            100.0 / last,
        ));
        let mark = if which == 0 { Mark::Rings } else { Mark::Discs };
        absorbed.push(series(
            &format!("{name}, bead"),
            ink,
            mark,
            off(&traces.device[which]),
            100.0 / last,
        ));
    }
    Chart {
        description:
            "What remains of force, acceleration and absorbed energy when the simulation is subtracted"
                .to_owned(),
        x: time_axis(traces),
        width: WIDTH,
        panels: vec![
            residual(&traces.force, "sensed − simulated force", "force (mN)", 1e3),
            residual(
                &traces.acceleration,
                "sensed − simulated acceleration",
                "acceleration (m/s²)",
                1.0,
            ),
            Panel {
                y_label: "energy (% of final)".to_owned(),
                height: 230,
                series: absorbed,
                ..Panel::default()
            },
        ],
    }
}

fn time_axis(traces: &Traces) -> Axis {
    Axis {
        label: "time since the striker hit (ms)".to_owned(),
        range: x_range(traces),
        scale: Scale::Linear,
    }
}

fn x_range(traces: &Traces) -> (f64, f64) {
    let ends = (traces.force.first(), traces.force.last());
    let (Some(first), Some(last)) = ends else {
        return (0.0, 1.0);
    };
    (first.time * 1e3, last.time * 1e3)
}

/// A curve over milliseconds, its values scaled to the axis.
fn series(
    name: &str,
    ink: Ink,
    mark: Mark,
    points: impl IntoIterator<Item = (f64, f64)>,
    scale: f64,
) -> Series {
    let points = points
        .into_iter()
        .map(|(time, value)| (time * 1e3, value * scale))
        .collect();
    Series {
        name: name.to_owned(),
        ink,
        mark,
        points,
    }
}

fn energies(points: &[Absorbed]) -> Vec<(f64, f64)> {
    points.iter().map(|point| (point.time, point.estimate)).collect()
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

impl Report<'_> {
    /// The page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn html(&self) -> Result<String, Failure> {
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
            type Of = fn(&Values) -> f64;
            let rows: [(&str, Of, f64, usize, Option<f64>); 3] = [
                (
                    "A, measured (nJ)",
                    |v| v.absorbed_measured,
                    1e9,
                    2,
                    Some(strike.goal.absorbed_measured),
                ),
                (
                    "B, predicted (nJ)",
                    |v| v.absorbed_predicted,
                    1e9,
                    2,
                    Some(strike.goal.absorbed_predicted),
                ),
                ("peak force (N)", |v| v.peak_force, 1.0, 4, None),
            ];
            for (name, of, scale, digits, goal) in rows {
                let cell = |values: Option<Values>| {
                    values.map_or_else(
                        || "–".to_owned(),
                        |values| format!("{:.digits$}", of(&values) * scale),
                    )
                };
                let off = of(&strike.deviation);
                let met = goal.map(|goal| off.abs() <= goal);
                let class = met.map_or("", |met| if met { "pass" } else { "fail" });
                push(
                    out,
                    format_args!(
                        "<tr><td>{name}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"{class}\">{}</td>\
                     <td>{}</td></tr>",
                        cell(Some(strike.device)),
                        cell(strike.replay),
                        cell(strike.f64_samples),
                        cell(Some(strike.f64_chain)),
                        percent(off),
                        goal.map_or_else(|| "–".to_owned(), |goal| format!("±{:.1} %", goal * 100.0)),
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
        let per_sample = emulator.instructions_per_sample;
        for (name, count) in [
            ("estimate A, observer", per_sample.observer),
            ("estimate B, reduced chain", per_sample.reduced_chain),
            ("calibration, peaks, chunks of a window", per_sample.window),
            ("frames, by sample of a window", per_sample.framing),
            ("trigger", per_sample.trigger),
            ("everything, while a strike is measured", per_sample.total),
            ("everything, in the busiest block", per_sample.worst_block),
            ("everything, while none is measured", per_sample.idle),
            ("everything, over the whole run", Some(per_sample.run)),
        ] {
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
                    reset_causes(identity.reset_cause).join(", ")
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

/// A deviation in percent, signed, with a true minus.
pub fn percent(part: f64) -> String {
    format!("{:+.3} %", part * 100.0).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::strike::Chain;
    use crate::comparison::testing::{paper_scenario, recorded_strike};

    fn page(failure: Option<&str>) -> String {
        let strike = recorded_strike();
        let comparison = Chain::run(&paper_scenario(), 8).unwrap().compare(&strike);
        let report = Report {
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
        report.html().unwrap()
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
