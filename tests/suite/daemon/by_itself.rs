//! What the daemon does of its own accord with pictures of people, and that the audit log tells of it.

use super::demo;
use super::process::Daemon;
use serde_json::json;
use std::time::Duration;
use tempfile::TempDir;
use videofields_vision::clock::{Clock, SystemClock};

/// Schedules fall on whole minutes: the longest wait for one, with time to make it.
const PATIENCE: Duration = Duration::from_secs(120);

#[test]
fn what_is_kept_by_schedule_is_masked_and_blurred_and_stands_in_the_audit_log() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let text = std::fs::read_to_string(&config).unwrap();
    let zone = "privacy_zones = [{name = \"garden\", reason = \"not ours\", polygon = [[0, 0], [0.5, 0], [0, 0.5]]}]";
    let text = text.replacen("id = \"north\"\n", &format!("id = \"north\"\n{zone}\n"), 1);
    let schedule = |id: &str, more: &str| {
        format!("[[snapshot]]\nid = \"{id}\"\ncamera = \"north\"\ninterval_mins = 1\n{more}\n")
    };
    let schedules = schedule("seen", "") + &schedule("blurred", "blur_people = true");
    std::fs::write(&config, format!("{text}\n{schedules}")).unwrap();
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&["north"]);

    // A snapshot's entry is written once the snapshot is there.
    let clock = SystemClock::new();
    let (entries, kept) = loop {
        let entries = daemon.json("/api/v1/audit?limit=1000")["entries"].as_array().unwrap().clone();
        let is_noted = |people: &str| {
            let ending = format!("&people={people}");
            entries.iter().any(|entry| entry["target"].as_str().unwrap().ends_with(&ending))
        };
        if is_noted("seen") && is_noted("blurred") {
            break (entries, daemon.json("/api/v1/snapshots")["snapshots"].as_array().unwrap().clone());
        }
        assert!(clock.monotonic() < PATIENCE, "{entries:?}");
        clock.sleep(Duration::from_millis(250));
    };
    let noted: Vec<(&str, &str)> = entries
        .iter()
        .map(|entry| (entry["action"].as_str().unwrap(), entry["target"].as_str().unwrap()))
        .collect();
    let zones = ("privacy zones of the configuration", "/api/v1/cameras/north/privacy#zones=1&version=1");
    assert!(noted.contains(&zones), "{noted:?}");
    for (name, people) in [("seen", "seen"), ("blurred", "blurred")] {
        let is_noted = |id: &str| {
            let target = format!("/api/v1/snapshots#snapshot={id}&schedule={name}&people={people}");
            noted.contains(&("snapshot by schedule", &target))
        };
        let ids = kept.iter().filter(|of| of["schedule"] == name).map(|of| of["id"].as_str().unwrap());
        let id = { ids }.find(|id| is_noted(id)).unwrap_or_else(|| panic!("{name}: {kept:?} {noted:?}"));
        let record = daemon.json(&format!("/api/v1/snapshots/{id}/record.json"));
        assert_eq!(record["people"]["blurred"], json!(name == "blurred"), "{record}");
        let picture = daemon.get(&format!("/api/v1/snapshots/{id}/picture.png")).body;
        let picture = image::load_from_memory(&picture).unwrap().into_rgb8();
        let filling = picture.get_pixel(2, 2);
        assert!((0..20).all(|x| picture.get_pixel(x, 20 - x) == filling), "the zone is filled");
        assert_eq!(daemon.json(&format!("/api/v1/snapshots/{id}/verification"))["is_whole"], true);
    }
    let stopped = daemon.stop("TERM");
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
}
