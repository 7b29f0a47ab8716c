//! Decoders in a worker write their pictures into memory that the daemon made.

use super::channel::Sender;
use super::launch::leave;
use super::memory::{OnFree, Slot, WritableBlock};
use super::message::{Block, FromWorker};
use gst::glib;
use gst::glib::subclass::prelude::*;
use gst::glib::translate::IntoGlibPtr as _;
use gst::subclass::prelude::*;
use gstreamer as gst;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

/// All memory for pictures that a worker has.
#[derive(Debug)]
pub(super) struct SlotPool {
    state: Mutex<State>,
    answered: Condvar,
    sender: Arc<Mutex<Sender>>,
    on_free: OnFree,
}

#[derive(Debug, Default)]
struct State {
    blocks: Vec<Arc<WritableBlock>>,
    /// True while the daemon was asked and has not answered.
    is_asking: bool,
    n_answers: u64,
    /// True where the last answer was that there is no more.
    is_full: bool,
}

/// A slot in the daemon's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SlotAddress {
    pub(super) block: u32,
    pub(super) slot: u32,
    pub(super) offset: u32,
}

impl SlotPool {
    pub(super) fn new(sender: Arc<Mutex<Sender>>, on_free: OnFree) -> Self {
        Self { state: Mutex::default(), answered: Condvar::new(), sender, on_free }
    }

    /// Returns a slot for `n_bytes`, after asking the daemon for more where all are in use; none where it has none.
    pub(super) fn take(&self, n_bytes: usize) -> Option<Slot> {
        let n_bytes = n_bytes as u64;
        let mut state = self.lock();
        loop {
            let is_fit =
                |block: &Block| block.slot_bytes >= n_bytes && block.slot_bytes < n_bytes + (64 << 10);
            let fitting = state.blocks.iter().filter(|block| is_fit(&block.block));
            if let Some(slot) = fitting.into_iter().find_map(|block| block.take(self.on_free)) {
                return Some(slot);
            }
            if !state.is_asking {
                state.is_asking = true;
                // Pictures of another size are not coming back.
                let unused = state.blocks.extract_if(.., |block| !is_fit(&block.block) && block.is_free());
                for block in unused {
                    self.send(&FromWorker::Unmap(block.block.id));
                }
                self.send(&FromWorker::NeedMemory(n_bytes));
            }
            let n_answers = state.n_answers;
            while state.n_answers == n_answers {
                state = self.answered.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            if state.is_full {
                return None;
            }
        }
    }

    /// Takes the daemon's answer.
    pub(super) fn answer(&self, memory: Option<(OwnedFd, Block)>) {
        let block = memory.and_then(|(file, block)| WritableBlock::new(file, block).ok());
        let mut state = self.lock();
        state.is_full = block.is_none();
        state.blocks.extend(block.map(Arc::new));
        state.is_asking = false;
        state.n_answers += 1;
        self.answered.notify_all();
    }

    /// Returns the slot in which an address lies.
    pub(super) fn find(&self, address: usize) -> Option<SlotAddress> {
        self.lock().blocks.iter().find_map(|block| {
            let (slot, offset) = block.find(address)?;
            Some(SlotAddress { block: block.block.id, slot, offset })
        })
    }

    fn send(&self, message: &FromWorker) {
        let sent = self.sender.lock().unwrap_or_else(PoisonError::into_inner).send(message, &[], None);
        if sent.is_err() {
            // Without the daemon there is nothing to do.
            leave(0);
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

glib::wrapper! {
    /// Gives `GStreamer` slots in the daemon's memory.
    pub struct PictureAllocator(ObjectSubclass<imp::PictureAllocator>)
        @extends gst::Allocator, gst::Object;
}

impl PictureAllocator {
    pub(super) fn new(slots: &Arc<SlotPool>) -> Self {
        let allocator: Self = glib::Object::new();
        if allocator.imp().slots.set(Arc::clone(slots)).is_err() {
            unreachable!("an allocator that was just made has no memory yet");
        }
        allocator
    }
}

mod imp {
    use super::*;

    /// Holds the memory of [`super::PictureAllocator`].
    #[derive(Debug, Default)]
    pub struct PictureAllocator {
        pub(super) slots: OnceLock<Arc<SlotPool>>,
    }

    #[glib::object_subclass]
    impl ObjectSubclass for PictureAllocator {
        const NAME: &'static str = "VideofieldsPictureAllocator";
        type Type = super::PictureAllocator;
        type ParentType = gst::Allocator;
    }

    impl ObjectImpl for PictureAllocator {}
    impl GstObjectImpl for PictureAllocator {}

    #[expect(unsafe_code, reason = "nothing safe makes an allocator")]
    // SAFETY: the memory given back is one that the library made, or none, which says that there is none; freeing is the library's.
    unsafe impl AllocatorImpl for PictureAllocator {
        unsafe fn alloc(&self, size: usize, params: &gst::AllocationParams) -> *mut gst::ffi::GstMemory {
            let n_bytes = size.saturating_add(params.prefix()).saturating_add(params.padding());
            let slot = self.slots.get().and_then(|slots| slots.take(n_bytes));
            let Some(slot) = slot else { return std::ptr::null_mut() };
            let mut memory = gst::Memory::from_mut_slice(slot);
            if let Some(memory) = memory.get_mut() {
                memory.resize(params.prefix()..params.prefix() + size);
            }
            memory.into_glib_ptr()
        }
    }
}
