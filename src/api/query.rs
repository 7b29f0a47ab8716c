//! Query parameters: what is read, what is allowed, and what a caller is told about everything that is neither.
//!
//! A raw query string flows in; typed values flow out, or one problem that names every wrong parameter. `+` is
//! read as itself (an RFC 3339 offset such as `+02:00` needs no escape), `%XX` as a byte of UTF-8.

use super::error::Problem;
use super::looks;
use super::parameters::Named;
use glam::DVec3;
use percent_encoding::percent_decode_str;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;
use videofields_service::engine::{At, EngineError};
use videofields_vision::clock::{ParseTimestampError, Timestamp};
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::is_id;

/// Furthest coordinate of a viewer, metres: room for any projected map, and squares stay far from infinity.
pub(super) const MAX_COORDINATE_M: f64 = 1e8;

/// Which time is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Moment {
    pub(super) at: At,
    /// Whether the same request will always mean the same time.
    pub(super) is_fixed: bool,
}

/// The parameters of one request, and the faults found in them so far.
#[derive(Debug)]
pub(super) struct Query {
    pairs: Vec<(String, String)>,
    faults: Vec<Fault>,
}

impl Query {
    /// Takes the query string apart; every parameter must be one of `known` and come once.
    pub(super) fn parse<P: Named>(raw: Option<&str>, known: &[P]) -> Self {
        let known: Vec<&str> = known.iter().map(Named::name).collect();
        let mut query = Self { pairs: Vec::new(), faults: Vec::new() };
        for part in raw.unwrap_or_default().split('&').filter(|part| !part.is_empty()) {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            query.take(name, value, &known);
        }
        query
    }

    fn take(&mut self, name: &str, value: &str, known: &[&str]) {
        let (Ok(name), Ok(value)) =
            (percent_decode_str(name).decode_utf8(), percent_decode_str(value).decode_utf8())
        else {
            return self.fault(&shortened(name), "its escapes are not UTF-8");
        };
        if !known.contains(&name.as_ref()) {
            let listed = listed(&name, known);
            return self.fault(&shortened(&name), format!("is not a parameter here; {listed}"));
        }
        if self.pairs.iter().any(|(other, _)| *other == name) {
            return self.fault(&name, "is given more than once");
        }
        self.pairs.push((name.into_owned(), value.into_owned()));
    }

    fn fault(&mut self, name: &str, message: impl Into<String>) {
        self.faults.push(Fault::new(name, message));
    }

    /// The value of `name` as `read` understands it; if it understands nothing, a fault says what is `allowed`.
    pub(super) fn value<T>(
        &mut self,
        name: &str,
        allowed: &str,
        read: impl FnOnce(&str) -> Option<T>,
    ) -> Option<T> {
        let (_, text) = self.pairs.iter().find(|(other, _)| other == name)?;
        let value = read(text);
        if value.is_none() {
            let message = format!("must be {allowed}, not {}", shown(text));
            self.fault(name, message);
        }
        value
    }

    /// A finite number within `range`.
    pub(super) fn number(&mut self, name: &str, range: &RangeInclusive<f64>, unit: &str) -> Option<f64> {
        let allowed = format!("a number from {} to {}{unit}", range.start(), range.end());
        self.value(name, &allowed, |text| finite(text).filter(|number| range.contains(number)))
    }

    /// A whole number within `range`.
    pub(super) fn whole<N: FromStr + PartialOrd + Display>(
        &mut self,
        name: &str,
        range: &RangeInclusive<N>,
    ) -> Option<N> {
        let allowed = format!("a whole number from {} to {}", range.start(), range.end());
        self.value(name, &allowed, |text| text.parse().ok().filter(|number| range.contains(number)))
    }

    /// A point in the world, metres: three numbers with commas between them.
    pub(super) fn point(&mut self, name: &str) -> Option<DVec3> {
        let allowed = format!("x,y,z: three numbers of metres, each within +-{MAX_COORDINATE_M:e}");
        self.value(name, &allowed, |text| {
            let mut numbers =
                text.split(',').map(|part| finite(part).filter(|number| number.abs() <= MAX_COORDINATE_M));
            let point = DVec3::new(numbers.next()??, numbers.next()??, numbers.next()??);
            numbers.next().is_none().then_some(point)
        })
    }

