//! Puts packets that changed places back in order, by their numbers alone.
//!
//! `GStreamer`'s jitter buffer does that by time: what is behind its place in a picture that comes late counts as lost at once. A packet
//! that is missing follows within a few others, or not at all: over TCP the camera never sent it, over UDP it is lost.

use std::collections::VecDeque;

/// Most packets that wait for one before them.
const MAX_WAITING: usize = 8;

/// Farthest that a packet is ahead of the next one; those farther ahead follow a gap, or the camera counts anew.
const MAX_AHEAD: u16 = 16;

/// Farthest that a packet is behind the next one; those farther behind are of a camera that counts anew.
const MOST_BEHIND: u16 = 256;

/// Packets of one stream on their way into order.
#[derive(Debug, Default)]
pub(super) struct PacketOrder {
    /// Number of the next packet; none before the first.
    next: Option<u16>,
    /// Packets that came before one that is missing, by their numbers.
    waiting: VecDeque<(u16, Vec<u8>)>,
}

impl PacketOrder {
    /// Takes the next packet that came, and gives those whose turn it is to `take`. One that is late, twice there, or no packet goes on
    /// as it is.
    pub(super) fn push(&mut self, packet: Vec<u8>, mut take: impl FnMut(Vec<u8>)) {
        let Some(number) = number(&packet) else { return take(packet) };
        let ahead = number.wrapping_sub(self.next.unwrap_or(number));
        match ahead {
            0 => {
                take(packet);
                self.next = Some(number.wrapping_add(1));
                self.give_in_turn(take);
            }
            1..=MAX_AHEAD => {
                let of = |number: u16| number.wrapping_sub(self.next.unwrap_or(number));
                let place = self.waiting.partition_point(|(other, _)| of(*other) <= ahead);
                self.waiting.insert(place, (number, packet));
                if self.waiting.len() > MAX_WAITING {
                    self.next = self.waiting.front().map(|(number, _)| *number);
                    self.give_in_turn(take);
                }
            }
            // Behind its turn.
            ahead if ahead >= MOST_BEHIND.wrapping_neg() => take(packet),
            _ => {
                self.flush(&mut take);
                take(packet);
                self.next = Some(number.wrapping_add(1));
            }
        }
    }

    /// Gives all that wait to `take`: no more packets come.
    pub(super) fn flush(&mut self, mut take: impl FnMut(Vec<u8>)) {
        for (number, packet) in self.waiting.drain(..) {
            take(packet);
            self.next = Some(number.wrapping_add(1));
        }
    }

    /// Returns true where packets wait for one before them.
    pub(super) fn has_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    fn give_in_turn(&mut self, mut take: impl FnMut(Vec<u8>)) {
        let mut next = self.next;
        while let Some((number, packet)) = self.waiting.pop_front() {
            let ahead = number.wrapping_sub(next.unwrap_or(number));
            // One that is there twice goes on twice.
            if ahead != 0 && ahead < 0x8000 {
                self.waiting.push_front((number, packet));
                break;
            }
            take(packet);
            next = Some(number.wrapping_add(1));
        }
        self.next = next;
    }
}

/// Returns the number of a packet (RFC 3550, 5.1).
fn number(packet: &[u8]) -> Option<u16> {
    Some(u16::from_be_bytes([*packet.get(2)?, *packet.get(3)?]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(number: u16) -> Vec<u8> {
        [&[0x80, 96][..], &number.to_be_bytes(), &[0; 8]].concat()
    }

    /// Returns the numbers in the order in which they go on, and how many had gone on after each.
    fn ordered(numbers: &[u16]) -> (Vec<u16>, Vec<usize>) {
        let (mut order, mut out, mut n_out) = (PacketOrder::default(), Vec::new(), Vec::new());
        for of in numbers {
            order.push(packet(*of), |packet| out.push(number(&packet).unwrap()));
            n_out.push(out.len());
        }
        order.flush(|packet| out.push(number(&packet).unwrap()));
        (out, n_out)
    }

    #[test]
    fn packets_that_changed_places_are_put_back_and_others_do_not_wait() {
        assert_eq!(ordered(&[7, 8, 9]), (vec![7, 8, 9], vec![1, 2, 3]));
        assert_eq!(ordered(&[7, 9, 8, 10]), (vec![7, 8, 9, 10], vec![1, 1, 3, 4]));
        assert_eq!(ordered(&[7, 10, 9, 8, 11]), (vec![7, 8, 9, 10, 11], vec![1, 1, 1, 4, 5]));
        let around = [65_534, 0, 65_535, 1];
        assert_eq!(ordered(&around).0, [65_534, 65_535, 0, 1]);
    }

    #[test]
    fn one_that_never_comes_holds_up_eight_at_most() {
        let numbers: Vec<u16> = [7].into_iter().chain(9..20).collect();
        let (out, n_out) = ordered(&numbers);
        assert_eq!(out, numbers);
        assert_eq!(n_out[..11], [1, 1, 1, 1, 1, 1, 1, 1, 1, 10, 11]);
        // It comes after all.
        let late: Vec<u16> = numbers.iter().copied().chain([8, 20]).collect();
        assert_eq!(ordered(&late).0, late);
    }

    #[test]
    fn gaps_and_cameras_that_count_anew_do_not_wait() {
        assert_eq!(ordered(&[7, 9, 40, 41]), (vec![7, 9, 40, 41], vec![1, 1, 3, 4]));
        assert_eq!(ordered(&[7, 8, 3, 4, 9]), (vec![7, 8, 3, 4, 9], vec![1, 2, 3, 4, 5]), "late, or again");
        assert_eq!(ordered(&[40_000, 5, 6]).0, [40_000, 5, 6]);
        assert_eq!(ordered(&[30_000, 30_002, 100, 102, 101, 103]).0, [30_000, 30_002, 100, 101, 102, 103]);
        assert_eq!(ordered(&[7, 9, 9, 8, 10]).0, [7, 8, 9, 9, 10], "twice there");
    }

    #[test]
    fn what_is_no_packet_goes_on_and_what_waits_comes_at_the_end() {
        let mut order = PacketOrder::default();
        let mut out = Vec::new();
        for bytes in [packet(1), packet(3), vec![0x80]] {
            order.push(bytes, |packet| out.push(packet));
        }
        assert_eq!(out, [packet(1), vec![0x80]]);
        order.flush(|packet| out.push(packet));
        assert_eq!(out[2], packet(3));
    }
}
