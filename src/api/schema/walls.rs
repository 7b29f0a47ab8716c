//! Walls: their documents, and what is told of their tiles.

use super::{
    Named, count, exactly, id, list, named, nullable, number, number_within, object, taken, text, time,
    whole_within, word,
};
use serde_json::{Value, json};

/// Schemas by name.
pub(crate) const NAMED: [Named; 4] =
    [("NamedView", named_view), ("Wall", wall), ("WallPattern", pattern), ("ScreenHealth", screen_health)];

/// Every wall.
pub(crate) fn all() -> Value {
    let wall = object([
        ("id", id(), ""),
        ("name", text(), "For people"),
        ("scene", id(), "What it shows"),
        ("version", count(), ""),
        ("tiles", count(), "How many"),
    ]);
    object([("walls", list(wall), "In the order of names")])
}

/// Every named view.
pub(crate) fn views() -> Value {
    let view = object([
        ("id", id(), ""),
        ("name", text(), "For people"),
        ("scene", id(), "What it shows"),
        ("parameters", text(), "As a view's query string has them"),
        ("group", text(), "Under what it is listed"),
        ("tags", list(text()), "By what it is found"),
        ("order", number(), "Its place in its group"),
        ("version", count(), ""),
    ]);
    object([("views", list(view), "Group by group, each in its order")])
}

fn named_view() -> Value {
    let at_most = |n: usize| json!({"type": "string", "maxLength": n});
    let tag = json!({"type": "string", "minLength": 1, "maxLength": 64});
    let tags = json!({"type": "array", "items": tag, "maxItems": 32, "uniqueItems": true});
    taken(
        &["scene"],
        [
            ("name", at_most(200), "For people"),
            ("scene", id(), "What is shown"),
            ("parameters", at_most(1024), "As a view's query string has them"),
            ("group", at_most(100), "Under what it is listed"),
            ("tags", tags, "By what it is found; at most 32, each once"),
            ("order", whole_within(-1_000_000, 1_000_000), "Its place in its group; default 0"),
        ],
    )
}

fn side_px() -> Value {
    exactly(2, whole_within(16, 16_384))
}

fn metres(n: usize) -> Value {
    exactly(n, number())
}

/// A place in wall space.
fn on_wall() -> Value {
    exactly(3, number_within(-1000.0, 1000.0))
}

fn wall() -> Value {
    let place = || exactly(3, number_within(-1e7, 1e7));
    let view = taken(
        &["eye_m", "target_m"],
        [("eye_m", place(), "Where the viewer is"), ("target_m", place(), "What is straight ahead")],
    );
    let name = json!({"type": "string", "maxLength": 200});
    let parameters = json!({"type": "string", "maxLength": 1024});
    taken(
        &["scene", "view", "surface"],
        [
            ("name", name, "For people"),
            ("scene", id(), "What is shown"),
            ("playhead", nullable(id()), "Whose time is shown; live without one"),
            ("rate_hz", number_within(0.5, 60.0), "Frames a second; default 10"),
            ("view", view, "Where the viewer stands in the world"),
            ("viewer_m", nullable(on_wall()), "The viewer's place in wall space"),
            ("zoom", number_within(0.01, 100.0), "How much larger everything is shown; default 1"),
            ("parameters", parameters, "Further parameters of views, as a query string"),
            ("surface", surface(), "One of its three members"),
        ],
    )
}

fn surface() -> Value {
    let grid = || {
        [
            ("columns", whole_within(1, 64), "Tiles side by side"),
            ("rows", whole_within(1, 64), "Tiles one above the other"),
            ("tile_px", side_px(), "Columns and rows of each tile's picture"),
            ("tile_m", metres(2), "Width and height of each tile's picture"),
            ("gap_m", metres(2), "Between neighbours' pictures; below 0 they overlap"),
        ]
    };
    let plane = taken(&["columns", "rows", "tile_px", "tile_m"], grid());
    let mut round = taken(&["columns", "rows", "tile_px", "tile_m", "radius_m"], grid());
    round["properties"]["radius_m"] = number();
    let tile = taken(
        &["id", "size_px", "lower_left_m", "lower_right_m", "upper_left_m"],
        [
            ("id", id(), ""),
            ("size_px", side_px(), "Columns and rows"),
            ("lower_left_m", on_wall(), "As the viewer sees it"),
            ("lower_right_m", on_wall(), ""),
            ("upper_left_m", on_wall(), ""),
            ("blend_px", exactly(4, count()), "Pixels at each edge over which it fades out"),
        ],
    );
    let tiles = json!({"type": "array", "items": tile, "minItems": 1, "maxItems": 64});
    taken(
        &[],
        [
            ("grid", nullable(plane), "Equal tiles on a plane"),
            ("cylinder", nullable(round), "Equal tiles on a cylinder"),
            ("tiles", nullable(tiles), "Any rectangles"),
        ],
    )
}

/// The tiles of a wall.
pub(crate) fn tiles() -> Value {
    let tile = object([
        ("id", id(), ""),
        ("size_px", exactly(2, count()), "Columns and rows"),
        ("blend_px", exactly(4, count()), "Pixels at each edge over which it fades out"),
        ("window_m", exactly(3, metres(3)), "Lower left, lower right and upper left corner in the world"),
    ]);
    object([
        ("wall", id(), ""),
        ("version", count(), ""),
        ("rate_hz", number(), "Frames a second"),
        ("eye_m", metres(3), "Where the viewer stands in the world"),
        ("tiles", list(tile), ""),
    ])
}

/// What all tiles of a wall show in the place of their pictures.
fn pattern() -> Value {
    object([
        ("shows", word(&PATTERNS), "`none` is their pictures"),
        ("seconds_left", nullable(number()), "For how long; null of `none`"),
    ])
}

/// A request for that.
pub(crate) fn pattern_asked() -> Value {
    taken(
        &["shows"],
        [
            ("shows", word(&PATTERNS), "Lines, the tiles' names, or their pictures again"),
            ("seconds", nullable(whole_within(1, 3600)), "For how long; default 60"),
        ],
    )
}

const PATTERNS: [&str; 3] = ["none", "test", "identify"];

fn screen_health() -> Value {
    object([
        ("frame", nullable(count()), "Number of the frame that it shows"),
        ("age_secs", nullable(number()), "How long it has shown that"),
        ("rate_hz", number(), "Frames a second over the last seconds"),
        ("missed", count(), "Frames that it passed over"),
        ("late", count(), "Frames that it showed more than a frame's time after they were due"),
        ("unreadable", count(), "Pictures that it could not read"),
        ("reconnects", count(), "Conversations before this one"),
        ("clock_offset_secs", nullable(number()), "Its clock before the daemon's, with the way between"),
    ])
}

/// Who shows a wall's tiles.
pub(crate) fn screens() -> Value {
    let screen = object([
        ("tile", id(), ""),
        ("since", time(), "When its conversation began"),
        ("frame", nullable(count()), "The last frame that it acknowledged"),
        ("heard_secs", number(), "How long ago that was, or the beginning"),
        ("health", nullable(named("ScreenHealth")), "What it says of itself; null where it says nothing"),
    ]);
    object([
        ("wall", id(), ""),
        ("pattern", named("WallPattern"), "What all tiles show where nothing else is asked of them"),
        ("screens", list(screen), "In the order of their tiles' names"),
    ])
}
