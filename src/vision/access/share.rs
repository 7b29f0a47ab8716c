//! The share that one of several callers gets of what there is little of.
//!
//! One caller may hold so many times as many as are left free: it alone never gets all, and who comes next finds some, without anybody
//! being told of the others (dynamic thresholds, `[CH98]` Choudhury, Hahne 1998, Dynamic queue length thresholds for shared-memory
//! packet switches). Many callers together can still take all.

/// The rule by which callers share a number of places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    n_places: usize,
    greed: usize,
}

/// The reason why a caller gets nothing more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Full {
    /// All places, so many, are taken.
    All(usize),
    /// The caller holds so many, which is its share.
    Own(usize),
}

impl Share {
    /// Returns the rule for so many places, of which one caller may hold up to `greed` for each that is free.
    #[must_use]
    pub const fn new(n_places: usize, greed: usize) -> Self {
        Self { n_places, greed }
    }

    /// Refuses a place where all are taken, or where the caller holds its share; of one whom nothing tells apart (`n_own` is none)
    /// nothing else is asked.
    ///
    /// # Errors
    /// When there is none for this caller.
    pub fn check(&self, n_taken: usize, n_own: Option<usize>) -> Result<(), Full> {
        self.check_many(n_taken, n_own, 1)
    }

    /// Refuses so many places at once, as [`Self::check`] would refuse the last of them; who holds none yet gets as many as are free.
    ///
    /// # Errors
    /// When there are not as many for this caller.
    pub fn check_many(&self, n_taken: usize, n_own: Option<usize>, n_more: usize) -> Result<(), Full> {
        let n_free = self.n_places.saturating_sub(n_taken);
        let Some(n_left) = n_free.checked_sub(n_more) else { return Err(Full::All(self.n_places)) };
        match n_own {
            Some(n_own) if n_own > 0 && n_own + n_more > self.greed.saturating_mul(n_left + 1) => {
                Err(Full::Own(n_own))
            }
            _ => Ok(()),
        }
    }
}

impl Full {
    /// Returns it in words: `what` there is, such as "streams are running", and `whose` a share is, such as "of this user".
    #[must_use]
    pub fn told(self, what: &str, whose: &str) -> String {
        match self {
            Self::All(n_all) => format!("{n_all} {what} already"),
            Self::Own(n_own) => format!("{n_own} {what} already {whose}, which is their share"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_caller_gets_its_share_and_all_are_bounded() {
        let share = Share::new(12, 1);
        assert_eq!(share.check(5, Some(5)), Ok(()));
        assert_eq!(share.check(6, Some(6)), Err(Full::Own(6)));
        assert_eq!(share.check(6, Some(0)), Ok(()));
        assert_eq!(share.check(6, None), Ok(()));
        assert_eq!(share.check(12, Some(0)), Err(Full::All(12)));
        assert_eq!(share.check(13, None), Err(Full::All(12)), "of more than there may be");
        assert_eq!(Share::new(12, 3).check(8, Some(8)), Ok(()));
        assert_eq!(Share::new(12, 3).check(9, Some(9)), Err(Full::Own(9)));
    }

    #[test]
    fn many_places_at_once_are_as_many_one_after_the_other() {
        for (n_places, greed) in [(12, 1), (13, 3), (2, 1)] {
            let share = Share::new(n_places, greed);
            for (n_others, n_own) in
                (0..n_places).flat_map(|others| (1..=n_places).map(move |own| (others, own)))
            {
                let taken = n_others + n_own;
                for n_more in 1..4 {
                    let each = (0..n_more).all(|idx| share.check(taken + idx, Some(n_own + idx)).is_ok());
                    let at_once = share.check_many(taken, Some(n_own), n_more).is_ok();
                    assert_eq!(each, at_once, "{share:?}: {n_own} of {taken}, and {n_more} more");
                }
            }
        }
        assert_eq!(Share::new(12, 1).check_many(1, Some(0), 11), Ok(()), "what is large comes too, alone");
        assert_eq!(Share::new(12, 1).check_many(2, Some(0), 11), Err(Full::All(12)));
    }
}
