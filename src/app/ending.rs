//! How a daemon's process ends.

use std::io::Write;

/// Ends the process at once with `status`, once everything that is to be kept has been written.
///
/// At an ordinary end the C library runs what libraries registered for it, and takes their data away: under the threads that a
/// daemon leaves with what they have in hand (a driver that draws, a decoder that waits for a camera), which then crash. They
/// end with the process here, and the status is the daemon's own.
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub fn leave(status: u8) -> ! {
    // Whom nobody reads any more cannot be told.
    drop(std::io::stdout().flush());
    // SAFETY: it takes a number and does not come back.
    unsafe { libc::_exit(i32::from(status)) }
}
