//! RTP and RTCP packets of one stream, as they come over the wire.
//!
//! Cameras change their SSRC at each group of pictures, send the first packets with another, or announce one and use
//! another. There is one stream in a session here, so whatever of its payload type comes is it: its packets get one SSRC
//! before `GStreamer` sees them, which would take each for a stream of its own. RFC 3550, 5.1 and 6.

/// The SSRC that the stream has behind this place.
const SSRC: [u8; 4] = *b"vfld";

/// Bytes of an RTP header without extensions.
const HEADER_BYTES: usize = 12;

const SENDER_REPORT: u8 = 200;
const RECEIVER_REPORT: u8 = 201;
const SOURCE_DESCRIPTION: u8 = 202;

/// A packet of the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A piece of a picture.
    Rtp,
    /// Report of the camera's clock.
    SenderReport,
    /// Anything else: another stream's, another report.
    Other,
}

/// Returns whether bytes may be an RTP or an RTCP packet: both begin with the version, 2.
pub(super) fn is_packet(bytes: &[u8]) -> bool {
    bytes.first().is_some_and(|first| first >> 6 == 2)
}

/// Gives a packet of the stream with that payload type the one SSRC, and tells what it is. Of a compound of reports the
/// sender's alone is left.
pub(super) fn unify(packet: &mut Vec<u8>, payload_type: u8) -> Kind {
    if !is_packet(packet) || packet.len() < 8 {
        return Kind::Other;
    }
    // Payload types from 64 on cannot be told from reports where both come on one channel (RFC 5761).
    let is_report = (192..=223).contains(&packet[1]);
    if is_report {
        if packet[1] != SENDER_REPORT || packet.len() < 28 {
            return Kind::Other;
        }
        let n_bytes = 4 * (usize::from(u16::from_be_bytes([packet[2], packet[3]])) + 1);
        if n_bytes < 28 || n_bytes > packet.len() {
            return Kind::Other;
        }
        packet.truncate(n_bytes);
        packet[4..8].copy_from_slice(&SSRC);
        return Kind::SenderReport;
    }
    if packet.len() < HEADER_BYTES || packet[1] & 127 != payload_type {
        return Kind::Other;
    }
    packet[8..12].copy_from_slice(&SSRC);
    Kind::Rtp
}

/// Returns a receiver's report without a word on what was received, and who says it: a sign of life.
pub(super) fn sign_of_life() -> Vec<u8> {
    const NAME: &[u8] = b"videofields";
    let mut bytes = vec![0x80, RECEIVER_REPORT, 0, 1];
    bytes.extend(SSRC.map(|byte| !byte));
    // One chunk: SSRC, a canonical name, and zeros to the next multiple of four.
    let mut chunk = SSRC.map(|byte| !byte).to_vec();
    chunk.extend([1, NAME.len() as u8]);
    chunk.extend(NAME);
    chunk.resize((chunk.len() + 1).next_multiple_of(4), 0);
    bytes.extend([0x81, SOURCE_DESCRIPTION, 0, (chunk.len() / 4) as u8]);
    bytes.extend(chunk);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rtp(payload_type: u8, ssrc: u8) -> Vec<u8> {
        vec![0x80, payload_type, 0, 1, 0, 0, 0, 2, ssrc, ssrc, ssrc, ssrc, 9, 9]
    }

    fn report(kind: u8, n_words: u8) -> Vec<u8> {
        let mut bytes = vec![0x80, kind, 0, n_words];
        bytes.resize(4 * (usize::from(n_words) + 1), 7);
        bytes
    }

    #[test]
    fn packets_of_the_stream_have_one_ssrc_whatever_they_came_with() {
        for ssrc in [1, 2] {
            for marker in [0, 128] {
                let mut packet = rtp(96 | marker, ssrc);
                assert_eq!(unify(&mut packet, 96), Kind::Rtp);
                assert_eq!((&packet[8..12], &packet[12..], packet[1]), (&SSRC[..], &[9, 9][..], 96 | marker));
            }
        }
        let mut report_and_name = report(SENDER_REPORT, 6);
        report_and_name.extend(report(SOURCE_DESCRIPTION, 3));
        assert_eq!(unify(&mut report_and_name, 96), Kind::SenderReport);
        assert_eq!((report_and_name.len(), &report_and_name[4..8], report_and_name[8]), (28, &SSRC[..], 7));
    }

    #[test]
    fn all_else_is_left_out() {
        let cut = report(SENDER_REPORT, 6)[..24].to_vec();
        let short = report(SENDER_REPORT, 5);
        let long = [&[0x80, SENDER_REPORT, 1, 0][..], &[0; 30]].concat();
        let other_version = [&[0x40, 96][..], &[0; 20]].concat();
        let goodbye = report(203, 1);
        for mut packet in [
            Vec::new(),
            vec![0x80],
            rtp(97, 1),
            rtp(96, 1)[..11].to_vec(),
            cut,
            short,
            long,
            other_version,
            goodbye,
        ] {
            let before = packet.clone();
            assert_eq!(unify(&mut packet, 96), Kind::Other, "{before:?}");
            assert_eq!(packet, before);
        }
    }

    #[test]
    fn a_sign_of_life_is_a_compound_of_whole_words() {
        let bytes = sign_of_life();
        let n_first = 4 * (usize::from(bytes[3]) + 1);
        let n_second = 4 * (usize::from(bytes[n_first + 3]) + 1);
        assert_eq!(
            (bytes[1], bytes[n_first + 1], n_first + n_second),
            (RECEIVER_REPORT, SOURCE_DESCRIPTION, bytes.len())
        );
        assert_eq!(bytes.last(), Some(&0), "a chunk ends with a zero");
    }
}
