//! Doubts about the uncertainties that settings state.

use bead_model::design::{Day, Description};

/// A line if the settings state no uncertainties, or if their calibration expired before the day `on` or is
/// dated after it.
pub fn calibration_doubt(description: &Description, on: Day) -> Option<String> {
    let Some(stated) = &description.uncertainty else {
        return Some(
            "the settings state no uncertainties, so those of the energies are unknown; give them in [uncertainty]"
                .to_owned(),
        );
    };
    let name = match stated.calibration.as_str() {
        "" => "the calibration".to_owned(),
        name => format!("the calibration {name}"),
    };
    let later = stated.calibrated.filter(|day| *day > on).map(|day| {
        format!("{name} is dated {day}, which is after {on}; check uncertainty.calibrated and the clock")
    });
    let expired = || {
        let day = stated.valid_until.filter(|day| *day < on)?;
        Some(format!(
            "{name} expired on {day}, before {on}: its uncertainties are used unchanged; calibrate the bead again"
        ))
    };
    later.or_else(expired)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::Uncertainty;
    use bead_testing::paper_settings;

    #[test]
    fn a_calibration_is_doubted_before_its_first_and_after_its_last_day() {
        let day = |text| Day::parse(text).unwrap();
        let mut description = *paper_settings().description();
        let doubt =
            |description: &Description, on| calibration_doubt(description, day(on)).unwrap_or_default();
        assert!(doubt(&description, "2026-11-24").starts_with("the settings state no uncertainties"));
        description.uncertainty = Some(Uncertainty {
            calibrated: Some(day("2026-01-31")),
            valid_until: Some(day("2027-01-31")),
            ..Uncertainty::default()
        });
        for (on, expected) in [
            (
                "2026-01-30",
                "the calibration is dated 2026-01-31, which is after 2026-01-30;",
            ),
            ("2026-01-31", ""),
            ("2027-01-31", ""),
            (
                "2027-02-01",
                "the calibration expired on 2027-01-31, before 2027-02-01:",
            ),
        ] {
            let said = doubt(&description, on);
            assert!(
                said.starts_with(expected) && said.is_empty() == expected.is_empty(),
                "{said}"
            );
        }
    }
}
