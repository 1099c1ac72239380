//! `bead analyse`: spectra of strikes.

mod arguments;
pub(crate) mod report;
mod strikes;
mod text;

pub(crate) use arguments::Arguments;

use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::table_file::TableFile;
use arguments::{AccelerationUnit, SegmentWindow, ShownResponse, SpectrumCommand};
use bead_spectra::bead::BeadSpectrum;
use bead_spectra::fourier::Window;
use bead_spectra::picture;
use bead_spectra::plan::{Kind, Wanted};
use bead_spectra::shock::ResponseKind;
use bead_spectra::strike::SignalsWanted;
use bead_spectra::table;
use report::AnalyseReport;
use strikes::{Gathered, gather};
use text::text;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut response = ResponseKind::AbsoluteAcceleration;
    let (common, kind) = match &arguments.spectrum {
        SpectrumCommand::Srs(shock) => {
            response = match shock.response {
                ShownResponse::AbsoluteAcceleration => ResponseKind::AbsoluteAcceleration,
                ShownResponse::PseudoVelocity => ResponseKind::PseudoVelocity,
                ShownResponse::RelativeDisplacement => ResponseKind::RelativeDisplacement,
            };
            let (quality, per_octave) = (shock.q, shock.per_octave);
            (&shock.common, Kind::Shock { quality, per_octave })
        }
        SpectrumCommand::Psd(density) => {
            let window = match density.window {
                SegmentWindow::Hann => Window::Hann,
                SegmentWindow::FlatTop => Window::FlatTop,
                SegmentWindow::Rectangular => Window::Rectangular,
            };
            let (of, segment) = (density.of.into(), density.segment as usize);
            (&density.common, Kind::Density { of, segment, window })
        }
        SpectrumCommand::Fft(fourier) => (
            &fourier.common,
            Kind::Fourier {
                of: fourier.of.into(),
            },
        ),
        SpectrumCommand::Transfer(transfer) => (&transfer.common, Kind::Transfer),
    };
    if let (Some(from), Some(to)) = (common.from, common.to)
        && from > to
    {
        bail!(
            Input,
            "--from {from} is above --to {to}; give the lower frequency as --from"
        );
    }
    let inputs: Vec<&Path> = common
        .strikes
        .recordings
        .iter()
        .chain(&common.uncertainty)
        .map(PathBuf::as_path)
        .collect();
    place::apart(common.out.as_deref(), common.picture.as_deref())?;
    let out = TableFile::optional(common.overwrite, common.out.as_deref(), &inputs)?;
    let picture = common
        .overwrite
        .optional(common.picture.as_deref(), FileKind::Drawing, &inputs)?;
    let wanted = Wanted {
        kind,
        from: common.from,
        to: common.to,
        doubtful: common.doubtful,
    };
    let signals = SignalsWanted {
        sensors: wanted.sensors(),
        doubtful: common.doubtful,
        stated: settings_file::uncertainty(common.uncertainty.as_deref())?,
    };
    let wanted = Gathered {
        common,
        wanted,
        signals,
        response,
        gravities: common.unit == AccelerationUnit::G,
    };
    let beads = match &out {
        Some(out) => written(&wanted, out)?,
        None => gather(&wanted, None)?,
    };
    let report = AnalyseReport::new(kind, response, beads);
    if let Some(picture) = picture {
        picture.write_bytes(picture::chart(&report.name(), &report.beads).standalone_svg()?)?;
    }
    output::print(common.format, &report, || text(&report))
}

/// Gathers the strikes and writes the spectrum of each as a table.
fn written(wanted: &Gathered<'_>, out: &TableFile) -> Result<Vec<BeadSpectrum>, Failure> {
    let mut gathered = None;
    let columns = table::columns(wanted.wanted.kind);
    let file = out.write("spectra", &columns, |table| {
        let beads = gathered.insert(gather(wanted, Some(table)));
        anyhow::ensure!(beads.is_ok(), "no strike has a spectrum");
        Ok(())
    });
    // Returns a failure of the strikes as such, not as one of the file.
    let beads = gathered.transpose()?;
    file?;
    Ok(beads.unwrap_or_default())
}
