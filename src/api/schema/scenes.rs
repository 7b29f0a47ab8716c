//! Scenes: their documents, as [docs/scenes.md] has them, and what is told of them.

use super::{
    Named, anything, boolean, count, exactly, id, line, list, map, named, nullable, number, number_within,
    object, taken, text, time, whole_within, word,
};
use serde_json::{Value, json};

/// Schemas by name.
pub(crate) const NAMED: [Named; 9] = [
    ("Scene", scene),
    ("SceneCamera", camera),
    ("Calibration", calibration),
    ("Ground", ground),
    ("Imagery", imagery),
    ("Texture", texture),
    ("Color", color),
    ("Versions", versions),
    ("Plan", plan),
];

/// Every scene.
pub(crate) fn all() -> Value {
    let scene =
        object([("id", id(), ""), ("name", text(), "For people"), ("cameras", list(id()), "Its cameras")]);
    object([("scenes", list(scene), "The default one first")])
}

/// Who stands before a scene's cameras.
pub(crate) fn entities() -> Value {
    let entity = object([
        ("id", count(), ""),
        ("position_m", exactly(3, number()), "Where it touches the ground"),
        ("height_m", number(), ""),
        ("cameras", list(id()), "Those that see it"),
        ("has_hull", boolean(), "Whether enough of them do for its silhouettes to leave a shape"),
    ]);
    object([
        ("scene", id(), ""),
        ("time", time(), "The instant"),
        ("entities", list(entity), "By growing ids"),
    ])
}

/// A file that scenes may name.
pub(crate) fn asset() -> Value {
    object([
        ("file", text(), "Its name; a scene names it as `assets/` and this"),
        ("content_type", text(), "What it is"),
        ("bytes", count(), "How many it has"),
        ("modified_at", time(), "When it was brought"),
        ("etag", text(), "What `ETag` of the file is"),
    ])
}

/// All of them.
pub(crate) fn assets() -> Value {
    object([("assets", list(asset()), "By their names")])
}

/// Members of a document that are to be others.
pub(crate) fn patch() -> Value {
    let mut patch = anything();
    patch["description"] = json!("Members of a scene's document that are to be others; null takes one away");
    patch
}

fn metres(n: usize) -> Value {
    exactly(n, number())
}

/// A polygon on the ground.
fn corners(most: usize) -> Value {
    json!({"type": "array", "items": metres(2), "minItems": 3, "maxItems": most})
}

/// A file beside the scene's, or beneath its folder.
fn path() -> Value {
    json!({"type": "string", "minLength": 1})
}

fn color() -> Value {
    json!({"type": "string", "pattern": "^#[0-9a-fA-F]{6}$"})
}

fn texture() -> Value {
    taken(
        &["file", "size_m"],
        [("file", path(), "The picture"), ("size_m", metres(2), "After how many metres it repeats")],
    )
}

fn imagery() -> Value {
    let point = taken(
        &["pixel", "world"],
        [("pixel", exactly(2, number()), "Column and row"), ("world", metres(2), "x and y, metres")],
    );
    let bounds = taken(
        &["west_deg", "south_deg", "east_deg", "north_deg"],
        [
            ("west_deg", number(), ""),
            ("south_deg", number(), ""),
            ("east_deg", number(), ""),
            ("north_deg", number(), ""),
        ],
    );
    taken(
        &["file"],
        [
            ("file", path(), "The picture"),
            ("control_points", list(point), "Where pixels lie in the world"),
            ("transform", word(&["affine", "homography"]), "How the picture is bent onto them"),
            ("bounds", bounds, "Where its edges lie on the earth, in place of points"),
            ("residual_m", number(), "How far the points are off, told and never read"),
        ],
    )
}

fn ground() -> Value {
    taken(
        &["polygon"],
        [
            ("polygon", corners(4096), "Corners x, y; no edge crosses another"),
            ("height_m", number(), "Default 0"),
            ("color_srgb", named("Color"), "Where no camera sees it"),
            ("imagery", named("Imagery"), "A picture that lies on it"),
            ("texture", named("Texture"), "A picture that repeats over it"),
        ],
    )
}

