//! The description of a camera's streams (SDP, RFC 4566; RFC 2326, appendix C), and which of them is taken.

use crate::media::Fault;
use crate::media::allowed::{FORMATS, is_allowed};
use crate::media::input::Keep;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use gstreamer as gst;
use gstreamer_sdp::{SDPMediaRef, SDPMessage};

/// Most letters of a format's name.
const MAX_NAME_LETTERS: usize = 40;

/// Largest payload type: packets have seven bits for it.
const MAX_PAYLOAD_TYPE: u8 = 127;

/// The stream that is taken.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stream {
    /// The address that `SETUP` asks for.
    pub(super) control: String,
    /// The address that `PLAY` asks for.
    pub(super) session: String,
    pub(super) payload_type: u8,
    /// The format of its packets.
    pub(super) caps: gst::Caps,
}

/// The first video among the streams that `description` names whose format is read. Addresses in it are relative to `base`.
///
/// # Errors
/// When there is none.
pub(super) fn first_video(description: &[u8], base: &str) -> Result<Stream, Fault> {
    // Names in other scripts are of no use here, and no text for who reads the rest; the library ends at a zero.
    let text = description.iter().map(|byte| match byte {
        b'\t' => ' ',
        b'\0' | b'\r' | b'\n' | b' '..=b'~' => char::from(*byte),
        _ => '?',
    });
    let text: String = text.collect();
    let no_video = |detail: &str| Fault::NotVideo(detail.to_owned());
    // The library complains where there is no text at all.
    let message = Some(text.as_bytes()).filter(|text| !text.is_empty()).map(SDPMessage::parse_buffer);
    let message = message.and_then(Result::ok);
    let message = message.ok_or_else(|| no_video("its description of streams cannot be read"))?;
    let session = message.attribute_val("control").filter(|control| *control != "*");
    let session = session.map_or_else(|| base.to_owned(), |control| joined(base, control));
    let mut refused = Vec::new();
    for media in message.medias() {
        if media.media() != Some("video") {
            continue;
        }
        match format_of(media, &message) {
            Ok((payload_type, caps)) => {
                let control = media.attribute_val("control");
                let control = control.map_or_else(|| session.clone(), |control| joined(&session, control));
                return Ok(Stream { control, session, payload_type, caps });
            }
            Err(name) => refused.extend(name),
        }
    }
    if let Some(format) = refused.into_iter().next() {
        return Err(Fault::Refused { format, allowed: FORMATS.to_owned() });
    }
    Err(no_video("it has no video stream"))
}

/// Returns the fault of a stream whose payloads are of a kind that is read, by an element that is not installed: `GStreamer` itself would
/// say nothing of it.
pub(super) fn missing_reader(stream: &gst::CapsRef) -> Option<Fault> {
    let readers =
        gst::ElementFactory::factories_with_type(gst::ElementFactoryType::DEPAYLOADER, gst::Rank::MARGINAL);
    let reads = |factory: &gst::ElementFactory| {
        is_allowed(factory, Keep::Newest) && factory.can_sink_any_caps(stream)
    };
    if readers.iter().any(reads) {
        return None;
    }
    let name = stream.structure(0)?.get::<String>("encoding-name").ok()?.to_ascii_uppercase();
    // Only this one's reader is among the plugins that are written in Rust.
    let package = if name == "AV1" { "gstreamer1.0-plugins-rs" } else { "gstreamer1.0-plugins-good" };
    let name: String = name.chars().take(MAX_NAME_LETTERS).collect();
    Some(Fault::MissingCodec { codec: format!("reader for {name} over RTP"), package: package.into() })
}

/// The first format of a stream that is read; else the name of the first that is not.
fn format_of(media: &SDPMediaRef, message: &SDPMessage) -> Result<(u8, gst::Caps), Option<String>> {
    let mut refused = None;
    for format in media.formats() {
        let Some(payload_type) = format.parse::<u8>().ok().filter(|number| *number <= MAX_PAYLOAD_TYPE)
        else {
            continue;
        };
        let Some(mut caps) = media.caps_from_media(i32::from(payload_type)) else { continue };
        let writable = caps.make_mut();
        for added in [message.attributes_to_caps(writable), media.attributes_to_caps(writable)] {
            if let Err(error) = added {
                tracing::debug!(%error, "an attribute of a stream is left out");
            }
        }
        let Some(structure) = writable.structure_mut(0) else { continue };
        structure.set_name("application/x-rtp");
        // JPEG's payload type needs no name (RFC 3551).
        if payload_type == 26 && !structure.has_field("encoding-name") {
            structure.set("encoding-name", "JPEG");
        }
        let name = structure.get::<String>("encoding-name").unwrap_or_default().to_ascii_uppercase();
        let name: String = name.chars().take(MAX_NAME_LETTERS).collect();
        drop_parts_of_headers(structure);
        if is_read(&name) {
            return Ok((payload_type, caps));
        }
        refused.get_or_insert(if name.is_empty() {
            format!("RTP payload type {payload_type}")
        } else {
            name
        });
    }
    Err(refused)
}

