//! Damage to what earlier runs or tasks left: which errors tell of it, and what to say if it cannot be made good.

use crate::Error;
use crate::durable::directory::JobDirectory;
use std::io::ErrorKind;

/// Tells whether `error` may come from a damaged file of the job, where steps were done before: a step that they need does not fit, or one
/// of the job's own files is cut off or no longer what it was.
pub(crate) fn is_damage(error: &Error, directory: &JobDirectory) -> bool {
    match error {
        Error::System(sys::Error::Broken(_)) => true,
        Error::System(sys::Error::Input { path, .. }) => path.starts_with(directory.output().directory()),
        _ => is_cut_off(error, directory),
    }
}

/// Tells whether `error` says that one of the job's own files is shorter than it was. No disk that fails for a moment does that.
pub(crate) fn is_cut_off(error: &Error, directory: &JobDirectory) -> bool {
    let Error::System(sys::Error::Io { path, source, .. }) = error else { return false };
    let job = directory.output().directory().parent();
    source.kind() == ErrorKind::UnexpectedEof && job.is_some_and(|job| path.starts_with(job))
}

/// Returns the error where what tasks left cannot be made good.
pub(crate) fn damaged_by_tasks(directory: &JobDirectory) -> Error {
    Error::TooEarly(format!(
        "what tasks left in {} is damaged: submit the job with --restart, which does it again",
        directory.job().display()
    ))
}
