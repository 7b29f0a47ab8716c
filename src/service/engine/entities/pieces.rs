//! Times, divided among those who know of them.

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

/// Returns the parts of a time that are concluded at once, in order: they end where the clock has whole five minutes, so that it says
/// nothing which time was asked for.
pub(super) fn cut((from, to): Piece) -> impl Iterator<Item = Piece> {
    let mut next = Some(from);
    std::iter::from_fn(move || {
        let first = next.take().filter(|first| *first <= to)?;
        let (_, end) = around(Timestamp::from_nanos(first));
        let last = to.min(end);
        next = last.checked_add(1);
        Some((first, last))
    })
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
    fn a_time_is_cut_where_the_clock_has_whole_five_minutes() {
        let p = PIECE_NANOS;
        assert_eq!(cut((p - 5, p + 5)).collect::<Vec<_>>(), [(p - 5, p - 1), (p, p + 5)]);
        assert_eq!(cut((-1, 2 * p - 1)).collect::<Vec<_>>(), [(-1, -1), (0, p - 1), (p, 2 * p - 1)]);
        assert_eq!(cut((7, 7)).collect::<Vec<_>>(), [(7, 7)]);
        assert_eq!(cut((i64::MAX - 1, i64::MAX)).count(), 1);
        assert_eq!(around(Timestamp::from_nanos(p + 3)), (p, 2 * p - 1));
        assert_eq!(around(Timestamp::from_nanos(-3)), (-p, -1));
    }
}
