//! Room on the disk that owners share, so that nobody's files push out another's.
//!
//! In: what all take, what one owner's take of it, what went of the owner's already. Out: how much more may come. An owner with
//! few rights may take so many times as much as is left free, so that no number of them takes all and who comes next finds some
//! (dynamic thresholds, `[CH98]` Choudhury, Hahne 1998, Dynamic queue length thresholds for shared-memory packet switches). Whoever
//! has a full share goes on, in the room of the owner's oldest.

/// Times what is left free that a user's files may take, where that user is no admin.
pub const GREED: u64 = 3;

/// Part of the room that one owner's files may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// The whole room.
    All,
    /// Half of the room. An owner with more gives up two for one.
    Half,
    /// So many times as much as is left free. An owner with more gives up one for one.
    Free(u64),
}

/// Room for files, in bytes or in number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Most that all owners' files may take.
    pub max: u64,
    /// Sum of all owners' files.
    pub kept: u64,
    /// Sum of this owner's files.
    pub own: u64,
    /// Sum of this owner's files that were removed for the new one.
    pub freed: u64,
}

impl Room {
    /// Returns the most that a new file may take within a bound, or in the place of removed ones.
    #[must_use]
    pub fn left(self, bound: Bound) -> u64 {
        let Self { max, kept, own, freed } = self;
        let free = max.saturating_sub(kept);
        let of_share = match bound {
            Bound::All => free,
            Bound::Half => (max / 2).saturating_sub(own).max(freed / 2),
            // The most `n` for which own + n <= greed * (free - n).
            Bound::Free(greed) => {
                (greed.saturating_mul(free).saturating_sub(own) / greed.saturating_add(1)).max(freed)
            }
        };
        of_share.min(free)
    }

    /// Returns the room once all files of the owner were removed.
    #[must_use]
    pub const fn without_own(self) -> Self {
        Self {
            max: self.max,
            kept: self.kept.saturating_sub(self.own),
            own: 0,
            freed: self.freed.saturating_add(self.own),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn room(own: u64, others: u64, freed: u64) -> Room {
        Room { max: 100, kept: own + others, own, freed }
    }

    /// Returns what each owner has once all asked in turn until nobody gets more, and gave up nothing.
    fn filled(bounds: &[Bound]) -> Vec<u64> {
        let mut own = vec![0; bounds.len()];
        loop {
            let before = own.clone();
            for (idx, bound) in bounds.iter().enumerate() {
                let others = own.iter().sum::<u64>() - own[idx];
                own[idx] += u64::from(room(own[idx], others, 0).left(*bound) >= 1);
            }
            if own == before {
                return own;
            }
        }
    }

    #[test]
    fn users_leave_room_for_who_comes_next_and_admins_may_take_it() {
        assert_eq!(filled(&[Bound::All]), [100]);
        assert_eq!(filled(&[Bound::Half]), [50]);
        assert_eq!(filled(&[Bound::Free(3)]), [75]);
        assert_eq!(filled(&[Bound::Free(1)]), [50]);
        assert_eq!(filled(&[Bound::Free(3), Bound::Free(1)]), [50, 33]);
        let many: u64 = filled(&[Bound::Free(3); 10]).iter().sum();
        assert!((90..100).contains(&many), "{many}");
        assert_eq!(room(0, many, 0).left(Bound::All), 100 - many, "an admin finds what the others left");
        assert_eq!(room(20, 0, 0).left(Bound::Free(3)), 55, "all at once is as much as one by one");
    }

    #[test]
    fn whoever_has_a_full_share_or_more_replaces_and_never_grows() {
        // A database from before there were shares: one user has it all.
        for others in [0, 10] {
            let own = 100 - others;
            assert_eq!(room(own, others, 0).left(Bound::Free(3)), 0);
            assert_eq!(room(own - 4, others, 4).left(Bound::Free(3)), 4);
            assert_eq!(room(own - 4, others, 4).left(Bound::Half), 2, "it shrinks to its half");
        }
        // Nothing of one's own: others' never go.
        for bound in [Bound::All, Bound::Half, Bound::Free(3)] {
            assert_eq!(room(0, 100, 0).without_own().left(bound), 0);
            assert_eq!(room(0, 130, 0).left(bound), 0, "there is less room than there was");
        }
        assert_eq!(room(60, 40, 0).without_own(), room(0, 40, 60));
        assert_eq!(room(60, 40, 0).without_own().left(Bound::All), 60);
    }
}
