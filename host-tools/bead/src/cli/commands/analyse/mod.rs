//! `bead analyse`: spectra of strikes.

mod arguments;
pub(crate) mod report;
mod strikes;
mod text;

pub(crate) use arguments::Arguments;

use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use arguments::{AccelerationUnit, SegmentWindow, ShownResponse, SpectrumCommand};
use bead_spectra::bead::BeadSpectrum;
use bead_spectra::fourier::Window;
use bead_spectra::picture;
use bead_spectra::plan::{Kind, Wanted};
use bead_spectra::shock::ResponseKind;
use bead_spectra::strike::SignalsWanted;
use bead_spectra::table;
use bead_tables::Writer;
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
            "--from {from} is above --to {to}; give the lower frequency first"
        );
    }
    let inputs: Vec<&Path> = common
        .strikes
        .recordings
        .iter()
        .chain(&common.uncertainty)
        .map(PathBuf::as_path)
        .collect();
    let is_csv = common
        .out
        .as_ref()
        .is_some_and(|out| out.extension().is_some_and(|end| end == "csv"));
    let table_kind = if is_csv {
        FileKind::Table
    } else {
        FileKind::Parquet
    };
    place::apart(common.out.as_deref(), common.picture.as_deref())?;
    let out = common
        .overwrite
        .optional(common.out.as_deref(), table_kind, &inputs)?;
    let picture = common
        .overwrite
        .optional(common.picture.as_deref(), FileKind::Drawing, &inputs)?;
    let wanted = Wanted {
        kind,
        from: common.from,
        to: common.to,
        doubtful: common.doubtful,
    };
    let stated = common.uncertainty.as_deref();
    let signals = SignalsWanted {
        sensors: wanted.sensors(),
        doubtful: common.doubtful,
        stated: stated.map(settings_file::uncertainty).transpose()?,
    };
    let wanted = Gathered {
        common,
        wanted,
        signals,
        response,
        gravities: common.unit == AccelerationUnit::G,
    };
    let beads = match &out {
        Some(out) => written(&wanted, out, is_csv)?,
        None => gather(&wanted, None)?,
    };
    let report = AnalyseReport::new(kind, response, beads);
    if let Some(picture) = picture {
        picture.write_bytes(picture::chart(&report.name(), &report.beads).standalone_svg()?)?;
    }
    output::print(common.format, &report, || text(&report))
}

/// Gathers the strikes and writes the spectrum of each as a table, whole or not at all.
fn written(wanted: &Gathered<'_>, out: &Target, is_csv: bool) -> Result<Vec<BeadSpectrum>, Failure> {
    const NOTES: [(&str, &str); 1] = [("made_by", concat!("bead ", env!("CARGO_PKG_VERSION")))];
    let columns = table::columns(wanted.wanted.kind);
    // A failure of the strikes is none of the file's.
    let mut outcome = None;
    let file = out.write(|file| {
        let mut writer = if is_csv {
            Writer::csv(file, &columns)?
        } else {
            Writer::parquet(file, "spectra", &columns, &NOTES)?
        };
        let gathered = gather(wanted, Some(&mut writer));
        let is_whole = gathered.is_ok();
        outcome = Some(gathered);
        anyhow::ensure!(is_whole, "no strike has a spectrum");
        writer.finish()
    });
    match outcome {
        Some(Err(failure)) => Err(failure),
        Some(Ok(beads)) => {
            file?;
            Ok(beads)
        }
        None => Err(file
            .err()
            .map_or_else(|| failure!(Input, "nothing was written"), Failure::from)),
    }
}
