//! Step 8 for jobs with `[output] classified`: the inputs as LAZ, with the points on the ground that the job has found in class 2.

use crate::durable::atomic_file::{PendingFile, create_folder, find_pending, partial_path};
use crate::durable::directory::JobDirectory;
use crate::plan::job_plan::{Plan, PlannedInput};
use ground::Ground;
use points::{ClassifiedRecord, FileFormat, KeptReturns, OptionalFields, PointRules, write_classified};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use sys::{Error, Result, interrupt};

/// The classes that are written: not on the ground, and on it.
const UNCLASSIFIED: u8 = 1;
const GROUND: u8 = 2;
/// Low and high noise stay what they are.
const NOISE: [u8; 2] = [7, 18];

/// What came of the inputs.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ClassifiedInputs {
    /// Bytes of all files.
    pub(crate) bytes: u64,
    /// What the user should know of inputs that are not written.
    pub(crate) warnings: Vec<String>,
}

/// Writes the inputs of `plan`. Calls `done` with the number of records of each.
///
/// # Errors
/// [`Error::Io`] on a file, [`Error::Interrupted`].
pub(crate) fn write_all(
    plan: &Plan,
    ground: &Ground,
    directory: &JobDirectory,
    done: &(dyn Fn(u64) + Sync),
) -> Result<(ClassifiedInputs, Vec<PendingFile>)> {
    let (folder, _) = directory.output().classified();
    create_folder(&folder)?;
    let write = |(input, name): (&PlannedInput, String)| {
        let written = write_one(input, ground, &folder.join(name));
        done(input.source.records);
        match written {
            // The terrain is whole without the copy.
            Err(Error::Input { path, what }) => Ok(Err(format!("{} is not in classified/: {what}", path.display()))),
            written => written.map(Ok),
        }
    };
    let inputs: Vec<_> = plan.inputs.iter().zip(names(plan)).collect();
    let written: Vec<_> = inputs.into_par_iter().with_max_len(1).map(write).collect::<Result<_>>()?;
    let (mut result, mut files) = (ClassifiedInputs::default(), Vec::new());
    for file in written {
        match file {
            Ok(file) => {
                result.bytes += file.bytes;
                files.push(file);
            }
            Err(warning) => result.warnings.push(warning),
        }
    }
    Ok((result, files))
}

/// Returns the names of the copies: those of the inputs, told apart by numbers where several have one name.
fn names(plan: &Plan) -> Vec<String> {
    let mut taken = HashSet::new();
    let name = |input: &PlannedInput| {
        let stem = input.source.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let stem = stem.strip_suffix(".copc").unwrap_or(&stem).to_owned();
        let numbered = |number: u32| if number == 1 { stem.clone() } else { format!("{stem}-{number}") };
        // Some file systems take upper and lower case for the same.
        let free = (1..).map(numbered).find(|name| taken.insert(name.to_lowercase()));
        free.unwrap_or(stem) + ".laz"
    };
    plan.inputs.iter().map(name).collect()
}

fn write_one(input: &PlannedInput, ground: &Ground, path: &Path) -> Result<PendingFile> {
    let PlannedInput { source, .. } = input;
    let not_copied = match source.format {
        FileFormat::Las | FileFormat::Laz => None,
        FileFormat::Text => Some("only LAS and LAZ files are copied, and it is a text"),
        FileFormat::Ept => Some("only LAS and LAZ files are copied, and it is an EPT"),
    };
    if let Some(what) = not_copied {
        return Err(Error::input(&source.path, what));
    }
    let judged = judged_records(input, ground)?;
    let partial: PathBuf = partial_path(path);
    write_classified(&source.path, &partial, |record| class_of(record, judged.of(record.number)))?;
    find_pending(path)
}

/// Returns the class of a record that the job has `judged`.
fn class_of(ClassifiedRecord { class, is_followed, .. }: ClassifiedRecord, judged: Judged) -> u8 {
    match judged {
        Judged::Nothing => class,
        _ if NOISE.contains(&class) => class,
        // Only last returns are taken for ground.
        Judged::Ground if !is_followed => GROUND,
        Judged::Ground | Judged::Other => UNCLASSIFIED,
    }
}

/// What the job has found out about a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Judged {
    /// Nothing: the job does not want it.
    Nothing,
    /// That it is on the ground.
    Ground,
    /// That it is not.
    Other,
}

/// What the job has found out about all records of a file, four in a byte.
struct JudgedRecords(Vec<AtomicU8>);

impl JudgedRecords {
    fn none(records: u64) -> JudgedRecords {
        JudgedRecords((0..records.div_ceil(4)).map(|_| AtomicU8::new(0)).collect())
    }

    fn set(&self, record: u64, is_ground: bool) {
        let value = if is_ground { 1 } else { 2 };
        if let Some(byte) = self.0.get(record as usize / 4) {
            byte.fetch_or(value << (record % 4 * 2), Ordering::Relaxed);
        }
    }

    fn of(&self, record: u64) -> Judged {
        match self.0.get(record as usize / 4).map(|byte| byte.load(Ordering::Relaxed) >> (record % 4 * 2) & 3) {
            Some(1) => Judged::Ground,
            Some(2) => Judged::Other,
            _ => Judged::Nothing,
        }
    }
}

/// Finds out which records of an input lie on the ground, whatever their returns.
fn judged_records(input: &PlannedInput, ground: &Ground) -> Result<JudgedRecords> {
    let PlannedInput { source, rules, .. } = input;
    let returns = KeptReturns::All;
    let rules =
        PointRules { numbered: true, first_order: 0, fields: OptionalFields::default(), returns, ..rules.clone() };
    let judged = JudgedRecords::none(source.records);
    let _ahead = source.read_ahead(rules.bounds.as_ref(), false)?;
    let decoded = source.decoded_chunks(rules.bounds.as_ref());
    (0..decoded.len()).into_par_iter().try_for_each(|index| {
        interrupt::check()?;
        let mut take = |points: &[points::Point]| {
            points.iter().for_each(|point| judged.set(point.order(), ground.has(point.corner())));
            Ok(())
        };
        source.decode(decoded.chunk(index), &rules, &mut take).map(drop)
    })?;
    Ok(judged)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_told_apart() {
        let judged = JudgedRecords::none(9);
        judged.set(0, true);
        judged.set(3, false);
        judged.set(8, true);
        judged.set(12, true);
        let found: Vec<Judged> = (0..10).map(|record| judged.of(record)).collect();
        let (n, g, o) = (Judged::Nothing, Judged::Ground, Judged::Other);
        assert_eq!(found, [g, n, n, o, n, n, n, n, g, n]);
    }

    #[test]
    fn classes_of_others_stay() {
        let class = |class, is_followed, judged| class_of(ClassifiedRecord { number: 0, class, is_followed }, judged);
        assert_eq!((class(0, false, Judged::Ground), class(0, false, Judged::Other)), (2, 1));
        assert_eq!((class(2, false, Judged::Other), class(0, true, Judged::Ground)), (1, 1));
        assert_eq!((class(7, false, Judged::Other), class(18, false, Judged::Ground)), (7, 18));
        assert_eq!((class(5, false, Judged::Nothing), class(2, true, Judged::Nothing)), (5, 2));
    }
}