fn sky() -> Value {
    let gradient = taken(
        &["zenith_srgb", "horizon_srgb", "ground_srgb"],
        [
            ("zenith_srgb", named("Color"), ""),
            ("horizon_srgb", named("Color"), ""),
            ("ground_srgb", named("Color"), ""),
        ],
    );
    let picture = taken(&["file"], [("file", path(), "All around"), ("yaw_deg", number(), "Its turn")]);
    taken(
        &[],
        [
            ("color_srgb", named("Color"), "One colour"),
            ("gradient", gradient, "Or three"),
            ("picture", picture, "Or a picture"),
        ],
    )
}

fn effects() -> Value {
    let on = || ("on", boolean(), "Whether it is on where a request does not say; true if absent");
    let occlusion = taken(
        &[],
        [
            on(),
            ("radius_m", number_within(0.05, 20.0), "Within how many metres"),
            ("strength", number_within(0.0, 2.0), "How much"),
        ],
    );
    let sun = taken(
        &[],
        [
            ("azimuth_deg", number_within(-360.0, 360.0), "From north towards east"),
            ("elevation_deg", number_within(-10.0, 90.0), "Above the horizon"),
            ("strength", number_within(0.0, 20.0), "Of what all else gives in the mean"),
        ],
    );
    let picture = taken(&["file"], [("file", path(), "All around"), ("yaw_deg", number(), "Its turn")]);
    let relight = taken(
        &[],
        [
            on(),
            ("light", word(&["sky", "picture", "camera"]), "Where it comes from; `sky` if absent"),
            ("picture", picture, "The light as a picture"),
            ("camera", id(), "The camera whose background is the light"),
            ("sun", sun, "A sun beside it"),
            ("exposure_stops", number_within(-4.0, 4.0), "How bright"),
            ("strength", number_within(0.0, 1.0), "How much of it is taken"),
        ],
    );
    let stipple = taken(
        &[],
        [
            on(),
            ("dot_px", whole_within(1, 8), "Side of a dot"),
            ("blur_px", whole_within(1, 32), "How far away a dot's pixel may lie"),
            ("contrast", number_within(0.25, 8.0), "Power of the grey"),
            ("shade", number_within(0.0, 1.0), "Share of dots in what is black"),
        ],
    );
    taken(
        &[],
        [
            ("occlusion", occlusion, "Light that is taken away where much stands around"),
            ("relight", relight, "Another light"),
            ("stipple", stipple, "Dots on paper"),
        ],
    )
}

fn calibration() -> Value {
    let model = word(&["none", "brown_conrady", "fisheye"]);
    let lens = taken(
        &["model"],
        [("model", model, "Which"), ("coefficients", list(number()), "OpenCV's, as many as the model has")],
    );
    taken(
        &["image_size_px", "focal_px", "center_px", "position_m", "world_from_camera"],
        [
            ("image_size_px", exactly(2, count()), "Columns and rows of the picture that was calibrated"),
            ("focal_px", exactly(2, number()), "Focal lengths, pixels"),
            ("center_px", exactly(2, number()), "Principal point, pixel centres at +0.5"),
            ("distortion", lens, "Of the lens; none if absent"),
            ("position_m", metres(3), "Where the camera stands"),
            ("world_from_camera", exactly(4, number()), "Unit quaternion x, y, z, w"),
        ],
    )
}

