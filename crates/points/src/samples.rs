//! A quick look at the content of a file: its size, and a hash of its beginning, its end and samples between them.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64, xxh3_128};

use crate::ept::files::page;
use crate::ept::key::NodeKey;
use crate::ept::name::{NODES, PAGES, is_ept};
use crate::remote::identity;
use crate::remote::name::is_remote;
use sys::positional_io::read_exact_at;
use sys::{Error, Result, fault};

/// Bytes that are hashed at the beginning and at the end of a file.
const END_BYTES: u64 = 64 << 10;
/// Bytes of a sample between them.
const SAMPLE_BYTES: u64 = 4 << 10;
/// The number of samples between them.
const SAMPLES: u64 = 16;

/// After so long, a file that is written again has another time. A file system that keeps whole seconds, or every second one, has no
/// fractions; times of others are those of the system's last tick.
const COARSE_TICK: Duration = Duration::from_secs(2);
const FINE_TICK: Duration = Duration::from_millis(20);

/// A file that is still being written is waited for so many times.
const MOST_LOOKS: usize = 3;

/// The size of a file, and a hash of samples of its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FileSamples {
    /// Its size in bytes.
    pub bytes: u64,
    /// The XXH3 of its beginning, its end and samples between them.
    pub samples: u64,
}

impl FileSamples {
    /// Looks at the file at `path`. Of one of another machine, what its server says of it stands for samples.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub fn of(path: &Path) -> Result<FileSamples> {
        if is_ept(path) {
            return FileSamples::of_ept(path);
        }
        FileSamples::of_one(path)
    }

    /// As [`FileSamples::of`], with the time when the file was written, in milliseconds since 1970; 0 for one of another machine. If it was
    /// written only now, this waits until another change would give it another time.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub fn with_time(path: &Path) -> Result<(FileSamples, u64)> {
        if is_remote(path) {
            return Ok((FileSamples::of(path)?, 0));
        }
        let written = || path.metadata().and_then(|data| data.modified()).map_err(Error::io("read", path));
        let mut before = written()?;
        for _ in 1..MOST_LOOKS {
            sleep(time_to_wait(before, SystemTime::now()));
            let (samples, after) = (FileSamples::of(path)?, written()?);
            if after == before {
                return Ok((samples, milliseconds(after)));
            }
            before = after;
        }
        Ok((FileSamples::of(path)?, milliseconds(before)))
    }

    /// As [`FileSamples::of`], of an EPT: its index, the first page of its hierarchy, which has the number of points of many nodes, and on this
    /// machine the names, sizes and times of all its files.
    fn of_ept(path: &Path) -> Result<FileSamples> {
        let index = FileSamples::of_one(path)?;
        let page = page(path, NodeKey::default())?;
        let page = page.as_ref();
        let files = if is_remote(path) { 0 } else { xxh3_64(settled_files_beside(path)?.as_bytes()) };
        let parts = [index.samples, xxh3_64(page), files].map(u64::to_le_bytes).concat();
        Ok(FileSamples { bytes: index.bytes + page.len() as u64, samples: xxh3_64(&parts) })
    }

    fn of_one(path: &Path) -> Result<FileSamples> {
        if is_remote(path) {
            return identity(path).map(|(bytes, samples)| FileSamples { bytes, samples });
        }
        let file = File::open(path).map_err(Error::io("read", path))?;
        let bytes = file.metadata().map_err(Error::io("read", path))?.len();
        let samples = hash_of_samples(&file, bytes).map_err(Error::io("read", path))?;
        Ok(FileSamples { bytes, samples })
    }
}

/// Returns how long to wait at the time `now` until a change of a file that was `written` then gives it another time.
fn time_to_wait(written: SystemTime, now: SystemTime) -> Duration {
    let is_whole = written.duration_since(SystemTime::UNIX_EPOCH).is_ok_and(|time| time.subsec_nanos() == 0);
    let tick = if is_whole { COARSE_TICK } else { FINE_TICK };
    match now.duration_since(written) {
        Ok(age) => tick.saturating_sub(age),
        // A clock that is further ahead gives no time that this one gives soon.
        Err(ahead) if ahead.duration() < tick => ahead.duration().saturating_add(tick),
        Err(_) => Duration::ZERO,
    }
}

/// Returns the milliseconds since 1970; of earlier times, counted down from the greatest number. Finer fractions get lost on the way to other file
/// systems.
fn milliseconds(time: SystemTime) -> u64 {
    let whole = |duration: Duration| u64::try_from(duration.as_millis()).unwrap_or(u64::MAX);
    match time.duration_since(SystemTime::UNIX_EPOCH) {
        Ok(since) => whole(since),
        Err(before) => u64::MAX - whole(before.duration()),
    }
}

/// As [`files_beside`], once another change of a file would give another time.
fn settled_files_beside(index: &Path) -> Result<String> {
    let (mut lines, mut newest) = files_beside(index)?;
    for _ in 1..MOST_LOOKS {
        let wait = time_to_wait(newest, SystemTime::now());
        if wait.is_zero() {
            break;
        }
        sleep(wait);
        (lines, newest) = files_beside(index)?;
    }
    Ok(lines)
}

