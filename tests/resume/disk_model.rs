//! What a power failure leaves on a disk. The program writes down every change of a file that it makes (`GDT_TRACE`); this makes up
//! what the disk may hold if the power fails after one of them.
//!
//! Only what was synced is sure to be there: the bytes of a file once the file is synced, its name once its folder is. Of everything
//! else any part may be lost, also a later change without an earlier one, and a write may be torn or leave garbage. What was freed may
//! be gone at once, whatever else is lost. A rename happens or does not, as journaling file systems promise.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use crate::random::Random;

/// A change, or a place that the program came to.
#[derive(Clone, Debug)]
pub(crate) enum Change {
    Create { inode: u64, path: String },
    Write { inode: u64, at: usize, bytes: Vec<u8> },
    Length { inode: u64, length: usize },
    Free { inode: u64, at: usize, length: usize },
    Sync { inode: u64 },
    Rename { from: String, to: String },
    Remove { path: String },
    Folder { path: String },
    SyncFolder { path: String },
    Mark,
}

impl Change {
    /// Tells whether a power failure right after it is worth a look: not between two pieces of a file.
    pub(crate) fn is_decisive(&self) -> bool {
        !matches!(self, Change::Write { .. } | Change::Length { .. })
    }
}

impl fmt::Display for Change {
    /// Writes all but the bytes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Change::Write { inode, at, bytes } => write!(f, "write {} bytes at {at} to {inode}", bytes.len()),
            other => write!(f, "{other:?}"),
        }
    }
}

/// Reads what the program wrote down.
#[track_caller]
pub(crate) fn read_trace(path: &Path) -> Vec<Change> {
    let (text, mut at, mut changes) = (fs::read(path).unwrap(), 0, Vec::new());
    while at < text.len() {
        let end = at + text[at..].iter().position(|&byte| byte == b'\n').expect("the trace is whole");
        let line = std::str::from_utf8(&text[at..end]).unwrap();
        at = end + 1;
        let (what, rest) = line.split_once(' ').unwrap();
        let numbers = || rest.split(' ').map_while(|word| word.parse::<usize>().ok()).collect::<Vec<usize>>();
        let path = rest.to_string();
        changes.push(match what {
            "create" => {
                let (inode, path) = rest.split_once(' ').unwrap();
                Change::Create { inode: inode.parse().unwrap(), path: path.into() }
            }
            "write" => {
                let [inode, position, length] = numbers()[..] else { panic!("{line}") };
                at += length;
                Change::Write { inode: inode as u64, at: position, bytes: text[at - length..at].to_vec() }
            }
            "free" => {
                let [inode, at, length] = numbers()[..] else { panic!("{line}") };
                Change::Free { inode: inode as u64, at, length }
            }
            "length" => Change::Length { inode: numbers()[0] as u64, length: numbers()[1] },
            "sync" => Change::Sync { inode: numbers()[0] as u64 },
            "rename" => {
                let (from, to) = rest.split_once('\t').unwrap();
                Change::Rename { from: from.into(), to: to.into() }
            }
            "remove" => Change::Remove { path },
            "folder" => Change::Folder { path },
            "sync-folder" => Change::SyncFolder { path: if path == "." { String::new() } else { path } },
            "mark" => Change::Mark,
            _ => panic!("{line}"),
        });
    }
    changes
}

/// What becomes of changes that were not synced.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Loss {
    /// All are lost.
    Everything,
    /// Bytes are lost, but names stay, and what was freed is gone.
    Bytes,
    /// Names are lost, bytes stay.
    Names,
    /// Any part is lost.
    Some(u64),
}

/// The files of a folder: bytes by path from the working directory. Folders have no bytes.
pub(crate) type Files = BTreeMap<String, Option<Vec<u8>>>;

/// A file, whatever its name.
#[derive(Clone, Default)]
struct Node {
    on_disk: Vec<u8>,
    /// What was not synced.
    pending: Vec<Pending>,
}

/// A change of a file that may be lost.
#[derive(Clone)]
enum Pending {
    Length(usize),
    Bytes(usize, Vec<u8>),
    Free(usize, usize),
}

