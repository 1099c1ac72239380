//! `bead sweep plot`: curves and maps of a sweep's table.

use bead_console::prelude::*;
use hertz_sweep::picture;
use hertz_sweep::view::View;

const AFTER_HELP: &str = "\
Columns are those of the table. Without options, a sweep over one axis is drawn as a curve, one over two as \
a map.

Examples:
  bead sweep plot map.parquet --out map.svg
  bead sweep plot map.parquet --x striker_velocity_mps \\
      --y absorbed_of_injected --by intruder_1_mass_kg --out curves.svg
  bead sweep plot map.parquet --x striker_velocity_mps \\
      --y intruder_1_mass_kg --map absorbed_j --at chain_relaxation_s=0 \\
      --out masses.svg";

/// `bead sweep plot`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct PlotArguments {
    /// The table of a sweep.
    table: PathBuf,
    /// The picture.
    #[arg(long, value_name = "F.svg")]
    out: PathBuf,
    #[command(flatten)]
    choice: PictureOptions,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Options of a picture.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct PictureOptions {
    /// The column of the horizontal axis.
    #[arg(long, value_name = "COLUMN")]
    x: Option<String>,
    /// The column of the vertical axis: a result for curves, an axis of the sweep for a map.
    #[arg(long, value_name = "COLUMN")]
    y: Option<String>,
    /// Draw a map whose colours show this column, a result [default: the first result].
    #[arg(long, value_name = "COLUMN", num_args = 0..=1, default_missing_value = "")]
    map: Option<String>,
    /// Draw a curve for each value of this column.
    #[arg(long, value_name = "COLUMN", conflicts_with = "map")]
    by: Option<String>,
    /// Draw only points where this column has this value, or the nearest one, which the picture names; may
    /// be repeated, once for each axis.
    #[arg(long, value_name = "COLUMN=VALUE")]
    at: Vec<String>,
}

impl PictureOptions {
    /// The view that the options ask for.
    pub(crate) fn view(&self) -> View {
        View {
            x: self.x.clone(),
            y: self.y.clone(),
            map: self.map.clone(),
            by: self.by.clone(),
            at: self.at.clone(),
        }
    }
}

pub(crate) fn plot(plotting: &PlotArguments) -> Result<(), Failure> {
    let out = place::target(
        &plotting.out,
        FileKind::Drawing,
        &[&plotting.table],
        plotting.overwrite,
    )?;
    draw(&plotting.table, &plotting.choice, &out)?;
    output::print_line(&out.path().display().to_string())
}

pub(crate) fn draw(table: &Path, choice: &PictureOptions, out: &Target) -> Result<(), Failure> {
    let chart = picture::chart(table, &choice.view()).with_context(|| table.display().to_string())?;
    out.write_bytes(chart.standalone_svg()?)?;
    Ok(())
}
