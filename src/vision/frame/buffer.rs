//! Bytes of a picture or a mask, whose memory goes round.
//!
//! A camera makes masks and small pictures with every frame, and others hold them for as long as they like. Large
//! allocations are the system's own (see `memory`), and cost a page fault every 4 KiB: what comes back is used again.

use std::fmt;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Buffers that were given back and wait to be used again.
#[derive(Debug)]
pub struct BufferPool {
    spare: Mutex<Vec<Vec<u8>>>,
    max_spare: usize,
}

/// Bytes that go back to the pool they came from, if that is still there.
pub struct Buffer {
    data: Vec<u8>,
    pool: Weak<BufferPool>,
}

impl BufferPool {
    /// A pool of which at most `max_spare` buffers wait; what comes back beyond that is freed.
    #[must_use]
    pub fn new(max_spare: usize) -> Arc<Self> {
        Arc::new(Self { spare: Mutex::new(Vec::with_capacity(max_spare)), max_spare })
    }

    /// `len` bytes, each `value`; of a spare buffer that has the room and not twice that, if there is one. Spare ones of
    /// other sizes go: pictures do not change their size often.
    #[must_use]
    pub fn filled(self: &Arc<Self>, len: usize, value: u8) -> Buffer {
        let mut data = self.spare_of(len);
        if data.capacity() == 0 {
            data = vec![value; len];
        } else {
            data.clear();
            data.resize(len, value);
        }
        Buffer { data, pool: Arc::downgrade(self) }
    }

    /// No bytes yet, and room for `len`; as [`Self::filled`].
    #[must_use]
    pub fn empty(self: &Arc<Self>, len: usize) -> Buffer {
        let mut data = self.spare_of(len);
        data.clear();
        data.reserve_exact(len);
        Buffer { data, pool: Arc::downgrade(self) }
    }

    fn spare_of(&self, len: usize) -> Vec<u8> {
        let mut spare = self.lock();
        spare.retain(|data| (len..=len.saturating_mul(2)).contains(&data.capacity()));
        spare.pop().unwrap_or_default()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Vec<u8>>> {
        // A panic leaves a list that is whole.
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl From<Vec<u8>> for Buffer {
    fn from(data: Vec<u8>) -> Self {
        Self { data, pool: Weak::new() }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let Some(pool) = self.pool.upgrade() else { return };
        let mut spare = pool.lock();
        if spare.len() < pool.max_spare {
            spare.push(std::mem::take(&mut self.data));
        }
    }
}

impl Deref for Buffer {
    type Target = Vec<u8>;

    fn deref(&self) -> &Vec<u8> {
        &self.data
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut Vec<u8> {
        &mut self.data
    }
}

impl AsRef<[u8]> for Buffer {
    fn as_ref(&self) -> &[u8] {
        &self.data
    }
}

impl FromIterator<u8> for Buffer {
    fn from_iter<I: IntoIterator<Item = u8>>(bytes: I) -> Self {
        Vec::from_iter(bytes).into()
    }
}

impl<'a> IntoIterator for &'a Buffer {
    type Item = &'a u8;
    type IntoIter = std::slice::Iter<'a, u8>;

    fn into_iter(self) -> Self::IntoIter {
        self.data.iter()
    }
}

impl<'a> IntoIterator for &'a mut Buffer {
    type Item = &'a mut u8;
    type IntoIter = std::slice::IterMut<'a, u8>;

    fn into_iter(self) -> Self::IntoIter {
        self.data.iter_mut()
    }
}

/// The copy belongs to no pool.
impl Clone for Buffer {
    fn clone(&self) -> Self {
        self.data.clone().into()
    }
}

impl PartialEq for Buffer {
    fn eq(&self, other: &Self) -> bool {
        self.data == other.data
    }
}

impl Eq for Buffer {}

impl fmt::Debug for Buffer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} bytes", self.data.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_back_is_used_again_and_as_good_as_new() {
        let pool = BufferPool::new(2);
        let mut first = pool.filled(1000, 7);
        let place = first.as_ptr();
        assert!(first.iter().all(|byte| *byte == 7));
        first[3] = 1;
        assert_eq!(first.clone(), first);
        drop(first);
        let second = pool.filled(1000, 9);
        assert_eq!((second.as_ptr(), second.len()), (place, 1000));
        assert!(second.iter().all(|byte| *byte == 9));
        drop(second);
        let smaller = pool.filled(600, 0);
        assert_eq!((smaller.as_ptr(), smaller.len()), (place, 600));
        assert!(smaller.iter().all(|byte| *byte == 0));
    }

    #[test]
    fn spare_buffers_are_few_and_of_the_size_that_is_asked_for() {
        let pool = BufferPool::new(2);
        let many: Vec<Buffer> = (0..5).map(|_| pool.filled(100, 0)).collect();
        drop(many);
        assert_eq!(pool.lock().len(), 2);
        let other = pool.filled(1000, 0);
        assert_eq!((other.len(), pool.lock().len()), (1000, 0));
        let empty = pool.filled(0, 0);
        assert!(empty.is_empty());
        // Whoever holds one longer than its pool lives frees it.
        drop(pool);
        assert_eq!(other.len(), 1000);
    }
}
