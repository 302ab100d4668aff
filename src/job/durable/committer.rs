//! The thread that brings records and results to the disk while others work: all of some time together, since what costs is to
//! wait for the disk.

use crate::job::durable::directory::publish;
use crate::{Error, Result, fault};
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two commits: what a kill costs at the most, beside the steps that are under way. Short, so that at the end of a stage
/// little is left to wait for.
const INTERVAL: Duration = Duration::from_millis(40);
/// Where commits take longer, the disk is the job's alone for as long after each, but for no longer than this.
const LONGEST_REST: Duration = Duration::from_secs(1);
/// From then on a job waits for the disk before it gives up what it could be repeated from.
const WORTH_SYNCING: Duration = Duration::from_secs(60);

/// What is to be committed together.
#[derive(Default)]
pub(crate) struct Batch {
    /// Lines of the journal, to be written once the results are published.
    pub(crate) lines: String,
    /// Results to publish.
    pub(crate) results: Vec<PathBuf>,
}

impl Batch {
    fn append(&mut self, mut other: Batch) {
        self.lines += &other.lines;
        self.results.append(&mut other.results);
    }
}

/// A journal file and the thread that writes to it. Dropping it commits what has been added, unless a commit has failed.
pub(crate) struct Committer {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    interval: Duration,
    start: Instant,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    /// Somebody waits for a commit, or this is the end.
    wanted: Condvar,
    committed: Condvar,
}

#[derive(Default)]
struct State {
    batch: Batch,
    /// Records added, and those of them that are on the disk.
    added: u64,
    committed: u64,
    wanted: bool,
    closing: bool,
    /// What failed. After that nothing is written any more: the end of the journal is unknown.
    failure: Option<Error>,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Committer {
    /// Starts the thread for the journal at `path`.
    pub(crate) fn start(path: &Path) -> Result<Committer> {
        let file = File::options().append(true).open(path).map_err(Error::io("open", path))?;
        let interval = fault::commit_interval().unwrap_or(INTERVAL);
        let shared = Arc::new(Shared::default());
        let (of_thread, path) = (shared.clone(), path.to_path_buf());
        let run = move || run(&of_thread, &file, &path, interval);
        let thread = std::thread::Builder::new().name("journal".into()).spawn(run);
        let thread = Some(thread.map_err(|e| Error::Memory(format!("cannot start a thread: {e}")))?);
        Ok(Committer { shared, thread, interval, start: Instant::now() })
    }

    /// Adds a record to the next commit.
    pub(crate) fn add(&self, record: Batch) -> Result<()> {
        let mut state = self.shared.state();
        state.batch.append(record);
        state.added += 1;
        let due = state.added;
        if let Some(error) = &state.failure {
            return Err(again(error));
        }
        drop(state);
        if self.interval.is_zero() { self.commit(due) } else { Ok(()) }
    }

    /// How many records have been added.
    pub(crate) fn added(&self) -> u64 {
        self.shared.state().added
    }

    /// Waits until the first `due` records are committed.
    pub(crate) fn commit(&self, due: u64) -> Result<()> {
        let mut state = self.shared.state();
        if state.committed < due {
            state.wanted = true;
            self.shared.wanted.notify_one();
        }
        while state.committed < due && state.failure.is_none() {
            state = self.shared.committed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        match &state.failure {
            Some(error) if state.committed < due => Err(again(error)),
            _ => Ok(()),
        }
    }

    pub(crate) fn is_worth_syncing(&self) -> bool {
        self.interval.is_zero() || self.start.elapsed() > WORTH_SYNCING
    }
}

impl Drop for Committer {
    fn drop(&mut self) {
        self.shared.state().closing = true;
        self.shared.wanted.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic there has been printed; there is nobody left to tell.
            let _ = thread.join();
        }
    }
}

fn run(shared: &Shared, file: &File, path: &Path, interval: Duration) {
    let interval = interval.max(Duration::from_millis(1));
    let mut rest = interval;
    loop {
        let state = shared.state();
        let waits = |state: &mut State| !state.wanted && !state.closing;
        let waited = shared.wanted.wait_timeout_while(state, rest, waits);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let (batch, added, closing) = (std::mem::take(&mut state.batch), state.added, state.closing);
        let due = added > state.committed && state.failure.is_none();
        state.wanted = false;
        drop(state);
        let begun = Instant::now();
        let outcome = due.then(|| commit(batch, file, path));
        rest = interval.max(LONGEST_REST.min(begun.elapsed()));
        let mut state = shared.state();
        match outcome {
            Some(Ok(())) => state.committed = added,
            Some(Err(error)) => state.failure = Some(error),
            // Nothing to do, or nothing that may be done any more.
            None => {}
        }
        shared.committed.notify_all();
        if closing {
            return;
        }
    }
}

/// The same error for everybody who waits: nobody knows whose will be shown.
fn again(error: &Error) -> Error {
    match error {
        Error::Io { action, path, source } => Error::io(action, path)(match source.raw_os_error() {
            Some(code) => io::Error::from_raw_os_error(code),
            None => io::Error::new(source.kind(), source.to_string()),
        }),
        other => Error::Broken(other.to_string()),
    }
}

/// In this order, so that whatever the journal says is so, whenever the machine stops.
fn commit(batch: Batch, mut file: &File, path: &Path) -> Result<()> {
    fault::point("commit");
    publish(&batch.results)?;
    fault::point("published");
    let lines = batch.lines.as_bytes();
    if fault::is_due("torn") {
        // What a power failure may leave of it.
        let _ = file.write_all(&lines[..lines.len() / 2]);
        fault::die();
    }
    file.write_all(lines).and_then(|()| file.sync_data()).map_err(Error::io("write", path))?;
    fault::point("committed");
    Ok(())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_committed_after_a_failure_whoever_has_been_told() {
        let committer = Committer::start(Path::new("/dev/full")).unwrap();
        let record = || Batch { lines: "a step\n".into(), results: Vec::new() };
        let told = std::iter::repeat_with(|| {
            std::thread::sleep(Duration::from_millis(1));
            committer.add(record())
        });
        let told = told.take(10_000).find_map(Result::err).unwrap();
        assert_eq!(told.exit_code(), 1, "{told}");
        // The thread goes on waking up meanwhile.
        for _ in 0..100 {
            let again = committer.commit(committer.added()).unwrap_err();
            assert_eq!(again.to_string(), told.to_string(), "whoever asks is told why");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
