//! A stepped chain: twenty large beads, then forty of half the radius. The single wave of the large beads
//! goes on in the small ones as a train of waves, each weaker and slower than the one before (Job et al.,
//! Granular Matter 10, 13, 2007).

use hertz_chain::{Chain, Material, PulseSearch, Scenario, Section, Striker, simulate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (radius, bakelite) = (0.019, Material::BAKELITE);
    // A bead like the first ones strikes, so that one wave has nearly all of the energy.
    let striker = Striker::new(radius, bakelite, 0.45);
    let mut scenario = Scenario::new(0.0076, Chain::new(60, radius, bakelite), striker);
    "Twenty beads of 38 mm, forty of 19 mm".clone_into(&mut scenario.title);
    let mut small = Section::of(21..=60);
    small.radius = Some(0.5 * radius);
    scenario.sections = vec![small];
    let solution = simulate(&scenario)?;
    let search = PulseSearch {
        height: 0.05,
        ..PulseSearch::default()
    };

    println!("{}\n", scenario.title);
    println!("contact   arrives (ms)   peak force (N)   width at half (ms)   energy (mJ)");
    for contact in [10, 50] {
        for pulse in solution.pulses(contact, &search) {
            let width = pulse
                .fwhm
                .map_or("-".to_owned(), |width| format!("{:.4}", 1e3 * width));
            println!(
                "{contact:7}   {:12.4}   {:14.3}   {width:>18}   {:11.4}",
                1e3 * pulse.time,
                pulse.force,
                1e3 * pulse.energy,
            );
        }
    }
    Ok(())
}
