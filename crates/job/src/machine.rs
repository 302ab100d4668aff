//! What the machine has to offer, as far as it tells.

use std::fs;
use std::path::{Path, PathBuf};
use sys::{Error, Result, address_space};

/// Returns the free bytes on the disk of `directory`, which need not exist yet; `None` if the system does not tell.
pub(crate) fn free_disk(directory: &Path) -> Option<u64> {
    fs4::available_space(nearest_existing(directory)).ok()
}

/// Returns the bytes of disk that a file takes: less than its length if parts of it were freed.
#[cfg(unix)]
pub(crate) fn allocated(data: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::blocks(data) * 512
}

#[cfg(not(unix))]
pub(crate) fn allocated(data: &fs::Metadata) -> u64 {
    data.len()
}

/// Checks that a file can be made on the disk of `directory`, which need not exist yet. Leaves nothing behind.
///
/// # Errors
/// [`Error::Io`] if no file can be made.
pub(crate) fn check_writable(directory: &Path) -> Result<()> {
    tempfile::tempfile_in(nearest_existing(directory)).map(drop).map_err(Error::io("write to", directory))
}

/// Returns the directory, or the nearest one above it that exists.
fn nearest_existing(directory: &Path) -> &Path {
    directory.ancestors().find(|d| d.exists()).unwrap_or(Path::new("."))
}

/// Returns the bytes of memory that this process can have before the system swaps, kills or refuses; `None` if the system does not
/// tell.
pub(crate) fn free_memory() -> Option<u64> {
    free_outside().into_iter().chain(address_space::at_start().map(|left| left.bytes)).min()
}

/// Returns the bytes of memory that the machine and the control groups of this process leave.
fn free_outside() -> Option<u64> {
    let table = fs::read_to_string("/proc/meminfo").ok()?;
    let machine = kibibytes(&table, "MemAvailable:")? * 1024;
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    Some(free_in_groups(&groups, Path::new("/sys/fs/cgroup")).map_or(machine, |free| free.min(machine)))
}

/// Returns the bytes that the control groups of this process leave, as the kernel's table `groups` names them below `root`. The
/// limit of every group above counts too: Slurm and containers set it on one of them.
fn free_in_groups(groups: &str, root: &Path) -> Option<u64> {
    // Version 2 has one hierarchy, number 0, without controllers. Version 1 has one for memory.
    let free_in = |line: &str| {
        let mut fields = line.splitn(3, ':');
        let (number, controllers, path) = (fields.next()?, fields.next()?, fields.next()?);
        if number == "0" && controllers.is_empty() {
            least_free(root, path, &GroupFiles::V2)
        } else if controllers.split(',').any(|controller| controller == "memory") {
            least_free(&root.join("memory"), path, &GroupFiles::V1)
        } else {
            None
        }
    };
    groups.lines().filter_map(free_in).min()
}

/// What the files of a control group are called.
struct GroupFiles {
    limit: &'static str,
    usage: &'static str,
    /// The rows of `memory.stat` with the bytes of cached files, which the usage includes.
    cached: [&'static str; 2],
}

impl GroupFiles {
    const V1: GroupFiles = GroupFiles {
        limit: "memory.limit_in_bytes",
        usage: "memory.usage_in_bytes",
        cached: ["total_inactive_file", "total_active_file"],
    };
    const V2: GroupFiles =
        GroupFiles { limit: "memory.max", usage: "memory.current", cached: ["inactive_file", "active_file"] };
}

/// Returns the least that any group from `root` down to `path` leaves.
fn least_free(root: &Path, path: &str, files: &GroupFiles) -> Option<u64> {
    let number = |file: PathBuf| fs::read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let free = |group: &Path| {
        let (limit, usage) = (number(group.join(files.limit))?, number(group.join(files.usage))?);
        // The system drops cached files before it runs out of memory.
        let stat = fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
        let row = |name: &str| -> Option<u64> {
            stat.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok())
        };
        let cached: u64 = files.cached.iter().filter_map(|name| row(name)).sum();
        Some(limit.saturating_sub(usage.saturating_sub(cached)))
    };
    // A container may see its own group as the root, whatever the path says.
    let own = root.join(path.trim_start_matches('/'));
    own.ancestors().take_while(|group| group.starts_with(root)).filter_map(free).min()
}

/// Returns the largest resident set of this process so far in bytes; `None` if the system does not tell.
pub(crate) fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    kibibytes(&status, "VmHWM:").map(|kibibytes| kibibytes * 1024)
}

/// Returns the number after `name` in one of the kernel's tables.
fn kibibytes(table: &str, name: &str) -> Option<u64> {
    let line = table.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(root: &Path, path: &str, names: [&str; 2], values: [&str; 2]) {
        let folder = root.join(path);
        fs::create_dir_all(&folder).unwrap();
        names.iter().zip(values).for_each(|(name, value)| fs::write(folder.join(name), value).unwrap());
    }

    #[test]
    fn the_tightest_group_above_the_process_limits_its_memory() {
        let root = tempfile::tempdir().unwrap();
        let names = ["memory.max", "memory.current"];
        group(root.path(), "slurm", names, ["max\n", "900\n"]);
        group(root.path(), "slurm/job_7", names, ["1000\n", "300\n"]);
        group(root.path(), "slurm/job_7/task_0", names, ["max\n", "100\n"]);
        group(root.path(), "other", names, ["10\n", "0\n"]);
        assert_eq!(free_in_groups("0::/slurm/job_7/task_0\n", root.path()), Some(700));
        assert_eq!(free_in_groups("0::/slurm\n", root.path()), None, "no group has a limit");
        assert_eq!(free_in_groups("0::/gone/elsewhere\n", root.path()), None);
        assert_eq!(free_in_groups("", root.path()), None);
    }

    #[test]
    fn cached_files_do_not_count_as_used() {
        let root = tempfile::tempdir().unwrap();
        group(root.path(), "a", ["memory.max", "memory.current"], ["1000\n", "950\n"]);
        let stat = "anon 50\ninactive_file 600\nactive_file 200\ninactive_file_other 7\n";
        fs::write(root.path().join("a/memory.stat"), stat).unwrap();
        assert_eq!(free_in_groups("0::/a\n", root.path()), Some(850));
    }

    #[test]
    fn groups_of_version_1_count_too() {
        let root = tempfile::tempdir().unwrap();
        group(root.path(), "memory/a/b", ["memory.limit_in_bytes", "memory.usage_in_bytes"], ["500\n", "600\n"]);
        let groups = "12:cpu,cpuacct:/a\n7:hugetlb,memory:/a/b\n0::/\n";
        assert_eq!(free_in_groups(groups, root.path()), Some(0));
    }

    #[test]
    fn a_container_sees_its_own_group_as_the_root() {
        let root = tempfile::tempdir().unwrap();
        group(root.path(), "", ["memory.max", "memory.current"], ["5000\n", "2000\n"]);
        assert_eq!(free_in_groups("0::/../../docker/abc\n", root.path()), Some(3000));
    }
}
