//! The result of `bead analyse`.

use crate::cli::commands::prelude::*;
use bead_spectra::bead::BeadSpectrum;
use bead_spectra::fourier::Window;
use bead_spectra::plan::Kind;
use bead_spectra::shock::ResponseKind;
use bead_spectra::strike::Sensors;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct AnalyseReport {
    /// `srs`, `psd`, `fft` or `transfer`.
    spectrum: &'static str,
    /// The values: a response of an oscillator, or a signal.
    of: &'static str,
    /// Quality of the oscillators of a shock response spectrum.
    quality: Option<f64>,
    /// Samples of a segment of a density.
    segment: Option<usize>,
    /// Window over each segment of a density.
    window: Option<&'static str>,
    /// One for each bead.
    pub(super) beads: Vec<BeadSpectrum>,
}

impl AnalyseReport {
    pub(super) fn new(kind: Kind, response: ResponseKind, beads: Vec<BeadSpectrum>) -> Self {
        let signal = |of| match of {
            Sensors::Force => "force",
            Sensors::Acceleration | Sensors::Both => "acceleration",
        };
        let (spectrum, of) = match kind {
            Kind::Shock { .. } => ("srs", response.name()),
            Kind::Density { of, .. } => ("psd", signal(of)),
            Kind::Fourier { of } => ("fft", signal(of)),
            Kind::Transfer => ("transfer", "acceleration over force"),
        };
        let mut report = Self {
            spectrum,
            of,
            quality: None,
            segment: None,
            window: None,
            beads,
        };
        match kind {
            Kind::Shock { quality, .. } => report.quality = Some(quality),
            Kind::Density { segment, window, .. } => {
                report.segment = Some(segment);
                report.window = Some(match window {
                    Window::Rectangular => "rectangular",
                    Window::Hann => "hann",
                    Window::FlatTop => "flat-top",
                });
            }
            Kind::Fourier { .. } | Kind::Transfer => {}
        }
        report
    }

    /// True for a spectrum of the force.
    pub(super) fn is_of_force(&self) -> bool {
        self.of == "force"
    }

    /// The values in words.
    pub(super) fn name(&self) -> String {
        let of = self.of.replace('_', " ");
        match self.spectrum {
            "srs" => format!("shock response, {of}"),
            "psd" => format!("power density of the {of}"),
            "fft" => format!("Fourier transform of the {of}"),
            _ => format!("{of}, H1"),
        }
    }

    /// Parameters of the computation, in words; empty for none.
    pub(super) fn conditions(&self) -> String {
        let quality = self.quality.map(|quality| format!(", Q = {quality}"));
        let segment = self.segment.zip(self.window);
        let segment = segment.map(|(segment, window)| format!(", {window} over {segment} samples"));
        quality.or(segment).unwrap_or_default()
    }
}
