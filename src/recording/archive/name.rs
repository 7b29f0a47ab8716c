//! Names of segments' files: camera, day and instant of the first frame, so that files without a database still say
//! what they are.

use std::fmt;
use std::str::FromStr;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Where a segment's file lies beneath the archive's folder: `<camera>/<YYYY-MM-DD>/<HHMMSS>.<nanoseconds>Z.mkv`, UTC.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SegmentName {
    /// The camera.
    pub camera: CameraId,
    /// Scene time of the first frame.
    pub first_at: Timestamp,
}

impl SegmentName {
    /// The three parts of the path.
    pub(super) fn parts(&self) -> [String; 3] {
        let nanos = i128::from(self.first_at.as_nanos());
        // Any i64 of nanoseconds lies within the years that it knows.
        let instant = jiff::Timestamp::from_nanosecond(nanos).unwrap_or_default();
        let time = instant.to_zoned(jiff::tz::TimeZone::UTC);
        let day = format!("{:04}-{:02}-{:02}", time.year(), time.month(), time.day());
        let nanos = nanos.rem_euclid(1_000_000_000);
        let file = format!("{:02}{:02}{:02}.{nanos:09}Z.mkv", time.hour(), time.minute(), time.second());
        [self.camera.to_string(), day, file]
    }
}

impl fmt::Display for SegmentName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.parts().join("/"))
    }
}

/// A path that names no segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NotASegment;

impl FromStr for SegmentName {
    type Err = NotASegment;

    /// Takes exactly what is written: every other file beneath the folder is somebody else's.
    fn from_str(path: &str) -> Result<Self, NotASegment> {
        let parts: Vec<&str> = path.split('/').collect();
        let &[camera, day, file] = parts.as_slice() else { return Err(NotASegment) };
        let camera = CameraId::new(camera).ok().ok_or(NotASegment)?;
        let (clock, nanos) =
            file.strip_suffix("Z.mkv").and_then(|file| file.split_once('.')).ok_or(NotASegment)?;
        let is_plain = clock.is_ascii() && clock.len() == 6 && nanos.len() == 9;
        if !is_plain {
            return Err(NotASegment);
        }
        let text = format!("{day}T{}:{}:{}.{nanos}Z", &clock[..2], &clock[2..4], &clock[4..]);
        let first_at = text.parse().ok().ok_or(NotASegment)?;
        let name = Self { camera, first_at };
        // Dates can be written in several ways; only one of them is a segment's name.
        if name.to_string() == path { Ok(name) } else { Err(NotASegment) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_camera_and_instant() {
        let check = |text: &str, expected: &str| {
            let name =
                SegmentName { camera: CameraId::new("north").unwrap(), first_at: text.parse().unwrap() };
            assert_eq!(name.to_string(), expected);
            assert_eq!(expected.parse(), Ok(name));
        };
        check("2026-11-22T05:06:07.0001Z", "north/2026-11-22/050607.000100000Z.mkv");
        check("1970-01-01T00:00:00Z", "north/1970-01-01/000000.000000000Z.mkv");
        check("1969-12-31T23:59:59.999999999Z", "north/1969-12-31/235959.999999999Z.mkv");
        check(&i64::MAX.to_string(), "north/2262-04-11/234716.854775807Z.mkv");
        check(&i64::MIN.to_string(), "north/1677-09-21/001243.145224192Z.mkv");
    }

    #[test]
    fn other_files_are_no_segments() {
        for path in [
            "",
            "north",
            "north/2026-11-22",
            "north/2026-11-22/050607.000100000Z.mkv.part",
            "north/2026-11-22/050607.0001Z.mkv",
            "north/2026-11-22/050607.000100000z.mkv",
            "north/2026-11-22/+50607.000100000Z.mkv",
            "north/2026-11-22/05060\u{e9}.00010000Z.mkv",
            "north/2026-13-22/050607.000100000Z.mkv",
            "north/2026-11-31/050607.000100000Z.mkv",
            "north/20261122/050607.000100000Z.mkv",
            "north/2026-11-22/250607.000100000Z.mkv",
            "North/2026-11-22/050607.000100000Z.mkv",
            "../2026-11-22/050607.000100000Z.mkv",
            "north//050607.000100000Z.mkv",
            "/north/2026-11-22/050607.000100000Z.mkv",
            "north/2026-11-22/../050607.000100000Z.mkv",
        ] {
            assert_eq!(path.parse::<SegmentName>(), Err(NotASegment), "{path}");
        }
    }
}