/// Leaves out headers of H.264 and H.265 that lack a part: their readers refuse the stream then, where without any they take
/// what comes within it.
fn drop_parts_of_headers(format: &mut gst::StructureRef) {
    const H264: &str = "sprop-parameter-sets";
    const H265: [&str; 3] = ["sprop-vps", "sprop-sps", "sprop-pps"];
    if let Ok(sets) = format.get::<String>(H264) {
        // The kind of a unit is in the low bits of its first byte: 7 says the size, 8 goes with it.
        let kinds = sets.split(',').filter_map(|set| Some(*BASE64.decode(set.trim()).ok()?.first()? & 31));
        let kinds: Vec<u8> = kinds.collect();
        if ![7, 8].iter().all(|kind| kinds.contains(kind)) {
            format.remove_field(H264);
        }
    }
    let is_there = |name: &str| format.get::<String>(name).is_ok_and(|set| !set.trim().is_empty());
    if !H265.iter().all(|name| is_there(name)) {
        format.remove_fields(H265);
    }
}

/// Returns whether payloads of that name are read.
fn is_read(name: &str) -> bool {
    ["H264", "H265", "JPEG", "VP8", "VP9", "AV1", "MP4V-ES", "RAW"].contains(&name)
}

/// The address that `control` means. As cameras and clients have it, not as RFC 3986 does: what is no address of its own is put
/// behind `base`, also where that ends in a query.
fn joined(base: &str, control: &str) -> String {
    let is_whole = |text: &str| {
        let text = text.to_ascii_lowercase();
        text.starts_with("rtsp://") || text.starts_with("rtsps://")
    };
    if is_whole(control) {
        return control.to_owned();
    }
    if control.is_empty() || control == "*" {
        return base.to_owned();
    }
    let slash = if base.ends_with('/') || control.starts_with('/') { "" } else { "/" };
    format!("{base}{slash}{}", if base.ends_with('/') { control.trim_start_matches('/') } else { control })
}

