//! What is told of cameras, and how they are set.

use super::{
    Named, anything, boolean, count, exactly, id, line, list, named, nullable, number, number_within, object,
    taken, text, time, whole_within, word,
};
use serde_json::{Value, json};

/// Schemas by name.
pub(crate) const NAMED: [Named; 8] = [
    ("Camera", camera),
    ("Stage", stage),
    ("CameraDocument", document),
    ("SegmentSettings", segment),
    ("SourceSettings", source),
    ("ClockSettings", clock),
    ("PrivacyZone", privacy_zone),
    ("PrivacyZones", privacy_zones),
];

/// Every camera.
pub(crate) fn all() -> Value {
    object([("cameras", list(named("Camera")), "In the configuration's order")])
}

fn size() -> Value {
    exactly(2, count())
}

fn camera() -> Value {
    let states = ["connecting", "live", "frozen", "stalled", "failed", "ended"];
    let recording = object([
        ("state", word(&["recording", "waiting", "paused", "off"]), "What it does"),
        ("reason", nullable(text()), "Why it is paused"),
        ("frames", count(), "Frames written since the daemon started"),
        ("bytes", count(), "Bytes written since the daemon started"),
        ("dropped", count(), "Frames left out since the daemon started"),
    ]);
    let decoding = object([
        ("process_id", count(), "Number of the process"),
        ("limits", boolean(), "Whether its memory and files are limited"),
        (
            "landlock",
            nullable(count()),
            "Version of Landlock by which other files are kept from it; null where the kernel has none",
        ),
        (
            "seccomp",
            boolean(),
            "Whether system calls that it does not need, those of networks among them, are refused",
        ),
        ("cgroup", boolean(), "Whether a control group limits its processor time and memory"),
    ]);
    let privacy = object([
        ("zones", count(), "How many hide something"),
        ("version", count(), "Which version they are"),
        ("since", nullable(time()), "Since when they hold, by the daemon's clock"),
    ]);
    let stretched = object([
        ("scene", id(), "The scene"),
        ("calibrated_px", size(), "Columns and rows of the picture that was calibrated"),
    ]);
    object([
        ("id", id(), "Its id"),
        ("name", text(), "For people"),
        ("state", word(&states), "What its source does"),
        ("reason", nullable(text()), "Why it is in that state, or why it failed last"),
        ("since", time(), "When the state began, by the daemon's clock"),
        ("retries", count(), "How often its source was opened again since the daemon started"),
        ("next_try", nullable(time()), "When a failed source is opened again"),
        (
            "decoding",
            nullable(decoding),
            "The process that decodes it and what holds that, once a frame has come; null where frames come unencoded",
        ),
        ("size_px", nullable(size()), "Columns and rows, once a frame has come"),
        (
            "vision_size_px",
            nullable(size()),
            "Columns and rows at which its background is learned and what moves is found",
        ),
        (
            "stages",
            list(named("Stage")),
            "Stages of detection, in the order in which they run, and why each runs or does not",
        ),
        ("recording", nullable(recording), "How its recording goes; null where it is not recorded"),
        ("frames", count(), "Frames taken since the daemon started"),
        ("dropped", count(), "Frames dropped since the daemon started"),
        ("first", nullable(time()), "Scene time of the earliest frame kept"),
        ("last", nullable(time()), "Scene time of the latest frame kept"),
        ("age_secs", nullable(number()), "Seconds since the latest frame came"),
        ("privacy", privacy, "What nobody may see of its pictures"),
        ("scenes", list(id()), "Scenes that hold it"),
        (
            "stretched",
            list(stretched),
            "Those of them whose calibration is of pictures of another shape than its newest",
        ),
    ])
}

fn stage() -> Value {
    let kinds = ["shake", "light", "noise", "flicker", "shadow", "blinking"];
    let quantities = ["shake_px", "gain_drift", "noise_share", "flicker_share", "shadow_share"];
    object([
        ("stage", word(&kinds), "Which one"),
        ("is_on", boolean(), "Whether it runs"),
        ("choice", choice(), "What settings say; `auto` goes by the figure"),
        (
            "quantity",
            word(&quantities),
            "Which figure decides: the root mean square of the picture's shifts, pixels; the light's last change, share; the noise's \
             standard deviation, share of full scale; the share of pixels whose verdict keeps turning; the share of the foreground that \
             is certain to be cast shadow",
        ),
        ("measured", nullable(number()), "The figure, once it was measured"),
        ("on_above", number(), "The stage goes on above this"),
        ("off_below", number(), "The stage goes off once the figure was below this for a while"),
        ("frames", count(), "Frames in which it ran since the camera's pictures were first looked at"),
    ])
}

fn privacy_zone() -> Value {
    let corner = exactly(2, number_within(0.0, 1.0));
    taken(
        &["name", "reason", "polygon"],
        [
            ("name", line(100), "Another than the others'"),
            ("reason", line(1000), "Why it is hidden"),
            (
                "polygon",
                json!({"type": "array", "items": corner, "minItems": 3, "maxItems": 64}),
                "Corners in the texture, from (0, 0) at the upper left; sides do not cross",
            ),
        ],
    )
}

/// What a camera's zones are to be.
pub(crate) fn privacy_asked() -> Value {
    taken(&["zones"], [("zones", some_zones(), "All of them")])
}