    /// Three points in the world, metres: nine numbers with commas between them.
    pub(super) fn points(&mut self, name: &str) -> Option<[DVec3; 3]> {
        let allowed =
            format!("x,y,z three times: nine numbers of metres, each within +-{MAX_COORDINATE_M:e}");
        self.value(name, &allowed, |text| {
            let number = |part| finite(part).filter(|number: &f64| number.abs() <= MAX_COORDINATE_M);
            let numbers = text.split(',').map(number).collect::<Option<Vec<f64>>>()?;
            let (points, rest) = numbers.as_chunks::<3>();
            let points: [[f64; 3]; 3] = points.try_into().ok().filter(|_| rest.is_empty())?;
            Some(points.map(DVec3::from))
        })
    }

    /// Whether the parameter `name` came.
    pub(super) fn has(&self, name: &str) -> bool {
        self.pairs.iter().any(|(other, _)| other == name)
    }

    /// Notes a fault where the parameter `name` came, and forgets it.
    pub(super) fn refuse(&mut self, name: &str, why: &str) {
        if self.has(name) {
            self.pairs.retain(|(other, _)| other != name);
            self.fault(name, why);
        }
    }

    /// One of a few words.
    pub(super) fn choice<T: Copy>(&mut self, name: &str, choices: &[(&str, T)]) -> Option<T> {
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        let allowed = format!("one of {}", words.join(", "));
        self.value(name, &allowed, |text| {
            choices.iter().find(|(word, _)| *word == text).map(|(_, choice)| *choice)
        })
    }

    /// The id of a scene or camera.
    pub(super) fn id(&mut self, name: &str) -> Option<String> {
        let allowed = "an id (1 to 64 of a-z, 0-9, - and _, the first a letter or digit)";
        self.value(name, allowed, |text| is_id(text).then(|| text.to_owned()))
    }

    /// The parameter `t`; live if absent. `playhead` says where the playhead of a name stands.
    pub(super) fn moment(&mut self, playhead: impl FnOnce(&str) -> Result<Timestamp, EngineError>) -> Moment {
        let allowed = "live, playhead: and its name, nanoseconds since 1970-01-01 (UTC) or an RFC 3339 instant such as \
                       2026-03-01T12:00:00.5Z";
        let mut failure = None;
        let read = |text: &str| {
            if let Some(id) = text.strip_prefix("playhead:") {
                let at = playhead(id).map(At::Time).map_err(|error| failure = Some(error));
                return Some(Moment { at: at.unwrap_or_default(), is_fixed: false });
            }
            match Timestamp::from_str(text) {
                _ if text == "live" => Some(Moment::default()),
                Ok(instant) => Some(Moment { at: At::Time(instant), is_fixed: true }),
                Err(ParseTimestampError) => None,
            }
        };
        let moment = self.value("t", allowed, read).unwrap_or_default();
        if let Some(error) = failure {
            self.fault("t", error.to_string());
        }
        if let At::Time(instant) = moment.at {
            looks::at(instant);
        }
        moment
    }

    /// An instant.
    pub(super) fn instant(&mut self, name: &str) -> Option<Timestamp> {
        let allowed =
            "an RFC 3339 instant such as 2026-03-01T12:00:00.5Z, or nanoseconds since 1970-01-01 (UTC)";
        let instant = self.value(name, allowed, |text| Timestamp::from_str(text).ok());
        instant.into_iter().for_each(looks::at);
        instant
    }

    /// Notes a fault where the parameter `name` did not come at all.
    pub(super) fn require(&mut self, name: &str) {
        if !self.has(name) {
            self.fault(name, "is required");
        }
    }