/// A change of names.
enum NameChange {
    Link(String, usize),
    Rename(String, String),
    Remove(String),
    Folder(String),
}

impl NameChange {
    /// The folder whose sync brings it to the disk.
    fn folder(&self) -> &str {
        match self {
            NameChange::Link(path, _) | NameChange::Rename(_, path) => parent(path),
            NameChange::Remove(path) | NameChange::Folder(path) => parent(path),
        }
    }
}

fn parent(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// A disk before the program runs: `names` leads to nodes, folders to `None`.
pub(crate) struct Disk {
    nodes: Vec<Node>,
    names: BTreeMap<String, Option<usize>>,
    by_inode: HashMap<u64, usize>,
}

impl Disk {
    /// Reads the folder `name` in `base`, all of which is on the disk.
    pub(crate) fn read(base: &Path, name: &str) -> Disk {
        let mut disk = Disk { nodes: Vec::new(), names: BTreeMap::new(), by_inode: HashMap::new() };
        disk.add(base, name);
        disk
    }

    fn add(&mut self, base: &Path, name: &str) {
        let path = base.join(name);
        let Ok(data) = path.metadata() else { return };
        if data.is_dir() {
            self.names.insert(name.into(), None);
            let below = fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().file_name());
            below.for_each(|entry| self.add(base, &format!("{name}/{}", entry.to_str().unwrap())));
        } else {
            self.by_inode.insert(data.ino(), self.nodes.len());
            self.names.insert(name.into(), Some(self.nodes.len()));
            self.nodes.push(Node { on_disk: fs::read(&path).unwrap(), pending: Vec::new() });
        }
    }

    /// Returns what it holds.
    pub(crate) fn files(&self) -> Files {
        let content = |node: usize| self.nodes[node].on_disk.clone();
        self.names.iter().map(|(name, node)| (name.clone(), node.map(content))).collect()
    }

    /// Returns what the disk may hold if the power fails after `changes`.
    pub(crate) fn after(&self, changes: &[Change], loss: Loss) -> Files {
        let (mut nodes, mut by_inode) = (self.nodes.clone(), self.by_inode.clone());
        // The names as the program sees them, only to tell whether a created file was there.
        let mut seen = self.names.clone();
        let mut name_changes: Vec<(NameChange, bool)> = Vec::new();
        for change in changes {
            let named = match change {
                Change::Create { inode, path } => {
                    let known = by_inode.get(inode).copied().filter(|node| seen.get(path) == Some(&Some(*node)));
                    match known {
                        Some(node) => {
                            nodes[node].pending.push(Pending::Length(0));
                            None
                        }
                        None => {
                            by_inode.insert(*inode, nodes.len());
                            nodes.push(Node::default());
                            Some(NameChange::Link(path.clone(), nodes.len() - 1))
                        }
                    }
                }
                Change::Write { inode, at, bytes } => {
                    nodes[by_inode[inode]].pending.push(Pending::Bytes(*at, bytes.clone()));
                    None
                }
                Change::Length { inode, length } => {
                    nodes[by_inode[inode]].pending.push(Pending::Length(*length));
                    None
                }
                Change::Free { inode, at, length } => {
                    nodes[by_inode[inode]].pending.push(Pending::Free(*at, *length));
                    None
                }
                Change::Sync { inode } => {
                    nodes[by_inode[inode]].sync();
                    None
                }
                Change::Rename { from, to } => Some(NameChange::Rename(from.clone(), to.clone())),
                Change::Remove { path } => Some(NameChange::Remove(path.clone())),
                Change::Folder { path } => Some(NameChange::Folder(path.clone())),
                Change::SyncFolder { path } => {
                    let in_folder = name_changes.iter_mut().filter(|(change, _)| change.folder() == path);
                    in_folder.for_each(|(_, synced)| *synced = true);
                    None
                }
                Change::Mark => None,
            };
            if let Some(named) = named {
                apply(&named, &mut seen, &mut |_| true);
                name_changes.push((named, false));
            }
        }
        let mut random = Random(if let Loss::Some(seed) = loss { seed } else { 0 });
        let mut names = self.names.clone();
        // A name may depend on many others, so that some disks keep most of them.
        let kept_of_eight = [1, 4, 7][random.below(3) as usize];
        for (change, synced) in &name_changes {
            let mut stays = |_: &str| match loss {
                _ if *synced => true,
                Loss::Everything | Loss::Names => false,
                Loss::Bytes => true,
                Loss::Some(_) => random.below(8) < kept_of_eight,
            };
            apply(change, &mut names, &mut stays);
        }
        let contents: Vec<Vec<u8>> = nodes.into_iter().map(|node| node.after(loss, &mut random)).collect();
        names.into_iter().map(|(name, node)| (name, node.map(|node| contents[node].clone()))).collect()
    }
}

