//! Evidence that users with few rights cannot destroy, over HTTP: nobody's snapshots push out another's, and admins alone lift
//! holds.

use super::snapshots::{House, id_of};
use super::{camera, pictures};
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;
use videofields_service::evidence::SnapshotSettings;
use videofields_vision::config::End;

const ALL: &str = "/api/v1/snapshots";

/// A house of users, where snapshots are kept as `change` has it.
fn house(folder: &Path, change: impl FnOnce(&mut SnapshotSettings)) -> House {
    let cameras = ["north", "south"].map(|id| camera(id, pictures(folder, id, 0..20), End::Stop));
    House::keeping(folder, cameras.to_vec(), change)
}

/// Room for `n` snapshots of the camera `north`, and a little more.
fn bytes_of(n: u64) -> u64 {
    let folder = TempDir::new().unwrap();
    let house = house(folder.path(), |_settings| {});
    let made = house.send("root", "POST", ALL, None, of_north(0));
    let n_bytes = made.body["bytes"].as_u64().unwrap();
    house.bench.stop();
    n_bytes * n + n_bytes / 2
}

fn of_north(frame: i64) -> Value {
    json!({"camera": "north", "t": (frame % 20 * super::FRAME_NANOS).to_string(), "note": "at the gate"})
}

fn of_north_now(note: i64) -> Value {
    json!({"camera": "north", "note": note.to_string()})
}

fn held(mut wanted: Value) -> Value {
    wanted["hold"] = json!(true);
    wanted
}

impl House {
    fn patch(&self, user: &str, path: &str, body: Value) -> super::snapshots::Answer {
        self.send(user, "PATCH", path, Some("*"), body)
    }

    fn delete(&self, user: &str, path: &str) -> u16 {
        self.send(user, "DELETE", path, Some("*"), Value::Null).status
    }

    /// Number and bytes of all snapshots.
    fn kept(&self) -> (usize, u64) {
        let all = self.get("root", &format!("{ALL}?limit=1000")).body["snapshots"].clone();
        let all = all.as_array().unwrap();
        (all.len(), all.iter().map(|of| of["bytes"].as_u64().unwrap()).sum())
    }

    /// Lines of the audit log as `user action target status`.
    fn audit(&self) -> Vec<String> {
        let log = self.get("root", "/api/v1/audit?limit=1000").body;
        let line = |of: &Value| {
            let word = |name: &str| of[name].as_str().unwrap_or("nobody").to_owned();
            format!("{} {} {} {}", word("user"), word("action"), word("target"), of["status"])
        };
        log["entries"].as_array().unwrap().iter().map(line).collect()
    }
}

#[test]
fn sixty_snapshots_of_an_operator_push_out_none_but_the_operators_own() {
    let max_bytes = bytes_of(20);
    let folder = TempDir::new().unwrap();
    let house = house(folder.path(), |settings| settings.max_bytes = max_bytes);
    let of_admin: Vec<String> = (0..3).map(|frame| house.make("root", of_north(frame))).collect();
    let mut own: Vec<String> = (0..60).map(|frame| id_of(&house.make("both", of_north(frame)))).collect();
    for path in &of_admin {
        let verified = house.get("root", &format!("{path}/verification"));
        assert_eq!((verified.status, &verified.body["is_whole"]), (200, &json!(true)), "{path}");
    }
    // The operator's newest stay, as many as leave room for who comes next.
    own.reverse();
    let kept = house.ids("root", "made_by=both");
    assert_eq!(kept, own[..kept.len()]);
    assert!((10..=13).contains(&kept.len()), "{kept:?}");
    let (_, n_bytes) = house.kept();
    assert!(n_bytes <= max_bytes, "{n_bytes} of {max_bytes}");
    let gone = house.audit();
    let gone: Vec<_> = gone.iter().filter(|line| line.contains("removed to make room")).collect();
    assert_eq!(gone.len(), 60 - kept.len());
    let first = format!("both snapshot removed to make room {ALL}/{}#made_by=both 204", own[59]);
    assert_eq!(gone[0], &first);
    // Others find room, and so does the admin, whom no share bounds; all of it is bounded.
    let next = house.make("half", of_north(5));
    for frame in 0..20 {
        house.send("half", "POST", ALL, None, of_north(frame));
        house.send("both", "POST", ALL, None, of_north(frame));
    }
    assert!(house.kept().1 <= max_bytes);
    assert_eq!(house.ids("root", "made_by=root").len(), 3);
    house.make("root", of_north(6));
    assert_eq!(house.ids("root", "made_by=root").len(), 4);
    assert_eq!(house.get("root", &next).status, 404, "it was the oldest of its own maker's");
    // Once the admin has the rest, others go on with what they have, and who has nothing is told so.
    for frame in 0..20 {
        house.make("root", of_north(frame));
    }
    let refused = house.send("present", "POST", ALL, None, json!({"camera": "north"}));
    assert_eq!(refused.status, 507, "{}", refused.body);
    assert!(refused.body["detail"].as_str().unwrap().contains("ask an admin"), "{}", refused.body);
    let (n_of_both, n_of_half) =
        (house.ids("root", "made_by=both").len(), house.ids("root", "made_by=half").len());
    house.make("both", of_north(7));
    // The new one may be some bytes larger than the oldest: then two go for it.
    assert!((n_of_both - 1..=n_of_both).contains(&house.ids("root", "made_by=both").len()));
    assert_eq!(house.ids("root", "made_by=half").len(), n_of_half);
    house.bench.stop();
}

