//! Services, profiles and streams of a device.

use super::soap::{AskedBy, Question};
use super::token::escaped;
use super::xml::{at, children, shown, text_at};
use roxmltree::Node;
use serde::Serialize;
use videofields_vision::config::CameraUrl;

/// Namespace of the device service.
const DEVICE: &str = "http://www.onvif.org/ver10/device/wsdl";

/// Namespace of the first media service.
const MEDIA: &str = "http://www.onvif.org/ver10/media/wsdl";

/// Namespace of the second media service, which knows H.265.
const MEDIA_2: &str = "http://www.onvif.org/ver20/media/wsdl";

/// Most profiles whose streams are asked for.
pub(super) const MAX_PROFILES: usize = 32;

/// Most letters of a name, and of a profile's token.
const MAX_NAME_LETTERS: usize = 64;

/// Most bytes of a URL.
const MAX_URL_BYTES: usize = 2048;

/// A stream that a device gives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceStream {
    /// Name of the profile that it belongs to.
    pub profile: String,
    /// Its encoding as the device calls it, such as `H264`, where it says so.
    pub encoding: Option<String>,
    /// Columns and rows of its pictures, where it says so.
    pub size_px: Option<[u32; 2]>,
    /// Most pictures a second, where it says so.
    pub rate_hz: Option<f64>,
    /// Its URL at the host that was asked, without a login; none where the device tells none that cameras have.
    pub url: Option<CameraUrl>,
    /// Its URL as the device tells it, where that is at another host.
    pub reported_url: Option<CameraUrl>,
}

/// A media service's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MediaKind {
    /// The second, which knows all encodings.
    Second,
    /// The first.
    First,
}

/// A profile, and its token by which its stream is asked for.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    pub(super) token: String,
    pub(super) stream: DeviceStream,
}

pub(super) fn ask_clock() -> Question {
    Question { asked_by: AskedBy::Everybody, ..Question::new(DEVICE, "GetSystemDateAndTime", String::new()) }
}

pub(super) fn ask_names() -> Question {
    Question::new(DEVICE, "GetDeviceInformation", String::new())
}

pub(super) fn ask_services() -> Question {
    let inner = "<q:IncludeCapability>false</q:IncludeCapability>".to_owned();
    Question::new(DEVICE, "GetServices", inner)
}

pub(super) fn ask_capabilities() -> Question {
    Question::new(DEVICE, "GetCapabilities", "<q:Category>Media</q:Category>".to_owned())
}

pub(super) fn ask_profiles(kind: MediaKind) -> Question {
    match kind {
        MediaKind::First => Question::new(MEDIA, "GetProfiles", String::new()),
        MediaKind::Second => {
            Question::new(MEDIA_2, "GetProfiles", "<q:Type>VideoEncoder</q:Type>".to_owned())
        }
    }
}

pub(super) fn ask_stream(kind: MediaKind, token: &str) -> Question {
    let token = escaped(token);
    match kind {
        MediaKind::First => {
            let inner = format!(
                "<q:StreamSetup><t:Stream>RTP-Unicast</t:Stream><t:Transport><t:Protocol>RTSP</t:Protocol></t:Transport>\
                 </q:StreamSetup><q:ProfileToken>{token}</q:ProfileToken>"
            );
            Question::new(MEDIA, "GetStreamUri", inner)
        }
        MediaKind::Second => {
            let inner = format!("<q:Protocol>RTSP</q:Protocol><q:ProfileToken>{token}</q:ProfileToken>");
            Question::new(MEDIA_2, "GetStreamUri", inner)
        }
    }
}

/// Returns maker and model of an answer to [`ask_names`].
pub(super) fn names(answer: Node<'_, '_>) -> Option<(Option<String>, Option<String>)> {
    let name =
        |name: &str| Some(shown(text_at(answer, &[name])?, MAX_NAME_LETTERS)).filter(|name| !name.is_empty());
    Some((name("Manufacturer"), name("Model")))
}

/// Returns where an answer to [`ask_services`] has media services, the better one first.
pub(super) fn services(answer: Node<'_, '_>) -> Option<Vec<(MediaKind, String)>> {
    let of = |kind: MediaKind, namespace: &str| {
        let is_it = |service: &Node<'_, '_>| {
            text_at(*service, &["Namespace"]).is_some_and(|found| found.trim_end_matches('/') == namespace)
        };
        let service = children(answer, "Service").find(is_it)?;
        Some((kind, url_of(service, &["XAddr"])?))
    };
    Some([of(MediaKind::Second, MEDIA_2), of(MediaKind::First, MEDIA)].into_iter().flatten().collect())
}

/// Returns where an answer to [`ask_capabilities`] has the first media service.
pub(super) fn capabilities(answer: Node<'_, '_>) -> Option<Vec<(MediaKind, String)>> {
    Some(vec![(MediaKind::First, url_of(answer, &["Capabilities", "Media", "XAddr"])?)])
}

