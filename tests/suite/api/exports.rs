//! `/api/v1/exports` over HTTP.

use super::{Answer, Bench};
use axum::body::Body;
use axum::http::Request;
use serde_json::json;
use videofields_recording::archive::ExportFile;

const EXPORTS: &str = "/api/v1/exports";
const ONE: &str = "/api/v1/exports/20260301t120000z";

async fn send(bench: &Bench, method: &str, path: &str, body: &str) -> Answer {
    bench.send(Request::builder().method(method).uri(path).body(Body::from(body.to_owned())).unwrap()).await
}

#[tokio::test]
async fn an_export_is_asked_for_watched_and_taken_back() {
    let bench = Bench::new();
    let asked = send(&bench, "POST", EXPORTS, r#"{"note": "case 7"}"#).await;
    assert_eq!((asked.status.as_u16(), asked.field("location")), (202, ONE));
    let expected = json!({
        "id": "20260301t120000z", "state": "waiting", "reason": null, "progress": 0.0,
        "made_at": super::LAST.to_string(), "from": super::FIRST.to_string(), "to": super::LAST.to_string(),
        "cameras": ["north"], "note": "case 7", "asked_by": null, "bytes": 0, "files": []
    });
    assert_eq!(asked.json(), expected);
    assert_eq!(bench.get(ONE).await.json(), expected);
    let list = bench.get(EXPORTS).await;
    let listed = json!({"exports": [expected], "next": null});
    assert_eq!((list.json(), list.field("cache-control")), (listed, "no-store"));
    assert_eq!(send(&bench, "DELETE", ONE, "").await.status.as_u16(), 204);
    send(&bench, "DELETE", ONE, "").await.problem(404, ONE);
    bench.get(ONE).await.problem(404, ONE);
}

#[tokio::test]
async fn files_are_given_whole_or_in_parts_and_no_other_than_an_exports_own() {
    let bench = Bench::new();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("north.mp4"), b"0123456789").unwrap();
    std::fs::write(folder.path().join("secret"), b"secret").unwrap();
    send(&bench, "POST", EXPORTS, "{}").await;
    {
        let mut state = bench.door.0.lock().unwrap();
        state.export_folder = folder.path().to_owned();
        let file = |name: &str| ExportFile {
            file: name.to_owned(),
            bytes: 10,
            sha256: "0".repeat(64),
            media_type: "video/mp4".to_owned(),
        };
        state.exports[0].files = vec![file("north.mp4"), file("gone.mp4")];
    }
    let path = format!("{ONE}/north.mp4");
    let whole = bench.get(&path).await;
    assert_eq!((whole.status.as_u16(), whole.body.as_slice()), (200, b"0123456789".as_slice()));
    assert_eq!((whole.field("content-type"), whole.field("content-length")), ("video/mp4", "10"));
    assert_eq!(whole.field("content-disposition"), "attachment; filename=\"20260301t120000z-north.mp4\"");
    let range = Request::get(&path).header("range", "bytes=4-6").body(Body::empty()).unwrap();
    let part = bench.send(range).await;
    assert_eq!((part.status.as_u16(), part.body.as_slice()), (206, b"456".as_slice()));
    assert_eq!(part.field("content-range"), "bytes 4-6/10");
    let head = Request::head(&path).body(Body::empty()).unwrap();
    let head = bench.send(head).await;
    assert_eq!((head.status.as_u16(), head.body.len(), head.field("content-length")), (200, 0, "10"));
    for name in ["secret", "..%2F..%2Fetc%2Fpasswd", "%2Fetc%2Fpasswd"] {
        let problem = bench.get(&format!("{ONE}/{name}")).await;
        assert_eq!(problem.status.as_u16(), 404, "{name}");
    }
    let gone = format!("{ONE}/gone.mp4");
    bench.get(&gone).await.problem(503, &gone);
    let other = "/api/v1/exports/none/north.mp4";
    bench.get(other).await.problem(404, other);
}

#[tokio::test]
async fn what_is_no_request_for_an_export_is_refused() {
    let bench = Bench::new();
    send(&bench, "POST", EXPORTS, "{").await.problem(400, EXPORTS);
    let foreign =
        Request::post(EXPORTS).header("sec-fetch-site", "cross-site").body(Body::from("{}")).unwrap();
    bench.send(foreign).await.problem(400, EXPORTS);
    let refused = send(&bench, "PUT", EXPORTS, "{}").await;
    assert_eq!(refused.field("allow"), "GET, HEAD, POST");
    refused.problem(405, EXPORTS);
    let refused = send(&bench, "POST", ONE, "{}").await;
    assert_eq!(refused.field("allow"), "GET, HEAD, DELETE");
    refused.problem(405, ONE);
}
