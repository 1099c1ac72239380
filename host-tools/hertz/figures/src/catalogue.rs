//! All figures, by name.

use crate::error::Error;
use crate::plan::FigurePlan;
use crate::plates::PLATES;

/// Every figure, in the paper's order.
pub fn catalogue() -> Vec<FigurePlan> {
    PLATES.concat()
}

/// The figures of these names, in the paper's order; every figure if no name is given. `6` stands for all of
/// Fig. 6.
///
/// # Errors
/// A name that no figure has.
pub fn chosen(names: &[String]) -> Result<Vec<FigurePlan>, Error> {
    let all = catalogue();
    for name in names {
        if !all.iter().any(|plan| plan.goes_by(name)) {
            let known: Vec<&str> = all.iter().map(|plan| plan.name).collect();
            return Err(Error::Unknown {
                name: name.clone(),
                known: known.join(", "),
            });
        }
    }
    let wanted = |plan: &FigurePlan| names.is_empty() || names.iter().any(|name| plan.goes_by(name));
    Ok(all.into_iter().filter(wanted).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chapter;
    use crate::lab::Lab;

    #[test]
    fn every_check_of_every_figure_passes() {
        let lab = Lab::default();
        let mut failed = Vec::new();
        for plan in catalogue() {
            let name = plan.name;
            let figure = match plan.draw(&lab) {
                Ok(figure) => figure,
                Err(error) => {
                    failed.push(format!("{name}: cannot be drawn: {error}, expected a figure"));
                    continue;
                }
            };
            assert!(!figure.checks.is_empty(), "figure {name} checks nothing");
            for check in figure.checks.iter().filter(|check| !check.pass) {
                let (value, expected) = (chapter::number(check.value), chapter::expectation(check));
                failed.push(format!("{name}: {} is {value}, expected {expected}", check.what));
            }
        }
        let (count, list) = (failed.len(), failed.join("\n"));
        assert!(failed.is_empty(), "{count} checks fail:\n{list}");
    }

    #[test]
    fn a_figure_goes_by_its_name_and_by_that_of_its_plate() {
        let names = |asked: &str| -> Vec<&str> {
            let plans = chosen(&[asked.to_owned()]).unwrap();
            plans.iter().map(|plan| plan.name).collect()
        };
        assert_eq!(names("5B"), ["5b"]);
        assert_eq!(names("2"), ["2a", "2b", "2c", "2d"]);
        assert_eq!(names("A1"), ["A1"]);
        assert_eq!(names("solitary"), ["solitary"]);
        let message = chosen(&["9z".to_owned()]).unwrap_err().to_string();
        assert!(
            message.starts_with("9z: no such figure; the figures are 2a, 2b"),
            "{message}"
        );
    }
}
