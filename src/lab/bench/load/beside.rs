//! Connections that are there beside those that are measured: readers that take a byte a second, and some that never ask.

use super::client::Client;
use anyhow::Result;
use std::io::ErrorKind;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::task::JoinSet;

/// Between two bytes that a slow reader takes, and before one that was cut off comes again.
const PAUSE: Duration = Duration::from_secs(1);

/// Tries in a row after which the daemon is gone.
const MAX_FAILURES: u32 = 60;

/// Connections beside the measured ones. They end when this is dropped.
#[derive(Debug, Default)]
pub(super) struct Beside {
    readers: JoinSet<()>,
    idle: Vec<TcpStream>,
}

impl Beside {
    /// So many readers, of `paths` in turns, which take a byte a second and come again when they are cut off.
    pub(super) fn slow(client: &Arc<Client>, paths: &[String], n_readers: u64) -> Self {
        let mut beside = Self::default();
        for path in paths.iter().cycle().take(usize::try_from(n_readers).unwrap_or(usize::MAX)) {
            beside.readers.spawn(read_slowly(Arc::clone(client), path.clone()));
        }
        beside
    }

    /// So many connections that ask for nothing, opened one after the other. Those that the daemon ends are not opened again.
    ///
    /// # Errors
    /// When one cannot be opened: this process has too few descriptors, or nobody answers.
    pub(super) async fn idle(client: &Client, n_connections: u64) -> Result<Self> {
        let mut beside = Self::default();
        for _ in 0..n_connections {
            beside.idle.push(client.open(None).await?);
        }
        Ok(beside)
    }
}

/// Reads what stands at `path` a byte a second, until nobody answers any more.
async fn read_slowly(client: Arc<Client>, path: String) {
    let mut n_failures = 0;
    while n_failures < MAX_FAILURES {
        if let Ok(stream) = client.open(Some(&path)).await {
            n_failures = 0;
            while takes_a_byte(&stream).await {
                tokio::time::sleep(PAUSE).await;
            }
        } else {
            n_failures += 1;
        }
        tokio::time::sleep(PAUSE).await;
    }
}

/// Whether there was one more byte.
async fn takes_a_byte(stream: &TcpStream) -> bool {
    loop {
        if stream.readable().await.is_err() {
            return false;
        }
        match stream.try_read(&mut [0]) {
            Ok(n_read) => return n_read == 1,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => return false,
        }
    }
}
