//! Truths about copies of a database and about the note of a restore, whatever bytes they have.

use super::super::copy::{Contents, Depth, ReadOnly, copy, verify};
use super::super::{SCHEMA_VERSION, StoreError};
use super::{BEFORE, MAX_NOTE_BYTES, Note, PARTS};
use std::path::Path;
use std::sync::LazyLock;
use tokio::runtime::Runtime;

/// The database that a note is of.
const NAME: &str = "videofields.sqlite";

/// Most lines that tell what is wrong with a database.
const MAX_LINES: usize = 100;

/// Least bytes of a row in a file: its length, its number and the length of its header.
const MIN_ROW_BYTES: u64 = 3;

static RUNTIME: LazyLock<Runtime> = LazyLock::new(|| {
    let built = tokio::runtime::Builder::new_current_thread().enable_all().build();
    built.expect("a runtime needs nothing but memory")
});

/// Looks at a copy of a database, which is left as it is, tells the same twice and holds no more rows than it has bytes for, and whose own
/// copy holds the same; reads the bytes as a restore's note too, by which nothing but the parts of its database is ever renamed.
pub fn database_copies(data: &[u8]) -> usize {
    let folder = tempfile::TempDir::new().expect("a folder for a moment");
    let path = folder.path().join(NAME);
    std::fs::write(&path, data).expect("there is room for it");
    let n_found = RUNTIME.block_on(holds_database(&path));
    assert!(std::fs::read(&path).is_ok_and(|after| after == data), "looking at it changes nothing");
    n_found + holds_note(data)
}

async fn holds_database(path: &Path) -> usize {
    let n_lines = lines(path).await;
    let verified = verify(path).await;
    let Ok(contents) = verified else { return 0 };
    assert_eq!(n_lines, Some([0, 0]), "one that is whole has nothing wrong with it");
    holds_contents(&contents, path);
    assert_eq!(verify(path).await.ok().as_ref(), Some(&contents), "it is the same as before");
    let to = path.with_extension("copy");
    match copy(path, &to).await {
        Ok(copied) => {
            assert_eq!(copied, contents, "its copy holds the same");
            assert_eq!(verify(&to).await.ok(), Some(copied));
        }
        Err(error) => {
            assert!(!matches!(error, StoreError::NotWritable { .. }), "{error}");
            assert!(
                to.try_exists().is_ok_and(|is_there| !is_there),
                "nothing is left of a copy that is none"
            );
        }
    }
    1
}

/// Counts the lines that tell what is wrong with a database; none where it cannot be opened or asked.
async fn lines(path: &Path) -> Option<[usize; 2]> {
    let mut database = ReadOnly::open(path).await.ok()?;
    let quick = database.faults(Depth::Quick).await;
    let full = database.faults(Depth::Full).await;
    database.close().await.ok()?;
    let counts = [quick.ok()?.len(), full.ok()?.len()];
    assert!(counts.iter().all(|count| *count <= MAX_LINES), "{counts:?} lines");
    Some(counts)
}

fn holds_contents(contents: &Contents, path: &Path) {
    let n_bytes = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    assert!(contents.schema <= SCHEMA_VERSION, "{contents:?}");
    for (table, rows) in &contents.rows {
        let n_rows = u64::try_from(*rows).unwrap_or_else(|_negative| panic!("{rows} rows of {table:?}"));
        assert!(n_rows * MIN_ROW_BYTES <= n_bytes, "{rows} rows of {table:?} in {n_bytes} bytes");
    }
}

/// Reads a note: it renames parts of its database and nothing else, within their folder, each once.
fn holds_note(data: &[u8]) -> usize {
    let Ok(note) = Note::read(data, NAME) else { return 0 };
    assert!(data.len() <= MAX_NOTE_BYTES && note.aside.len() <= PARTS.len(), "{note:?}");
    let folder = Path::new("/var/lib/videofields");
    for (was, now) in &note.aside {
        assert!(PARTS.iter().any(|part| *was == format!("{NAME}{part}")), "{note:?}");
        assert!(now.starts_with(&format!("{NAME}{BEFORE}")), "{note:?}");
        for name in [was, now] {
            let path = folder.join(name);
            assert_eq!((path.parent(), path.file_name()), (Some(folder), Some(name.as_ref())), "{note:?}");
        }
        let n_same = note.aside.iter().filter(|(other, to)| other == was || to == now).count();
        assert_eq!(n_same, 1, "{note:?}");
    }
    let written = serde_json::to_vec(&note).expect("it is texts alone");
    assert_eq!(Note::read(&written, NAME).as_ref(), Ok(&note), "a note that is written is read");
    1 + note.aside.len()
}
