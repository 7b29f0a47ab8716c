//! What is not sent again, and what is sent in fewer bytes.

use super::{Answer, Bench, DOCUMENT, State};
use axum::body::Body;
use axum::http::Request;
use std::io::Read as _;
use videofields_api::Limits;

async fn get(bench: &Bench, path: &str, fields: &[(&str, &str)]) -> Answer {
    let request =
        fields.iter().fold(Request::get(path), |request, (name, value)| request.header(*name, *value));
    bench.send(request.body(Body::empty()).unwrap()).await
}

#[tokio::test]
async fn every_picture_and_document_has_a_tag_and_is_not_sent_to_who_has_it() {
    let bench = Bench::new();
    for path in [
        "/api/v1/cameras/north/frame.jpg",
        "/api/v1/cameras/north/mask.png?t=2000000000",
        "/api/v1/cameras/north/strip.jpg?from=2&to=9000000000&count=2",
        "/api/v1/scenes/plaza/view.png?width=8&height=8",
        "/api/v1/scenes/plaza",
    ] {
        let first = get(&bench, path, &[]).await;
        let tag = first.field("etag").to_owned();
        assert_eq!(first.status, 200, "{path}");
        assert!(tag.starts_with('"') && tag.ends_with('"') && tag.len() > 2, "{path}: {tag}");
        for named in [tag.clone(), format!("W/{tag}"), format!("\"other\", {tag}"), "*".to_owned()] {
            let again = get(&bench, path, &[("if-none-match", &named)]).await;
            assert_eq!((again.status.as_u16(), again.body.len()), (304, 0), "{path} {named}");
            assert_eq!(again.field("etag"), tag, "{path} {named}");
            assert_eq!(again.field("cache-control"), first.field("cache-control"), "{path}");
            assert_eq!(again.field("content-type"), "(absent)", "{path}");
        }
        let other = get(&bench, path, &[("if-none-match", "\"other\"")]).await;
        assert_eq!((other.status.as_u16(), other.body), (200, first.body), "{path}");
        let head = Request::head(path).header("if-none-match", &tag).body(Body::empty()).unwrap();
        assert_eq!(bench.send(head).await.status.as_u16(), 304, "{path}");
    }
    // What failed has no tag, and `*` makes no 304 of it.
    let missing = get(&bench, "/api/v1/cameras/nobody/frame.jpg", &[("if-none-match", "*")]).await;
    missing.problem(404, "/api/v1/cameras/nobody/frame.jpg");
}

#[tokio::test]
async fn text_is_compressed_for_who_takes_it_and_pictures_never_are() {
    let bench = Bench::new();
    let gzip = [("accept-encoding", "gzip, br")];
    for path in ["/", "/wall", "/api/v1/accuracy", "/api/v1/cameras"] {
        let plain = get(&bench, path, &[]).await;
        let packed = get(&bench, path, &gzip).await;
        if plain.body.len() < 1024 {
            assert_eq!(packed.field("content-encoding"), "(absent)", "{path}");
            continue;
        }
        assert_eq!(plain.field("content-encoding"), "(absent)", "{path}");
        assert_eq!(packed.field("content-encoding"), "gzip", "{path}");
        assert!(packed.field("vary").to_lowercase().contains("accept-encoding"), "{path}");
        assert!(packed.body.len() < plain.body.len(), "{path}: {} bytes", packed.body.len());
        let mut unpacked = Vec::new();
        flate2::read::GzDecoder::new(packed.body.as_slice()).read_to_end(&mut unpacked).unwrap();
        assert_eq!(unpacked, plain.body, "{path}");
    }
    for path in
        ["/api/v1/cameras/north/frame.png", "/api/v1/scenes/plaza/view.jpg?width=64&height=64", "/nothing"]
    {
        assert_eq!(get(&bench, path, &gzip).await.field("content-encoding"), "(absent)", "{path}");
    }
    assert_eq!(
        get(&bench, "/", &[("accept-encoding", "gzip;q=0")]).await.field("content-encoding"),
        "(absent)"
    );
}

#[tokio::test]
async fn what_was_compressed_has_a_tag_of_its_own_that_means_the_same() {
    let document = format!("{{\"name\": \"{}\"}}", "plaza ".repeat(2000));
    let bench =
        Bench::within(Limits::default(), State { document: Some(document.clone()), ..State::default() });
    let path = "/api/v1/scenes/plaza";
    let plain = get(&bench, path, &[]).await;
    assert_eq!((plain.field("etag"), plain.body.len()), ("\"0\"", document.len()));
    let packed = get(&bench, path, &[("accept-encoding", "gzip")]).await;
    assert_eq!((packed.field("etag"), packed.field("content-encoding")), ("\"0-gzip\"", "gzip"));
    assert!(packed.body.len() < 200, "{} bytes", packed.body.len());
    for named in ["\"0\"", "\"0-gzip\""] {
        let again = get(&bench, path, &[("accept-encoding", "gzip"), ("if-none-match", named)]).await;
        assert_eq!((again.status.as_u16(), again.field("etag")), (304, named));
        assert_eq!(again.field("content-encoding"), "(absent)");
    }
    assert_eq!(get(&Bench::new(), path, &[("accept-encoding", "gzip")]).await.body, DOCUMENT.as_bytes());
}
