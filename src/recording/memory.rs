//! How the C library keeps memory.

/// Bytes from which on every allocation is the system's own, and goes back to it as soon as it is freed. Pictures from about
/// 640 x 270 on are larger.
#[cfg(target_env = "gnu")]
const LARGE_BYTES: i32 = 256 << 10;

/// Fewest and most heaps. Threads beyond these share them.
#[cfg(target_env = "gnu")]
const N_HEAPS: std::ops::RangeInclusive<usize> = 2..=32;

/// Sets how the C library keeps memory; to be called before there are threads.
///
/// Large allocations are made by the system, always. Left to itself the C library takes them from its heaps once some were
/// freed, where what is still in use keeps apart what is free: after a while of looking back, several times what is in use.
///
/// There are as many heaps as processors (two at least, 32 at most), whatever `MALLOC_ARENA_MAX` says. Left to itself the C library makes
/// eight for each processor, and every one keeps as much as was ever in use of it at once: a flood of requests that reaches more and more
/// threads makes the sum grow for minutes.
#[cfg(target_env = "gnu")]
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub fn settle() {
    let n_processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let n_heaps = n_processors.clamp(*N_HEAPS.start(), *N_HEAPS.end()) as i32;
    for (setting, number) in [(libc::M_MMAP_THRESHOLD, LARGE_BYTES), (libc::M_ARENA_MAX, n_heaps)] {
        // SAFETY: it sets a number, under its own lock.
        let is_set = unsafe { libc::mallopt(setting, number) } == 1;
        debug_assert!(is_set, "the number is in range");
    }
}

/// Other C libraries have no such setting, or need none.
#[cfg(not(target_env = "gnu"))]
pub const fn settle() {}

/// Gives back what the C library keeps of freed memory, in whole pages; some milliseconds where that is much.
///
/// Decoders allocate from many threads, and what they free stays in the heaps for the next.
#[cfg(target_env = "gnu")]
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub fn give_back() {
    // SAFETY: it takes each heap's lock itself and moves nothing that is in use.
    unsafe { libc::malloc_trim(0) };
}

/// Other C libraries have no such call, or need none.
#[cfg(not(target_env = "gnu"))]
pub const fn give_back() {}
