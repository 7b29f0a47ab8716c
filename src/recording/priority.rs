//! Lowers the priority of what works long and may wait, so that what is live comes first.

use rustix::process::{Pid, getpriority_process, setpriority_pgrp, setpriority_process};
use std::io;
use std::sync::LazyLock;
use tokio::runtime::{Builder, Runtime};
use tokio::task::{JoinHandle, spawn_blocking};

/// Steps of niceness by which it is lowered: a processor that is asked for by both gives a tenth of its time to what is lowered.
const STEPS: i32 = 10;

/// Most threads of a lower priority. Who gives them work takes turns, so that few are ever there.
const MAX_THREADS: usize = 64;

/// Threads of a lower priority, which are made as work comes and end when none comes for a while.
static THREADS: LazyLock<io::Result<Runtime>> = LazyLock::new(|| {
    let mut builder = Builder::new_current_thread();
    builder
        .max_blocking_threads(MAX_THREADS)
        .thread_name("low priority")
        .on_thread_start(lower_thread)
        .build()
});

/// Does `work`, which may block, on a thread of a lower priority. What it starts, threads and processes, inherits that. Where no
/// such thread can be had, it is done with the usual priority.
pub fn spawn<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> JoinHandle<T> {
    match &*THREADS {
        Ok(threads) => threads.handle().spawn_blocking(work),
        Err(error) => {
            tracing::warn!(%error, "there are no threads of a lower priority");
            spawn_blocking(work)
        }
    }
}

/// Lowers the priority of the thread that calls this, for good.
fn lower_thread() {
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

    #[tokio::test]
    async fn work_is_done_with_a_lower_priority_and_its_panic_is_told() {
        let before = getpriority_process(None).unwrap();
        let of_work = spawn(|| getpriority_process(None).unwrap()).await.unwrap();
        assert_eq!(of_work, (before + STEPS).min(19));
        assert!(spawn(|| panic!("on purpose")).await.unwrap_err().is_panic());
        assert_eq!(getpriority_process(None).unwrap(), before);
    }

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