fn camera() -> Value {
    let import = taken(
        &["file"],
        [
            ("file", path(), "The file"),
            ("format", nullable(word(&["tsai", "opencv", "json"])), "Told from the text if absent"),
            ("image_size_px", nullable(exactly(2, count())), ""),
            ("camera", nullable(text()), "Which of several"),
            ("metres_per_unit", nullable(number()), ""),
        ],
    );
    let imported = taken(&["import"], [("import", import, "Where the calibration is read from")]);
    let calibration = json!({"anyOf": [named("Calibration"), imported]});
    taken(
        &["id", "calibration"],
        [
            ("id", id(), "Which camera"),
            ("calibration", calibration, "How it is calibrated; answers have the calibration itself"),
        ],
    )
}

fn upright<const N: usize>(required: &[&str], members: [(&str, Value, &str); N]) -> Value {
    let mut schema = taken(required, members);
    let shared = taken(
        &[],
        [
            ("id", id(), "Unique among all that stands"),
            ("color_srgb", named("Color"), "Where no camera sees it"),
            ("texture", named("Texture"), "A picture that repeats over its walls"),
            ("roof_texture", named("Texture"), "A picture that repeats over its roof"),
        ],
    );
    for (name, member) in shared["properties"].as_object().into_iter().flatten() {
        schema["properties"][name] = member.clone();
    }
    schema
}

fn scene() -> Value {
    let origin = taken(
        &["latitude_deg", "longitude_deg"],
        [
            ("latitude_deg", number_within(-90.0, 90.0), ""),
            ("longitude_deg", number_within(-180.0, 180.0), ""),
            ("height_m", number_within(-20_000.0, 100_000.0), "Above the ellipsoid"),
        ],
    );
    let a_box = upright(
        &["id", "center_m", "size_m"],
        [
            ("center_m", metres(3), "Its middle"),
            ("size_m", metres(3), "Its full extents"),
            ("yaw_deg", number_within(-360.0, 360.0), "Its turn from east towards north"),
        ],
    );
    let cylinder = upright(
        &["id", "base_m", "radius_m", "height_m"],
        [
            ("base_m", metres(3), "The middle of its lower cap"),
            ("radius_m", number(), ""),
            ("height_m", number(), ""),
        ],
    );
    let footprint = upright(
        &["id", "polygon", "top_m"],
        [
            ("polygon", corners(1024), "Corners x, y"),
            ("base_m", number(), "Height of its under side"),
            ("top_m", number(), "Height of its roof"),
        ],
    );
    let field = taken(
        &["id", "low_m", "step_m", "columns", "heights_m"],
        [
            ("id", id(), ""),
            ("low_m", metres(2), "The south-western post"),
            ("step_m", number(), "Distance between posts"),
            ("columns", count(), "Posts from west to east"),
            ("heights_m", list(number()), "Rows from south to north"),
            ("color_srgb", named("Color"), ""),
            ("imagery", named("Imagery"), ""),
            ("texture", named("Texture"), ""),
        ],
    );
    let model = taken(
        &["id", "file"],
        [
            ("id", id(), ""),
            ("file", path(), ".gltf, .glb or .ply"),
            ("position_m", metres(3), "Where the file's origin stands"),
            ("yaw_deg", number_within(-360.0, 360.0), ""),
            ("scale", number(), "Length of the file's unit, metres"),
            ("up", word(&["y", "z"]), "Which of the file's axes points upwards"),
            ("color_srgb", named("Color"), ""),
        ],
    );
    let sequence = taken(
        &["id", "file"],
        [
            ("id", id(), ""),
            ("file", path(), "Its manifest, or the folder that it lies in"),
            ("repeats", boolean(), "Whether it is shown over and over, at any instant"),
        ],
    );
    let view = taken(
        &["eye_m", "target_m"],
        [
            ("eye_m", metres(3), ""),
            ("target_m", metres(3), ""),
            ("fov_deg", number_within(1.0, 170.0), "Vertical field of view"),
        ],
    );
    let entities =
        taken(&[], [("min_size_m", number_within(0.0, 10.0), "Least extent of what stands there, metres")]);
    taken(
        &["version"],
        [
            ("version", json!({"type": "integer", "enum": [1]}), "Of the document's form"),
            ("name", line(200), "For people; the scene's id if absent"),
            ("origin", origin, "Where the scene's origin lies on the earth"),
            ("sky", sky(), "What is seen where nothing stands"),
            ("ground", list(named("Ground")), "Level ground"),
            ("boxes", list(a_box), "Upright boxes"),
            ("cylinders", list(cylinder), "Upright cylinders"),
            ("footprints", list(footprint), "Outlines of buildings, drawn upwards"),
            ("height_fields", list(field), "Uneven ground"),
            ("models", list(model), "Models in files"),
            ("sequences", list(sequence), "Recorded mesh sequences that are shown in it"),
            ("effects", effects(), "What is done to pictures of it once they are drawn"),
            ("entities", entities, "What is taken for something that stands there"),
            ("cameras", list(named("SceneCamera")), "The cameras that look at it"),
            ("view", view, "What is shown where a request names no view"),
        ],
    )
}

