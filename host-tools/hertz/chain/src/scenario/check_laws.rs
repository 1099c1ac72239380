//! Ranges of the values of a drive and of a contact's law.

use super::check::TableCheck;
use super::check::ValueRange::{NotNegative, Positive};
use super::contact::{ContactLaw, Damping};
use super::drive::{Drive, DriveQuantity};
use super::read::InputError;

impl Drive {
    /// Checks the drive of a run of this duration, s.
    pub(super) fn check(&self, duration: f64) -> Result<(), InputError> {
        let at = TableCheck::of("drive.");
        let (unit, value) = match self.quantity {
            DriveQuantity::Displacement => ("a number in m, such as 1e-7", "m"),
            DriveQuantity::Force => ("a number in N, such as 0.1", "N"),
        };
        if !self.amplitude.is_finite() {
            let what = format!("{} is not an amplitude", self.amplitude);
            return Err(at.error("amplitude", what, format!("give {unit}")));
        }
        if let Some(file) = &self.file {
            let what = format!("{file} has not been read");
            let advice = "read the scenario with its file's name, or give the record as drive.samples";
            return Err(at.error("file", what, advice));
        }
        at.check("frequency", self.frequency, Positive("Hz, such as 1500.0"))?;
        at.check(
            "frequency_end",
            self.frequency_end,
            Positive("Hz, such as 3000.0"),
        )?;
        at.check("sweep", self.sweep, Positive("s, such as 0.1"))?;
        let ramp = NotNegative("a time in s, such as 2e-3, or leave it out");
        at.check("ramp", self.ramp, ramp)?;
        if self.frequency_end.is_some() != self.sweep.is_some() {
            let what = "frequency_end and sweep belong together";
            return Err(at.error("sweep", what, "give both for a chirp, none for a sine"));
        }
        match (self.frequency.is_some(), self.samples.is_empty()) {
            (true, true) => {}
            (false, false) => self.check_samples(&at, duration, value)?,
            (true, false) => {
                let what = "a drive is either a sine or a record";
                return Err(at.error("frequency", what, "leave out the frequency or the record"));
            }
            (false, true) => {
                let advice = "give drive.frequency, drive.file or drive.samples";
                return Err(at.error("frequency", "the drive has no signal", advice));
            }
        }
        if self.frequency.is_none() && (self.frequency_end.is_some() || self.ramp != 0.0) {
            let what = "a record has neither sweep nor ramp";
            return Err(at.error("ramp", what, "leave out frequency_end, sweep and ramp"));
        }
        Ok(())
    }

    fn check_samples(&self, at: &TableCheck, duration: f64, unit: &str) -> Result<(), InputError> {
        let count = self.samples.len();
        let error = |what: String, advice: &str| Err(at.error("samples", what, advice));
        if count < 3 {
            return error(
                format!("{count} samples are too few for a record"),
                "give three or more",
            );
        }
        if let Some(wrong) = self
            .samples
            .iter()
            .position(|sample| !sample.iter().all(|x| x.is_finite()))
        {
            let what = format!("sample {} has a value that is not a finite number", wrong + 1);
            return error(what, &format!("give times in s and values in {unit}"));
        }
        if self.samples[0][0] != 0.0 {
            let what = format!("the record begins at {} s", self.samples[0][0]);
            return error(what, "begin at 0 s, as the run does");
        }
        if let Some(wrong) = self.samples.windows(2).position(|pair| pair[0][0] >= pair[1][0]) {
            let what = format!("the time of sample {} is not after that before it", wrong + 2);
            return error(what, "sort the samples, and give each time once");
        }
        let end = self.samples[count - 1][0];
        if end < duration * (1.0 - 1e-12) {
            let what = format!("the record ends at {end} s, the run at {duration} s");
            return error(what, "shorten the duration, or record longer");
        }
        Ok(())
    }
}

impl ContactLaw {
    /// Checks the law; `is_clipped` if forces are clipped at zero.
    pub(super) fn check(&self, is_clipped: bool) -> Result<(), InputError> {
        let at = TableCheck::of("contact.");
        if !(1.0..=8.0).contains(&self.exponent) {
            let what = format!("{} is not an exponent of a contact", self.exponent);
            return Err(at.error("exponent", what, "give a number from 1 to 8, such as 1.5"));
        }
        at.check("stiffness", self.stiffness, Positive("N/m^exponent"))?;
        if self.stiffness.is_none() && self.exponent != 1.5 {
            let what = "materials give a stiffness for the exponent 1.5 only";
            let advice = "give the stiffness of a contact in N/m^exponent";
            return Err(at.error("stiffness", what, advice));
        }
        at.check("coefficient", self.coefficient, NotNegative("zero or more"))?;
        let power = self.damping == Damping::Power;
        let in_range = self.damping_exponent.is_none_or(|p| (0.0..=8.0).contains(&p));
        if power != self.damping_exponent.is_some() || !in_range {
            let what = "it belongs to damping = \"power\", and is a number from 0 to 8";
            return Err(at.error("damping_exponent", what, "give both, or neither"));
        }
        if self.damping == Damping::Viscoelastic && self.coefficient != 0.0 {
            let what = "viscoelastic damping follows from the relaxation times of the materials";
            return Err(at.error("coefficient", what, "leave it out, or give another damping"));
        }
        if !(0.0..1.0).contains(&self.friction) {
            let what = format!("{} is not a coefficient of friction", self.friction);
            return Err(at.error("friction", what, "give 0 or more, but less than 1, such as 0.03"));
        }
        let range = Positive("m/s, such as 1e-3");
        at.check("friction_speed", self.friction_speed, range)?;
        if !self.is_usual() && is_clipped {
            let what = "only Hertz' contacts with a damping of the exponent 1/2, without friction, can be \
                        clipped";
            return Err(InputError::at("chain.contact_force", what, "leave it out"));
        }
        Ok(())
    }
}
