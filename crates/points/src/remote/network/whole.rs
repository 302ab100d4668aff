//! Small files of other machines that are fetched whole, in one request each: lists of point clouds, and the nodes and pages of an EPT. Servers
//! that make their answers anew, such as those of catalogues, send no parts of them.

use std::collections::{BTreeMap, HashSet};
use std::io::{self, Read};
use std::path::Path;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

use xxhash_rust::xxh3::xxh3_64;

use crate::remote::network::client::{Address, Headers, refusal};
use crate::remote::network::failure::{Failure, FailureKind};
use crate::remote::network::read_plan::may_keep;
use crate::remote::network::timeouts::{Timeouts, persist};
use crate::remote::network::window::{Pending, Window};
use crate::remote::traffic::count_bytes;
use sys::{Error, Result};

static STATE: LazyLock<Mutex<State>> = LazyLock::new(Mutex::default);

/// What is known of files that somebody will ask for.
#[derive(Default)]
struct State {
    /// Those that are on their way, or are kept for those who read them once more, by their URLs.
    kept: BTreeMap<String, Pending>,
    /// Hashes of the URLs of those that will be read once more, and have not been yet.
    expected: HashSet<u64>,
}

/// The bytes of a file.
#[derive(Clone)]
pub(crate) struct WholeFile(Arc<Window>);

impl WholeFile {
    /// Returns the bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0.bytes
    }

    /// Reads some bytes from position `at` on; none behind the end.
    pub(crate) fn read_at(&self, out: &mut [u8], at: u64) -> io::Result<usize> {
        let rest = usize::try_from(at).ok().and_then(|at| self.bytes().get(at..)).unwrap_or_default();
        let count = rest.len().min(out.len());
        out[..count].copy_from_slice(&rest[..count]);
        Ok(count)
    }
}

/// A file that is read whole.
pub(crate) struct WholeRequest<'a> {
    /// What messages call the file.
    name: &'a Path,
    /// Its URL, with its query.
    url: &'a str,
    /// It has no more bytes than this.
    most: u64,
    /// It has about so many.
    about: u64,
}

impl<'a> WholeRequest<'a> {
    /// Returns the request for the file that messages call `name`, with its URL and query. It has about so many bytes, and no more than `most`.
    pub(crate) fn new(name: &'a Path, url: &'a str, most: u64, about: u64) -> WholeRequest<'a> {
        WholeRequest { name, url, most, about }
    }

    /// Says that the file will be fetched once more, and not again.
    pub(crate) fn expect(&self) {
        state().expected.insert(self.hash());
    }

    /// Begins to fetch a file that is expected, if there is room for it.
    pub(crate) fn prepare(&self) {
        let mut state = state();
        let is_wanted = state.expected.contains(&self.hash()) && !state.kept.contains_key(self.url);
        if is_wanted && may_keep(self.about) {
            state.kept.insert(self.url.into(), self.begin());
        }
    }

    /// Returns the file; `None` if there is none. With `keep` it stays in memory for those who ask again, if there is room and it is not
    /// expected: then this is the last time.
    ///
    /// # Errors
    /// [`Error::Input`] if it has more bytes than it may have, [`Error::Io`] if it is not handed out, [`Error::Interrupted`].
    pub(crate) fn fetch(&self, keep: bool) -> Result<Option<WholeFile>> {
        let pending = self.pending(keep);
        let failure = match pending.wait()? {
            Ok(window) if window.bytes.len() as u64 <= self.most => return Ok(Some(WholeFile(window))),
            Ok(_) => return Err(Error::input(self.name, format!("has more than {} MiB", self.most >> 20))),
            Err(failure) => failure,
        };
        state().kept.remove(self.url);
        match failure.kind {
            FailureKind::Missing => Ok(None),
            _ => Err(failure.into_error(self.name, "")),
        }
    }

    /// Returns the file that comes.
    fn pending(&self, keep: bool) -> Pending {
        let mut state = state();
        let known = state.kept.remove(self.url);
        let is_last_time = state.expected.remove(&self.hash());
        let keeps = keep && !is_last_time && (known.is_some() || may_keep(self.about));
        let pending = known.unwrap_or_else(|| self.begin());
        if keeps {
            state.kept.insert(self.url.into(), pending.clone());
        }
        pending
    }

    fn begin(&self) -> Pending {
        let (url, most) = (self.url.to_string(), self.most);
        Pending::begin(0..self.about, move || {
            let address = Address::of(&url).map_err(|error| Failure::new(FailureKind::Refused, error.to_string()))?;
            persist(Timeouts::standard(), false, || attempt(&address, most).map_err(|failure| (0, failure)))
        })
    }

    fn hash(&self) -> u64 {
        xxh3_64(self.url.as_bytes())
    }
}

/// Gives up what is kept and expected, and nobody has asked for.
pub(crate) fn forget_whole_files() {
    *state() = State::default();
}

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Asks once, and returns the bytes of the file, or one more than it may have.
fn attempt(address: &Address, most: u64) -> std::result::Result<Vec<u8>, Failure> {
    let answer = address.ask(&Headers::new())?;
    if answer.status() != 200 {
        return Err(refusal(answer, address));
    }
    let promised = answer.body().content_length();
    let mut bytes = Vec::new();
    let read = answer.into_body().into_reader().take(most + 1).read_to_end(&mut bytes);
    count_bytes(bytes.len());
    let came = bytes.len() as u64;
    let missing = promised.unwrap_or(0).min(most + 1).saturating_sub(came);
    match read {
        Ok(_) if missing == 0 => Ok(bytes),
        Ok(_) => Err(Failure::new(FailureKind::Passing, format!("the answer ended {missing} bytes too early"))),
        Err(error) => {
            Err(Failure::new(FailureKind::Passing, format!("the answer broke off after {came} bytes: {error}")))
        }
    }
}
