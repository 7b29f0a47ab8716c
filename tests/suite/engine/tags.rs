//! Pictures that a caller has already: answered without drawing, and never by another caller's tag.

use super::rights::{self, seen, two_worlds, users};
use super::{Bench, FRAME_NANOS, has_adapter, pictures};
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::{HeaderMap, Request};
use std::sync::Arc;
use tempfile::TempDir;
use tower::ServiceExt;
use videofields_api::{Limits, Site, router_within};
use videofields_service::engine::Handle;
use videofields_vision::clock::SystemClock;

fn router(handle: Handle) -> Router {
    router_within(Limits::default(), (handle, None), Arc::new(SystemClock::new()), Site::default())
}

/// Status, fields and body of what `path` answers to who has `tag`.
async fn get(router: &Router, path: &str, tag: Option<&str>) -> (u16, HeaderMap, Vec<u8>) {
    let fields: Vec<_> = tag.iter().map(|tag| ("if-none-match", *tag)).collect();
    ask(router, path, &fields).await
}

async fn ask(router: &Router, path: &str, fields: &[(&str, &str)]) -> (u16, HeaderMap, Vec<u8>) {
    let request =
        fields.iter().fold(Request::get(path), |request, (name, value)| request.header(*name, *value));
    let response = router.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap();
    let (parts, body) = response.into_parts();
    (parts.status.as_u16(), parts.headers, to_bytes(body, 1 << 24).await.unwrap().to_vec())
}

fn tag(headers: &HeaderMap) -> String {
    headers["etag"].to_str().unwrap().to_owned()
}

/// Pictures that the renderer was asked for.
fn asked(bench: &Bench) -> u64 {
    let text = bench.handle.metrics_text().unwrap();
    let count = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.trim().parse::<f64>().unwrap() as u64
    };
    count("videofields_render_wait_seconds_count ")
}

#[test]
fn who_has_a_picture_gets_no_other_and_none_is_drawn() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path(), pictures(folder.path(), "south", 0..20));
    let router = router(bench.handle.clone());
    bench.runtime.block_on(async {
        let size = "width=64&height=48";
        for path in [
            format!("/api/v1/scenes/yard/view.png?{size}"),
            format!("/api/v1/scenes/yard/view.jpg?{size}&t=200000000"),
            format!("/api/v1/scenes/yard/view.png?{size}&t=200000000&entities=points&projection=map"),
        ] {
            let (status, headers, body) = get(&router, &path, None).await;
            assert_eq!((status, body.is_empty()), (200, false), "{path}");
            let known = tag(&headers);
            let before = asked(&bench);
            let (status, again, body) = get(&router, &path, Some(&known)).await;
            assert_eq!((status, body.len(), tag(&again)), (304, 0, known.clone()), "{path}");
            assert_eq!(again["videofields-time"], headers["videofields-time"], "{path}");
            assert_eq!(again["cache-control"], headers["cache-control"], "{path}");
            assert_eq!(asked(&bench), before, "nothing was asked of the renderer: {path}");
            // A tag of something else, and another picture by this one's tag.
            assert_eq!(get(&router, &path, Some("\"AAAAAAAAAAAAAAAAAAAAAA\"")).await.0, 200, "{path}");
            assert_ne!(get(&router, &format!("{path}&quality=draft"), Some(&known)).await.0, 304, "{path}");
            assert!(asked(&bench) > before, "{path}");
        }
        for kind in ["frame.png", "background.jpg", "mask.png"] {
            let path = format!("/api/v1/cameras/north/{kind}?t=200000000");
            let (_, headers, _) = get(&router, &path, None).await;
            let (status, again, body) = get(&router, &path, Some(&tag(&headers))).await;
            assert_eq!((status, body.len()), (304, 0), "{kind}");
            assert!(!again.contains_key("server-timing"), "nothing was encoded: {kind}");
            assert_eq!(headers["cache-control"], "private, no-cache");
            let later = format!("/api/v1/cameras/north/{kind}?t={}", FRAME_NANOS * 15);
            let (status, other, _) = get(&router, &later, Some(&tag(&headers))).await;
            // Backgrounds of a still place may be the same to the bit.
            assert!(status == 200 || tag(&other) == tag(&headers), "{kind}: {status}");
        }
    });
    bench.stop();
}

#[test]
fn a_changed_scene_or_another_callers_cameras_are_another_picture() {
    if !has_adapter() {
        return;
    }
    let (_folders, [bench, other]) = two_worlds();
    let tokens = [&bench, &other].map(|bench| users(bench).map(|token| format!("Bearer {token}")));
    let routers = [&bench, &other].map(rights::router);
    let of = |wishes: &str| format!("/api/v1/scenes/yard/view.png?width=64&height=48{wishes}");
    let paths =
        ["", "&t=200000000", "&t=380000000", "&t=380000000&projection=map", "&entities=points"].map(of);
    bench.runtime.block_on(async {
        let mut n_unlike = 0;
        for path in &paths {
            let (status, admins, _) = ask(&routers[0], path, &[("authorization", &tokens[0][0])]).await;
            assert_eq!(status, 200, "{path}");
            let mut own_tags = Vec::new();
            for (router, [_, guest]) in routers.iter().zip(&tokens) {
                // Before this caller has drawn anything, and after: by the admin's tag only where the bytes are its own too.
                for _ in 0..2 {
                    let fields = [("authorization", guest.as_str()), ("if-none-match", &tag(&admins))];
                    let (status, own, body) = ask(router, path, &fields).await;
                    let is_own = tag(&own) == tag(&admins);
                    assert_eq!((status == 304, body.is_empty()), (is_own, is_own), "{path}: {status}");
                    assert!([200, 304].contains(&status), "{path}: {status}");
                    n_unlike += usize::from(!is_own);
                    own_tags.push(tag(&own));
                }
                let fields = [("authorization", guest.as_str()), ("if-none-match", own_tags.last().unwrap())];
                assert_eq!(ask(router, path, &fields).await.0, 304, "one's own is good: {path}");
            }
            assert!(
                own_tags.iter().all(|own| *own == own_tags[0]),
                "a tag tells of the hidden camera: {path}"
            );
        }
        assert!(n_unlike >= 4, "{n_unlike} pictures hang on the hidden camera");
        let path = &paths[0];
        let (_, admins, _) = ask(&routers[0], path, &[("authorization", &tokens[0][0])]).await;

        let scene = bench.handle.scene("yard").unwrap();
        let text = scene.document.replace("#705030", "#307050");
        let changed =
            videofields_picture::scene::parse("yard", &text, videofields_picture::scene::no_imports).unwrap();
        bench.handle.put_scene(Arc::new(changed.scene)).unwrap();
        let fields = [("authorization", tokens[0][0].as_str()), ("if-none-match", &tag(&admins))];
        let (status, now, _) = ask(&routers[0], path, &fields).await;
        assert_eq!(status, 200);
        assert_ne!(tag(&now), tag(&admins), "the ground has another colour");
    });
    bench.stop();
    other.stop();
}