/// The address to which others are relative: what an answer says it is, if that is an address, else what was asked for.
pub(super) fn base(named: [Option<&str>; 2], asked: &str) -> String {
    let is_whole = |text: &&str| text.to_ascii_lowercase().starts_with("rtsp");
    named.into_iter().flatten().map(str::trim).find(is_whole).unwrap_or(asked).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_that_lack_a_part_are_left_out() {
        let sets = |value: &str| {
            let media = format!(
                "m=video 0 RTP/AVP 96\r\na=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1;sprop-parameter-sets={value}\r\n"
            );
            taken(&media).unwrap().caps.structure(0).unwrap().get::<String>("sprop-parameter-sets").ok()
        };
        let whole = "Z0LAHtkDxWhAAAADAEAAAAwDxYuS,aMuMsg==";
        assert_eq!(sets(whole).as_deref(), Some(whole));
        for part in [
            "Z0LAHtkDxWhAAAADAEAAAAwDxYuS",
            "aMuMsg==",
            "Z0LAHtkDxWhAAAADAEAAAAwDxYuS,",
            "?,?",
            "aMuMsg==,aMuMsg==",
        ] {
            assert_eq!(sets(part), None, "{part}");
        }
        let h265 = |sets: &str| {
            let media = format!("m=video 0 RTP/AVP 96\r\na=rtpmap:96 H265/90000\r\na=fmtp:96 {sets}\r\n");
            taken(&media).unwrap().caps.structure(0).unwrap().has_field("sprop-sps")
        };
        assert!(h265("sprop-vps=QAE=;sprop-sps=QgE=;sprop-pps=RAE="));
        assert!(!h265("sprop-sps=QgE=;sprop-pps=RAE=") && !h265("sprop-vps=;sprop-sps=QgE=;sprop-pps=RAE="));
    }

    fn taken(media: &str) -> Result<Stream, Fault> {
        gst::init().unwrap();
        let text = format!("v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=\u{30ab}\r\nt=0 0\r\n{media}");
        first_video(text.as_bytes(), "rtsp://cam/a/")
    }

    const H264: &str = "m=video 0 RTP/AVP 96\r\na=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1;sprop-parameter-sets=Z0I=,aM4=\r\na=control:trackID=1\r\n";

    #[test]
    fn the_first_video_that_is_read_is_taken() {
        let audio = "m=audio 0 RTP/AVP 8\r\na=control:trackID=0\r\n";
        let stream = taken(&format!("{audio}{H264}m=application 0 RTP/AVP 107\r\n")).unwrap();
        assert_eq!((stream.payload_type, stream.control.as_str()), (96, "rtsp://cam/a/trackID=1"));
        assert_eq!(stream.session, "rtsp://cam/a/");
        let structure = stream.caps.structure(0).unwrap();
        assert_eq!(structure.name(), "application/x-rtp");
        assert_eq!(structure.get::<i32>("clock-rate"), Ok(90_000));
        assert_eq!(structure.get::<&str>("sprop-parameter-sets"), Ok("Z0I=,aM4="));
        let elsewhere = taken(&format!("a=control:rtsp://cam/live/\r\n{H264}")).unwrap();
        assert_eq!(elsewhere.control, "rtsp://cam/live/trackID=1", "relative to the session's own");
        let jpeg = "m=video 0 RTP/AVP 26\r\n";
        assert_eq!(taken(jpeg).unwrap().payload_type, 26, "a payload type that needs no map");
        let unread = "m=video 0 RTP/AVP 97\r\na=rtpmap:97 jpeg2000/90000\r\n";
        assert_eq!(taken(&format!("{unread}{H264}")).unwrap().payload_type, 96);
        let Err(Fault::Refused { format, .. }) = taken(unread) else { panic!("JPEG 2000 is taken") };
        assert_eq!(format, "JPEG2000");
        assert!(matches!(taken(audio), Err(Fault::NotVideo(_))));
        assert!(matches!(first_video(b"nothing", "rtsp://cam/"), Err(Fault::NotVideo(_))));
    }

    #[test]
    fn payloads_that_nothing_installed_reads_are_named() {
        for media in [
            H264,
            "m=video 0 RTP/AVP 26\r\n",
            "m=video 0 RTP/AVP 97\r\na=rtpmap:97 vp8/90000\r\n",
            "m=video 0 RTP/AVP 98\r\na=rtpmap:98 raw/90000\r\na=fmtp:98 sampling=YCbCr-4:2:0; width=64; height=48; depth=8\r\n",
        ] {
            assert!(missing_reader(&taken(media).unwrap().caps).is_none(), "{media}");
        }
        // Its payloads are read where the element is installed, which is not allowed for other payloads.
        let mut unread = taken(H264).unwrap().caps;
        unread.make_mut().set("encoding-name", "MP2T");
        let fault = missing_reader(&unread).map(|fault| fault.to_string());
        assert_eq!(fault.as_deref(), Some("no reader for MP2T over RTP: install gstreamer1.0-plugins-good"));
    }

    #[test]
    fn what_steers_a_terminal_and_payload_types_that_no_packet_has_are_left_out() {
        let unread = "m=video 0 RTP/AVP 97\r\na=rtpmap:97 a\u{1b}[2J/90000\r\n";
        let Err(Fault::Refused { format, .. }) = taken(unread) else { panic!("that is taken") };
        assert_eq!(format, "A?[2J");
        let odd = H264.replace("trackID", "track\u{7f}\tID");
        assert_eq!(taken(&odd).unwrap().control, "rtsp://cam/a/track? ID=1");
        assert!(matches!(taken(&H264.replace("96", "224")), Err(Fault::NotVideo(_))));
        assert_eq!(taken(&H264.replace("96", "127")).unwrap().payload_type, 127);
    }

    #[test]
    fn controls_are_joined_as_cameras_mean_them() {
        let check = |base: &str, control: &str, expected: &str| assert_eq!(joined(base, control), expected);
        check("rtsp://cam/a", "trackID=1", "rtsp://cam/a/trackID=1");
        check("rtsp://cam/a/", "trackID=1", "rtsp://cam/a/trackID=1");
        check("rtsp://cam/a/", "/trackID=1", "rtsp://cam/a/trackID=1");
        check("rtsp://cam/a?ch=1", "track1", "rtsp://cam/a?ch=1/track1");
        check("rtsp://cam/a", "rtsp://other:8554/b", "rtsp://other:8554/b");
        check("rtsp://cam/a", "RTSP://other/b", "RTSP://other/b");
        check("rtsp://cam/a", "*", "rtsp://cam/a");
        assert_eq!(base([Some("192.168.0.9/a/"), None], "rtsp://cam/a"), "rtsp://cam/a");
        assert_eq!(base([None, Some(" rtsp://cam/b/")], "rtsp://cam/a"), "rtsp://cam/b/");
        assert_eq!(base([None, None], "rtsp://cam/a"), "rtsp://cam/a");
    }
}
