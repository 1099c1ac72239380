//! Checks what docs/how-to.md, "Your own chain", says of its scenario.

use hertz_chain::{Scenario, simulate};

const TEXT: &str = include_str!("../../../../../docs/scenarios/own-chain.toml");
const PAGE: &str = include_str!("../../../../../docs/how-to.md");

#[test]
fn it_absorbs_what_the_page_says() {
    let scenario = Scenario::from_toml(TEXT, "own-chain.toml").expect("the scenario is sound");
    let solution = simulate(&scenario).expect("it runs");
    let energy = solution.summary().energy;
    let [six, eight, nine] = solution.absorption(solution.end())[..] else {
        panic!("three hosts")
    };
    let micro = |joule: f64, digits: usize| format!("{:.digits$} µJ", 1e6 * joule);
    let page = PAGE.split_whitespace().collect::<Vec<_>>().join(" ");
    for said in [
        format!("`own-chain.toml` brings {}.", micro(energy.striker_initial, 1)),
        format!("absorb {}", micro(energy.dissipated_intruders, 3)),
        format!("{} in bead 6", micro(six.dissipated, 3)),
        format!("{} in bead 8", micro(eight.dissipated, 3)),
        format!("{} in bead 9", micro(nine.dissipated, 3)),
        format!("The contacts lose {}.", micro(energy.dissipated_contacts, 1)),
        format!("the intruders still hold {}.", micro(energy.intruders_final, 1)),
    ] {
        assert!(page.contains(&said), "the page does not say: {said}");
    }
    assert!(energy.balance_error < 5e-12, "{:e}", energy.balance_error);
}

/// The keys that the error of an unknown key names.
fn known(text: &str) -> Vec<String> {
    let error = Scenario::from_toml(text, "own-chain.toml").expect_err("the key is unknown");
    let names = error.advice.strip_prefix("known here are ");
    let names = names.expect("no key is near").split(", ");
    names.map(str::to_owned).collect()
}

#[test]
fn it_has_every_key_and_the_page_explains_each() {
    let section = &PAGE[PAGE.find("## Your own chain").expect("it is there")..];
    for table in "[chain] [striker] [wall] [[section]] [[start]] [[intruder]]".split(' ') {
        let with_stranger = TEXT.replacen(table, &format!("{table}\nqqqqqqqqqqqqqqq = 1\n"), 1);
        let start = TEXT.find(table).expect("the table is there") + table.len();
        let end = TEXT[start..].find("\n[").map_or(TEXT.len(), |next| start + next);
        let names = known(&with_stranger);
        assert!(names.len() >= 3, "{names:?}");
        for name in names {
            // A key without a neutral value stands there as a comment.
            let forms = [format!("\n{name} = "), format!("\n# {name} = ")];
            let given = forms.iter().any(|form| TEXT[start..end].contains(form));
            assert!(given, "{table} lacks {name}");
            assert!(section.contains(&format!("`{name}`")), "the page lacks {name}");
        }
        assert!(section.contains(&format!("`{table}`")), "the page lacks {table}");
    }
    let others = known(&format!("qqqqqqqqqqqqqqq = 1\n{TEXT}"));
    for name in others
        .into_iter()
        .filter(|name| name != "drive" && name != "contact")
    {
        let forms = [
            format!("\n{name} = "),
            format!("\n[{name}]"),
            format!("\n[[{name}]]"),
        ];
        assert!(forms.iter().any(|form| TEXT.contains(form)), "{name} is missing");
    }
}

/// Checks that a scenario shows every key of a table, and that the page explains each.
fn shows(text: &str, table: &str) {
    let section = &PAGE[PAGE.find("## Your own chain").expect("it is there")..];
    assert!(section.contains(&format!("`{table}`")), "the page lacks {table}");
    for name in known(&text.replacen(table, &format!("{table}\nqqqqqqqqqqqqqqq = 1\n"), 1)) {
        let forms = [format!("\n{name} = "), format!("\n# {name} = ")];
        assert!(forms.iter().any(|form| text.contains(form)), "{name} is missing");
        assert!(section.contains(&format!("`{name}`")), "the page lacks {name}");
    }
}

#[test]
fn the_driven_chain_shows_every_key_of_a_drive() {
    const DRIVEN: &str = include_str!("../../../../../docs/scenarios/driven-chain.toml");
    let scenario = Scenario::from_toml(DRIVEN, "driven-chain.toml").expect("the scenario is sound");
    let energy = simulate(&scenario).expect("it runs").summary().energy;
    assert!(energy.drive_work.expect("it is driven") > 0.0);
    assert!(energy.balance_error < 1e-10, "{:e}", energy.balance_error);
    shows(DRIVEN, "[drive]");
}

#[test]
fn the_chain_of_a_power_law_shows_every_key_of_a_contact() {
    const CUBIC: &str = include_str!("../../../../../docs/scenarios/power-law.toml");
    let scenario = Scenario::from_toml(CUBIC, "power-law.toml").expect("the scenario is sound");
    let energy = simulate(&scenario).expect("it runs").summary().energy;
    assert!(energy.dissipated_contacts > 0.1 * energy.striker_initial);
    assert!(energy.balance_error < 1e-11, "{:e}", energy.balance_error);
    shows(CUBIC, "[contact]");
}
