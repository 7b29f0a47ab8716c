//! Truths about what a device says of itself, whatever it answers.

use super::clock::{self, ClockOffset};
use super::media::{self, MediaKind, Profile};
use super::place::{AskedHost, placed, service};
use super::probe::Gathered;
use super::soap::{Outcome, Question, verdict};
use super::{OnvifError, xml};
use crate::media::Peer;
use std::net::{IpAddr, Ipv4Addr};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::CameraUrl;

/// The address that is asked.
const ADDRESS: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 0, 0, 7));

/// Most letters of anything that is shown.
const MAX_LETTERS: usize = 128;

/// Reads answers: whatever a device tells, only the host that was asked is ever asked again, what is shown is short and plain, and what is
/// sent back to it is read as it was meant.
///
/// The first byte names the question.
pub fn onvif_answers(data: &[u8]) -> usize {
    let [kind, bytes @ ..] = data else { return 0 };
    let text = String::from_utf8_lossy(bytes);
    let media_kind = if *kind & 8 == 0 { MediaKind::First } else { MediaKind::Second };
    match *kind % 8 {
        0 => answer(&text, &media::ask_clock(), |node| Some(clock::read(node)))
            .flatten()
            .map_or(0, holds_clock),
        1 => {
            let names = answer(&text, &media::ask_names(), media::names).unwrap_or_default();
            [names.0, names.1].into_iter().flatten().inspect(|name| holds_shown(name)).count()
        }
        2 => holds_services(answer(&text, &media::ask_services(), media::services)),
        3 => holds_services(answer(&text, &media::ask_capabilities(), media::capabilities)),
        4 => {
            let question = media::ask_profiles(media_kind);
            let found = answer(&text, &question, |node| Some(media::profiles(node, media_kind)));
            let found = found.unwrap_or_default();
            assert!(found.len() <= media::MAX_PROFILES);
            found.iter().for_each(|profile| holds_profile(profile, media_kind));
            found.len()
        }
        5 => {
            let question = media::ask_stream(media_kind, "token");
            let reported = answer(&text, &question, |node| media::stream_url(node, media_kind));
            reported.map_or(0, |reported| holds_placed(&reported))
        }
        6 => holds_found(bytes),
        _ => holds_placed(&text) + holds_services(Some(vec![(media_kind, text.into_owned())])),
    }
}

/// Returns what an answer to a question tells.
fn answer<T>(
    text: &str,
    question: &Question,
    read: impl FnOnce(roxmltree::Node<'_, '_>) -> Option<T>,
) -> Option<T> {
    match verdict(text, question, read) {
        Outcome::Answered(reported) => Some(reported),
        Outcome::NotAuthorized | Outcome::Failed(OnvifError::NotUnderstood) => None,
        Outcome::Failed(OnvifError::Refused { code }) => {
            holds_shown(&code);
            None
        }
        Outcome::Failed(error) => panic!("{error:?}"),
    }
}

fn asked() -> AskedHost {
    AskedHost { written: "gate".to_owned(), address: ADDRESS }
}

fn holds_shown(text: &str) {
    assert!(text.chars().count() <= MAX_LETTERS && !text.contains(char::is_control), "{text:?}");
}

fn holds_clock(reported: Timestamp) -> usize {
    let at = |secs: i64| Timestamp::from_nanos(secs * 1_000_000_000);
    let offset = ClockOffset::of(reported, at(1_700_000_000), at(1_700_000_001));
    assert!(offset.secs.is_finite() && (offset.error_secs - 1.0).abs() < 1e-9, "{offset:?}");
    // A double has some hundred nanoseconds at such distances.
    let wrong_secs = offset.device_time(at(1_700_000_001)).secs_since(reported);
    assert!((-1.0..=2.0).contains(&wrong_secs), "{offset:?}: {wrong_secs}");
    1
}

fn holds_services(reported: Option<Vec<(MediaKind, String)>>) -> usize {
    let peer = Peer {
        address: (ADDRESS, 8080).into(),
        host: "gate".to_owned(),
        is_encrypted: false,
        place: "http://gate:8080".to_owned(),
        authority: "gate:8080".to_owned(),
        url: String::new(),
        path_and_query: "/".to_owned(),
    };
    let found = reported
        .unwrap_or_default()
        .into_iter()
        .filter_map(|(_, reported)| service(&reported, &peer, &asked()));
    found
        .inspect(|found| {
            assert_eq!(
                (found.address.ip(), found.host.as_str(), found.is_encrypted),
                (ADDRESS, "gate", false)
            );
            let port = found.address.port();
            let written = if port == 80 { "gate".to_owned() } else { format!("gate:{port}") };
            assert_eq!((&found.authority, &found.place), (&written, &format!("http://gate:{port}")));
            assert!(found.path_and_query.starts_with('/'), "{found:?}");
            let request = hyper::Request::post(found.path_and_query.as_str()).body(());
            assert!(request.is_ok(), "{:?}", found.path_and_query);
        })
        .count()
}

fn holds_profile(profile: &Profile, kind: MediaKind) {
    let stream = &profile.stream;
    holds_shown(&stream.profile);
    stream.encoding.iter().for_each(|encoding| holds_shown(encoding));
    assert!(stream.rate_hz.is_none_or(|rate| rate > 0.0 && rate <= 1000.0), "{stream:?}");
    assert!(stream.size_px.is_none_or(|sides| sides.iter().all(|side| *side > 0)), "{stream:?}");
    assert!(!profile.token.is_empty());
    let message = media::ask_stream(kind, &profile.token).message("");
    let document = xml::read(&message).expect("a question is well-formed");
    let path = ["Body", "GetStreamUri", "ProfileToken"];
    let found = xml::at(document.root_element(), &path).and_then(|node| node.text());
    assert_eq!(found, Some(profile.token.as_str()), "the token that was told is sent back");
}

/// Holds the URL that a device tells to the host that was asked.
fn holds_placed(reported: &str) -> usize {
    let Some(found) = placed(reported, &asked()) else { return 0 };
    let host = |url: &CameraUrl| url.parse().map(|parts| parts.host.to_string());
    let own = ["gate".to_owned(), ADDRESS.to_string()];
    let is_own =
        |url: &CameraUrl| host(url).is_ok_and(|host| own.iter().any(|own| own.eq_ignore_ascii_case(&host)));
    assert!(is_own(&found.url), "{found:?}");
    assert!(
        found.reported.as_ref().is_none_or(|reported| host(reported).is_ok() && !is_own(reported)),
        "{found:?}"
    );
    1
}

/// Reads answers to a probe, which a byte of zero parts.
fn holds_found(bytes: &[u8]) -> usize {
    let mut gathered = Gathered::default();
    let mut n_understood = 0;
    for (n, answer) in (0..=u8::MAX).zip(bytes.split(|byte| *byte == 0)) {
        let from = [10, 0, 0, n % 3];
        n_understood += usize::from(gathered.take(answer, (from, 3702).into()).is_some());
    }
    let found = gathered.into_devices().devices;
    assert_eq!(found.is_empty(), n_understood == 0);
    for device in &found {
        holds_shown(&device.endpoint);
        [&device.name, &device.model].into_iter().flatten().for_each(|name| holds_shown(name));
        assert!(
            (1..=4).contains(&device.services.len()) && device.reported_services.len() <= 4,
            "{device:?}"
        );
        for url in &device.services {
            let parts = url.parse().unwrap_or_else(|error| panic!("{error}"));
            assert!(parts.host.to_string().starts_with("10.0.0.") && !parts.is_rtsp(), "{device:?}");
        }
    }
    found.len()
}
