//! Decoders in a worker write their pictures into memory that the daemon made.

use super::channel::Sender;
use super::launch::leave;
use super::memory::{Freed, Place, Places};
use super::message::{FromWorker, Room};
use gst::glib;
use gst::glib::subclass::prelude::*;
use gst::glib::translate::IntoGlibPtr as _;
use gst::subclass::prelude::*;
use gstreamer as gst;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

/// All memory for pictures that a worker has.
#[derive(Debug)]
pub(super) struct Rooms {
    state: Mutex<State>,
    answered: Condvar,
    sender: Arc<Mutex<Sender>>,
    becomes: Freed,
}

#[derive(Debug, Default)]
struct State {
    rooms: Vec<Arc<Places>>,
    /// True while the daemon was asked and has not answered.
    is_asking: bool,
    n_answers: u64,
    /// True where the last answer was that there is no more.
    is_full: bool,
}

/// A place in the daemon's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub(super) room: u32,
    pub(super) place: u32,
    pub(super) offset: u32,
}

impl Rooms {
    pub(super) fn new(sender: Arc<Mutex<Sender>>, becomes: Freed) -> Self {
        Self { state: Mutex::default(), answered: Condvar::new(), sender, becomes }
    }

    /// Returns a place for `n_bytes`, after asking the daemon for more where all are in use; none where it has none.
    pub(super) fn place(&self, n_bytes: usize) -> Option<Place> {
        let n_bytes = n_bytes as u64;
        let mut state = self.lock();
        loop {
            let is_fit = |room: &Room| room.place_bytes >= n_bytes && room.place_bytes < n_bytes + (64 << 10);
            let fitting = state.rooms.iter().filter(|places| is_fit(&places.room));
            if let Some(place) = fitting.into_iter().find_map(|places| places.take(self.becomes)) {
                return Some(place);
            }
            if !state.is_asking {
                state.is_asking = true;
                // Pictures of another size are not coming back.
                let unused = state.rooms.extract_if(.., |places| !is_fit(&places.room) && places.is_free());
                for places in unused {
                    self.send(&FromWorker::Unmap(places.room.id));
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
    pub(super) fn answer(&self, memory: Option<(OwnedFd, Room)>) {
        let places = memory.and_then(|(file, room)| Places::new(file, room).ok());
        let mut state = self.lock();
        state.is_full = places.is_none();
        state.rooms.extend(places.map(Arc::new));
        state.is_asking = false;
        state.n_answers += 1;
        self.answered.notify_all();
    }

    /// Returns the place in which an address lies.
    pub(super) fn find(&self, address: usize) -> Option<Found> {
        self.lock().rooms.iter().find_map(|places| {
            let (place, offset) = places.find(address)?;
            Some(Found { room: places.room.id, place, offset })
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
    /// Gives `GStreamer` places in the daemon's memory.
    pub struct PictureAllocator(ObjectSubclass<imp::PictureAllocator>)
        @extends gst::Allocator, gst::Object;
}

impl PictureAllocator {
    pub(super) fn new(rooms: &Arc<Rooms>) -> Self {
        let allocator: Self = glib::Object::new();
        if allocator.imp().rooms.set(Arc::clone(rooms)).is_err() {
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
        pub(super) rooms: OnceLock<Arc<Rooms>>,
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
            let place = self.rooms.get().and_then(|rooms| rooms.place(n_bytes));
            let Some(place) = place else { return std::ptr::null_mut() };
            let mut memory = gst::Memory::from_mut_slice(place);
            if let Some(memory) = memory.get_mut() {
                memory.resize(params.prefix()..params.prefix() + size);
            }
            memory.into_glib_ptr()
        }
    }
}