#[test]
fn what_operators_hold_is_bounded_apart_and_leaves_room() {
    let max_bytes = bytes_of(20);
    let folder = TempDir::new().unwrap();
    let house = house(folder.path(), |settings| settings.max_bytes = max_bytes);
    let of_admin: Vec<String> = (0..3).map(|frame| house.make("root", of_north(frame))).collect();
    let held_by = |user: &str| {
        let all = house.get("root", &format!("{ALL}?limit=1000")).body["snapshots"].clone();
        let all = all.as_array().unwrap().clone();
        all.into_iter().filter(|of| of["held_by"] == json!(user)).count()
    };
    let statuses: Vec<u16> =
        (0..30).map(|frame| house.send("both", "POST", ALL, None, held(of_north(frame))).status).collect();
    assert_eq!(statuses.iter().filter(|status| **status == 201).count(), held_by("both"));
    assert!(
        statuses[..8].iter().all(|status| *status == 201)
            && statuses[8..].iter().all(|status| *status == 507)
    );
    // Nor may others' be held beyond it, which would keep their room from them. One that is there takes none anew.
    assert_eq!(house.patch("both", &of_admin[0], json!({"hold": true})).status, 200);
    let refused = house.patch("both", &of_admin[1], json!({"hold": true}));
    assert_eq!(refused.status, 507, "{}", refused.body);
    assert!(refused.body["detail"].as_str().unwrap().contains("that you hold"), "{}", refused.body);
    let put = house.patch("half", &of_admin[1], json!({"hold": true}));
    assert_eq!((put.status, &put.body["held_by"]), (200, &json!("half")), "{}", put.body);
    // What is not held counts apart.
    house.make("both", of_north(1));
    // Admins hold what they like, and find room for it.
    assert_eq!(house.patch("root", &of_admin[2], json!({"hold": true})).status, 200);
    house.make("chief", held(of_north(2)));
    assert_eq!((held_by("root"), held_by("chief"), held_by("half"), held_by("both")), (1, 1, 1, 9));
    assert!(house.kept().1 <= max_bytes);
    house.bench.stop();
}

