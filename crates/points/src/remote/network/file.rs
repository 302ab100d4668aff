//! A file of another machine: what is known of it, and its bytes.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::remote::network::client::Address;
use crate::remote::network::read_plan::{ReadPlan, may_keep};
use crate::remote::network::transfer::{Transferred, Version, transfer};
use crate::remote::network::window::{Pending, Window, held_bytes};
use sys::{Error, Result};

/// The bytes that the first request asks for: the headers of most files.
const FIRST: u64 = 1 << 15;

/// The bytes that the beginnings of files may take until the files are opened.
const BEGINNINGS: u64 = 32 << 20;

/// The files that this process has met.
static KNOWN: Mutex<BTreeMap<OsString, Arc<RemoteFile>>> = Mutex::new(BTreeMap::new());

/// A file of another machine. All of a process share what is known of it.
pub(crate) struct RemoteFile {
    /// Its public name.
    name: PathBuf,
    address: Address,
    version: Version,
    /// Tells its content from others.
    hash: u64,
    /// Its beginning, until somebody takes it.
    beginning: Mutex<Option<Arc<Window>>>,
    /// What will be read.
    plan: Mutex<ReadPlan>,
    /// What was fetched to be held before the plan was made: samples of chunks that the plan wants too.
    kept: Mutex<Kept>,
}

/// What is kept of a file for those who read it later.
#[derive(Default)]
struct Kept {
    windows: Vec<(Range<u64>, Pending)>,
    /// Whether it is being read: then nothing more is kept, and what is handed out is given up.
    is_read: bool,
}

impl Kept {
    /// Returns the number of the window that has all of a range.
    fn holding(&self, range: &Range<u64>) -> Option<usize> {
        self.windows.iter().position(|(kept, _)| kept.start <= range.start && range.end <= kept.end)
    }

    /// Hands out the window that has all of a range, if there is one.
    fn hand_out(&mut self, range: &Range<u64>) -> Option<Pending> {
        let at = self.holding(range)?;
        let is_last = self.is_read && self.windows[at].0 == *range;
        Some(if is_last { self.windows.swap_remove(at).1 } else { self.windows[at].1.clone() })
    }
}

/// Returns the size of a file and a number that tells its content from others. Asks the server what it has now.
///
/// # Errors
/// As [`RemoteFile::look`].
pub(crate) fn identity(name: &Path) -> Result<(u64, u64)> {
    RemoteFile::look(name).map(|file| (file.size(), file.hash()))
}

