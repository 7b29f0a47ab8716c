//! What is told of a scene's past: its time, its tracks, its cameras' clocks.

use super::{boolean, count, exactly, id, list, named, nullable, number, number_within, object, time};
use serde_json::Value;

/// What there is of a scene's time.
pub(crate) fn timeline() -> Value {
    let activity = object([
        ("at", time(), "Where the stretch begins"),
        ("moving_share", number_within(0.0, 1.0), "Share of the picture that moved, mean over the frames"),
        ("max_tracks", count(), "Most things followed at once"),
        ("new_tracks", count(), "Things that came"),
    ]);
    let camera = object([
        ("camera", id(), ""),
        ("ranges", list(exactly(2, time())), "From when to when it can be shown"),
        ("activity", list(activity), "Stretches in which a frame was looked at"),
    ]);
    object([
        ("from", time(), ""),
        ("to", time(), ""),
        ("resolution_secs", count(), "Length of the stretches"),
        ("cameras", list(camera), ""),
        ("events", list(named("Event")), "The newest 1000"),
    ])
}

/// How much moved, step by step.
pub(crate) fn activity() -> Value {
    let share = nullable(number_within(0.0, 1.0));
    let camera = object([
        ("camera", id(), ""),
        ("frames", list(nullable(count())), "Frames looked at"),
        ("moving_share", list(share), "Share of the picture that moved, mean over the frames"),
        ("max_tracks", list(nullable(count())), "Most things followed at once"),
        ("new_tracks", list(nullable(count())), "Things that came"),
    ]);
    object([
        ("from", time(), ""),
        ("to", time(), ""),
        ("step_secs", count(), "Length of a step"),
        ("first", time(), "Where the first step begins"),
        ("steps", count(), "How many there are: the length of every series"),
        ("cameras", list(camera), "Null in a step in which nothing was looked at"),
    ])
}

/// What moved.
pub(crate) fn tracks() -> Value {
    let point = object([
        ("at", time(), "Within 0.05 s"),
        ("u", number(), "Texture coordinate"),
        ("v", number(), "Texture coordinate"),
        (
            "point_m",
            nullable(exactly(3, number())),
            "World point, metres; null where the ray meets no surface well",
        ),
    ]);
    let track = object([
        ("camera", id(), "Who followed it"),
        ("track", count(), "Its number; numbers begin anew with each start of the camera"),
        ("entity", nullable(count()), "Id of the entity that it shows; null where that is not known"),
        ("began", time(), "First sighting"),
        ("ended", time(), "Last sighting"),
        ("height", number(), "Largest height in the picture, share of the picture's"),
        ("first_in_region", nullable(time()), "Null where no region is named"),
        ("last_in_region", nullable(time()), "Null where no region is named"),
        ("path", list(point), "Where its feet were, at most 512 points"),
    ]);
    object([
        ("from", time(), ""),
        ("to", time(), ""),
        ("tracks", list(track), "The one that began last first"),
        ("is_complete", boolean(), "Whether no further track fits the question"),
        super::next(),
    ])
}

/// Describes who was where, by all cameras of a scene together.
pub(crate) fn entity_paths() -> Value {
    let point = object([
        ("at", time(), "Within 0.05 s"),
        ("point_m", exactly(3, number()), "Where it touched the ground, metres"),
        ("cameras", list(id()), "Those that saw it"),
    ]);
    let entity = object([
        ("id", count(), "The same for one person, now and when it is over"),
        ("height_m", number(), ""),
        ("path", list(point), "Where it was within the time, in order of time, at most 514 points"),
    ]);
    let unknown = object([("from", time(), ""), ("to", time(), "")]);
    object([
        ("from", time(), ""),
        ("to", time(), ""),
        (
            "entities",
            list(entity),
            "Whoever began first comes first; one who was away for 3 s is told once more",
        ),
        (
            "unknown",
            list(unknown),
            "Times of which nothing is known yet, or no camera followed anybody; the first hundred",
        ),
        ("is_complete", boolean(), "Whether nobody else was there"),
        super::next(),
    ])
}

/// How far clocks are apart.
pub(crate) fn alignment() -> Value {
    let calibration = object([
        (
            "offset_m",
            number(),
            "Distance on the ground between where it sees people and where it would with the correction; median",
        ),
        (
            "offset_error_m",
            number(),
            "Standard error; large where too few cameras see the same to tell which of them is wrong",
        ),
        ("apart_m", number(), "Distance between where it sees people and where others do; median"),
        ("apart_corrected_m", number(), "The same with the corrections of all cameras"),
        ("moved_m", exactly(3, number()), "Movement of the camera in the world"),
        ("turned_deg", exactly(3, number()), "Turn about itself: axis in the world times angle"),
        ("paths", count(), "Paths of people by which it is known"),
        (
            "is_used",
            boolean(),
            "Whether it is farther off than feet tell, so that people are placed by the correction",
        ),
        (
            "corrected",
            nullable(named("Calibration")),
            "Its calibration with the correction; null while too few people were seen",
        ),
    ]);
    let camera = object([
        ("camera", id(), ""),
        ("confidence", nullable(number_within(0.0, 1.0)), "1 of the reference; null where nothing is known"),
        ("ahead_secs", nullable(number()), "How far its clock is ahead"),
        ("clock", nullable(named("ClockSettings")), "What brings it into step, for its source's `clock`"),
        (
            "calibration",
            nullable(calibration),
            "What people whom it and others saw say of its calibration; null where there were none",
        ),
    ]);
    let pair = object([
        ("first", id(), ""),
        ("second", id(), ""),
        ("offset_secs", number(), "How far the second's clock is ahead"),
        ("offset_error_secs", number(), "Standard error"),
        ("drift_ppm", number(), "How much faster it runs"),
        ("drift_error_ppm", number(), "Standard error"),
        ("since", time(), "When the offset was that"),
        ("confidence", number_within(0.0, 1.0), "Low where another offset fits nearly as well"),
        ("meetings", count(), "Who was seen by both"),
    ]);
    object([
        ("cameras", list(camera), ""),
        ("pairs", list(pair), ""),
        ("pairs_left_out", count(), "Pairs beyond the first 200"),
    ])
}
