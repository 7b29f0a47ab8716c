//! Divides times among the spans that know of them.

use videofields_recording::store::EntitySpan;
use videofields_vision::clock::Timestamp;

/// Time that is concluded at once, where it is not known yet who was where.
const PIECE_NANOS: i64 = 300_000_000_000;

/// Time from one instant to another, both of them included, nanoseconds since 1970.
pub(super) type Piece = (i64, i64);

/// Divides a time among spans, the one that counts first, and returns what falls to each of them, and what to none, in order.
pub(super) fn divide(
    (from, to): (Timestamp, Timestamp),
    spans: &[EntitySpan],
) -> (Vec<(i64, Piece)>, Vec<Piece>) {
    let mut left: Vec<Piece> = vec![(from.as_nanos(), to.as_nanos())];
    let mut known = Vec::new();
    for span in spans {
        let (began, ended) = (span.began_at.as_nanos(), span.ended_at.as_nanos());
        let mut next = Vec::with_capacity(left.len() + 1);
        for (from, to) in left {
            let (first, last) = (from.max(began), to.min(ended));
            if first > last {
                next.push((from, to));
                continue;
            }
            known.push((span.id, (first, last)));
            if from < first {
                next.push((from, first - 1));
            }
            if last < to {
                next.push((last + 1, to));
            }
        }
        left = next;
    }
    known.sort_by_key(|(_, piece)| *piece);
    (known, left)
}

/// Returns the whole five minutes that an instant lies in.
pub(super) fn around(instant: Timestamp) -> Piece {
    let past = instant.as_nanos().rem_euclid(PIECE_NANOS);
    let first = instant.as_nanos().saturating_sub(past);
    // Beyond the ends of what an instant can say, there is less.
    (first, instant.as_nanos().saturating_add(PIECE_NANOS - 1 - past))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(id: i64, began: i64, ended: i64) -> EntitySpan {
        let [began_at, ended_at] = [began, ended].map(Timestamp::from_nanos);
        EntitySpan { id, began_at, ended_at }
    }

    fn divided(spans: &[EntitySpan]) -> (Vec<(i64, Piece)>, Vec<Piece>) {
        divide((Timestamp::from_nanos(0), Timestamp::from_nanos(99)), spans)
    }

    #[test]
    fn the_first_span_has_all_of_its_time_and_others_what_is_left() {
        assert_eq!(divided(&[]), (vec![], vec![(0, 99)]));
        assert_eq!(divided(&[span(1, -9, 200)]), (vec![(1, (0, 99))], vec![]));
        let (known, left) = divided(&[span(3, 40, 49), span(2, 10, 60), span(1, 0, 10)]);
        assert_eq!(known, [(1, (0, 9)), (2, (10, 39)), (3, (40, 49)), (2, (50, 60))]);
        assert_eq!(left, [(61, 99)]);
        assert_eq!(divided(&[span(1, 100, 200), span(2, -9, -1)]), (vec![], vec![(0, 99)]));
        assert_eq!(divided(&[span(1, 99, 200), span(2, -9, 0)]).1, [(1, 98)]);
    }

    #[test]
    fn five_minutes_are_the_clock_s() {
        let p = PIECE_NANOS;
        assert_eq!(around(Timestamp::from_nanos(p + 3)), (p, 2 * p - 1));
        assert_eq!(around(Timestamp::from_nanos(p)), (p, 2 * p - 1));
        assert_eq!(around(Timestamp::from_nanos(-3)), (-p, -1));
        let (first, last) = around(Timestamp::from_nanos(i64::MAX));
        assert!(last == i64::MAX && last - first < p);
        let (first, last) = around(Timestamp::from_nanos(i64::MIN));
        assert!(first == i64::MIN && last - first < p);
    }
}