fn versions() -> Value {
    let version = object([
        ("version", count(), "1 at first, and one more with every change"),
        ("changed_at", time(), "When"),
        ("changed_by", nullable(text()), "By whom; null where there are no users"),
        ("removed", boolean(), "Whether that change took it away"),
    ]);
    object([
        ("versions", list(version), "The newest first"),
        ("is_complete", boolean(), "Whether there are no more"),
        super::next(),
    ])
}

fn plan() -> Value {
    let source = object([("camera", id(), ""), ("time", time(), "Of the frame")]);
    let effect = object([
        ("effect", text(), "Named as its pass"),
        ("is_on", boolean(), "Whether it runs"),
        ("because", text(), "Why"),
    ]);
    let entity = object([
        ("foot_m", metres(3), "Where it stands"),
        ("shown_from", id(), "By which camera it is shown"),
        ("seen_by", list(id()), "Which cameras see it"),
    ]);
    let opened = object([
        ("surface", text(), "What kind of surface"),
        ("surface_idx", count(), "Which one of that kind"),
        ("opacity", number_within(0.0, 1.0), ""),
    ]);
    let gain = object([
        ("camera", id(), ""),
        ("gain", exactly(3, number()), "Red, green and blue, in linear light"),
    ]);
    let sampling = object([
        ("samples", whole_within(1, 4), "Places of a pixel at which edges are looked for"),
        ("supersampling", whole_within(1, 4), "Pixels each way that are drawn for one"),
    ]);
    object([
        ("time", time(), "The instant"),
        ("view", anything(), "The view with the parameters that would ask for it again"),
        ("size_px", exactly(2, count()), "Columns and rows"),
        ("parts", count(), "Flat pictures that it is put together from"),
        ("sources", list(source), "Frames that would go in"),
        ("gaps", list(id()), "Cameras without one"),
        ("restricted", boolean(), "Whether the scene has cameras that the caller may not see"),
        ("effects", list(effect), "Each effect, and why"),
        ("gains", list(gain), "What cameras' colours are evened out by"),
        ("surface_cameras", list(id()), "Whose backgrounds lie on the surfaces, best first"),
        ("depth_map_cameras", list(id()), "Those of them that something may hide a surface from"),
        ("entity_cameras", list(id()), "Whose live frames show what moves"),
        ("entity_style", word(&["billboards", "points", "none"]), "How what moves is drawn"),
        ("entities", list(entity), "What is drawn as a billboard"),
        ("opened", list(opened), "Buildings that are drawn translucent, the farthest first"),
        ("sampling", sampling, "How often a pixel is looked at"),
        ("settings", map(text()), "Every knob"),
        ("left_out", list(text()), "Knobs below `exact`"),
        ("expected_ms", nullable(number()), "What it is expected to take, median"),
        ("expected_upper_ms", nullable(number()), "The same, upper quartile"),
        ("expected_error", nullable(number()), "The error that the settings leave"),
        ("expected_by", nullable(word(&["table", "pictures", "guess"])), "What that rests on"),
    ])
}
