//! Limits of processor time and memory by control groups, where the service manager delegates one to the daemon (cgroup v2,
//! `Delegate=` of systemd).
//!
//! A group with limits for its children may have no processes itself. So the daemon moves into one group below its own, and each
//! worker into one of its own beneath a second, which gets less of a busy processor than the daemon.

use super::sandbox::MAX_DATA_BYTES;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Processors that a worker may use: its decoder has two threads.
const MAX_PROCESSORS: u32 = 2;

/// Length of the stretch of time in which it may use them, in microseconds.
const PERIOD_MICROS: u32 = 100_000;

/// Most bytes of a worker: its own, and pictures that it shares with the daemon.
const MAX_MEMORY_BYTES: u64 = MAX_DATA_BYTES + (1 << 30);

/// Most threads of a worker.
const MAX_THREADS: u32 = 256;

/// Weight of all workers together where processors are busy; the daemon has 100.
const WEIGHT: u32 = 50;

/// Controllers that are of use here.
const CONTROLLERS: [&str; 3] = ["cpu", "memory", "pids"];

/// The group of one worker. It is removed when this is dropped, which is to be once the process has ended.
#[derive(Debug)]
pub(super) struct Group {
    folder: PathBuf,
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir(&self.folder) {
            tracing::debug!(%error, folder = %self.folder.display(), "a control group stays");
        }
    }
}

/// Parts the daemon's group between it and workers, once, if it was delegated to the daemon; returns the group of all workers. To be
/// called before the first worker is started: then the daemon is alone in its group.
pub(super) fn parted() -> Option<&'static Root> {
    static ROOT: OnceLock<Option<Root>> = OnceLock::new();
    let make = || {
        let folder = own_folder()?;
        if !is_delegated(&folder) {
            return None;
        }
        let root = Root::new(&folder, std::process::id());
        root.inspect_err(|error| tracing::debug!(%error, "decoding processes have no control group")).ok()
    };
    ROOT.get_or_init(make).as_ref()
}

/// The group of all workers.
#[derive(Debug)]
pub(super) struct Root {
    folder: PathBuf,
}

impl Root {
    /// Parts `folder`, the group of the process `daemon_id`, between it and workers.
    ///
    /// # Errors
    /// When the group is not the daemon's to part, has nothing to limit by, or holds others than the daemon.
    fn new(folder: &Path, daemon_id: u32) -> io::Result<Self> {
        let members = std::fs::read_to_string(folder.join("cgroup.procs"))?;
        let is_other = |member: &str| member.trim() != daemon_id.to_string();
        if members.lines().any(is_other) {
            return Err(io::Error::other("other processes are in the daemon's control group"));
        }
        let found = std::fs::read_to_string(folder.join("cgroup.controllers"))?;
        let found: Vec<&str> = CONTROLLERS
            .into_iter()
            .filter(|name| found.split_whitespace().any(|word| word == *name))
            .collect();
        if !found.contains(&"cpu") || !found.contains(&"memory") {
            return Err(io::Error::other("the controllers of processors and memory are not delegated"));
        }
        let (daemon, workers) = (folder.join("daemon"), folder.join("decoders"));
        make(&daemon)?;
        write(&daemon, "cgroup.procs", &daemon_id.to_string())?;
        make(&workers)?;
        let enabled = found.iter().map(|name| format!("+{name}")).collect::<Vec<_>>().join(" ");
        write(folder, "cgroup.subtree_control", &enabled)?;
        write(&workers, "cgroup.subtree_control", &enabled)?;
        write(&workers, "cpu.weight", &WEIGHT.to_string())?;
        Ok(Self { folder: workers })
    }

    /// Puts a worker into a group of its own; says in the log where that fails.
    pub(super) fn confine(&self, process_id: u32) -> Option<Group> {
        let group = self.add(process_id);
        group.inspect_err(|error| tracing::warn!(%error, "a decoding process has no control group")).ok()
    }

    /// Puts a process into a new group.
    ///
    /// # Errors
    /// When the process has ended, or the kernel refuses it.
    fn add(&self, process_id: u32) -> io::Result<Group> {
        let folder = self.folder.join(process_id.to_string());
        make(&folder)?;
        let group = Group { folder };
        let limits = [
            ("cpu.max", format!("{} {PERIOD_MICROS}", MAX_PROCESSORS * PERIOD_MICROS)),
            ("memory.max", MAX_MEMORY_BYTES.to_string()),
            ("pids.max", MAX_THREADS.to_string()),
        ];
        for (file, limit) in limits {
            // Those of controllers that are not delegated are not there.
            if group.folder.join(file).try_exists()? {
                write(&group.folder, file, &limit)?;
            }
        }
        write(&group.folder, "cgroup.procs", &process_id.to_string())?;
        Ok(group)
    }
}

/// Returns true for a group that its service manager marked as delegated (systemd from 251 on).
fn is_delegated(folder: &Path) -> bool {
    let mut value = [0; 1];
    let mut has_mark =
        |name: &str| matches!(rustix::fs::getxattr(folder, name, &mut value), Ok(1)) && value == *b"1";
    has_mark("user.delegate") || has_mark("trusted.delegate")
}

