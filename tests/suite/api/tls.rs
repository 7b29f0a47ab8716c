//! Connections that are encrypted: what certificates are taken, exchanged and refused, and who gets an answer.

use super::door::{FakeDoor, State};
use rcgen::KeyPair;
use rustls::pki_types::CertificateDer;
use std::io::{ErrorKind, Read, Write};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};
use videofields_api::{Limits, Site, Tls, router_within, serve};
use videofields_service::engine::Handle;
use videofields_testing::tls::{self, Files, connect};
use videofields_vision::clock::SystemClock;

struct Running {
    address: SocketAddr,
    stop: oneshot::Sender<()>,
    served: JoinHandle<()>,
}

fn load(files: &Files) -> Arc<Tls> {
    Arc::new(Tls::load(&files.certificate(), &files.private_key()).unwrap())
}

async fn start(tls: Arc<Tls>) -> Running {
    let door = Handle::new(Arc::new(FakeDoor(State::default().into())) as _);
    let site = Site { is_encrypted: true, ..Site::default() };
    let router = router_within(Limits::default(), (door, None), Arc::new(SystemClock::new()), site);
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopped) = oneshot::channel::<()>();
    let served = tokio::spawn(serve(listener, Some(tls), router, async move { stopped.await.unwrap() }));
    Running { address, stop, served }
}

/// What is answered over an encrypted connection to who trusts `trusted` alone.
async fn exchange(address: SocketAddr, trusted: CertificateDer<'static>) -> std::io::Result<String> {
    spawn_blocking(move || tls::get(address, trusted, "/healthz")).await.unwrap()
}

#[tokio::test]
async fn who_speaks_tls_is_answered_and_nobody_else_holds_that_up() {
    let (files, trusted) = Files::new();
    let running = start(load(&files)).await;
    // One never begins to agree on keys, another does not know how: neither is answered, nor in anybody's way.
    let silent = connect(running.address);
    let mut plain = connect(running.address);
    plain.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
    let answer = exchange(running.address, trusted).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
    assert!(answer.contains("strict-transport-security: max-age=31536000\r\n"), "{answer}");
    let said = spawn_blocking(move || {
        let mut said = Vec::new();
        plain.read_to_end(&mut said).map(|_| said)
    });
    let said = said.await.unwrap().unwrap_or_default();
    assert!(!said.starts_with(b"HTTP"), "{said:?}");
    running.stop.send(()).unwrap();
    tokio::time::timeout(Duration::from_secs(5), running.served).await.expect("it ends by itself").unwrap();
    drop(silent);
}

#[tokio::test]
async fn a_certificate_is_exchanged_while_the_server_runs_and_a_faulty_one_is_not() {
    let (files, first) = Files::new();
    let tls = load(&files);
    let running = start(Arc::clone(&tls)).await;
    assert!(!tls.reload().unwrap(), "nothing has changed");

    let second = files.renew().cert.der().clone();
    assert!(exchange(running.address, first.clone()).await.is_ok(), "not read yet");
    assert!(tls.reload().unwrap());
    assert!(exchange(running.address, second.clone()).await.is_ok());
    let refused = exchange(running.address, first).await.unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::InvalidData, "{refused}");

    // The key of another certificate: what was good goes on.
    let stray = KeyPair::generate().unwrap();
    std::fs::write(files.private_key(), stray.serialize_pem()).unwrap();
    let error = tls.reload().unwrap_err().to_string();
    assert!(error.contains("site.pem cannot be used with the key of"), "{error}");
    assert!(exchange(running.address, second).await.is_ok());
    running.stop.send(()).unwrap();
    running.served.await.unwrap();
}

#[test]
fn what_is_no_certificate_is_told_with_its_file() {
    let (files, _) = Files::new();
    let (certificate, key) = (files.certificate(), files.private_key());
    let check = |certificate: &Path, key: &Path, expected: &str| {
        let error = Tls::load(certificate, key).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains(expected), "{expected:?}: {error:?}");
    };
    let other = |name: &str, bytes: &[u8]| {
        let path = files.folder().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    check(&files.folder().join("none.pem"), &key, "cannot read");
    check(&certificate, &files.folder().join("none.key"), "none.key");
    check(files.folder(), &key, "expected a file");
    check(Path::new("/dev/zero"), &key, "/dev/zero: expected a file");
    check(&other("empty", b""), &key, "expected a certificate (-----BEGIN CERTIFICATE-----)");
    check(&other("noise", &[0xff; 4096]), &key, "noise: expected a certificate");
    check(&other("large", &vec![b'a'; (1 << 20) + 1]), &key, "at most 1048576 bytes");
    let broken = b"-----BEGIN CERTIFICATE-----\n!!!\n-----END CERTIFICATE-----\n";
    check(&other("broken", broken), &key, "broken: expected PEM");
    check(&certificate, &certificate, "site.pem: expected a private key that is not encrypted");
    let no_certificate = b"-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
    check(&other("three", no_certificate), &key, "cannot be used");
    assert!(Tls::load(&certificate, &key).is_ok());
}
