//! Lowers the priority of what works long and may wait, so that what is live comes first.

use rustix::process::{Pid, getpriority_process, setpriority_pgrp, setpriority_process};

/// Steps of niceness by which it is lowered: a processor that is asked for by both gives a tenth of its time to what is lowered.
const STEPS: i32 = 10;

/// Lowers the priority of the thread that calls this, for good.
pub fn lower_thread() {
    // Linux keeps a priority for each thread, and takes no process for the one that calls.
    let lowered =
        getpriority_process(None).and_then(|now| setpriority_process(None, now.saturating_add(STEPS)));
    if let Err(error) = lowered {
        tracing::debug!(%error, "a thread's priority stays as it is");
    }
}

/// Lowers the priority of all threads of a group of processes, and of those that they start, to [`STEPS`] below the usual one.
pub(crate) fn lower_group(leader: u32) {
    let Some(leader) = i32::try_from(leader).ok().and_then(Pid::from_raw) else { return };
    if let Err(error) = setpriority_pgrp(Some(leader), STEPS) {
        tracing::debug!(%error, "the priority of a group of processes stays as it is");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_is_lowered_leaves_the_others_as_they_are() {
        let before = getpriority_process(None).unwrap();
        let lowered = std::thread::Builder::new().spawn(|| {
            lower_thread();
            getpriority_process(None).unwrap()
        });
        assert_eq!(lowered.unwrap().join().unwrap(), (before + STEPS).min(19));
        assert_eq!(getpriority_process(None).unwrap(), before);
    }
}
