//! How the C library keeps memory.

/// Bytes from which on every allocation is the system's own, and goes back to it as soon as it is freed. Pictures from about
/// 640 x 270 on are larger.
#[cfg(target_env = "gnu")]
const LARGE_BYTES: i32 = 256 << 10;

/// Has large allocations made by the system, always. Left to itself the C library takes them from its heaps once some were
/// freed, where what is still in use keeps apart what is free: after a while of looking back, several times what is in use.
#[cfg(target_env = "gnu")]
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub fn settle() {
    // SAFETY: it sets a number, under its own lock.
    let is_set = unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BYTES) } == 1;
    debug_assert!(is_set, "the threshold is in range");
}

/// Other C libraries have no such setting, or need none.
#[cfg(not(target_env = "gnu"))]
pub const fn settle() {}

/// Gives back what the C library keeps of freed memory, in whole pages; some milliseconds where that is much.
///
/// Decoders allocate from many threads, each of which has a heap of its own, and what they free stays there for the next.
#[cfg(target_env = "gnu")]
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub fn give_back() {
    // SAFETY: it takes each heap's lock itself and moves nothing that is in use.
    unsafe { libc::malloc_trim(0) };
}

/// Other C libraries have no such call, or need none.
#[cfg(not(target_env = "gnu"))]
pub const fn give_back() {}
