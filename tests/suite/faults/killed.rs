//! `kill -9` while several callers change users, tokens, scenes and walls: whatever was acknowledged is there afterwards,
//! whatever was not is there whole or not at all, and the audit log has a line of every change.

use super::Random;
use super::client::{self, Ask, ask, configure, root_token, say};
use crate::daemon::process::{Daemon, run, signal, videofields};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::time::Duration;
use tempfile::TempDir;
use videofields_vision::clock::{Clock, SystemClock};

/// Callers that change things side by side, each its own.
const CALLERS: u64 = 3;

/// Things of a kind that each caller changes.
const EACH: u64 = 3;

/// What is known of one thing.
#[derive(Clone, Debug, Default)]
struct Known {
    /// What was acknowledged last: its tag and its mark; nothing of what is not there.
    acknowledged: Option<(String, String)>,
    /// What a change that broke off was to leave: its mark, or nothing.
    maybe: Option<Option<String>>,
    /// Changes that were acknowledged.
    n: u64,
}

/// What one caller knows.
struct Caller {
    random: Random,
    number: u64,
    name: u64,
    things: BTreeMap<String, Known>,
    /// Tokens by id: their text, and whether they are to be good; unknown where a revocation broke off.
    tokens: BTreeMap<String, (String, Option<bool>)>,
}

impl Caller {
    fn new(name: u64) -> Self {
        let kinds = ["walls", "scenes", "users"];
        let paths = kinds.iter().flat_map(|kind| (0..EACH).map(move |at| (kind, at)));
        let things = paths.map(|(kind, at)| (format!("/api/v1/{kind}/c{name}-{at}"), Known::default()));
        let things = things.collect();
        Self { random: Random(name), number: 0, name, things, tokens: BTreeMap::new() }
    }

    /// Changes one thing after the other until the daemon is gone; how many changes were acknowledged.
    fn change_until_killed(&mut self, address: SocketAddr, token: &str) -> u64 {
        let mut n = 0;
        while self.change(address, token) {
            n += 1;
        }
        n
    }

    /// One change; false where it broke off.
    fn change(&mut self, address: SocketAddr, token: &str) -> bool {
        self.number += 1;
        if self.random.below(6) == 0 {
            return self.change_token(address, token);
        }
        let place = self.random.below(self.things.len() as u64) as usize;
        let is_removed = self.random.below(4) == 0;
        let (path, known) = self.things.iter_mut().nth(place).unwrap();
        let mark = format!("m{}-{}", self.name, self.number);
        let tag = known.acknowledged.as_ref().map(|(tag, _)| tag.clone());
        let condition = tag.as_deref().map_or(("if-none-match", "*"), |tag| ("if-match", tag));
        let (method, body, left) = match tag {
            Some(_) if is_removed => ("DELETE", String::new(), None),
            _ => ("PUT", document(path, &mark).to_string(), Some(mark)),
        };
        known.maybe = Some(left.clone());
        let request = Ask { token: Some(token), fields: &[condition], body: &body };
        let Some(answer) = ask(address, method, path, &request) else { return false };
        assert!((200..300).contains(&answer.status), "{method} {path}: {}", answer.text());
        known.acknowledged = left.map(|mark| (answer.field("etag").unwrap().to_owned(), mark));
        known.maybe = None;
        known.n += 1;
        true
    }

    fn change_token(&mut self, address: SocketAddr, token: &str) -> bool {
        let good = self.tokens.iter().find(|(_, (_, is_good))| *is_good == Some(true));
        let shown = Some(token);
        if let Some(id) = good.map(|(id, _)| id.clone()).filter(|_| self.random.below(2) == 0) {
            self.tokens.get_mut(&id).unwrap().1 = None;
            let path = format!("/api/v1/tokens/{id}");
            let Some(answer) = ask(address, "DELETE", &path, &Ask { token: shown, ..Ask::default() }) else {
                return false;
            };
            assert_eq!(answer.status, 204, "{}", answer.text());
            self.tokens.get_mut(&id).unwrap().1 = Some(false);
            return true;
        }
        let request = Ask { token: shown, body: "{}", ..Ask::default() };
        let Some(answer) = ask(address, "POST", "/api/v1/tokens", &request) else { return false };
        assert_eq!(answer.status, 201, "{}", answer.text());
        let made = answer.json();
        let text = |name: &str| made[name].as_str().unwrap().to_owned();
        self.tokens.insert(text("id"), (text("token"), Some(true)));
        true
    }