/// Returns the profiles of an answer to [`ask_profiles`] that have video.
pub(super) fn profiles(answer: Node<'_, '_>, kind: MediaKind) -> Vec<Profile> {
    let path: &[&str] = match kind {
        MediaKind::First => &["VideoEncoderConfiguration"],
        MediaKind::Second => &["Configurations", "VideoEncoder"],
    };
    let found = children(answer, "Profiles").filter_map(|profile| {
        let token = profile.attribute("token")?;
        let encoder = at(profile, path)?;
        let is_usable = !token.is_empty()
            && token.chars().count() <= MAX_NAME_LETTERS
            && !token.contains(char::is_control);
        let name = text_at(profile, &["Name"]).unwrap_or(token);
        let stream = stream(shown(name, MAX_NAME_LETTERS), encoder);
        is_usable.then(|| Profile { token: token.to_owned(), stream })
    });
    found.take(MAX_PROFILES).collect()
}

fn stream(profile: String, encoder: Node<'_, '_>) -> DeviceStream {
    let side =
        |name: &str| text_at(encoder, &["Resolution", name])?.parse::<u32>().ok().filter(|side| *side > 0);
    let encoding = text_at(encoder, &["Encoding"]).map(|name| shown(name, MAX_NAME_LETTERS));
    let rate_hz =
        text_at(encoder, &["RateControl", "FrameRateLimit"]).and_then(|rate| rate.parse::<f64>().ok());
    DeviceStream {
        profile,
        encoding,
        size_px: side("Width").zip(side("Height")).map(|(width, height)| [width, height]),
        rate_hz: rate_hz.filter(|rate| (0.001..=1000.0).contains(rate)),
        url: None,
        reported_url: None,
    }
}

/// Returns the URL of an answer to [`ask_stream`]; may hold secrets.
pub(super) fn stream_url(answer: Node<'_, '_>, kind: MediaKind) -> Option<String> {
    match kind {
        MediaKind::First => url_of(answer, &["MediaUri", "Uri"]),
        MediaKind::Second => url_of(answer, &["Uri"]),
    }
}

fn url_of(node: Node<'_, '_>, path: &[&str]) -> Option<String> {
    let url = text_at(node, path)?;
    (url.len() <= MAX_URL_BYTES).then(|| url.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::onvif::xml;

    #[test]
    fn profiles_are_read_of_both_kinds() {
        let first = "<r><Profiles token='a&amp;b'><Name>main</Name><VideoEncoderConfiguration><Encoding>H264</Encoding>\
            <Resolution><Width>1920</Width><Height>1080</Height></Resolution>\
            <RateControl><FrameRateLimit>25</FrameRateLimit></RateControl></VideoEncoderConfiguration></Profiles>\
            <Profiles token='audio'/></r>";
        let document = xml::read(first).unwrap();
        let found = profiles(document.root_element(), MediaKind::First);
        let expected = DeviceStream {
            profile: "main".to_owned(),
            encoding: Some("H264".to_owned()),
            size_px: Some([1920, 1080]),
            rate_hz: Some(25.0),
            url: None,
            reported_url: None,
        };
        assert_eq!((found.len(), &found[0].token, &found[0].stream), (1, &"a&b".to_owned(), &expected));
        assert!(ask_stream(MediaKind::First, &found[0].token).inner.contains(">a&amp;b<"));
        let second = "<r><Profiles token='1'><Configurations><VideoEncoder><Encoding>H265</Encoding>\
            <Resolution><Width>0</Width><Height>-3</Height></Resolution><RateControl><FrameRateLimit>12.5</FrameRateLimit>\
            </RateControl></VideoEncoder></Configurations></Profiles></r>";
        let document = xml::read(second).unwrap();
        let stream = &profiles(document.root_element(), MediaKind::Second)[0].stream;
        assert_eq!((stream.profile.as_str(), stream.size_px, stream.rate_hz), ("1", None, Some(12.5)));
        let many: String = (0..99)
            .map(|n| format!("<Profiles token='{n}'><VideoEncoderConfiguration/></Profiles>"))
            .collect();
        let many = format!("<r>{many}</r>");
        let document = xml::read(&many).unwrap();
        assert_eq!(profiles(document.root_element(), MediaKind::First).len(), MAX_PROFILES);
    }

    #[test]
    fn the_second_media_service_comes_before_the_first() {
        let service = |namespace: &str, place: &str| {
            format!("<x:Service><x:Namespace>{namespace}</x:Namespace><x:XAddr>{place}</x:XAddr></x:Service>")
        };
        let text = format!(
            "<r xmlns:x='x'>{}{}{}</r>",
            service(DEVICE, "http://d/"),
            service(MEDIA, "http://m/1"),
            service(MEDIA_2, "http://m/2")
        );
        let document = xml::read(&text).unwrap();
        let found = services(document.root_element()).unwrap();
        assert_eq!(
            found,
            [(MediaKind::Second, "http://m/2".to_owned()), (MediaKind::First, "http://m/1".to_owned())]
        );
    }
}
