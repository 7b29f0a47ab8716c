//! The machine: its clock, its memory, how many files a process may have open.

use super::line::Line;
use rustix::process::{Resource, getrlimit};
use std::process::{Command, Stdio};
use videofields_recording::store::probe::holder;
use videofields_vision::config::Config;

/// Files beside those of cameras: connections, the database, the GPU.
const FILES: u64 = 512;

/// Files of a camera: its connection, decoder, and what is recorded of it.
const FILES_OF_CAMERA: u64 = 16;

/// MiB beside what settings bound: the program, the scene, the renderer.
const MIB: u64 = 512;

/// MiB of a camera beside its timeline: its decoder and background.
const MIB_OF_CAMERA: u64 = 80;

pub(super) fn look(config: &Config) -> Vec<Line> {
    vec![clock(), memory(config), files(config)]
}

/// Whether something keeps the clock right, as systemd tells.
fn clock() -> Line {
    let mut asked = Command::new("timedatectl");
    asked.args(["show", "--property=NTPSynchronized", "--value"]).stdin(Stdio::null()).stderr(Stdio::null());
    let told = asked.output().ok().filter(|output| output.status.success());
    let told = told.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    let why = "recordings and the audit log bear the machine's time, and cameras are held against it";
    match told.as_deref() {
        Some("yes") => Line::ok("clock", "synchronised".to_owned()),
        Some("no") => Line::warning("clock", "not synchronised".to_owned(), why)
            .do_this("`timedatectl set-ntp true`, or another time service"),
        _ => Line::warning("clock", "not known whether it is synchronised".to_owned(), why)
            .do_this("ask the time service (`chronyc tracking`, `ntpq -p`); in a container, on its host"),
    }
}

fn memory(config: &Config) -> Line {
    let settings = config.settings();
    let cameras = settings.camera.len() as u64;
    let each = u64::from(settings.timeline.mib_per_camera) + MIB_OF_CAMERA;
    let replay = if settings.archive.is_on() { u64::from(settings.timeline.replay_mib) } else { 0 };
    let needed = MIB + cameras * each + replay + u64::from(settings.render.cache_mib);
    let told = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let Some(there) = total_mib(&told) else {
        return Line::warning("memory", "not known".to_owned(), "the system does not tell (/proc/meminfo)");
    };
    let what = format!("{there} MiB, of which the settings allow some {needed} MiB to be used");
    if there < needed {
        return Line::warning("memory", what, "the daemon is ended by the system when there is no more")
            .do_this("lower `timeline.mib_per_camera`, or fewer cameras");
    }
    Line::ok("memory", what)
}

/// The machine's memory by the lines of `proc_meminfo(5)`.
fn total_mib(told: &str) -> Option<u64> {
    let line = told.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? / 1024)
}

/// How many files may be open: of the daemon where it runs, else of who asks.
fn files(config: &Config) -> Line {
    let needed = FILES + config.settings().camera.len() as u64 * FILES_OF_CAMERA;
    let process = holder(&config.settings().storage.database).ok().flatten().filter(|process| *process > 0);
    let limits = process.and_then(|process| std::fs::read_to_string(format!("/proc/{process}/limits")).ok());
    let (whose, most) = match limits.as_deref().and_then(open_files) {
        Some(most) => ("the running daemon", most),
        None => ("this user", getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX)),
    };
    let what = format!("{whose} may have {most} files open, some {needed} are needed");
    if most < needed {
        return Line::warning("open files", what, "cameras and callers are refused when there are no more")
            .do_this("`LimitNOFILE=` in the service, or `ulimit -n`");
    }
    Line::ok("open files", what)
}

/// The soft limit of open files in the lines of `/proc/PID/limits`.
fn open_files(told: &str) -> Option<u64> {
    let line = told.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    let soft = line.split_whitespace().next()?;
    if soft == "unlimited" { Some(u64::MAX) } else { soft.parse().ok() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_tells_is_read() {
        assert_eq!(total_mib("MemTotal:       24684348 kB\nMemFree: 1 kB\n"), Some(24_105));
        assert_eq!(total_mib("MemFree: 1 kB\n"), None);
        let limits = "Limit  Soft Limit  Hard Limit  Units\nMax open files            1024                 524288               files\n";
        assert_eq!(open_files(limits), Some(1024));
        assert_eq!(open_files("Max open files   unlimited unlimited files"), Some(u64::MAX));
        assert_eq!(open_files("Max processes 7 7"), None);
    }
}
