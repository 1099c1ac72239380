//! The figures of one number on one sheet, as the paper prints them: (a), (b), (c).

use hertz_charts::Plate;

use crate::catalogue::catalogue;
use crate::plan::{Figure, FigurePlan};

/// Numbers of the plates of these figures, in their order, each once.
pub fn numbers(plans: &[FigurePlan]) -> Vec<&'static str> {
    let mut numbers: Vec<_> = plans.iter().map(FigurePlan::plate).collect();
    numbers.dedup();
    numbers
}

/// Numbers of the plates that have several figures, all of them among these.
pub fn whole(plans: &[FigurePlan]) -> Vec<&'static str> {
    let count = |plans: &[FigurePlan], number: &str| {
        let lettered = |plan: &&FigurePlan| plan.plate() == number && !plan.letter().is_empty();
        plans.iter().filter(lettered).count()
    };
    let mut numbers = numbers(plans);
    numbers.retain(|number| {
        let all = count(&catalogue(), number);
        all > 1 && count(plans, number) == all
    });
    numbers
}

/// The sheet of these figures of one number; `None` if one is missing or the number has only one. Animations
/// are left out.
pub fn assemble(figures: &[(FigurePlan, Figure)]) -> Option<Plate> {
    let plans: Vec<FigurePlan> = figures.iter().map(|(plan, _)| *plan).collect();
    let number = *whole(&plans).first()?;
    let still = figures.iter().filter(|(_, figure)| figure.frames.is_empty());
    let charts: Vec<_> = still
        .map(|(plan, figure)| (plan.letter().to_owned(), figure.chart.clone()))
        .collect();
    Some(Plate {
        description: format!("Figure {number}"),
        // Three rows of three belong together in Fig. 6: one size of each striker in a column.
        columns: if charts.len() == 9 { 3 } else { 2 },
        charts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::chosen;

    #[test]
    fn a_plate_is_whole_with_all_its_figures() {
        let of = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            whole(&chosen(&names).unwrap())
        };
        assert_eq!(of(&["2"]), ["2"]);
        assert_eq!(of(&["2a", "2c", "2d", "A1", "eq9"]), [""; 0]);
        assert_eq!(of(&[]), ["2", "3", "4", "5", "6", "7", "A2", "A3", "A4", "A6"]);
    }
}
