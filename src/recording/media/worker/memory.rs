//! Memory for pictures that the daemon makes, and that a worker fills.
//!
//! Its size is sealed before a worker gets it: neither side can make it shorter under the other's eyes. The worker may write into
//! it at any time, also into a picture that the daemon looks at: pixels then change, and nothing else hangs on them.

use super::message::Room;
use memmap2::{Mmap, MmapOptions, MmapRaw};
use rustix::fs::{FallocateFlags, MemfdFlags, SealFlags};
use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of a page; places begin and end with one.
const PAGE_BYTES: u64 = 4096;

/// Bytes of a room, about, where places are smaller than that.
const ROOM_BYTES: u64 = 4 << 20;

/// Most places of a room.
const MAX_PLACES: u64 = 16;

/// Memory in the daemon.
#[derive(Debug)]
pub(super) struct Pictures {
    map: Mmap,
    pub(super) room: Room,
}

impl Pictures {
    /// Makes a room for pictures of `bytes` each; the file is the worker's.
    ///
    /// # Errors
    /// When the system has no memory or no descriptor.
    pub(super) fn make(id: u32, bytes: u64) -> io::Result<(Self, OwnedFd)> {
        let place_bytes = bytes.max(1).next_multiple_of(PAGE_BYTES);
        let n_places = (ROOM_BYTES / place_bytes).clamp(1, MAX_PLACES);
        let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
        let make = |flags| rustix::fs::memfd_create("videofields-pictures", flags);
        // Kernels before 6.3 do not know that nothing there is ever a program.
        let file = make(flags | MemfdFlags::NOEXEC_SEAL).or_else(|_unknown| make(flags))?;
        rustix::fs::ftruncate(&file, place_bytes * n_places)?;
        rustix::fs::fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
        let map = map_readable(&file)?;
        Ok((Self { map, room: Room { id, place_bytes, n_places: n_places as u32 } }, file))
    }

    /// Returns the bytes of a place; none where there is no such place.
    pub(super) fn place(&self, place: u32) -> Option<&[u8]> {
        let place_bytes = usize::try_from(self.room.place_bytes).ok()?;
        self.map.chunks_exact(place_bytes).nth(usize::try_from(place).ok()?)
    }

    pub(super) fn len_bytes(&self) -> u64 {
        self.map.len() as u64
    }
}

#[expect(unsafe_code, reason = "memory that another process writes has no safe reader")]
fn map_readable(file: &OwnedFd) -> io::Result<Mmap> {
    // SAFETY: the file cannot become shorter. Another process may write to what is read as numbers from 0 to 255, which any
    // value is one of; no length and no index is ever taken from there.
    unsafe { MmapOptions::new().map(file) }
}

/// Memory in a worker.
#[derive(Debug)]
pub(super) struct Places {
    map: MmapRaw,
    file: File,
    pub(super) room: Room,
    /// Places that nothing is in.
    free: Mutex<Vec<u32>>,
}

/// A place that is in use; it is free again when this is dropped.
#[derive(Debug)]
pub(super) struct Place {
    places: Arc<Places>,
    number: u32,
    becomes: Freed,
}

/// Fate of a place's memory once nothing is in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freed {
    /// It stays for the next picture.
    Kept,
    /// It goes back to the system.
    GivenBack,
}

impl Places {
    /// Takes a room that the daemon made.
    ///
    /// # Errors
    /// When the room is not as large as it should be, or cannot be mapped.
    pub(super) fn new(file: OwnedFd, room: Room) -> io::Result<Self> {
        let file = File::from(file);
        let expected = room.place_bytes * u64::from(room.n_places);
        if file.metadata()?.len() != expected {
            return Err(io::Error::other("the room has another size than was said"));
        }
        let map = MmapRaw::map_raw(&file)?;
        let free = Mutex::new((0..room.n_places).rev().collect());
        Ok(Self { map, file, room, free })
    }

    /// Takes a free place.
    pub(super) fn take(self: &Arc<Self>, becomes: Freed) -> Option<Place> {
        let number = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop()?;
        Some(Place { places: Arc::clone(self), number, becomes })
    }

    pub(super) fn is_free(&self) -> bool {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.len() == self.room.n_places as usize
    }

    /// Returns the place in which an address lies, and the bytes before it; none where it lies elsewhere.
    pub(super) fn find(&self, address: usize) -> Option<(u32, u32)> {
        let offset = address.checked_sub(self.map.as_ptr() as usize)?;
        if offset >= self.map.len() {
            return None;
        }
        let offset = offset as u64;
        let place = u32::try_from(offset / self.room.place_bytes).ok()?;
        Some((place, u32::try_from(offset % self.room.place_bytes).ok()?))
    }
}

impl Place {
    pub(super) fn room(&self) -> u32 {
        self.places.room.id
    }

    pub(super) const fn number(&self) -> u32 {
        self.number
    }
}

impl AsMut<[u8]> for Place {
    #[expect(unsafe_code, reason = "memory that another process reads has no safe writer")]
    fn as_mut(&mut self) -> &mut [u8] {
        let place_bytes = self.places.room.place_bytes as usize;
        let offset = self.number as usize * place_bytes;
        // SAFETY: the place lies within the map, which lives as long as this; nobody else in this process has this place, since its
        // number was taken from the list of those that are free; the daemon only reads.
        unsafe { std::slice::from_raw_parts_mut(self.places.map.as_mut_ptr().add(offset), place_bytes) }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let place_bytes = self.places.room.place_bytes;
        if self.becomes == Freed::GivenBack {
            let hole = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
            let offset = u64::from(self.number) * place_bytes;
            if let Err(error) = rustix::fs::fallocate(&self.places.file, hole, offset, place_bytes) {
                // It is used again by the next picture.
                tracing::trace!(%error, "memory stays");
            }
        }
        self.places.free.lock().unwrap_or_else(PoisonError::into_inner).push(self.number);
    }
}