    /// What was made of the parameters.
    ///
    /// # Errors
    /// When any of them was wrong: one problem that names them all.
    pub(super) fn finish<T>(self, value: Option<T>) -> Result<T, Problem> {
        match value {
            Some(value) if self.faults.is_empty() => Ok(value),
            _ => Err(Problem::at(ErrorKind::Invalid, self.faults)),
        }
    }
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

fn shortened(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// What a caller sent, quoted and at most 40 characters of it.
pub(super) fn shown(text: &str) -> String {
    format!("{:?}", shortened(text))
}

/// "did you mean" and the list of what there is (the first 24), for a name that is none of it.
pub(super) fn listed(name: &str, there_are: &[&str]) -> String {
    const SHOWN: usize = 24;
    if there_are.is_empty() {
        return "there is none".to_owned();
    }
    let nearest = there_are.iter().map(|other| (strsim::damerau_levenshtein(name, other), other)).min();
    let mut text = match nearest {
        Some((distance, other)) if distance <= 1 + other.len() / 4 => format!("did you mean {other:?}? "),
        _ => String::new(),
    };
    text.push_str("known: ");
    text.push_str(&there_are[..there_are.len().min(SHOWN)].join(", "));
    if there_are.len() > SHOWN {
        text.push_str(&format!(" and {} more", there_are.len() - SHOWN));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Parameter;

    fn no_playhead(id: &str) -> Result<Timestamp, EngineError> {
        Err(EngineError::NoPlayhead { id: id.to_owned() })
    }

    fn known<const N: usize>(names: [&'static str; N]) -> [Parameter; N] {
        names.map(|name| Parameter::id(name, ""))
    }

    fn fault_of(raw: &str, read: impl FnOnce(&mut Query)) -> Vec<(String, String)> {
        let mut query = Query::parse(Some(raw), &known(["t", "fov", "width", "eye", "method"]));
        read(&mut query);
        query.faults.into_iter().map(|fault| (fault.place, fault.message)).collect()
    }

    #[test]
    fn plus_is_itself_and_escapes_are_utf8() {
        let mut query = Query::parse(Some("t=1970-01-01T02:00:01+02:00"), &known(["t"]));
        assert_eq!(query.moment(no_playhead).at, At::Time(Timestamp::from_nanos(1_000_000_000)));
        let mut query = Query::parse(Some("t=%6Cive"), &known(["t"]));
        assert_eq!(query.moment(no_playhead).at, At::Live);
        assert!(query.finish(Some(())).is_ok());
        assert_eq!(fault_of("t=%ff", |_| ()), [("t".into(), "its escapes are not UTF-8".into())]);
    }

    #[test]
    fn unknown_and_repeated_parameters_are_faults() {
        let faults = fault_of("widht=3&fov=1&fov=1", |_| ());
        assert_eq!(faults[0].0, "widht");
        assert!(faults[0].1.contains("did you mean \"width\"? known: t, fov"), "{faults:?}");
        assert_eq!(faults[1], ("fov".into(), "is given more than once".into()));
    }

    #[test]
    fn numbers_outside_their_range_are_faults() {
        for bad in ["NaN", "inf", "-inf", "1e999", "", "0.5", "171", "1,2", " 3", "0x10"] {
            let faults = fault_of(&format!("fov={bad}"), |query| {
                assert_eq!(query.number("fov", &(1.0..=170.0), " degrees"), None, "{bad}");
            });
            assert!(faults[0].1.starts_with("must be a number from 1 to 170 degrees, not "), "{faults:?}");
        }
        for bad in ["0", "-1", "4294967296", "1.5", "", "9999999999999999999999"] {
            let faults = fault_of(&format!("width={bad}"), |query| {
                assert_eq!(query.whole("width", &(1..=100)), None, "{bad}");
            });
            assert_eq!(faults.len(), 1, "{bad}");
        }
    }

    #[test]
    fn points_have_three_finite_numbers() {
        let check = |text: &str, expected: Option<DVec3>| {
            let mut query = Query::parse(Some(&format!("eye={text}")), &known(["eye"]));
            assert_eq!(query.point("eye"), expected, "{text}");
            assert_eq!(query.faults.is_empty(), expected.is_some(), "{text}");
        };
        check("1,-2.5,3e2", Some(DVec3::new(1.0, -2.5, 300.0)));
        for bad in ["", "1", "1,2", "1,2,3,4", "1,2,", "1,2,NaN", "1,inf,3", "1e9,0,0", "1;2;3", ",,"] {
            check(bad, None);
        }
    }

    #[test]
    fn long_values_are_shortened_where_they_are_shown() {
        let long = "é".repeat(1000);
        assert_eq!(shown(&long).chars().count(), 45);
        let faults = fault_of(&format!("fov={long}"), |query| {
            assert_eq!(query.number("fov", &(1.0..=2.0), ""), None);
        });
        assert!(faults[0].1.len() < 200);
    }
}