#[test]
fn admins_alone_lift_holds_and_remove_what_another_made() {
    let folder = TempDir::new().unwrap();
    let house = house(folder.path(), |_settings| {});
    let of_admin = house.make("root", of_north(0));
    let sealed = house.make("root", held(of_north(1)));
    let own = house.make("both", held(of_north(2)));
    let of_half = house.make("half", of_north(3));
    for path in [&sealed, &own] {
        let refused = house.patch("both", path, json!({"hold": false}));
        assert_eq!(refused.status, 403, "{}", refused.body);
        assert!(refused.body["detail"].as_str().unwrap().contains("for admin"), "{}", refused.body);
        assert_eq!(
            (house.delete("both", path), house.delete("root", path)),
            (if path == &own { 409 } else { 403 }, 409)
        );
        assert_eq!(house.get("root", path).body["hold"], json!(true));
    }
    assert_eq!((house.delete("both", &of_admin), house.delete("both", &of_half)), (403, 403));
    // Something else may be said of it; the hold stays, and whose it is.
    let said = house.patch("half", &own, json!({"note": "It is Ann."}));
    assert_eq!((said.status, &said.body["held_by"]), (200, &json!("both")));
    let lifted = house.patch("root", &own, json!({"hold": false}));
    assert_eq!(
        (lifted.status, &lifted.body["hold"], &lifted.body["held_by"]),
        (200, &json!(false), &Value::Null)
    );
    assert_eq!((house.delete("both", &own), house.delete("root", &of_half)), (204, 204));
    let audit = house.audit();
    for line in [
        format!("both PATCH {ALL}/{{id}} {sealed} 403"),
        // The log names the first refusal of a kind.
        format!("both DELETE {ALL}/{{id}} {sealed} 403"),
        format!("root PATCH {ALL}/{{id}} {own}#hold=false 200"),
        format!("both DELETE {ALL}/{{id}} {own} 204"),
    ] {
        assert!(audit.contains(&line), "{line}: {audit:#?}");
    }
    house.bench.stop();
}

#[test]
fn two_admins_lift_a_hold_where_that_is_asked_for() {
    let folder = TempDir::new().unwrap();
    let house = house(folder.path(), |settings| settings.lift_window_nanos = Some(3_600_000_000_000));
    let path = house.make("both", held(of_north(1)));
    let lift = |user: &str| house.patch(user, &path, json!({"hold": false}));
    assert_eq!(lift("both").status, 403);
    let asked = lift("root");
    assert_eq!((asked.status, &asked.body["hold"], asked.field("etag")), (202, &json!(true), "\"2\""));
    let one = house.get("both", &path).body;
    assert_eq!(one["lift"]["asked_by"], json!("root"));
    assert!(one["lift"]["until"].as_str().unwrap() > one["annotations"][1]["at"].as_str().unwrap());
    assert_eq!(
        (&one["annotations"][0]["asks_lift"], &one["annotations"][1]["asks_lift"]),
        (&json!(false), &json!(true))
    );
    // Neither the same admin nor anybody else makes it go.
    assert_eq!((lift("root").status, lift("both").status), (409, 403));
    assert_eq!((house.delete("root", &path), house.delete("chief", &path)), (409, 409));
    assert_eq!(house.patch("both", &path, json!({"hold": true, "note": "keep it"})).status, 200);
    assert_eq!(
        house.get("both", &path).body["lift"]["asked_by"],
        json!("root"),
        "operators take nothing back"
    );
    // An admin takes it back; then it begins anew.
    let back = house.patch("chief", &path, json!({"hold": true}));
    assert_eq!((back.status, &back.body["lift"]), (200, &Value::Null));
    assert_eq!(lift("chief").status, 202);
    // Somebody who is no admin any more has asked for nothing.
    let change = |user: &str, role: &str| {
        let path = format!("/api/v1/users/{user}");
        let tag = house.get("root", &path).field("etag").to_owned();
        let rights = json!({"*": ["live", "history", "export"]});
        let body = json!({"role": role, "cameras": if role == "admin" { json!({}) } else { rights }});
        assert_eq!(house.send("root", "PUT", &path, Some(&tag), body).status, 200);
    };
    change("chief", "operator");
    let asked = lift("root");
    assert_eq!((asked.status, &asked.body["lift"]["asked_by"]), (202, &json!("root")));
    change("chief", "admin");
    // An admin who was made since confirms nothing of before.
    assert_eq!(lift("chief").status, 403);
    assert_eq!((house.patch("root", &path, json!({"hold": true})).status, lift("root").status), (200, 202));
    let lifted = lift("chief");
    assert_eq!(
        (lifted.status, &lifted.body["hold"], &lifted.body["lift"]),
        (200, &json!(false), &Value::Null)
    );
    assert_eq!(house.delete("both", &path), 204);
    let audit = house.audit();
    let lines = [
        format!("root PATCH {ALL}/{{id}} {path}#lift=asked 202"),
        format!("chief PATCH {ALL}/{{id}} {path}#hold=true 200"),
        format!("chief PATCH {ALL}/{{id}} {path}#hold=false 200"),
    ];
    for line in lines {
        assert!(audit.contains(&line), "{line}: {audit:#?}");
    }
    house.bench.stop();
}