/// Returns a line for each file of the nodes and pages beside the index of an EPT: its name, its size, and when it was written, in milliseconds
/// since 1970. Also returns when the newest of them was written.
fn files_beside(index: &Path) -> Result<(String, SystemTime)> {
    let (mut lines, mut newest) = (Vec::new(), SystemTime::UNIX_EPOCH);
    for folder in [NODES, PAGES].map(|name| index.with_file_name(name)) {
        let mut read = || -> std::io::Result<()> {
            for entry in folder.read_dir()? {
                let entry = entry?;
                let data = entry.metadata()?;
                let written = data.modified()?;
                newest = newest.max(written);
                let (name, time) = (entry.file_name(), milliseconds(written));
                lines.push(format!("{} {} {time}\n", name.to_string_lossy(), data.len()));
            }
            Ok(())
        };
        match read() {
            // Reading the data set names the files that are missing.
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            read => read.map_err(Error::io("read", &folder))?,
        }
    }
    lines.sort_unstable();
    Ok((lines.concat(), newest))
}

/// Returns a text of 32 hexadecimal digits that tells these files from others, whatever their names and their order.
pub fn fingerprint_of(mut files: Vec<FileSamples>) -> String {
    files.sort_unstable();
    let bytes = files.iter().flat_map(|file| [file.bytes, file.samples]).flat_map(u64::to_le_bytes);
    format!("{:032x}", xxh3_128(&bytes.collect::<Vec<u8>>()))
}

fn hash_of_samples(file: &File, bytes: u64) -> std::io::Result<u64> {
    let last = bytes.saturating_sub(END_BYTES);
    let between = (1..=SAMPLES).map(|i| (last / (SAMPLES + 1) * i, SAMPLE_BYTES));
    let (mut hasher, mut buffer) = (Xxh3::new(), Vec::new());
    for (at, length) in [(0, END_BYTES), (last, END_BYTES)].into_iter().chain(between) {
        buffer.resize(length.min(bytes - at) as usize, 0);
        fault::read("read-input")?;
        read_exact_at(file, &mut buffer, at)?;
        hasher.update(&buffer);
    }
    Ok(hasher.digest())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::{Seek, SeekFrom, Write};

    #[test]
    fn a_file_that_was_written_only_now_gets_another_time_with_the_next_change() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.las");
        let mut content = vec![0; 1 << 20];
        for change in 1..20 {
            // Between the samples, without a change of its size.
            content[100_000] = change;
            fs::write(&path, &content).unwrap();
            let (samples, time) = FileSamples::with_time(&path).unwrap();
            let mut file = fs::File::options().write(true).open(&path).unwrap();
            file.seek(SeekFrom::Start(100_000)).unwrap();
            file.write_all(&[change + 1]).unwrap();
            drop(file);
            let (same_samples, later) = FileSamples::with_time(&path).unwrap();
            assert!(same_samples == samples && later > time, "{time} {later}");
            assert_eq!(FileSamples::with_time(&path).unwrap(), (samples, later));
        }
    }

    #[test]
    fn only_a_recent_time_needs_waiting() {
        let second = SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000);
        let milliseconds = Duration::from_millis;
        for (written, age, wait) in [
            // With fractions.
            (second + milliseconds(5), 0, 20),
            (second + milliseconds(5), 15, 5),
            (second + milliseconds(5), 20, 0),
            // In whole seconds.
            (second, 0, 2_000),
            (second, 1_990, 10),
            (second, 2_000, 0),
        ] {
            assert_eq!(time_to_wait(written, written + milliseconds(age)), milliseconds(wait), "{age}");
        }
        assert_eq!(time_to_wait(second + milliseconds(15), second + milliseconds(5)), milliseconds(30));
        assert_eq!(time_to_wait(second + milliseconds(60_001), second), Duration::ZERO);
    }

    #[test]
    fn a_node_that_is_written_again_makes_another_data_set() {
        let folder = tempfile::tempdir().unwrap();
        let index = folder.path().join("ept.json");
        fs::write(&index, "{}").unwrap();
        for (name, file) in [(PAGES, "0-0-0-0.json"), (NODES, "0-0-0-0.bin"), (NODES, "1-0-0-0.bin")] {
            fs::create_dir_all(folder.path().join(name)).unwrap();
            fs::write(folder.path().join(name).join(file), "{}").unwrap();
        }
        let before = FileSamples::of(&index).unwrap();
        assert_eq!(FileSamples::of(&index).unwrap(), before);
        let node = fs::OpenOptions::new().write(true).open(folder.path().join(NODES).join("1-0-0-0.bin")).unwrap();
        node.set_modified(SystemTime::now() + Duration::from_millis(40)).unwrap();
        let after = FileSamples::of(&index).unwrap();
        assert_ne!(after, before);
        fs::remove_file(folder.path().join(NODES).join("1-0-0-0.bin")).unwrap();
        assert_ne!(FileSamples::of(&index).unwrap(), after);
    }
}
