//! The thread that brings records and results to the disk while others work. It commits many together, because waiting for the
//! disk is what costs time.

use crate::durable::atomic_file::publish;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use sys::disk::WriteFrom;
use sys::{Error, Result, disk, fault};

/// The time between two commits: a kill costs the work of this time, and the steps that are under way. It is short, so that little
/// is left to wait for at the end of a stage.
const INTERVAL: Duration = Duration::from_millis(40);
/// After a slow commit the thread rests for as long as the commit took, but for no longer than this, so that others get the disk.
const LONGEST_REST: Duration = Duration::from_secs(1);
/// A job that has run for longer waits for the disk before it removes what its steps could be repeated from.
const WORTH_SYNCING: Duration = Duration::from_secs(60);

/// What is committed together.
#[derive(Default)]
pub(crate) struct CommitBatch {
    /// Lines of the journal, written once the files are published.
    pub(crate) lines: String,
    /// Files to publish.
    pub(crate) files: Vec<PathBuf>,
}

impl CommitBatch {
    fn append(&mut self, mut other: CommitBatch) {
        self.lines += &other.lines;
        self.files.append(&mut other.files);
    }
}

/// A journal file and the thread that writes to it. Dropping it commits what has been added, unless a commit has failed.
pub(crate) struct Committer {
    shared: Arc<CommitterShared>,
    thread: Option<JoinHandle<()>>,
    interval: Duration,
    start: Instant,
}

#[derive(Default)]
struct CommitterShared {
    state: Mutex<CommitState>,
    /// Wakes the thread: a commit is wanted, or the end has come.
    wanted: Condvar,
    /// Wakes those who wait for a commit.
    committed: Condvar,
}

#[derive(Default)]
struct CommitState {
    batch: CommitBatch,
    /// The number of records that were added.
    added: u64,
    /// The number of them that are on the disk.
    committed: u64,
    wanted: bool,
    closing: bool,
    /// The first failure. Nothing is written after it, because the end of the journal is unknown.
    failure: Option<Error>,
}

impl CommitterShared {
    fn state(&self) -> MutexGuard<'_, CommitState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Committer {
    /// Starts the thread for the journal at `path`.
    pub(crate) fn start(path: &Path) -> Result<Committer> {
        let file = JournalFile::open(path)?;
        let interval = fault::commit_interval().unwrap_or(INTERVAL);
        let shared = Arc::new(CommitterShared::default());
        let of_thread = shared.clone();
        let run = move || run(&of_thread, file, interval);
        let thread = std::thread::Builder::new().name("journal".into()).spawn(run);
        let thread = Some(thread.map_err(|e| Error::Memory(format!("cannot start a thread: {e}")))?);
        Ok(Committer { shared, thread, interval, start: Instant::now() })
    }

    /// Adds a record to the next commit.
    pub(crate) fn add(&self, record: CommitBatch) -> Result<()> {
        let mut state = self.shared.state();
        state.batch.append(record);
        state.added += 1;
        let due = state.added;
        if let Some(error) = &state.failure {
            return Err(copy_of(error));
        }
        drop(state);
        if self.interval.is_zero() { self.commit(due) } else { Ok(()) }
    }

    /// Returns how many records have been added.
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
            Some(error) if state.committed < due => Err(copy_of(error)),
            _ => Ok(()),
        }
    }

    pub(crate) fn is_worth_syncing(&self) -> bool {
        self.interval.is_zero() || self.start.elapsed() > WORTH_SYNCING
    }

    /// Commits what can be committed, ends the thread and returns the number of committed records.
    pub(crate) fn close(mut self) -> u64 {
        self.stop();
        self.shared.state().committed
    }

    fn stop(&mut self) {
        self.shared.state().closing = true;
        self.shared.wanted.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has been printed, and there is nobody left to tell.
            let _ = thread.join();
        }
    }
}

impl Drop for Committer {
    fn drop(&mut self) {
        self.stop();
    }
}

fn run(shared: &CommitterShared, mut file: JournalFile, interval: Duration) {
    let interval = interval.max(Duration::from_millis(1));
    let mut rest = interval;
    loop {
        let state = shared.state();
        let waits = |state: &mut CommitState| !state.wanted && !state.closing;
        let waited = shared.wanted.wait_timeout_while(state, rest, waits);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let (batch, added, closing) = (std::mem::take(&mut state.batch), state.added, state.closing);
        let due = added > state.committed && state.failure.is_none();
        state.wanted = false;
        drop(state);
        let begun = Instant::now();
        let outcome = due.then(|| commit(batch, &mut file));
        rest = interval.max(LONGEST_REST.min(begun.elapsed()));
        let mut state = shared.state();
        match outcome {
            Some(Ok(())) => state.committed = added,
            Some(Err(error)) => state.failure = Some(error),
            // There was nothing to commit, or nothing may be committed any more.
            None => {}
        }
        shared.committed.notify_all();
        if closing {
            return;
        }
    }
}

/// The journal, to which lines are appended.
struct JournalFile {
    file: File,
    path: PathBuf,
    end: u64,
}

impl JournalFile {
    fn open(path: &Path) -> Result<JournalFile> {
        let file = disk::open(path).map_err(Error::io("open", path))?;
        let end = file.metadata().map_err(Error::io("read", path))?.len();
        Ok(JournalFile { file, path: path.into(), end })
    }

    /// Appends lines and waits until they are on the disk.
    fn append(&mut self, lines: &[u8]) -> Result<()> {
        let mut writer = WriteFrom { file: &self.file, at: self.end };
        let written = writer.write_all(lines);
        self.end = writer.at;
        written.and_then(|()| disk::sync_data(&self.file)).map_err(Error::io("write", &self.path))
    }
}

/// Returns the same error again. Everybody who waits gets it, because nobody knows whose error will be shown.
fn copy_of(error: &Error) -> Error {
    match error {
        Error::Io { action, path, source } => Error::io(action, path)(match source.raw_os_error() {
            Some(code) => io::Error::from_raw_os_error(code),
            None => io::Error::new(source.kind(), source.to_string()),
        }),
        other => Error::Broken(other.to_string()),
    }
}

/// Publishes the files, then writes the lines: so whatever the journal says is true, whenever the machine stops.
fn commit(batch: CommitBatch, journal: &mut JournalFile) -> Result<()> {
    fault::point("commit");
    publish(&batch.files)?;
    fault::point("published");
    let lines = batch.lines.as_bytes();
    if fault::is_due("torn") {
        // What a power failure may leave of it.
        let _ = journal.append(&lines[..lines.len() / 2]);
        fault::die();
    }
    journal.append(lines)?;
    fault::point("committed");
    Ok(())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use sys::ErrorKind;

    #[test]
    fn nothing_is_committed_after_a_failure() {
        let committer = Committer::start(Path::new("/dev/full")).unwrap();
        let record = || CommitBatch { lines: "a step\n".into(), files: Vec::new() };
        let told = std::iter::repeat_with(|| {
            std::thread::sleep(Duration::from_millis(1));
            committer.add(record())
        });
        let told = told.take(10_000).find_map(Result::err).unwrap();
        assert_eq!(told.kind(), ErrorKind::Retry, "{told}");
        // The thread keeps waking up meanwhile.
        for _ in 0..100 {
            let again = committer.commit(committer.added()).unwrap_err();
            assert_eq!(again.to_string(), told.to_string(), "everybody who asks is told why");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