#[test]
fn nobody_lifts_alone_what_takes_two_by_an_account_or_a_token_of_their_own_making() {
    let folder = TempDir::new().unwrap();
    let mut house = house(folder.path(), |settings| settings.lift_window_nanos = Some(3_600_000_000_000));
    let path = house.make("both", held(of_north(1)));
    let lift = |house: &House, user: &str| house.patch(user, &path, json!({"hold": false}));
    let token = |house: &mut House, user: &'static str, called: &'static str| {
        let made = house.send("root", "POST", "/api/v1/tokens", None, json!({"user": user}));
        assert_eq!(made.status, 201, "{}", made.body);
        house.tokens.push((called, made.body["token"].as_str().unwrap().to_owned()));
    };
    let user = |house: &House, id: &str, fields: &[(&str, &str)]| {
        let body = json!({"role": "admin", "password": "another long password"});
        let put = house.send_with(("root", "PUT", &format!("/api/v1/users/{id}")), fields, body);
        assert!([200, 201].contains(&put.status), "{}", put.body);
    };
    token(&mut house, "chief", "chief before");
    assert_eq!(lift(&house, "root").status, 202);
    // A second account, a token of the other admin's, and the other's account with a password that the first gave it.
    user(&house, "second", &[("if-none-match", "*")]);
    token(&mut house, "second", "second");
    token(&mut house, "chief", "chief after");
    let refused = |house: &House, user: &str| {
        let refused = lift(house, user);
        assert_eq!(refused.status, 403, "{user}: {}", refused.body);
        assert!(refused.body["detail"].as_str().unwrap().contains("older"), "{}", refused.body);
        assert_eq!(house.get("root", &path).body["hold"], json!(true));
    };
    refused(&house, "second");
    refused(&house, "chief after");
    user(&house, "chief", &[("if-match", "*")]);
    for name in ["chief", "chief before", "chief after"] {
        refused(&house, name);
    }
    // Once it is asked for anew, what is older than that confirms.
    assert_eq!(house.patch("root", &path, json!({"hold": true})).status, 200);
    assert_eq!(lift(&house, "root").status, 202);
    assert_eq!(lift(&house, "chief before").status, 200);
    let audit = house.audit();
    assert!(audit.contains(&format!("second PATCH {ALL}/{{id}} {path} 403")), "{audit:#?}");
    house.bench.stop();
}

#[test]
fn who_has_a_name_again_has_none_of_what_was_made_under_it_before() {
    let max_bytes = bytes_of(6);
    let folder = TempDir::new().unwrap();
    let mut house = house(folder.path(), |settings| settings.max_bytes = max_bytes);
    let before: Vec<String> = (0..2).map(|frame| house.make("present", of_north_now(frame))).collect();
    assert_eq!(house.get("present", &before[0]).status, 200, "its own");
    let user = "/api/v1/users/present";
    assert_eq!(house.delete("root", user), 204);
    let rights = json!({"role": "operator", "cameras": {"north": ["live", "export"]}});
    let made = house.send_with(("root", "PUT", user), &[("if-none-match", "*")], rights);
    assert_eq!(made.status, 201, "{}", made.body);
    let token = house.send("root", "POST", "/api/v1/tokens", None, json!({"user": "present"}));
    house.tokens.retain(|(name, _)| *name != "present");
    house.tokens.push(("present", token.body["token"].as_str().unwrap().to_owned()));
    // It may not look back, and did not make these.
    assert_eq!((house.get("present", &before[0]).status, house.delete("present", &before[0])), (404, 404));
    assert!(house.ids("present", "").is_empty());
    // Nor do its own push them out.
    for frame in 0..10 {
        house.make("present", of_north_now(frame));
    }
    for path in &before {
        assert_eq!(house.get("root", path).status, 200, "{path}");
    }
    // With the right to look back it sees them, and removes them no more than another's.
    let tag = house.get("root", user).field("etag").to_owned();
    let rights = json!({"role": "operator", "cameras": {"north": ["live", "history", "export"]}});
    assert_eq!(house.send("root", "PUT", user, Some(&tag), rights).status, 200);
    assert_eq!((house.get("present", &before[0]).status, house.delete("present", &before[0])), (200, 403));
    let own = house.make("present", of_north_now(0));
    assert_eq!(house.delete("present", &own), 204);
    house.bench.stop();
}
