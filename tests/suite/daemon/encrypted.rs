//! A daemon that other machines reach: with a certificate and users alone, and with a newer certificate on SIGHUP.

use super::demo;
use super::process::{run, signal, start_at, videofields};
use std::io::Write;
use std::process::Stdio;
use tempfile::TempDir;
use videofields_testing::tls::{self, Files};
use videofields_testing::wait_for;

#[test]
fn a_proxy_that_lets_others_in_is_taken_with_users_alone() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let text = std::fs::read_to_string(&config).unwrap();
    let listening = "[server]\nlisten = \"127.0.0.1:8080\"";
    assert!(text.contains(listening), "{text}");
    let proxied = "[server]\nlisten = \"127.0.0.1:0\"\ntrusted_proxies = [\"127.0.0.1/32\"]";
    std::fs::write(&config, text.replace(listening, proxied)).unwrap();
    let refused = run(videofields().args(["serve", "--config"]).arg(&config));
    assert_eq!(refused.status, Some(1), "{}", refused.stderr);
    assert!(refused.stderr.contains("`server.trusted_proxies` let other machines in"), "{}", refused.stderr);
}

#[test]
fn other_machines_come_in_encrypted_and_to_users_alone() {
    let folder = TempDir::new().unwrap();
    let (files, first) = Files::new();
    let config = demo(folder.path());
    let text = std::fs::read_to_string(&config).unwrap();
    let server = format!(
        "[server]\ncertificate = {:?}\nprivate_key = {:?}\nlisten = \"0.0.0.0:0\"",
        files.certificate(),
        files.private_key()
    );
    let listening = "[server]\nlisten = \"127.0.0.1:8080\"";
    assert!(text.contains(listening), "{text}");
    std::fs::write(&config, text.replace(listening, &server)).unwrap();

    let refused = run(videofields().args(["serve", "--config"]).arg(&config));
    assert_eq!(refused.status, Some(1));
    assert!(
        refused.stderr.contains("while there are no users everybody may do everything"),
        "{}",
        refused.stderr
    );

    let mut user = videofields();
    user.arg("user").arg(&config).args(["set", "root", "--role", "admin", "--password"]);
    let mut made = user.stdin(Stdio::piped()).spawn().unwrap();
    made.stdin.take().unwrap().write_all(b"correct horse battery\n").unwrap();
    assert!(made.wait().unwrap().success());

    let daemon = start_at(&config, &[], "https://");
    let address = ([127, 0, 0, 1], daemon.address.port()).into();
    let healthy = tls::get(address, first.clone(), "/healthz").unwrap();
    assert!(healthy.starts_with("HTTP/1.1 200 "), "{healthy}");
    let strange = tls::get(address, first.clone(), "/api/v1/cameras").unwrap();
    assert!(strange.starts_with("HTTP/1.1 401 "), "{strange}");

    let second = files.renew().cert.der().clone();
    signal(&daemon, "HUP");
    wait_for("the newer certificate", || tls::get(address, second.clone(), "/healthz").ok());
    assert!(tls::get(address, first, "/healthz").is_err());
    let stopped = daemon.stop("TERM");
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    assert!(stopped.stderr.contains("new connections get the new certificate"), "{}", stopped.stderr);
}
