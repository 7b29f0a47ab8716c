//! Memory for pictures that the daemon makes, and that a worker fills.
//!
//! Its size is sealed before a worker gets it: neither side can make it shorter under the other's eyes. The worker may write into
//! it at any time, also into a picture that the daemon looks at: pixels then change, and nothing else hangs on them.

use super::message::Block;
use memmap2::{Mmap, MmapOptions, MmapRaw};
use rustix::fs::{FallocateFlags, MemfdFlags, SealFlags};
use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of a page; slots begin and end with one.
const PAGE_BYTES: u64 = 4096;

/// Bytes of a block, about, where slots are smaller than that.
const BLOCK_BYTES: u64 = 4 << 20;

/// Most slots of a block.
const MAX_SLOTS: u64 = 16;

/// Memory in the daemon.
#[derive(Debug)]
pub(super) struct MappedBlock {
    map: Mmap,
    pub(super) block: Block,
}

impl MappedBlock {
    /// Makes a block for pictures of `bytes` each; the file is the worker's.
    ///
    /// # Errors
    /// When the system has no memory or no descriptor.
    pub(super) fn make(id: u32, bytes: u64) -> io::Result<(Self, OwnedFd)> {
        let slot_bytes = bytes.max(1).next_multiple_of(PAGE_BYTES);
        let n_slots = (BLOCK_BYTES / slot_bytes).clamp(1, MAX_SLOTS);
        let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
        let make = |flags| rustix::fs::memfd_create("videofields-pictures", flags);
        // Kernels before 6.3 do not know that nothing there is ever a program.
        let file = make(flags | MemfdFlags::NOEXEC_SEAL).or_else(|_unknown| make(flags))?;
        rustix::fs::ftruncate(&file, slot_bytes * n_slots)?;
        rustix::fs::fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
        let map = map_readable(&file)?;
        Ok((Self { map, block: Block { id, slot_bytes, n_slots: n_slots as u32 } }, file))
    }

    /// Returns the bytes of a slot; none where there is no such slot.
    pub(super) fn slot(&self, slot: u32) -> Option<&[u8]> {
        let slot_bytes = usize::try_from(self.block.slot_bytes).ok()?;
        self.map.chunks_exact(slot_bytes).nth(usize::try_from(slot).ok()?)
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
pub(super) struct WritableBlock {
    map: MmapRaw,
    file: File,
    pub(super) block: Block,
    /// Slots that nothing is in.
    free: Mutex<Vec<u32>>,
}

/// A slot that is in use; it is free again when this is dropped.
#[derive(Debug)]
pub(super) struct Slot {
    owner: Arc<WritableBlock>,
    number: u32,
    on_free: OnFree,
}

/// Fate of a slot's memory once nothing is in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OnFree {
    /// It stays for the next picture.
    Keep,
    /// It goes back to the system.
    GiveBack,
}

impl WritableBlock {
    /// Takes a block that the daemon made.
    ///
    /// # Errors
    /// When the block is not as large as it should be, or cannot be mapped.
    pub(super) fn new(file: OwnedFd, block: Block) -> io::Result<Self> {
        let file = File::from(file);
        let expected = block.slot_bytes * u64::from(block.n_slots);
        if file.metadata()?.len() != expected {
            return Err(io::Error::other("the block has another size than was said"));
        }
        let map = MmapRaw::map_raw(&file)?;
        let free = Mutex::new((0..block.n_slots).rev().collect());
        Ok(Self { map, file, block, free })
    }

    /// Takes a free slot.
    pub(super) fn take(self: &Arc<Self>, on_free: OnFree) -> Option<Slot> {
        let number = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop()?;
        Some(Slot { owner: Arc::clone(self), number, on_free })
    }

    pub(super) fn is_free(&self) -> bool {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.len() == self.block.n_slots as usize
    }

    /// Returns the slot in which an address lies, and the bytes before it; none where it lies elsewhere.
    pub(super) fn find(&self, address: usize) -> Option<(u32, u32)> {
        let offset = address.checked_sub(self.map.as_ptr() as usize)?;
        if offset >= self.map.len() {
            return None;
        }
        let offset = offset as u64;
        let slot = u32::try_from(offset / self.block.slot_bytes).ok()?;
        Some((slot, u32::try_from(offset % self.block.slot_bytes).ok()?))
    }
}

impl Slot {
    pub(super) fn block(&self) -> u32 {
        self.owner.block.id
    }

    pub(super) const fn number(&self) -> u32 {
        self.number
    }
}

impl AsMut<[u8]> for Slot {
    #[expect(unsafe_code, reason = "memory that another process reads has no safe writer")]
    fn as_mut(&mut self) -> &mut [u8] {
        let slot_bytes = self.owner.block.slot_bytes as usize;
        let offset = self.number as usize * slot_bytes;
        // SAFETY: the slot lies within the map, which lives as long as this; nobody else in this process has this slot, since its
        // number was taken from the list of those that are free; the daemon only reads.
        unsafe { std::slice::from_raw_parts_mut(self.owner.map.as_mut_ptr().add(offset), slot_bytes) }
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let slot_bytes = self.owner.block.slot_bytes;
        if self.on_free == OnFree::GiveBack {
            let hole = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
            let offset = u64::from(self.number) * slot_bytes;
            if let Err(error) = rustix::fs::fallocate(&self.owner.file, hole, offset, slot_bytes) {
                // It is used again by the next picture.
                tracing::trace!(%error, "memory stays");
            }
        }
        self.owner.free.lock().unwrap_or_else(PoisonError::into_inner).push(self.number);
    }
}
