//! The end of every procedure: the settings file, the certificate, the printed result, the verdict.

use bead_calibrate::about::About;
use bead_calibrate::calibration::Calibration;
use bead_calibrate::certificate::Certificate;
use bead_calibrate::conformity::Conformity;
use bead_calibrate::settings::{Provenance, entries, updated};
use bead_compare::report::Fact;
use bead_model::design::{Day, Description};
use bead_recording::physical::{self, Change};
use hertz_chain::read_text;

use crate::cli::commands::calibrate::arguments::Common;
use crate::cli::commands::calibrate::report::{CalibrateReport, TrueValue};
use crate::cli::commands::compared::publish;
use crate::cli::commands::prelude::*;
use crate::cli::provenance::{made_by, name_of, sha256_of, today};

/// A settings file as its owner left it.
pub(super) struct SettingsFile {
    path: PathBuf,
    text: String,
    pub(super) description: Description,
}

/// Everything about a calibration that was known before it began.
pub(super) struct Prepared {
    about: About,
    page: Option<Target>,
    pub(super) settings: Option<SettingsFile>,
    calibrated: Day,
    doubts: Vec<String>,
}

impl Prepared {
    /// Reads the files that a procedure was given, and checks the places of its outputs.
    pub(super) fn new(common: &Common, inputs: &[&Path]) -> Result<Self, Failure> {
        let given = [common.update.as_deref(), common.about.as_deref()];
        let inputs: Vec<&Path> = inputs
            .iter()
            .copied()
            .chain(given.into_iter().flatten())
            .collect();
        let page = common
            .overwrite
            .optional(common.page.as_deref(), FileKind::Page, &inputs)?;
        let about = match &common.about {
            Some(path) => {
                let text = read_text(path, "a file that `bead calibrate about` wrote")?;
                About::parse(&text, &path.display().to_string())?
            }
            None => About::default(),
        };
        let settings = common.update.as_deref().map(SettingsFile::read).transpose()?;
        let calibrated = common.date.or_else(today).ok_or_else(|| {
            failure!(
                Input,
                "this computer's clock shows no day from 2020 on; give the day with --date"
            )
        })?;
        let mut doubts = Vec::new();
        if let Some(expired) = about.expired(calibrated) {
            if !common.doubtful {
                bail!(Input, "{expired}, or go on with --doubtful; the page says so");
            }
            note!("{expired}");
            doubts.push(expired);
        }
        Ok(Self {
            about,
            page,
            settings,
            calibrated,
            doubts,
        })
    }

    /// The settings that a calibration starts from: those of the file, else those given.
    pub(super) fn before(&self, else_these: &Description) -> Description {
        self.settings
            .as_ref()
            .map_or(*else_these, |file| file.description)
    }

    /// Number of the certificate; without one the day.
    fn certificate(&self) -> String {
        match self.about.number.as_str() {
            "" => format!("bead {}", self.calibrated),
            number => number.to_owned(),
        }
    }

