//! Pictures of spectra.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::bead::{BeadSpectrum, Points, SpectrumPoint, TransferPoint};

/// The spectra of beads, one below the other, over frequency. `name` names their values, without unit.
pub fn chart(name: &str, beads: &[BeadSpectrum]) -> Chart {
    let several = beads.len() > 1;
    let panels = beads.iter().flat_map(|bead| {
        let of = if several {
            format!("bead {}", bead.address)
        } else {
            String::new()
        };
        match &bead.points {
            Points::Spectrum(points) => vec![spectrum(name, bead.unit, points).note(of)],
            Points::Transfer(points) => transfer(bead.unit, points, of),
        }
    });
    let frequencies = beads.iter().flat_map(|bead| match &bead.points {
        Points::Spectrum(points) => points.iter().map(|point| point.frequency_hz).collect::<Vec<_>>(),
        Points::Transfer(points) => points.iter().map(|point| point.frequency_hz).collect(),
    });
    let (low, high) = frequencies.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), frequency| {
        (low.min(frequency), high.max(frequency))
    });
    // A single frequency has room around it.
    let (low, high) = if low < high {
        (low, high)
    } else {
        (0.5 * low, 2.0 * high)
    };
    let panels: Vec<Panel> = panels.collect();
    Chart {
        description: format!("{name} over frequency"),
        width: WIDTH,
        ..Chart::new(Axis::log("frequency (Hz)", low..high), panels)
    }
}

/// Name, ink and mark of a curve, and its value at a point.
type Curve = (&'static str, Ink, Mark, fn(&SpectrumPoint) -> Option<f64>);

fn spectrum(name: &str, unit: &str, points: &[SpectrumPoint]) -> Panel {
    let over = |value: fn(&SpectrumPoint) -> Option<f64>| {
        points
            .iter()
            .filter_map(move |point| Some((point.frequency_hz, value(point)?)))
    };
    let is_shock = points.iter().any(|point| point.peaks.is_some());
    let several = points.iter().any(|point| point.standard_deviation.is_some());
    let curves: Vec<Curve> = if several {
        vec![
            ("envelope", Ink::Chain, Mark::Broad, |p| Some(p.envelope)),
            ("P95/50", Ink::Predicted, Mark::Dashed, |p| p.upper_95_50),
            ("mean", Ink::Measured, Mark::Line, |p| Some(p.mean)),
        ]
    } else if is_shock {
        vec![
            ("maximax", Ink::Chain, Mark::Broad, |p| Some(p.mean)),
            ("primary", Ink::Measured, Mark::Line, |p| Some(p.peaks?.primary)),
            ("residual", Ink::Predicted, Mark::Dashed, |p| {
                Some(p.peaks?.residual)
            }),
        ]
    } else {
        vec![("", Ink::Measured, Mark::Line, |p| Some(p.mean))]
    };
    let curves = curves.into_iter();
    let curves = curves.map(|(name, ink, mark, value)| Series::new(name, ink, mark, over(value)));
    let mut curves: Vec<Series> = curves.collect();
    curves.retain(|curve| !curve.points.is_empty());
    Panel::new(format!("{name} ({unit})"), curves).log().height(360)
}

fn transfer(unit: &str, points: &[TransferPoint], note: String) -> Vec<Panel> {
    let over = |value: fn(&TransferPoint) -> Option<f64>| {
        points
            .iter()
            .filter_map(move |point| Some((point.frequency_hz, value(point)?)))
    };
    let line = |value| vec![Series::new("", Ink::Measured, Mark::Line, over(value))];
    let mut panels = vec![
        Panel::new(
            format!("acceleration over force ({unit})"),
            line(|point| point.magnitude),
        )
        .log()
        .height(300)
        .note(note),
        Panel::new("phase (°)", line(|point| point.phase_rad.map(f64::to_degrees)))
            .range(-180.0, 180.0)
            .height(200),
    ];
    let coherence = line(|point| point.coherence);
    if !coherence[0].points.is_empty() {
        panels.push(Panel::new("coherence γ²", coherence).range(0.0, 1.0).height(160));
    }
    panels
}
