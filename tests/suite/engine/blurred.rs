//! Snapshots in which nobody can be told but who may be: two worlds that differ in what people look like alone.

use super::snapshots::House;
use super::{FRAME_NANOS, SIZE, camera, has_adapter, picture};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use videofields_service::engine::At;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::End;

/// Pictures of each camera, and the one that is kept.
const N_FRAMES: u32 = 60;
const SHOWN_NANOS: i64 = FRAME_NANOS * 55;

const ALL: &str = "/api/v1/snapshots";

/// Somebody who comes in after a while, in a coat of checks; `phase` says which of these are bright.
fn people(folder: &Path, name: &str, phase: u32) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for number in 0..N_FRAMES {
        let mut picture = picture(number);
        // Slowly to the right, as long as it takes until somebody is followed.
        let left = 16 + number / 4;
        for (x, y) in (0..SIZE.0).flat_map(|x| (0..SIZE.1).map(move |y| (x, y))) {
            let is_person = number >= 8 && (left..left + 12).contains(&x) && (12..36).contains(&y);
            let check = (x.wrapping_sub(left) / 2 + y / 2 + phase) % 2;
            match is_person {
                true => picture.put_pixel(x, y, image::Luma([if check == 0 { 250 } else { 170 }])),
                // Who walks there otherwise.
                false if picture.get_pixel(x, y).0[0] > 200 => picture.put_pixel(x, y, image::Luma([97])),
                false => {}
            }
        }
        picture.save(folder.join(format!("in{number:04}.png"))).unwrap();
    }
    folder.join("in%04d.png")
}

fn world(folder: &Path, phase: u32) -> House {
    let cameras = ["north", "south"].map(|id| camera(id, people(folder, id, phase), End::Stop));
    House::of(folder, cameras.to_vec())
}

fn pixels(bytes: &[u8]) -> Vec<u8> {
    image::load_from_memory(bytes).unwrap().into_rgb8().into_raw()
}

/// The greatest difference of two pictures, codes; and how many of each ten thousand differ by more than [`ALIKE`].
fn unlike(one: &[u8], other: &[u8]) -> (u8, usize) {
    assert_eq!(one.len(), other.len());
    let all = || one.iter().zip(other).map(|(one, other)| one.abs_diff(*other));
    (all().max().unwrap(), all().filter(|of| *of > ALIKE).count() * 10_000 / one.len())
}

/// What two worlds may differ by where people are blurred: a step of their means, and what is drawn between them.
const ALIKE: u8 = 24;