/// Applies a change of names if it can be applied and `stays` says that it does. A folder that is removed with everything in it may
/// lose a part of that.
fn apply(change: &NameChange, names: &mut BTreeMap<String, Option<usize>>, stays: &mut dyn FnMut(&str) -> bool) {
    let is_folder =
        |names: &BTreeMap<String, Option<usize>>, path: &str| path.is_empty() || names.get(path) == Some(&None);
    match change {
        NameChange::Link(path, node) if is_folder(names, parent(path)) && stays(path) => {
            names.insert(path.clone(), Some(*node));
        }
        NameChange::Folder(path) if is_folder(names, parent(path)) && stays(path) => {
            names.entry(path.clone()).or_insert(None);
        }
        NameChange::Rename(from, to) if names.contains_key(from) && is_folder(names, parent(to)) && stays(to) => {
            let node = names.remove(from).unwrap();
            names.insert(to.clone(), node);
        }
        NameChange::Remove(path) => {
            let below = |names: &BTreeMap<String, Option<usize>>, path: &str| -> BTreeSet<String> {
                let start = format!("{path}/");
                names.keys().filter(|name| *name == path || name.starts_with(&start)).cloned().collect()
            };
            // What is in a folder goes before the folder.
            for name in below(names, path).into_iter().rev() {
                if below(names, &name).len() == 1 && stays(&name) {
                    names.remove(&name);
                }
            }
        }
        _ => {}
    }
}

impl Node {
    fn sync(&mut self) {
        for change in std::mem::take(&mut self.pending) {
            put(&mut self.on_disk, &change);
        }
    }

    fn after(mut self, loss: Loss, random: &mut Random) -> Vec<u8> {
        for change in std::mem::take(&mut self.pending) {
            let stays = match loss {
                Loss::Names => true,
                Loss::Everything => false,
                Loss::Bytes => matches!(change, Pending::Free(..)),
                Loss::Some(_) => random.below(5) < 2,
            };
            let change = match (change, loss) {
                (change, _) if stays => change,
                (Pending::Bytes(at, bytes), Loss::Some(_)) => match random.below(3) {
                    0 => continue,
                    // Torn: a part of it, of any length.
                    1 => {
                        let part = random.below(bytes.len() as u64 + 1) as usize;
                        Pending::Bytes(at, bytes[..part].to_vec())
                    }
                    // The file has grown, but these blocks were never written.
                    _ => Pending::Bytes(at, vec![random.below(256) as u8; bytes.len()]),
                },
                _ => continue,
            };
            put(&mut self.on_disk, &change);
        }
        self.on_disk
    }
}

fn put(content: &mut Vec<u8>, change: &Pending) {
    match change {
        Pending::Length(length) => content.resize(*length, 0),
        Pending::Bytes(_, bytes) if bytes.is_empty() => {}
        Pending::Bytes(at, bytes) => {
            content.resize(content.len().max(at + bytes.len()), 0);
            content[*at..at + bytes.len()].copy_from_slice(bytes);
        }
        Pending::Free(at, length) => {
            let end = content.len();
            content[*at.min(&end)..(at + length).min(end)].fill(0);
        }
    }
}

/// Makes the folder `name` in `base` hold these files and no others.
pub(crate) fn restore(base: &Path, name: &str, files: &Files) {
    let root = base.join(name);
    if root.exists() {
        fs::remove_dir_all(&root).unwrap();
    }
    for (path, content) in files {
        match content {
            None => fs::create_dir_all(base.join(path)).unwrap(),
            Some(bytes) => fs::write(base.join(path), bytes).unwrap(),
        }
    }
}
