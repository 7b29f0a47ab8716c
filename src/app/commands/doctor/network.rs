//! How the daemon is reached: its port, its certificate, and whether it lets anybody in.

use super::line::Line;
use crate::commands::operator;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use std::net::SocketAddr;
use std::path::Path;
use videofields_recording::store::ReadOnly;
use videofields_recording::store::probe::{holder, probe};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{Config, ServerSettings};

/// Days before its end from which on a certificate is warned of.
const DAYS_BEFORE: i64 = 21;

const DAY_SECS: i64 = 86_400;

pub(super) fn look(config: &Config) -> Vec<Line> {
    let server = &config.settings().server;
    let mut lines = vec![port(config)];
    if server.is_encrypted() {
        lines.push(certificate(&server.certificate));
        lines.push(private_key(server));
    }
    if !server.listen.ip().is_loopback() || !server.trusted_proxies.is_empty() {
        lines.push(users(&config.settings().storage.database));
    }
    lines
}

/// Whether nobody listens where the daemon is to, or the daemon itself does.
fn port(config: &Config) -> Line {
    let listen = config.settings().server.listen;
    let tables =
        ["/proc/net/tcp", "/proc/net/tcp6"].map(|table| std::fs::read_to_string(table).unwrap_or_default());
    let is_taken = tables.iter().any(|table| is_listened_on(table, listen));
    let is_running = holder(&config.settings().storage.database).is_ok_and(|holder| holder.is_some());
    match (is_taken, is_running) {
        (false, _) => Line::ok("port", format!("{listen} is free")),
        (true, true) => Line::ok("port", format!("{listen} is listened on, and the daemon runs")),
        (true, false) => {
            let why = "and nobody has the daemon's database open: the daemon would not start";
            Line::problem("port", format!("{listen} is taken"), why)
                .do_this("`ss -ltnp` shows by whom; or another `server.listen`")
        }
    }
}

/// Whether somebody listens on an address, or on all of them at its port, by the lines of `/proc/net/tcp`: the second field is
/// address and port in hexadecimal, the fourth the state, 0A for listening.
fn is_listened_on(table: &str, listen: SocketAddr) -> bool {
    table.lines().skip(1).any(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (Some(local), Some(&"0A")) = (fields.get(1), fields.get(3)) else { return false };
        let Some((address, port)) = local.split_once(':') else { return false };
        let is_all = |text: &str| text.bytes().all(|byte| byte == b'0');
        let is_port = u16::from_str_radix(port, 16) == Ok(listen.port());
        is_port && (is_all(address) || listen.ip().is_unspecified() || address == written(listen))
    })
}

/// An address as the kernel writes it: its words in the machine's order.
fn written(address: SocketAddr) -> String {
    let words = |octets: &[u8]| {
        let word = |four: &[u8]| u32::from_ne_bytes([four[0], four[1], four[2], four[3]]);
        octets.chunks_exact(4).map(|four| format!("{:08X}", word(four))).collect()
    };
    match address {
        SocketAddr::V4(address) => words(&address.ip().octets()),
        SocketAddr::V6(address) => words(&address.ip().octets()),
    }
}

/// Until when the certificate is good.
fn certificate(path: &Path) -> Line {
    let what = format!("certificate {}", path.display());
    let read = CertificateDer::from_pem_file(path).map_err(|error| error.to_string());
    let end = read.and_then(|der| {
        let parsed = x509_parser::parse_x509_certificate(&der).map_err(|error| error.to_string());
        parsed.map(|(_, certificate)| certificate.validity().not_after.timestamp())
    });
    let renew = "have it renewed; the daemon reads it again once a minute";
    let left_secs = match end {
        Ok(end) => end.saturating_sub(SystemClock::new().now().as_nanos() / 1_000_000_000),
        Err(error) => return Line::problem("certificate", what, error).do_this("see `server.certificate`"),
    };
    let days = left_secs.div_euclid(DAY_SECS);
    match days {
        ..0 => Line::problem("certificate", what, format!("it ended {} days ago", -days)).do_this(renew),
        0..DAYS_BEFORE => {
            Line::warning("certificate", what, format!("it ends in {days} days")).do_this(renew)
        }
        _ => Line::ok("certificate", format!("{what} is good for {days} days")),
    }
}

fn private_key(server: &ServerSettings) -> Line {
    match videofields_api::Tls::load(&server.certificate, &server.private_key) {
        Ok(_) => Line::ok("certificate", "goes with its private key".to_owned()),
        Err(error) => {
            let error = super::super::message_with_causes(&anyhow::Error::from(error));
            Line::problem("certificate", "connections cannot be encrypted".to_owned(), error)
                .do_this("let the daemon's user read both, and let them belong together")
        }
    }
}

/// Whether there are users: without, the daemon does not listen beyond this machine.
fn users(database: &Path) -> Line {
    let is_there = probe(database).is_ok_and(|found| found.check_there(database).is_ok());
    let counted = operator::block_on(async {
        if !is_there {
            return Ok(0);
        }
        let mut database = ReadOnly::open(database).await?;
        Ok(database.contents().await?.rows.get("user").copied().unwrap_or(0))
    });
    match counted {
        Ok(0) => Line::problem(
            "users",
            "there are none".to_owned(),
            "the daemon listens beyond this machine only to users",
        )
        .do_this("`videofields user FILE set NAME --role admin --password`"),
        Ok(n) => Line::ok("users", format!("{n}")),
        Err(error) => Line::warning("users", "not known".to_owned(), error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_listens_is_read_from_the_kernel_s_table() {
        let table = "  sl  local_address rem_address   st\n\
                        0: 0100007F:1F90 00000000:0000 0A 00000000\n\
                        1: 00000000:1F91 00000000:0000 0A 00000000\n\
                        2: 0100007F:1F92 0100007F:0050 01 00000000\n";
        if cfg!(target_endian = "big") {
            return;
        }
        let is = |address: &str| is_listened_on(table, address.parse().unwrap());
        assert!(is("127.0.0.1:8080") && is("0.0.0.0:8080") && is("10.0.0.7:8081"));
        assert!(!is("10.0.0.7:8080") && !is("127.0.0.1:8082") && !is("127.0.0.1:9000"));
    }
}
