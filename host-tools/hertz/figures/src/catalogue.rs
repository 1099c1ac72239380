//! All figures, by name.

use crate::error::Error;
use crate::plan::FigurePlan;
use crate::plates::{
    bands, beyond, collision, contacts, diatomic, driven, fig_a2_a3, fig_a4, fig_a5_a6, fig2, fig3, fig4,
    fig5, fig6, fig7, meeting, periodic, protection, shaken,
};

/// Every figure, in the paper's order.
pub fn catalogue() -> Vec<FigurePlan> {
    [
        fig2::PLANS,
        fig3::PLANS,
        fig4::PLANS,
        fig5::PLANS,
        fig6::PLANS,
        fig7::PLANS,
        shaken::PLANS,
        fig_a2_a3::PLANS,
        fig_a4::PLANS,
        fig_a5_a6::PLANS,
        collision::PLANS,
        beyond::PLANS,
        bands::PLANS,
        driven::PLANS,
        diatomic::PLANS,
        periodic::PLANS,
        contacts::PLANS,
        meeting::PLANS,
        protection::PLANS,
    ]
    .concat()
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
            let figure = match plan.draw(&lab) {
                Ok(figure) => figure,
                Err(error) => {
                    failed.push(format!(
                        "{}: cannot be drawn: {error}, expected a figure",
                        plan.name
                    ));
                    continue;
                }
            };
            assert!(!figure.checks.is_empty(), "figure {} checks nothing", plan.name);
            for check in figure.checks.iter().filter(|check| !check.pass) {
                failed.push(format!(
                    "{}: {} is {}, expected {}",
                    plan.name,
                    check.what,
                    chapter::number(check.value),
                    chapter::expectation(check)
                ));
            }
        }
        assert!(
            failed.is_empty(),
            "{} checks fail:\n{}",
            failed.len(),
            failed.join("\n")
        );
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
            message.starts_with("9z: no such figure; there are 2a, 2b"),
            "{message}"
        );
    }
}
