//! The WGSL files that the binary carries, and the one rule by which they are put together.
//!
//! A line `#import "common/view.wgsl"` stands for that whole file, once a module however often it is asked for.

macro_rules! shaders {
    ($($path:literal),* $(,)?) => {
        /// Every WGSL file: path beneath `shaders/` and text.
        pub const SHADERS: &[(&str, &str)] =
            &[$(($path, include_str!(concat!("../../shaders/", $path)))),*];
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

/// The text of the shader at `path` with its imports in place.
///
/// # Errors
/// A message that names the file when it, or one it imports, is not embedded.
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
    let Some((_, source)) = SHADERS.iter().find(|(name, _)| *name == path) else {
        return Err(format!("there is no shader {path}"));
    };
    for line in source.lines() {
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
