//! The folders: whether they are there and can be written, on which file system, with how much room.

use super::line::Line;
use rustix::fs::{Access, access, statvfs};
use std::path::Path;
use videofields_recording::store::{file_system_of, is_network_file_system};
use videofields_vision::config::Config;
use videofields_vision::private_files::Overlap;

/// MiB that the database's disk should have left.
const DATABASE_MIB: u64 = 1024;

pub(super) fn look(config: &Config) -> Vec<Line> {
    let settings = config.settings();
    let mut lines = Vec::new();
    if let Some(folder) = settings.storage.database.parent() {
        lines.push(database(folder));
    }
    if settings.archive.is_on() {
        lines.push(recordings(&settings.archive.folder, u64::from(settings.archive.min_free_mib)));
    }
    let snapshots = &settings.storage.snapshot_folder;
    if !snapshots.as_os_str().is_empty() {
        lines.push(kept("snapshots", snapshots, u64::from(settings.storage.snapshot_min_free_mib)));
    }
    let folders = settings.media_folders();
    lines.extend(folders.roots.iter().map(|root| media(root)));
    let warning = |overlap: Overlap<'_>| {
        Line::warning("folders", format!("media in {}", overlap.root.display()), overlap.to_string())
            .do_this("name a folder in `media.roots` that holds media alone")
    };
    lines.extend(folders.overlaps().map(warning));
    lines.extend(settings.scene.iter().map(|scene| scene_file(&scene.id, &scene.file)));
    lines
}

/// What there is of a folder, or of the nearest one above it that is there.
fn nearest(folder: &Path) -> &Path {
    folder.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("/"))
}

/// The file system of a folder and the MiB that are left on it.
fn disk(folder: &Path) -> (String, Option<u64>) {
    let resolved = folder.canonicalize().unwrap_or_else(|_hidden| folder.to_owned());
    let file_system = file_system_of(&resolved).unwrap_or_else(|| "an unknown file system".to_owned());
    (file_system, statvfs(folder).ok().map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize) >> 20))
}

fn can_write(folder: &Path) -> Result<(), String> {
    access(folder, Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK).map_err(|error| error.to_string())
}

fn database(folder: &Path) -> Line {
    let there = nearest(folder);
    let (file_system, free_mib) = disk(there);
    let what = format!("database in {}: {file_system}, {} MiB free", folder.display(), shown(free_mib));
    if is_network_file_system(&file_system) {
        return Line::problem("folders", what, "on a network file system two writers can damage a database")
            .do_this("put `storage.database` on a local disk");
    }
    if let Err(error) = can_write(there) {
        return Line::problem(
            "folders",
            what,
            format!("this user cannot write to {}: {error}", there.display()),
        )
        .do_this("run this as the daemon's user, or give that user the folder");
    }
    match free_mib {
        Some(free) if free < DATABASE_MIB / 16 => {
            Line::problem("folders", what, "the database cannot grow").do_this("make room")
        }
        Some(free) if free < DATABASE_MIB => {
            Line::warning("folders", what, "the database grows by tracks and backgrounds")
                .do_this("make room")
        }
        _ => Line::ok("folders", what),
    }
}

/// A folder to which is only written while the disk has room.
fn kept(what: &str, folder: &Path, least_mib: u64) -> Line {
    let there = nearest(folder);
    let (file_system, free_mib) = disk(there);
    let what = format!("{what} in {}: {file_system}, {} MiB free", folder.display(), shown(free_mib));
    if let Err(error) = can_write(there) {
        return Line::problem(
            "folders",
            what,
            format!("this user cannot write to {}: {error}", there.display()),
        )
        .do_this("give the daemon's user the folder; for a service, `ReadWritePaths=` too");
    }
    match free_mib {
        Some(free) if free < least_mib => {
            let why = format!("nothing is kept there while less than {least_mib} MiB is free");
            Line::problem("folders", what, why).do_this("make room")
        }
        _ => Line::ok("folders", what),
    }
}

fn recordings(folder: &Path, least_mib: u64) -> Line {
    let there = nearest(folder);
    let (file_system, free_mib) = disk(there);
    let what = format!("recordings in {}: {file_system}, {} MiB free", folder.display(), shown(free_mib));
    if let Err(error) = can_write(there) {
        return Line::problem(
            "folders",
            what,
            format!("this user cannot write to {}: {error}", there.display()),
        )
        .do_this("give the daemon's user the folder; for a service, `ReadWritePaths=` too");
    }
    match free_mib {
        Some(free) if free < least_mib => {
            let why = format!("recording pauses while less than {least_mib} MiB is free");
            Line::problem("folders", what, why).do_this("make room, or lower `archive.max_gib`")
        }
        Some(free) if free < 2 * least_mib => {
            let why = format!("exports stop while less than {} MiB is free", 2 * least_mib);
            Line::warning("folders", what, why).do_this("make room, or lower `archive.max_gib`")
        }
        _ => Line::ok("folders", what),
    }
}

fn shown(free_mib: Option<u64>) -> String {
    free_mib.map_or_else(|| "unknown".to_owned(), |free| free.to_string())
}

fn media(root: &Path) -> Line {
    match access(root, Access::READ_OK | Access::EXEC_OK) {
        Ok(()) => Line::ok("folders", format!("media in {}", root.display())),
        Err(error) => Line::warning("folders", format!("media in {}", root.display()), error.to_string())
            .do_this("make the folder, or take it out of `media.roots`"),
    }
}

fn scene_file(id: &str, file: &Path) -> Line {
    match access(file, Access::READ_OK) {
        Ok(()) => Line::ok("scenes", format!("{id}: {} can be read", file.display())),
        Err(error) => Line::problem("scenes", format!("{id}: {}", file.display()), error.to_string())
            .do_this("`videofields check-config` says more"),
    }
}