impl RemoteFile {
    /// Returns the file with this public name. Asks the server only if this process has not.
    ///
    /// # Errors
    /// [`Error::Config`] if there is none or the server cannot hand out parts, [`Error::Io`] if it is not handed out.
    pub(crate) fn open(name: &Path) -> Result<Arc<RemoteFile>> {
        let known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner).get(name.as_os_str()).cloned();
        known.map_or_else(|| RemoteFile::look(name), Ok)
    }

    /// As [`RemoteFile::open`], but asks the server what it has now.
    ///
    /// # Errors
    /// As [`RemoteFile::open`].
    pub(crate) fn look(name: &Path) -> Result<Arc<RemoteFile>> {
        let address = Address::of(&name.to_string_lossy())?;
        let found = Arc::new(Mutex::new(None));
        let (there, asked) = (found.clone(), address.clone());
        let fetch = move || {
            let Transferred { bytes, version } = transfer(&asked, 0..FIRST, None, Vec::new())?;
            *there.lock().unwrap_or_else(PoisonError::into_inner) = Some(version);
            Ok(bytes)
        };
        let window = Pending::begin(0..FIRST, fetch).wait()?.map_err(|failure| failure.into_error(name, ""))?;
        let version = found.lock().unwrap_or_else(PoisonError::into_inner).take();
        let version = version.ok_or_else(|| Error::Broken(format!("{}: nothing is known of it", name.display())))?;
        let hash = version.hash(&window.bytes);
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = known.get(name.as_os_str()).filter(|file| (&file.version, file.hash) == (&version, hash)) {
            return Ok(file.clone());
        }
        let beginning = Mutex::new((held_bytes() <= BEGINNINGS).then_some(window));
        let plan = Mutex::new(ReadPlan::new(Vec::new()));
        let kept = Mutex::default();
        let file = Arc::new(RemoteFile { name: name.to_path_buf(), address, version, hash, beginning, plan, kept });
        known.insert(name.into(), file.clone());
        Ok(file)
    }

    /// Returns its size in bytes.
    pub(crate) fn size(&self) -> u64 {
        self.version.size
    }

    /// Returns a number that tells its content from others.
    pub(crate) fn hash(&self) -> u64 {
        self.hash
    }

    /// Returns whether the server tells contents of one size apart.
    pub(crate) fn is_sure(&self) -> bool {
        self.version.is_sure()
    }

    /// Hands out the beginning of the file, if it is there.
    pub(crate) fn take_beginning(&self) -> Option<Arc<Window>> {
        self.beginning.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Says that these ranges will be fetched, each once and about in this order, and no others. What is kept of them does not come again.
    /// Without ranges, nothing is kept any more.
    pub(crate) fn expect(&self, mut ranges: Vec<Range<u64>>) {
        let mut kept = self.kept();
        kept.is_read = !ranges.is_empty();
        if ranges.is_empty() {
            kept.windows.clear();
        }
        ranges.retain(|range| kept.holding(range).is_none());
        drop(kept);
        *self.plan.lock().unwrap_or_else(PoisonError::into_inner) = ReadPlan::new(ranges);
    }

    /// Begins to fetch a range, which lies in the file. One that is expected comes with those after it.
    pub(crate) fn fetch(self: &Arc<Self>, range: Range<u64>) -> Pending {
        self.planned(&range).or_else(|| self.kept().hand_out(&range)).unwrap_or_else(|| self.begin(range))
    }

    /// As [`RemoteFile::fetch`], but keeps the bytes for those who read the file later, if nobody has planned that yet.
    pub(crate) fn fetch_to_keep(self: &Arc<Self>, range: Range<u64>) -> Pending {
        if let Some(pending) = self.planned(&range).or_else(|| self.kept().hand_out(&range)) {
            return pending;
        }
        let keeps = may_keep(range.end - range.start);
        let pending = self.begin(range.clone());
        let mut kept = self.kept();
        if keeps && !kept.is_read {
            kept.windows.push((range, pending.clone()));
        }
        pending
    }

    fn planned(self: &Arc<Self>, range: &Range<u64>) -> Option<Pending> {
        let mut plan = self.plan.lock().unwrap_or_else(PoisonError::into_inner);
        plan.take(range, &|range| self.begin(range))
    }

    fn begin(self: &Arc<Self>, range: Range<u64>) -> Pending {
        let (file, wanted) = (self.clone(), range.clone());
        // Allocators keep what a thread has freed for other threads that begin later, but each thread that fetches ends soon: all of their
        // windows together would stay. So this thread makes room.
        let room = Mutex::new(Vec::with_capacity((range.end - range.start) as usize));
        Pending::begin(range, move || {
            let room = std::mem::take(&mut *room.lock().unwrap_or_else(PoisonError::into_inner));
            Ok(transfer(&file.address, wanted.clone(), Some(&file.version), room)?.bytes)
        })
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for what [`RemoteFile::fetch`] has begun for `range`.
    ///
    /// # Errors
    /// [`Error::Io`] if the server does not hand it out, [`Error::Interrupted`] if the process is to stop.
    pub(crate) fn wait(&self, pending: &Pending, range: &Range<u64>) -> Result<Arc<Window>> {
        let place = format!("bytes {} to {}: ", range.start, range.end.saturating_sub(1));
        pending.wait()?.map_err(|failure| {
            self.kept().windows.clear();
            failure.into_read_error(&self.name, &place)
        })
    }
}
