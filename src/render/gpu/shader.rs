//! The WGSL files that the program carries, and the one rule by which they are put together.
//!
//! A line `#import "common/view.wgsl"` stands for that whole file, once a module however often it is asked for.
//!
//! Release builds carry the files' texts. Development builds read them from the sources while they run, so that a shader can be
//! changed without building anything.

use std::borrow::Cow;

macro_rules! shaders {
    ($($path:literal),* $(,)?) => {
        /// Every WGSL file, by its path beneath `shaders/`.
        pub const SHADERS: &[&str] = &[$($path),*];

        #[cfg(not(debug_assertions))]
        fn carried(path: &str) -> Option<&'static str> {
            match path {
                $($path => Some(include_str!(concat!("../../../shaders/", $path))),)*
                _ => None,
            }
        }
    };
}

shaders![
    "common/camera.wgsl",
    "common/changing_mesh.wgsl",
    "common/color.wgsl",
    "common/distances.wgsl",
    "common/fullscreen.wgsl",
    "common/hull.wgsl",
    "common/hull_faces.wgsl",
    "common/lists.wgsl",
    "common/srgb.wgsl",
    "common/view.wgsl",
    "render/average.wgsl",
    "render/enlarge.wgsl",
    "render/billboard.wgsl",
    "render/camera_depth.wgsl",
    "render/changing_mesh.wgsl",
    "render/distance.wgsl",
    "render/fields.wgsl",
    "render/fields_distances.wgsl",
    "render/fields_topology.wgsl",
    "render/hull.wgsl",
    "render/hull_depths.wgsl",
    "render/hull_peel.wgsl",
    "render/hull_rays.wgsl",
    "render/hull_trim.wgsl",
    "render/hull_voxels.wgsl",
    "render/mesh_carry.wgsl",
    "render/mesh_colors.wgsl",
    "render/mesh_depths.wgsl",
    "render/mesh_sight.wgsl",
    "render/mesh_smooth.wgsl",
    "render/mesh_weights.wgsl",
    "render/occlusion.wgsl",
    "render/points.wgsl",
    "render/relight.wgsl",
    "render/sky.wgsl",
    "render/stipple.wgsl",
    "render/surface.wgsl",
    "render/yuv.wgsl",
];

/// Returns the text of one file.
#[cfg(not(debug_assertions))]
fn source(path: &str) -> Result<Cow<'static, str>, String> {
    carried(path).map(Cow::Borrowed).ok_or_else(|| format!("there is no shader {path}"))
}

/// Returns the text of one file as it is on the disk now.
#[cfg(debug_assertions)]
fn source(path: &str) -> Result<Cow<'static, str>, String> {
    if !SHADERS.contains(&path) {
        return Err(format!("there is no shader {path}"));
    }
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders"));
    std::fs::read_to_string(folder.join(path)).map(Cow::Owned).map_err(|error| {
        format!("cannot read the shader {path}, which development builds read from their sources: {error}")
    })
}

/// The text of the shader at `path` with its imports in place.
///
/// # Errors
/// A message that names the file when it, or one it imports, is not there.
pub fn compose(path: &str) -> Result<String, String> {
    let mut done = Vec::new();
    let mut text = String::new();
    append(path, &mut done, &mut text)?;
    Ok(text)
}

fn append(path: &str, done: &mut Vec<String>, text: &mut String) -> Result<(), String> {
    if done.iter().any(|file| file == path) {
        return Ok(());
    }
    done.push(path.to_owned());
    for line in source(path)?.lines() {
        match line.strip_prefix("#import ") {
            Some(import) => append(import.trim().trim_matches('"'), done, text)?,
            None => {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_imported_whole_and_once() {
        let text = compose("render/surface.wgsl").expect("an embedded shader");
        assert_eq!(text.matches("struct Camera {").count(), 1);
        assert!(!text.contains("#import") && text.contains("fn fs_main"));
    }

    #[test]
    fn a_missing_file_is_named() {
        assert_eq!(compose("render/nothing.wgsl"), Err("there is no shader render/nothing.wgsl".to_owned()));
    }
}
