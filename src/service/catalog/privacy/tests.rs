//! What is kept of zones: over restarts, changes of the configuration, and a database that is older than what was in force.

use super::*;
use std::path::Path;
use videofields_vision::clock::{Clock, SimulatedClock};

fn zone(name: &str, left: f64) -> Zone {
    let polygon = vec![[left, 0.1], [left + 0.1, 0.1], [left + 0.1, 0.2], [left, 0.2]];
    Zone { name: name.to_owned(), reason: "a window".to_owned(), polygon }
}

fn camera(zones: &[Zone]) -> CameraSettings {
    let text = "[[camera]]\nid = \"north\"\nsource.path = \"north.webm\"";
    let settings: videofields_vision::config::Settings = toml::from_str(text).unwrap();
    CameraSettings { privacy_zones: zones.to_vec(), ..settings.camera[0].clone() }
}

async fn open(database: &Path, at_secs: i64) -> Catalog {
    let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(at_secs * 1_000_000_000)));
    let store = Store::open(database).await.unwrap();
    Catalog::open(store, clock as Arc<dyn Clock>, Vec::new(), (".".into(), Vec::new())).await.unwrap()
}

fn names(zones: &[Zone]) -> Vec<&str> {
    zones.iter().map(|zone| zone.name.as_str()).collect()
}

async fn begun(catalog: &Catalog, configured: &[Zone]) -> Privacy {
    let mut begun = catalog.begin_privacy(&[camera(configured)]).await.unwrap();
    begun.pop_first().unwrap().1
}

#[tokio::test]
async fn a_configuration_that_hides_less_is_kept_and_still_hides_what_was() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("a.sqlite");
    let catalog = open(&database, 10).await;
    assert_eq!(catalog.privacy_state("north"), State { version: 0, is_there: false });
    let first = begun(&catalog, &[zone("window", 0.1), zone("door", 0.5)]).await;
    assert_eq!((first.version, names(&first.zones), first.lifted.len()), (1, vec!["window", "door"], 0));
    assert_eq!(catalog.privacy_state("north"), State { version: 1, is_there: true });
    // The same again is no change.
    let again = begun(&open(&database, 20).await, &[zone("window", 0.1), zone("door", 0.5)]).await;
    assert_eq!(again, first);
    let less = begun(&open(&database, 30).await, &[zone("door", 0.5)]).await;
    assert_eq!((less.version, names(&less.zones)), (2, vec!["door"]));
    let until: Vec<_> =
        less.lifted.iter().map(|of| (of.zone.name.as_str(), of.until.as_nanos() / 1_000_000_000)).collect();
    assert_eq!(until, [("window", 30)]);
    let none = begun(&open(&database, 40).await, &[]).await;
    assert_eq!((none.version, none.zones.len(), none.lifted.len()), (3, 0, 2));
}

#[tokio::test]
async fn a_database_from_before_does_not_make_zones_weaker() {
    let folder = tempfile::tempdir().unwrap();
    let (database, backup) = (folder.path().join("a.sqlite"), folder.path().join("backup.sqlite"));
    let catalog = open(&database, 10).await;
    begun(&catalog, &[zone("door", 0.5)]).await;
    catalog.store.clone().close().await.unwrap();
    std::fs::copy(&database, &backup).unwrap();
    let catalog = open(&database, 20).await;
    begun(&catalog, &[zone("door", 0.5), zone("window", 0.1)]).await;
    catalog.store.clone().close().await.unwrap();
    // The backup comes back, and with it the configuration of then.
    for suffix in ["", "-wal", "-shm"] {
        let path = folder.path().join(format!("a.sqlite{suffix}"));
        if path.try_exists().unwrap() {
            std::fs::remove_file(path).unwrap();
        }
    }
    std::fs::copy(&backup, &database).unwrap();
    let catalog = open(&database, 30).await;
    let now = begun(&catalog, &[zone("door", 0.5)]).await;
    assert_eq!((now.version, names(&now.zones)), (3, vec!["door", "window"]));
    // They stay over the next start too, though the configuration says less.
    let kept = begun(&open(&database, 40).await, &[zone("door", 0.5)]).await;
    assert_eq!((kept.version, names(&kept.zones)), (3, vec!["door", "window"]));
}

#[test]
fn zones_that_were_lifted_long_ago_are_joined_and_hide_no_less() {
    let mut kept = KeptPrivacy::default();
    for nth in 0..3 * MAX_LIFTED as i64 {
        let own = zone("window", 0.8 * nth as f64 / (3 * MAX_LIFTED) as f64);
        kept = kept.changed(vec![own], Timestamp::from_nanos(nth));
    }
    kept = kept.changed(Vec::new(), Timestamp::from_nanos(1000));
    assert_eq!(kept.lifted.len(), MAX_LIFTED);
    for nth in 0..3 * MAX_LIFTED {
        let place = [0.8 * nth as f64 / (3 * MAX_LIFTED) as f64 + 0.05, 0.15];
        let before = Timestamp::from_nanos(nth as i64);
        assert!(kept.lifted.iter().any(|of| of.zone.holds(place) && before < of.until), "{nth}");
    }
    // One that comes back and goes again hides until it went last.
    let back = kept.changed(vec![kept.lifted[5].zone.clone()], Timestamp::from_nanos(2000));
    let gone = back.changed(Vec::new(), Timestamp::from_nanos(3000));
    assert_eq!((gone.lifted.len(), gone.lifted.last().unwrap().until.as_nanos()), (MAX_LIFTED, 3000));
}
