//! Truths about scene documents, whatever text they come as.

use super::{ParsedScene, Scene, SceneError, no_imports, parse};
use videofields_vision::error::{Fault, MAX_FAULTS};

/// Id of the scene.
const ID: &str = "yard";

/// Reads a scene document of no file: it has faults, each at a pointer and told in one line, or there is a scene, whose document, written
/// as JSON, is read as the same scene and as the same document.
pub fn scene_documents(data: &[u8]) -> usize {
    let text = String::from_utf8_lossy(data);
    match parse(ID, &text, no_imports) {
        Ok(parsed) => holds_scene(&parsed),
        Err(SceneError::Faults(faults)) => {
            assert!((1..=MAX_FAULTS).contains(&faults.len()), "{} faults", faults.len());
            faults.iter().for_each(holds_fault);
            0
        }
        Err(error) => panic!("{error}"),
    }
}

fn holds_fault(fault: &Fault) {
    assert!(fault.place.is_empty() || fault.place.starts_with('/'), "{fault:?}");
    assert!(!fault.message.is_empty() && !fault.message.contains(char::is_control), "{fault:?}");
}

fn holds_scene(parsed: &ParsedScene) -> usize {
    let ParsedScene { scene, document } = parsed;
    let written = document.to_json();
    assert_eq!(*scene.document, *written);
    let again = parse(ID, &written, no_imports).unwrap_or_else(|error| panic!("{error} in {written}"));
    assert!(again == *parsed, "{written}\nis read as\n{}", again.document.to_json());
    let n_shapes = scene.surfaces.shapes().len();
    assert_eq!(scene.materials.len(), n_shapes);
    // Nothing stands in other files.
    assert!(scene.sequences.is_empty() && document.models.is_empty());
    holds_part(scene);
    1 + n_shapes + scene.cameras.len()
}

/// Holds what is left for who may see no camera to a document that is read again.
fn holds_part(scene: &Scene) {
    let part = scene.with_cameras(|_| false);
    assert!(part.cameras.is_empty());
    let read = parse(ID, &part.document, no_imports);
    let read = read.unwrap_or_else(|error| panic!("{error} in {}", part.document));
    assert_eq!(*read.scene.document, *part.document, "it is in its normal form");
}
