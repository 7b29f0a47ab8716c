//! Offsets of devices' clocks.

use super::xml::text_at;
use roxmltree::Node;
use serde::Serialize;
use videofields_vision::clock::Timestamp;

const NANOS_PER_SEC: f64 = 1e9;

/// Half of the step in which devices tell their time, seconds: they leave out what is beyond whole seconds.
const HALF_STEP_SECS: f64 = 0.5;

/// A device's clock against this machine's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClockOffset {
    /// Seconds by which the device's clock is ahead of this machine's; negative where it is behind.
    pub secs: f64,
    /// Most seconds by which that may be wrong: half of the time in which the answer came, and half a second, since devices tell
    /// whole seconds.
    pub error_secs: f64,
}

impl ClockOffset {
    /// Returns the offset of a device that told `reported` between `asked` and `answered`.
    pub(super) fn of(reported: Timestamp, asked: Timestamp, answered: Timestamp) -> Self {
        let half_secs = answered.secs_since(asked).max(0.0) / 2.0;
        let middle = asked.saturating_add_nanos(answered.nanos_since(asked) / 2);
        Self { secs: reported.secs_since(middle) + HALF_STEP_SECS, error_secs: half_secs + HALF_STEP_SECS }
    }

    /// Returns the time of the device's clock at `now`, rather too early than too late: what is made in the future is refused.
    pub(super) fn device_time(self, now: Timestamp) -> Timestamp {
        // A cast from float saturates.
        now.saturating_add_nanos(((self.secs - HALF_STEP_SECS) * NANOS_PER_SEC) as i64)
    }
}

/// Reads the UTC of an answer to `GetSystemDateAndTime`; none where it tells none that exists.
pub(super) fn read(answer: Node<'_, '_>) -> Option<Timestamp> {
    let part = |path: [&'static str; 4]| text_at(answer, &path)?.parse::<i16>().ok();
    let date = |name| part(["SystemDateAndTime", "UTCDateTime", "Date", name]);
    let time = |name| i8::try_from(part(["SystemDateAndTime", "UTCDateTime", "Time", name])?).ok();
    let small = |number: i16| i8::try_from(number).ok();
    let reported = jiff::civil::DateTime::new(
        date("Year")?,
        small(date("Month")?)?,
        small(date("Day")?)?,
        time("Hour")?,
        time("Minute")?,
        // A leap second is told as the one before it.
        time("Second")?.min(59),
        0,
    );
    let instant = reported.ok()?.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp();
    i64::try_from(instant.as_nanosecond()).ok().map(Timestamp::from_nanos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::onvif::xml;

    #[test]
    fn an_offset_is_the_devices_time_less_that_of_the_middle_between_question_and_answer() {
        let at = |secs: f64| Timestamp::from_nanos((secs * 1e9) as i64);
        // The device's clock is 37.2 s ahead: at 1000.4 here it shows 1037.6 and tells 1037.
        let found = ClockOffset::of(at(1037.0), at(1000.0), at(1000.8));
        assert!((found.secs - 37.1).abs() < 1e-6, "{found:?}");
        assert!((found.error_secs - 0.9).abs() < 1e-6, "{found:?}");
        assert!((found.secs - 37.2).abs() <= found.error_secs);
        let made = found.device_time(at(2000.0)).secs_since(at(2000.0));
        assert!((made - 36.6).abs() < 1e-6, "{made}");
        let behind = ClockOffset::of(at(0.0), at(1.7e9), at(1.7e9));
        assert!((behind.secs + 1.7e9 - 0.5).abs() < 1e-3, "{behind:?}");
    }

    #[test]
    fn times_are_read_where_they_exist() {
        let of = |date: [&str; 3], time: [&str; 3]| {
            let text = format!(
                "<r><SystemDateAndTime><UTCDateTime><Time><Hour>{}</Hour><Minute>{}</Minute><Second>{}</Second></Time>\
                 <Date><Year>{}</Year><Month>{}</Month><Day>{}</Day></Date></UTCDateTime></SystemDateAndTime></r>",
                time[0], time[1], time[2], date[0], date[1], date[2]
            );
            read(xml::read(&text).unwrap().root_element()).map(|reported| reported.to_string())
        };
        let reported = |text: &str| Some(text.to_owned());
        assert_eq!(of(["2026", "2", "28"], ["23", "5", "9"]), reported("2026-02-28T23:05:09Z"));
        assert_eq!(of(["1970", "01", "01"], ["00", "00", "00"]), reported("1970-01-01T00:00:00Z"));
        assert_eq!(of(["2016", "12", "31"], ["23", "59", "60"]), reported("2016-12-31T23:59:59Z"));
        assert_eq!(of(["2026", "2", "29"], ["0", "0", "0"]), None);
        assert_eq!(of(["99999", "1", "1"], ["0", "0", "0"]), None);
        assert_eq!(of(["9999", "1", "1"], ["0", "0", "0"]), None);
        assert_eq!(of(["2026", "1", "1"], ["24", "0", "0"]), None);
        assert_eq!(of(["2026", "1", "1"], ["-1", "0", "0"]), None);
        assert_eq!(of(["2026", "1", ""], ["1", "0", "0"]), None);
        assert_eq!(read(xml::read("<r/>").unwrap().root_element()), None);
    }
}