#[test]
fn people_in_snapshots_cannot_be_told_but_those_who_may_be_seen() {
    if !has_adapter() {
        return;
    }
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let houses = [world(folders[0].path(), 0), world(folders[1].path(), 1)];
    let t = SHOWN_NANOS;
    let made = |body: &Value, files: &[&str]| {
        let made = houses.each_ref().map(|house| {
            let path = house.make("both", body.clone());
            let of = |file: &&str| pixels(&house.get("both", &format!("{path}/{file}")).bytes);
            (files.iter().map(of).collect::<Vec<_>>(), path)
        });
        let n = files.len();
        (0..n).map(|idx| unlike(&made[0].0[idx], &made[1].0[idx])).collect::<Vec<_>>()
    };
    let view = |blur: Value| {
        let parameters = format!("eye=3,-6,3&target=0,0,0.5&width=240&height=180&t={t}");
        json!({"scene": "yard", "parameters": parameters, "blur_people": blur})
    };
    let of_north = |blur: Value| json!({"camera": "north", "t": t.to_string(), "blur_people": blur});
    let all = ["picture.png", "cameras/north.png", "cameras/south.png"];
    // Without it they can be told.
    let plain = made(&view(Value::Null), &all);
    assert!(plain[1].0 > 70 && plain[2].0 > 70, "{plain:?}");
    assert!(made(&of_north(Value::Null), &all[..1])[0].0 > 70);
    let points = |blur: Value| {
        let parameters = format!("eye=3,-6,3&target=0,0,0.5&width=240&height=180&t={t}&entities=points");
        json!({"scene": "yard", "parameters": parameters, "blur_people": blur})
    };
    let plain_points = made(&points(Value::Null), &all[..1]);
    // Where they stand follows from their outlines, which differ by a hair: so do their edges in a view.
    let check = |plain: (u8, usize), blurred: &[(u8, usize)]| {
        assert!(plain.1 > 5 * blurred[0].1 && blurred[0].1 <= 50, "{plain:?} {blurred:?}");
        assert!(blurred[1..].iter().all(|(most, _)| *most <= ALIKE), "{blurred:?}");
    };
    check(plain[0], &made(&view(json!({})), &all));
    check(plain_points[0], &made(&points(json!({})), &all));
    let blurred = made(&of_north(json!({})), &all[..1]);
    assert!(blurred[0].0 <= ALIKE, "{blurred:?}");

    // Who may be seen is, from that camera; the others blur them all the same.
    let house = &houses[0];
    let at = At::Time(Timestamp::from_nanos(t));
    let seen = house.bench.handle.observation("north", at).unwrap();
    let track = seen.tracks.iter().find(|track| track.blob_idx.is_some()).expect("somebody is followed");
    let who = json!({"camera": "north", "track": track.id, "at": track.last_seen.to_string()});
    let except = json!({"except": [who]});
    let path = house.make("both", of_north(except.clone()));
    let frame = house.get("both", &format!("/api/v1/cameras/north/frame.png?t={t}")).bytes;
    assert_eq!(pixels(&house.get("both", &format!("{path}/picture.png")).bytes), pixels(&frame));
    let record = house.get("both", &format!("{path}/record.json")).body;
    assert_eq!((&record["people"]["blurred"], &record["people"]["except"]), (&json!(true), &json!([who])));
    assert_eq!(record["people"]["found_by"], json!("segmentation"));
    assert_eq!(record["people"]["margin_share"], json!(0.15));
    assert_eq!(record["cameras"][0]["blurred"]["shown"], json!(1));
    let path = house.make("both", view(except));
    assert_eq!(pixels(&house.get("both", &format!("{path}/cameras/north.png")).bytes), pixels(&frame));
    let record = house.get("both", &format!("{path}/record.json")).body;
    let shown = [0, 1].map(|camera| record["cameras"][camera]["blurred"]["shown"].clone());
    assert_eq!(shown, [json!(1), json!(0)]);
    assert!(record["cameras"][1]["blurred"]["parts"].as_u64().unwrap() > 0, "{record}");
    assert_eq!(house.get("both", &format!("{path}/verification")).body["is_whole"], json!(true));

    // What is wrong is told as it is of exports, and nothing is kept.
    let n_kept = house.get("root", ALL).body["snapshots"].as_array().unwrap().len();
    let wrong = |body: Value, pointer: &str| {
        let refused = house.send("both", "POST", ALL, None, body);
        assert_eq!(refused.status, 400, "{}", refused.body);
        assert_eq!(refused.body["errors"][0]["pointer"], json!(pointer), "{}", refused.body);
    };
    let stranger = json!({"camera": "north", "track": 999, "at": track.last_seen.to_string()});
    let elsewhere = json!({"camera": "south", "track": 1, "at": track.last_seen.to_string()});
    let nowhere = json!({"camera": "west", "track": 1, "at": "0"});
    let never = json!({"camera": "north", "track": 1, "at": "noon"});
    wrong(of_north(json!({"except": [stranger]})), "/blur_people/except/0");
    wrong(view(json!({"except": [stranger]})), "/blur_people/except/0");
    wrong(of_north(json!({"except": [elsewhere]})), "/blur_people/except/0/camera");
    wrong(view(json!({"except": [nowhere]})), "/blur_people/except/0/camera");
    wrong(view(json!({"except": [never]})), "/blur_people/except/0/at");
    wrong(view(json!({"except": vec![who.clone(); 65]})), "/blur_people/except");
    wrong(view(json!({"but": []})), "/blur_people/but");
    assert_eq!(house.get("root", ALL).body["snapshots"].as_array().unwrap().len(), n_kept);

    let audit = house.get("root", "/api/v1/audit?limit=1000").body;
    let noted: Vec<&str> =
        audit["entries"].as_array().unwrap().iter().filter_map(|entry| entry["target"].as_str()).collect();
    for people in ["people=seen", "people=blurred", &format!("people=blurred&except=north/{}", track.id)] {
        let is_it = |target: &&&str| target.starts_with(ALL) && target.contains(&format!("&{people}&shown="));
        assert!(noted.iter().any(|target| is_it(&target)), "{people}: {noted:?}");
    }
    for house in houses {
        house.bench.stop();
    }
}

/// A camera of which nothing is known but its pictures: all of it is blurred.
#[test]
fn where_nobody_is_looked_for_everything_is_blurred() {
    let folder = TempDir::new().unwrap();
    let mut north = camera("north", people(folder.path(), "north", 0), End::Stop);
    let south = camera("south", people(folder.path(), "south", 0), End::Stop);
    north.vision = false;
    let house = House::of(folder.path(), vec![north, south]);
    let t = SHOWN_NANOS;
    let path = house.make("both", json!({"camera": "north", "t": t.to_string(), "blur_people": {}}));
    let record = house.get("both", &format!("{path}/record.json")).body;
    assert_eq!(record["cameras"][0]["blurred"], json!({"whole": true, "parts": null, "shown": 0}));
    let shown = image::load_from_memory(&house.get("both", &format!("{path}/picture.png")).bytes);
    let shown = shown.unwrap().into_luma8();
    let steps = shown.rows().flat_map(|row| {
        let row: Vec<u8> = row.map(|pixel| pixel.0[0]).collect();
        row.windows(2).map(|pair| pair[0].abs_diff(pair[1])).collect::<Vec<_>>()
    });
    assert!(steps.max().unwrap() < 40);
    house.bench.stop();
}
