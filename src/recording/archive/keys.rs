//! The places where decoding a segment can begin, as the store keeps them.
//!
//! Differences in 7 bits a byte: an hour of key frames every second takes some 22 kB.

use crate::media::TICK_NANOS;
use videofields_vision::clock::Timestamp;

/// A cluster that begins with a key frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Key {
    /// Where the cluster begins in the file.
    pub offset: u64,
    /// The key frame's time, nanoseconds from the segment's first frame.
    pub nanos: i64,
}

/// Encodes keys in the order of the file.
pub(super) fn encode(keys: &[Key]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(6 * keys.len());
    let mut last = Key { offset: 0, nanos: 0 };
    for key in keys {
        put(key.offset.wrapping_sub(last.offset), &mut bytes);
        put(zigzag(key.nanos / TICK_NANOS - last.nanos / TICK_NANOS), &mut bytes);
        last = *key;
    }
    bytes
}

/// Reads what [`encode`] wrote; none where it is something else.
pub(super) fn decode(mut bytes: &[u8]) -> Option<Vec<Key>> {
    let (mut keys, mut offset, mut ticks) = (Vec::new(), 0_u64, 0_i64);
    while !bytes.is_empty() {
        offset = offset.checked_add(take(&mut bytes)?)?;
        ticks = ticks.checked_add(unzigzag(take(&mut bytes)?))?;
        keys.push(Key { offset, nanos: ticks.checked_mul(TICK_NANOS)? });
    }
    Some(keys)
}

/// The last key at or before `at` in a segment that begins at `first_at`; the first where all are later.
pub(super) fn before(keys: &[Key], first_at: Timestamp, at: Timestamp) -> Option<Key> {
    let nanos = at.nanos_since(first_at);
    keys.iter().rev().find(|key| key.nanos <= nanos).or_else(|| keys.first()).copied()
}

const fn zigzag(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)).cast_unsigned()
}

const fn unzigzag(number: u64) -> i64 {
    (number >> 1).cast_signed() ^ -((number & 1).cast_signed())
}

fn put(mut number: u64, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn take(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0_u64;
    for shift in (0..64).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(first & 0x7f).checked_shl(shift)?;
        if first & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_key_at_or_before_an_instant_is_found() {
        let keys =
            [(300, 0), (900, 5), (2000, 9)].map(|(offset, ticks)| Key { offset, nanos: ticks * TICK_NANOS });
        let first_at = Timestamp::from_nanos(7 * TICK_NANOS);
        let check = |ticks: i64, expected: u64| {
            let at = Timestamp::from_nanos(ticks * TICK_NANOS);
            assert_eq!(before(&keys, first_at, at).map(|key| key.offset), Some(expected), "{ticks}");
        };
        check(0, 300);
        check(7, 300);
        check(11, 300);
        check(12, 900);
        check(16, 2000);
        check(i64::MAX / TICK_NANOS, 2000);
        assert_eq!(before(&[], first_at, first_at), None);
    }

    #[test]
    fn an_hour_of_keys_takes_little() {
        let keys: Vec<_> =
            (0..3600).map(|i| Key { offset: 400 + i * 500_000, nanos: i as i64 * 1_000_100_000 }).collect();
        assert!(encode(&keys).len() <= 22_000, "{}", encode(&keys).len());
    }

    proptest! {
        #![proptest_config(super::super::tests::seeded(500))]
        #[test]
        fn what_was_encoded_is_decoded(
            steps in prop::collection::vec((1_u64..1 << 40, -(1_i64 << 40)..1 << 40), 0..30),
            noise in prop::collection::vec(any::<u8>(), 0..60),
        ) {
            let (mut offset, mut ticks, mut keys) = (0, 0, Vec::new());
            for (bytes, step) in steps {
                offset += bytes;
                ticks += step;
                keys.push(Key { offset, nanos: ticks * TICK_NANOS });
            }
            prop_assert_eq!(decode(&encode(&keys)), Some(keys));
            if let Some(keys) = decode(&noise) {
                prop_assert!(keys.len() <= noise.len());
            }
        }
    }
}
