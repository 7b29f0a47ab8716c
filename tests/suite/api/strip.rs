//! `/api/v1/cameras/{id}/strip.jpg` over HTTP.

use super::Bench;
use std::time::Duration;

const STRIP: &str = "/api/v1/cameras/north/strip.jpg";

#[tokio::test]
async fn a_strip_shows_each_part_of_a_stretch_and_says_when_its_pictures_were_seen() {
    let bench = Bench::new();
    // The camera's first picture is of second 1.
    let answer = bench.get(&format!("{STRIP}?from=-8000000000&to=8000000000&count=4&height=40")).await;
    assert_eq!((answer.status.as_u16(), answer.field("content-type")), (200, "image/jpeg"));
    assert_eq!(answer.field("videofields-times"), "gap,gap,1970-01-01T00:00:02Z,1970-01-01T00:00:06Z");
    assert!(answer.field("server-timing").starts_with("decode;dur="));
    let picture = image::load_from_memory(&answer.body).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (4 * 60, 40));
    assert!(picture.get_pixel(30, 20).0[0] < 50 && picture.get_pixel(150, 20).0[0] > 200);
    assert_eq!(bench.door.0.lock().unwrap().reach, Some(Duration::from_secs(2)));
    let usual = bench.get(&format!("{STRIP}?from=2000000000&to=14000000000")).await;
    assert_eq!(usual.field("videofields-times").split(',').count(), 12);
}

#[tokio::test]
async fn a_strip_that_makes_no_sense_is_refused_at_its_place() {
    let bench = Bench::new();
    for (query, parameter, said) in [
        ("to=5", "from", "is required"),
        ("from=5&to=5", "to", "must be after from"),
        ("from=0&to=9&count=49", "count", "a whole number from 1 to 48"),
        ("from=0&to=9&height=20", "height", "a whole number from 32 to 360"),
        ("from=0&to=9&t=live", "t", "is not a parameter here"),
    ] {
        let problem = bench.get(&format!("{STRIP}?{query}")).await.problem(400, STRIP);
        assert_eq!(problem["errors"][0]["parameter"], parameter, "{query}: {problem}");
        assert!(problem["errors"][0]["detail"].as_str().unwrap().contains(said), "{query}: {problem}");
    }
    let other = "/api/v1/cameras/yard/strip.jpg";
    bench.get(&format!("{other}?from=0&to=9")).await.problem(404, other);
    // All of time is a stretch like any other.
    let all = format!("{STRIP}?from=-9223372036854775808&to=9223372036854775807&count=2");
    assert_eq!(bench.get(&all).await.field("videofields-times"), "gap,2026-09-21T14:13:20.5Z");
}