    /// Writes the settings file and the page, and prints the result. `before` are the bead's settings.
    pub(super) fn finish(
        self,
        common: &Common,
        mut calibration: Calibration,
        before: &Description,
        inputs: &[PathBuf],
        truth: Option<Vec<(&'static str, f64)>>,
    ) -> Result<(), Failure> {
        for result in &mut calibration.results {
            let of = |row: &&physical::KeyRow| Some(row.path()) == result.key;
            let row = physical::KEYS.iter().find(of);
            result.before = row.and_then(|row| physical::value(before, row.key).as_f64());
        }
        let conformity = common
            .tolerance
            .map(|tolerance| Conformity::of(&calibration, tolerance));
        let doubt = calibration.doubt();
        let changes = match (&self.settings, &doubt) {
            (Some(file), None) => self.update(file, common, &calibration, before)?,
            _ => Vec::new(),
        };
        let is_simulated = truth.is_some();
        let truth = truth.map(|truth| deviations(&calibration, truth));
        let made = match &self.page {
            Some(_) => made(inputs)?,
            None => Vec::new(),
        };
        let certificate = Certificate {
            calibration: &calibration,
            about: &self.about,
            calibrated: self.calibrated.to_string(),
            issued: today().map_or_else(|| self.calibrated.to_string(), |day| day.to_string()),
            conformity: conformity.as_ref(),
            doubts: &self.doubts,
            is_simulated,
            made: &made,
        };
        let text = certificate.report();
        for out in &calibration.left_out {
            note!("left out: {}: {}", out.subject, out.why);
        }
        let nonconforming = conformity.as_ref().filter(|conformity| !conformity.passes());
        let verdict = doubt.or_else(|| nonconforming.map(Conformity::sentence));
        let report = CalibrateReport {
            calibrated: self.calibrated,
            certificate: self.certificate(),
            conformity: conformity.clone(),
            doubts: self.doubts.clone(),
            changes,
            truth,
            calibration: calibration.clone(),
        };
        publish(common.format, self.page.as_ref(), &text, &report)?;
        self.say(&report);
        verdict.map_or(Ok(()), |verdict| Err(Failure::verdict(verdict)))
    }

    /// Puts the results into the settings file.
    fn update(
        &self,
        file: &SettingsFile,
        common: &Common,
        calibration: &Calibration,
        before: &Description,
    ) -> Result<Vec<Change>, Failure> {
        let provenance = Provenance {
            day: self.calibrated.to_string(),
            valid_until: common.valid_until.map(|day| day.to_string()),
            certificate: self.certificate(),
            references: self.about.references_line(),
        };
        let name = file.path.display().to_string();
        let entries = entries(calibration, before, &provenance);
        let (text, changes) = updated(&file.text, &name, &entries).map_err(|error| {
            let day = if error.key == "uncertainty.valid_until" {
                " by --valid-until"
            } else {
                ""
            };
            failure!(
                Input,
                "{error}{day}; {name} is unchanged, and these results are not in it"
            )
        })?;
        file.target().write_bytes(text)?;
        Ok(changes)
    }

    /// Lines for people about what was changed, and what to do next.
    fn say(&self, report: &CalibrateReport) {
        for truth in report.truth.iter().flatten() {
            note!(
                "the true {} of this bead is {:.6e}; the result deviates from it by {:+.2} U",
                truth.result,
                truth.value,
                truth.deviation_over_expanded
            );
        }
        let Some(file) = &self.settings else { return };
        let name = file.path.display();
        match report.changes.len() {
            0 => note!("{name} is unchanged"),
            keys => note!("{name}: {keys} keys have changed; send them: bead settings write {name} --port P"),
        }
    }
}

impl SettingsFile {
    fn read(path: &Path) -> Result<Self, Failure> {
        let shown = path.display();
        if path == Path::new("-") {
            bail!(Input, "--update changes a file; give its name in place of -");
        }
        let text = read_text(path, "a file that `bead settings make --template` wrote")?;
        let settings = physical::parse(&text, &shown.to_string())?;
        if path.metadata().is_ok_and(|found| found.permissions().readonly()) {
            bail!(Input, "{shown} is read-only; give --update another file");
        }
        let file = Self {
            path: path.to_owned(),
            text,
            description: *settings.description(),
        };
        file.target().try_out()?;
        Ok(file)
    }

    /// The place of the file. A link stays, and what it leads to is replaced.
    fn target(&self) -> Target {
        let path = std::fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone());
        Target::new(path).replacing(true)
    }
}

fn deviations(calibration: &Calibration, truth: Vec<(&'static str, f64)>) -> Vec<TrueValue> {
    let of = |(name, value): (&'static str, f64)| {
        let result = calibration.results.iter().find(|result| result.name == name)?;
        Some(TrueValue {
            result: name,
            value,
            deviation_over_expanded: (result.combined.value - value) / result.combined.expanded,
        })
    };
    truth.into_iter().filter_map(of).collect()
}

/// Facts about a page: its inputs by their digests, and the program.
fn made(inputs: &[PathBuf]) -> Result<Vec<Fact>, Failure> {
    let mut facts = Vec::new();
    for input in inputs {
        let name = name_of(input);
        facts.push(("input, SHA-256", format!("{name}: {}", sha256_of(input)?)));
    }
    facts.push(made_by());
    Ok(facts)
}