/// What is to be changed of them.
pub(crate) fn privacy_patch() -> Value {
    taken(&[], [("zones", some_zones(), "All of them; as they were if absent")])
}

fn some_zones() -> Value {
    json!({"type": "array", "items": named("PrivacyZone"), "maxItems": 32})
}

fn privacy_zones() -> Value {
    let lifted = object([
        ("zone", named("PrivacyZone"), "As it was"),
        ("until", time(), "What was seen before stays hidden by it"),
    ]);
    object([
        ("zones", list(named("PrivacyZone")), "Those that hold"),
        ("is_configured", boolean(), "Whether they are the configuration's"),
        ("version", count(), "What the entity tag says too"),
        ("since", nullable(time()), "Since when they hold, by the daemon's clock"),
        ("changed_by", nullable(text()), "Who made it so"),
        ("lifted", list(lifted), "Those that held before"),
    ])
}

/// Where a place in a picture lies.
pub(crate) fn located() -> Value {
    let kinds = ["ground", "box", "cylinder", "footprint", "height_field", "model"];
    object([
        ("point_m", exactly(3, number()), "The world point, metres"),
        ("theta_rad", number(), "Angle between ray and surface: 0 grazing, pi/2 head-on"),
        ("reliable", boolean(), "False where the ray grazes the surface by less than half a degree"),
        ("footprint_m", number(), "Extent of the texel on the surface along the viewing direction, metres"),
        ("surface", word(&kinds), "What it lies on"),
        ("surface_idx", count(), "Which one of the scene's of that kind"),
    ])
}

fn segment() -> Value {
    taken(
        &[],
        [
            (
                "resolution",
                word(&["auto", "full", "half", "quarter"]),
                "At which size foreground is computed; it cannot be changed while the camera runs",
            ),
            (
                "delta",
                nullable(number_within(0.001, 1.0)),
                "Blurred difference that is foreground everywhere, share of full scale; null: 0.12, less before dark backgrounds as far \
                 as the noise allows, more where verdicts keep turning",
            ),
            ("delta_high", number_within(0.0, 1.0), "Hysteresis; not above `delta` it asks for nothing"),
            ("blur_sigma_px", nullable(number_within(0.0, 16.0)), "Standard deviation of the blur, pixels"),
            ("mixture", word(&["ignore", "require", "add"]), "How the mixture's own match test counts"),
            (
                "shadow_darkest",
                number_within(0.05, 1.0),
                "Least share of its background's luma that a shadow keeps",
            ),
            (
                "shadow_chroma",
                number_within(0.0, 0.5),
                "Chroma that a shadow may change, share of full scale",
            ),
            (
                "highlight_brightest",
                number_within(1.0, 4.0),
                "Most times its background's luma that what more light falls on has; 1 looks for no such",
            ),
            (
                "suppress_blinking",
                nullable(boolean()),
                "Whether what mostly flutters is background; null: where much of the picture flickers",
            ),
            (
                "shadow",
                choice(),
                "Whether cast shadows are told from what moves; `shadow_darkest` of 1 looks for none",
            ),
            (
                "flicker",
                choice(),
                "Whether thresholds rise where verdicts keep turning; not if `delta` is set",
            ),
            ("shake", choice(), "Whether pictures of a shaking camera are shifted back"),
            ("light", choice(), "Whether the background is made as light as the whole picture became"),
            ("close_radius_px", whole_within(0, 16), "Half the width of gaps that are closed"),
            (
                "max_hole_px",
                whole_within(0, 1_000_000_000),
                "Greatest hole that is filled whatever is seen in it",
            ),
            (
                "min_area_px",
                whole_within(0, 1_000_000_000),
                "Least area of a blob; 0 follows from the picture's size",
            ),
            ("split_valley", number_within(0.0, 0.9), "When people who touch are parted"),
        ],
    )
}

/// Choice of when a stage runs.
fn choice() -> Value {
    word(&["auto", "on", "off"])
}

fn clock() -> Value {
    taken(
        &[],
        [
            (
                "offset_secs",
                number_within(-3.2e9, 3.2e9),
                "Seconds that are added to the camera's time, at most a century",
            ),
            (
                "drift_ppm",
                number_within(-58_823.0, 58_823.0),
                "Millionths that scene time runs faster than the camera's own",
            ),
            (
                "since",
                nullable(named("Instant")),
                "When the offset alone was right, by the camera's own time",
            ),
        ],
    )
}

/// Where frames come from.
pub(crate) fn place() -> Value {
    let mut source = anything();
    source["description"] = json!("The keys of `[camera.source]` in a configuration that belong to its kind");
    source
}

fn document() -> Value {
    taken(
        &["source"],
        [
            (
                "name",
                json!({"type": "string", "maxLength": 200}),
                "For people; the camera's id if absent or empty",
            ),
            ("enabled", boolean(), "Whether frames are taken at all; default true"),
            (
                "source",
                place(),
                "Where they come from, without user and password; of a URL nothing is shown behind the host",
            ),
            ("clock", named("ClockSettings"), "What is wrong with the camera's clock"),
            ("segment", named("SegmentSettings"), "How its foreground is found"),
        ],
    )
}

fn source() -> Value {
    taken(
        &[],
        [
            ("enabled", boolean(), "Whether frames are taken at all"),
            ("source", place(), "Where they come from; of a URL nothing is shown behind the host"),
            ("clock", named("ClockSettings"), "What is wrong with the camera's clock"),
        ],
    )
}
