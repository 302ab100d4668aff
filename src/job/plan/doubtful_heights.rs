//! Heights that stand for nodata, though the header of their file does not claim them, or that may.

use crate::geometry::Bounds;
use crate::geometry::lattice::Lattice;
use crate::input::{
    Axis, DoubtfulHeight, Extremes, FileFormat, Source, is_nodata_beside, is_number_in_steps, shown_height,
};
use crate::job::options::JobOptions;
use crate::job::plan::extent::to_float;
use crate::job::plan::height_range::HeightSample;
use crate::job::plan::text_inputs::row_choice;
use crate::{Error, Result};

/// Fails if a file has a height that may stand for nodata, or one that does and that its header does not claim. Where a sample of its points
/// looks like it, all of them are read to decide.
///
/// # Errors
/// [`Error::NoTerrain`] names the first such file, [`Error::Io`] one that cannot be read. It is no bad file that a job may leave out: what the
/// sample of all files has of one depends on the others, and so would the mesh.
pub(crate) fn refuse_doubtful_heights(
    sources: &[Source],
    sample: &HeightSample,
    lattice: &Lattice,
    options: &JobOptions,
) -> Result<()> {
    for source in sources.iter().filter(|_| options.input.nodata.is_on()) {
        let what = match source.format {
            FileFormat::Text => source.doubtful_height().map(|doubt| of_doubt(doubt, "line")),
            _ => match sample
                .by_file
                .get(&source.path)
                .map(|file| file.extremes.map(|z| own_height(source, lattice, z as i64)))
            {
                Some(heights) if of_heights(source, &heights, lattice, options).is_some() => {
                    of_heights(source, &source.heights_of(&row_choice(options))?, lattice, options)
                }
                _ => None,
            },
        };
        if let Some(what) = what {
            return Err(Error::NoTerrain(format!("{}: {what}", source.path.display())));
        }
    }
    Ok(())
}

/// Returns a sentence about the heights of a file that is not a text, if some of them stand for nodata or may.
fn of_heights(source: &Source, heights: &Extremes, lattice: &Lattice, options: &JobOptions) -> Option<String> {
    let step = to_float(lattice.resolution_z) / source.factor_of_heights();
    let found = heights.nodata(|value| is_number_in_steps(value, step));
    if let Some(height) = found.heights.first() {
        return Some(unannounced(source, height.value));
    }
    // Who names nodata has looked at the heights.
    let doubt = heights.doubtful().filter(|_| options.input.nodata.is_auto());
    doubt.map(|doubt| of_doubt(&doubt, "point"))
}

fn of_doubt(DoubtfulHeight { height, others: [low, high] }: &DoubtfulHeight, record: &str) -> String {
    let value = shown_height(height.value);
    format!(
        "{} {record}s have the height {value} (the first is {record} {}), and all others lie between {low} and {high}: {value} may stand for nodata. Leave such \
         points out with [input] nodata = {value}, or keep them with nodata = \"none\"",
        height.count, height.first
    )
}

/// Returns a sentence about the points of a LAS or LAZ file that were read, in the box `read` of the lattice, if their lowest or highest height
/// stands for nodata, and the header does not announce it.
pub(crate) fn unannounced_nodata(
    source: &Source,
    read: Option<Bounds<3>>,
    lattice: &Lattice,
    options: &JobOptions,
) -> Option<String> {
    let Bounds { min, max } = read.filter(|_| source.format != FileFormat::Text && options.input.nodata.is_on())?;
    let step = to_float(lattice.resolution_z) / source.factor_of_heights();
    let claimed = [source.min[2], source.max[2]].map(|height| height / source.factor_of_heights());
    let is_nodata = |value: &f64| is_nodata_beside(*value, step, claimed);
    let found = [min[2], max[2]].map(|steps| own_height(source, lattice, steps.into())).into_iter().find(is_nodata)?;
    Some(unannounced(source, found))
}

fn unannounced(source: &Source, height: f64) -> String {
    let value = shown_height(height.round());
    let [low, high] = [source.min[2], source.max[2]].map(|height| height / source.factor_of_heights());
    format!(
        "has points of the height {value}, which stands for nodata, though its header gives heights from {low} to {high}. Leave such points \
         out with [input] nodata = {value}, or keep them with nodata = \"none\""
    )
}

/// Returns the height of a lattice point as the file has it.
pub(crate) fn own_height(source: &Source, lattice: &Lattice, steps: i64) -> f64 {
    let axis = Axis { offset: lattice.offset[2], scale: lattice.resolution_z };
    axis.value(steps) / source.factor_of_heights()
}
