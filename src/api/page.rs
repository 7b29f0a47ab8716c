//! `/` and `/wall`: a page for people and one for a wall's screens, made of a few files in `page/`; they use nothing but the interface beside it.

use super::Api;
use axum::Router;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;

/// The page runs its own scripts and shows its own pictures (fetched, hence `blob:`), and talks to nobody else.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Path, content type and text of every file.
const FILES: [(&str, &str, &str); 13] = [
    ("/", "text/html; charset=utf-8", include_str!("page/index.html")),
    ("/app.css", "text/css; charset=utf-8", include_str!("page/app.css")),
    ("/app.js", "text/javascript; charset=utf-8", include_str!("page/app.js")),
    ("/ask.js", "text/javascript; charset=utf-8", include_str!("page/ask.js")),
    ("/login.js", "text/javascript; charset=utf-8", include_str!("page/login.js")),
    ("/view.js", "text/javascript; charset=utf-8", include_str!("page/view.js")),
    ("/orbit.js", "text/javascript; charset=utf-8", include_str!("page/orbit.js")),
    ("/cameras.js", "text/javascript; charset=utf-8", include_str!("page/cameras.js")),
    ("/wall", "text/html; charset=utf-8", include_str!("page/wall.html")),
    ("/wall.css", "text/css; charset=utf-8", include_str!("page/wall.css")),
    ("/wall.js", "text/javascript; charset=utf-8", include_str!("page/wall.js")),
    ("/frames.js", "text/javascript; charset=utf-8", include_str!("page/frames.js")),
    ("/icon.svg", "image/svg+xml", include_str!("page/icon.svg")),
];

/// A route for every file.
pub(super) fn routes() -> Router<Api> {
    FILES.iter().fold(Router::new(), |router, &(path, content_type, text)| {
        router.route(path, get(move || async move { answer(content_type, text) }))
    })
}

fn answer(content_type: &'static str, text: &'static str) -> Response {
    let fields = [
        (header::CONTENT_TYPE, content_type),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (fields, text).into_response()
}
