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

/// Whom to ask, and as whom.
pub(crate) fn discovery_asked() -> Value {
    let letters = || json!({"type": "string", "minLength": 1, "maxLength": 1024});
    taken(
        &[],
        [
            (
                "address",
                nullable(letters()),
                "One camera: HOST, HOST:PORT or the http or https URL of its device service; everybody if absent",
            ),
            ("credentials", nullable(letters()), "Id of the configuration's credentials; needs an `address`"),
        ],
    )
}

/// Cameras that were found.
pub(crate) fn discovery() -> Value {
    let clock = object([
        (
            "secs",
            number(),
            "Seconds by which the camera's clock is ahead of the daemon's; negative where it is behind",
        ),
        ("error_secs", number(), "Most seconds by which that may be wrong"),
    ]);
    let stream = object([
        ("profile", text(), "Name of the profile that it belongs to"),
        ("encoding", nullable(text()), "As the camera calls it, such as `H264`"),
        ("size_px", nullable(exactly(2, count())), "Columns and rows"),
        ("rate_hz", nullable(number()), "Most pictures a second"),
        (
            "url",
            nullable(text()),
            "At the host that was asked, without a login, as `url` of a source takes it; null where there is none",
        ),
        ("reported_url", nullable(text()), "As the camera tells it, where that is at another host"),
    ]);
    let device = object([
        (
            "services",
            list(text()),
            "Its device service at each address from which it answered, as `address` takes it",
        ),
        ("reported_services", list(text()), "As it tells it, where that is at other hosts"),
        ("endpoint", nullable(text()), "What it is told apart by, where it answered everybody's question"),
        ("name", nullable(text()), ""),
        ("maker", nullable(text()), ""),
        ("model", nullable(text()), ""),
        ("clock", nullable(clock), "Null where it does not tell its time"),
        ("streams", list(stream), "None unless it was asked by its address"),
        ("problem", nullable(text()), "Why no more is known, in words for people"),
    ]);
    object([
        ("devices", list(device), "By their addresses; what stands here strangers say"),
        (
            "n_ignored",
            count(),
            "Answers that were left out: not understood, too long, or from outside `media.networks`",
        ),
        ("is_cut", boolean(), "Whether there may be more"),
        ("credentials", list(text()), "Ids of the configuration's credentials"),
    ])
}
