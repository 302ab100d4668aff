//! Heights that stand for nodata, though the header of their file does not claim them, or that may.

use crate::options::JobOptions;
use crate::plan::extent::to_float;
use crate::plan::height_range::HeightSample;
use crate::plan::text_inputs::row_choice;
use delaunay::geometry::Bounds;
use lattice::Lattice;
use points::{Axis, Extremes, Source, SuspectHeight, is_nodata_beside, is_number_in_steps, shown_height, who_has};

/// What is doubtful about the heights of a file.
struct Doubt {
    what: String,
    /// Whether the user has to decide before the job runs.
    stops: bool,
}

/// Fails if a file has a height that may stand for nodata, or one that does and that its header does not claim. Warns of a height that is less
/// doubtful. Where a sample of the points of a file looks like it, all of them are read to decide. A unit of heights is so many `metres`.
///
/// # Errors
/// [`crate::Error::NoTerrain`] names the first such file, [`sys::Error::Io`] one that cannot be read. It is no bad file that a job may
/// leave out: what the sample of all files has of one depends on the others, and so would the mesh.
pub(crate) fn check_suspect_heights(
    sources: &[Source],
    sample: &HeightSample,
    lattice: &Lattice,
    options: &JobOptions,
    metres: f64,
) -> crate::Result<Vec<String>> {
    let mut warnings = Vec::new();
    // Of a text with outliers the heights show nothing but these.
    let is_told = |source: &&Source| !source.format.is_text() || source.outliers() == 0;
    for source in sources.iter().filter(|_| options.input.nodata.is_on()).filter(is_told) {
        let of = |heights: &Extremes| doubt_about(source, heights, lattice, options, metres);
        let doubt = match source.heights_of_text() {
            Some(heights) => of(heights),
            None => {
                let known = sample.by_file.get(&source.path).map(|file| &file.extremes);
                let known = known.map(|heights| heights.map(|z| own_height(source, lattice, z as i64)));
                match known.and_then(|heights| of(&heights)) {
                    Some(_) => of(&source.heights_of(&row_choice(options))?),
                    None => None,
                }
            }
        };
        let Some(Doubt { what, stops }) = doubt else { continue };
        let what = format!("{}: {what}", source.path.display());
        if stops {
            return Err(crate::Error::NoTerrain(what));
        }
        warnings.push(what);
    }
    Ok(warnings)
}

/// Returns what is doubtful about the heights of a file: some of them stand for nodata, or may.
fn doubt_about(
    source: &Source,
    heights: &Extremes,
    lattice: &Lattice,
    options: &JobOptions,
    metres: f64,
) -> Option<Doubt> {
    let is_text = source.format.is_text();
    let step = to_float(lattice.resolution_z) / source.factor_of_heights();
    let found = (!is_text).then(|| heights.nodata(|value| is_number_in_steps(value, step)));
    if let Some(height) = found.as_ref().and_then(|found| found.heights.first()) {
        return Some(Doubt { what: unannounced(source, height.value), stops: true });
    }
    // Who names nodata has looked at the heights.
    if !options.input.nodata.is_auto() {
        return None;
    }
    let metres = metres * source.factor_of_heights();
    let record = if is_text { "line" } else { "point" };
    let error = || heights.doubtful(metres).map(|doubt| Doubt { what: of_doubt(&doubt, record), stops: true });
    let apart = || heights.set_apart(metres, source.records);
    let warning = || apart().map(|doubt| Doubt { what: of_doubt(&doubt, record), stops: false });
    error().or_else(warning)
}

fn of_doubt(SuspectHeight { height, others: [low, high] }: &SuspectHeight, record: &str) -> String {
    let value = shown_height(height.value);
    format!(
        "{}, and all others lie between {low} and {high}: {value} may stand for nodata; fix: [input] nodata = {value} leaves such \
         points out, [input] nodata = \"none\" keeps them",
        who_has(height, record)
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
    let Bounds { min, max } = read.filter(|_| !source.format.is_text() && options.input.nodata.is_on())?;
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
        "has points of the height {value}, which stands for nodata, though its header gives heights from {low} to {high}; fix: [input] \
         nodata = {value} leaves such points out, [input] nodata = \"none\" keeps them"
    )
}

/// Returns the height of a lattice point as the file has it.
pub(crate) fn own_height(source: &Source, lattice: &Lattice, steps: i64) -> f64 {
    let axis = Axis { offset: lattice.offset[2], scale: lattice.resolution_z };
    axis.value(steps) / source.factor_of_heights()
}

/// Returns it rounded as far as a step of the lattice lets it be known.
pub(crate) fn shown_own_height(source: &Source, lattice: &Lattice, steps: i64) -> f64 {
    let factor = source.factor_of_heights();
    let (step, height) = (to_float(lattice.resolution_z) / factor, own_height(source, lattice, steps));
    if factor == 1.0 {
        return height;
    }
    let power = 10f64.powi((-step.log10()).floor().clamp(0.0, 9.0) as i32);
    (height * power).round() / power
}