fn make(folder: &Path) -> io::Result<()> {
    match std::fs::create_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(error),
        _ => Ok(()),
    }
}

/// Writes to a file of a group, and names it where that fails.
fn write(folder: &Path, file: &str, text: &str) -> io::Result<()> {
    let path = folder.join(file);
    std::fs::write(&path, text)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}

/// Returns the folder of this process's group, where it has one below the topmost.
fn own_folder() -> Option<PathBuf> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let mounts = std::fs::read_to_string("/proc/self/mountinfo").ok()?;
    folder_of(&groups, &mounts)
}

/// Returns the folder of a group, by the lists of a process's groups and mounts (cgroups(7), `proc_pid_mountinfo(5)`).
fn folder_of(groups: &str, mounts: &str) -> Option<PathBuf> {
    let path = groups.lines().find_map(|line| line.strip_prefix("0::/")).filter(|path| !path.is_empty())?;
    let (root, mounted) = mounts.lines().find_map(|line| {
        let (place, kind) = line.split_once(" - ")?;
        let mut fields = place.split(' ').skip(3);
        let found = (fields.next()?, fields.next()?);
        kind.starts_with("cgroup2 ").then_some(found)
    })?;
    let path = format!("/{path}");
    // Within a container the mounted folder is one further down.
    let below = path.strip_prefix(root.trim_end_matches('/'))?.trim_start_matches('/');
    Some(Path::new(mounted).join(below))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOUNTS: &str = "24 30 0:22 / /proc rw,nosuid shared:5 - proc proc rw\n\
                          29 23 0:26 / /sys/fs/cgroup rw,nosuid,nodev shared:9 - cgroup2 cgroup2 rw,nsdelegate\n";

    #[test]
    fn the_own_group_is_found_where_it_is_mounted() {
        let folder = |groups: &str, mounts: &str| folder_of(groups, mounts);
        let service = "1:name=systemd:/\n0::/system.slice/videofields.service\n";
        let expected = PathBuf::from("/sys/fs/cgroup/system.slice/videofields.service");
        assert_eq!(folder(service, MOUNTS), Some(expected));
        let within = MOUNTS.replace("0:26 / /sys", "0:26 /system.slice /sys");
        assert_eq!(folder(service, &within), Some("/sys/fs/cgroup/videofields.service".into()));
        assert_eq!(folder(service, &MOUNTS.replace("0:26 / /sys", "0:26 /user.slice /sys")), None);
        assert_eq!(folder("0::/\n", MOUNTS), None, "the topmost is everybody's");
        assert_eq!(folder("4:memory:/a\n", MOUNTS), None, "version 1");
        assert_eq!(folder(service, "24 30 0:22 / /proc rw shared:5 - proc proc rw\n"), None);
        assert_eq!(folder(service, "garbage\n - cgroup2 \n"), None);
    }

    /// A folder in place of the kernel's, which takes what is written.
    fn delegated(members: &str, controllers: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("cgroup.procs"), members).unwrap();
        std::fs::write(folder.path().join("cgroup.controllers"), controllers).unwrap();
        folder
    }

    fn is_there(folder: &tempfile::TempDir, name: &str) -> bool {
        folder.path().join(name).try_exists().unwrap()
    }

    #[test]
    fn daemon_and_workers_part_the_group_and_workers_are_limited() {
        let folder = delegated("41\n", "cpuset cpu io memory pids\n");
        let read = |file: &str| std::fs::read_to_string(folder.path().join(file)).unwrap();
        let root = Root::new(folder.path(), 41).unwrap();
        assert_eq!(read("daemon/cgroup.procs"), "41");
        assert_eq!(read("cgroup.subtree_control"), "+cpu +memory +pids");
        assert_eq!(read("decoders/cgroup.subtree_control"), "+cpu +memory +pids");
        assert_eq!(read("decoders/cpu.weight"), "50");
        // The kernel makes these files, but not those of a controller that is not delegated.
        std::fs::create_dir(folder.path().join("decoders/42")).unwrap();
        for file in ["cpu.max", "memory.max"] {
            std::fs::write(folder.path().join("decoders/42").join(file), "max").unwrap();
        }
        let group = root.add(42).unwrap();
        assert_eq!(read("decoders/42/cgroup.procs"), "42");
        assert_eq!(
            (read("decoders/42/cpu.max"), read("decoders/42/memory.max")),
            ("200000 100000".into(), "3221225472".into())
        );
        assert!(!is_there(&folder, "decoders/42/pids.max"));
        for file in ["cpu.max", "memory.max", "cgroup.procs"] {
            std::fs::remove_file(folder.path().join("decoders/42").join(file)).unwrap();
        }
        drop(group);
        assert!(!is_there(&folder, "decoders/42"));
    }

    #[test]
    fn a_group_with_others_in_it_or_nothing_to_limit_by_is_left_alone() {
        for (members, controllers) in
            [("41\n7\n", "cpu memory"), ("7\n", "cpu memory"), ("41\n", "cpu pids\n"), ("41\n", "")]
        {
            let folder = delegated(members, controllers);
            assert!(Root::new(folder.path(), 41).is_err(), "{members:?} {controllers:?}");
            assert!(!is_there(&folder, "daemon") && !is_there(&folder, "decoders"));
        }
    }
}
