//! Memory that was freed, given back to the system.

/// Gives back what the C library keeps of freed memory, in whole pages; some milliseconds where that is much.
///
/// Decoders allocate a picture of a megabyte or more at a time from many threads, each of which has a heap of its own.
/// What they free stays there for the next: after a while of looking back several times what is in use.
#[cfg(target_env = "gnu")]
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub fn give_back() {
    // SAFETY: it takes each heap's lock itself and moves nothing that is in use.
    unsafe { libc::malloc_trim(0) };
}

/// Other C libraries have no such call, or need none.
#[cfg(not(target_env = "gnu"))]
pub const fn give_back() {}
