//! What is told of sources that feed no camera yet.

use super::{
    boolean, cameras, count, exactly, list, nullable, number, number_within, object, taken, text, time,
    whole_within,
};
use serde_json::{Value, json};

/// A source, and when in a file it is looked at.
pub(crate) fn look_asked() -> Value {
    taken(
        &["source"],
        [
            ("source", cameras::place(), "Without user and password"),
            ("at_secs", number_within(0.0, 1e7), "Of a file: seconds after its first picture; default 0"),
        ],
    )
}

/// What a source shows.
pub(crate) fn look() -> Value {
    object([
        ("size_px", exactly(2, whole_within(1, 8192)), "Columns and rows of its pictures"),
        ("rate_hz", nullable(number()), "Frames a second, where that is known"),
        ("codec", nullable(text()), "Such as `h264`; null where pictures come unencoded"),
        ("duration_secs", nullable(number()), "How long a file is, where it says so"),
        ("at_secs", nullable(number()), "When in a file the picture is seen, seconds after the first"),
        ("picture_jpeg", text(), "The picture: a JPEG in base64"),
    ])
}

/// What could feed a camera.
pub(crate) fn files() -> Value {
    let mut file = object([
        (
            "path",
            text(),
            "As `path` of a source takes it; numbered pictures are one pattern, such as `img%06d.png`",
        ),
        ("bytes", count(), "All pictures of a pattern together"),
        ("modified_at", time(), "When it was last written"),
    ]);
    file["properties"]["count"] =
        json!({"type": "integer", "minimum": 2, "description": "How many pictures a pattern has"});
    let device = object([("path", text(), "As `device` of a source takes it")]);
    object([
        ("files", list(file), "By their paths"),
        ("is_cut", boolean(), "Whether there may be more: name a folder with `under`"),
        ("devices", list(device), "Cameras at this machine (V4L2)"),
    ])
}