    /// Holds what a daemon answers after its start to what was acknowledged before.
    fn check(&mut self, address: SocketAddr, token: &str) {
        for (path, known) in &mut self.things {
            let answer = ask(address, "GET", path, &Ask { token: Some(token), ..Ask::default() }).unwrap();
            let found = (answer.status == 200).then(|| mark(path, &answer.json()));
            let was = known.acknowledged.as_ref().map(|(_, mark)| mark.clone());
            let is_kept = found == was;
            let is_broken_off = known.maybe.as_ref() == Some(&found);
            assert!(is_kept || is_broken_off, "{path}: {known:?}, but {}", answer.text());
            let tag = answer.field("etag").map(str::to_owned);
            if let (true, Some((before, _))) = (is_kept, &known.acknowledged) {
                assert_eq!(tag.as_ref(), Some(before), "{path}: the same version");
            }
            known.acknowledged = found.map(|mark| (tag.unwrap(), mark));
            known.maybe = None;
        }
        for (id, (text, is_good)) in &mut self.tokens {
            let request = Ask { token: Some(text.as_str()), ..Ask::default() };
            let status = ask(address, "GET", "/api/v1/cameras", &request).unwrap().status;
            let expected = is_good.map_or(status, |is_good| if is_good { 200 } else { 401 });
            assert_eq!(status, expected, "token {id}");
            *is_good = Some(status == 200);
        }
    }
}

/// What is to stand at `path`, with a mark to know it by.
fn document(path: &str, mark: &str) -> Value {
    if path.contains("/users/") {
        return json!({"role": "viewer", "cameras": {mark: ["live"]}});
    }
    if path.contains("/scenes/") {
        return json!({"version": 1, "name": mark});
    }
    json!({
        "name": mark,
        "scene": "yard",
        "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "surface": {"grid": {"columns": 2, "rows": 1, "tile_px": [96, 64], "tile_m": [0.96, 0.64]}},
    })
}

/// The mark of what stands at `path`.
fn mark(path: &str, found: &Value) -> String {
    if path.contains("/users/") {
        let cameras = found["cameras"].as_object().unwrap();
        return cameras.keys().next().unwrap().clone();
    }
    found["name"].as_str().unwrap().to_owned()
}

/// Every entry of the audit log.
fn audit(address: SocketAddr, token: &str) -> Vec<Value> {
    let (mut entries, mut after) = (Vec::new(), Some(0_u64));
    while let Some(number) = after {
        let path = format!("/api/v1/audit?cursor={number}&limit=1000");
        let page = ask(address, "GET", &path, &Ask { token: Some(token), ..Ask::default() }).unwrap().json();
        entries.extend(page["entries"].as_array().unwrap().iter().cloned());
        after = page["next"].as_str().map(|next| next.parse().unwrap());
    }
    entries
}

#[test]
fn what_was_acknowledged_survives_being_killed_while_callers_change_things() {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |n| n.parse().unwrap());
    let (least_changes, least_kills) = (number("VIDEOFIELDS_CHANGES", 500), number("VIDEOFIELDS_KILLS", 30));
    let folder = TempDir::new().unwrap();
    let config = configure(folder.path(), &folder.path().join("kept.sqlite"), "");
    let token = root_token(&config);
    let first = Daemon::start(&config);
    let yard = json!({"version": 1, "name": "Yard"}).to_string();
    let request = Ask { token: Some(&token), fields: &[("if-none-match", "*")], body: &yard };
    assert_eq!(ask(first.address, "PUT", "/api/v1/scenes/yard", &request).unwrap().status, 201);
    client::end(first);
    let mut callers: Vec<Caller> = (0..CALLERS).map(Caller::new).collect();
    let mut random = Random(7);
    let (mut n_changes, mut n_kills, mut n_busy, mut opened) = (0, 0, 0, Duration::ZERO);
    while n_changes < least_changes || n_kills < least_kills {
        let clock = SystemClock::new();
        let daemon = Daemon::start(&config);
        opened = opened.max(clock.monotonic());
        let address = daemon.address;
        let after = Duration::from_millis(30 + random.below(600));
        callers.iter_mut().for_each(|caller| caller.check(address, &token));
        let n = std::thread::scope(|scope| {
            let token = &token;
            let change = |caller: &mut Caller| caller.change_until_killed(address, token);
            let changing: Vec<_> =
                callers.iter_mut().map(|caller| scope.spawn(move || change(caller))).collect();
            clock.sleep(after);
            signal(&daemon, "KILL");
            changing.into_iter().map(|changing| changing.join().unwrap()).sum::<u64>()
        });
        drop(daemon.stop("KILL"));
        n_changes += n;
        n_kills += 1;
        n_busy += u64::from(n > 0);
    }
    assert!(n_busy * 2 > n_kills, "{n_busy} of {n_kills} were killed while something was changed");

    let daemon = Daemon::start(&config);
    for caller in &mut callers {
        caller.check(daemon.address, &token);
    }
    let entries = audit(daemon.address, &token);
    for (path, known) in callers.iter().flat_map(|caller| &caller.things) {
        let is_of = |entry: &&Value| entry["target"] == **path && entry["status"].as_u64() < Some(300);
        let noted = entries.iter().filter(is_of).count() as u64;
        assert!(noted >= known.n, "{path}: {} changes were acknowledged, {noted} are noted", known.n);
    }
    assert_eq!(client::end(daemon).status, Some(0));
    let checked = run(videofields().arg("check-store").arg(&config));
    assert_eq!(checked.status, Some(0), "{}{}", checked.stdout, checked.stderr);
    say(&format!(
        "{n_changes} changes, {n_kills} kills, {n_busy} of them during changes; started within {opened:?}"
    ));
}
