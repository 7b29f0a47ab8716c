//! `/` and `/wall`: the pages for people and for a wall's screens, as `web/` has them and `build.rs` embeds them; they use nothing
//! but the interface beside it. Development builds embed none and read them when they start: the pages change more often than
//! the daemon, and embedding them anew compiles the whole crate.

use super::Api;
use super::tags::EntityTag;
use axum::Router;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

/// The pages run their own scripts and show their own pictures (fetched, hence `blob:`), and talk to nobody else.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
                      connect-src 'self'; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// Files of this folder have a digest in their names: another content is another name.
const LASTING: &str = "/assets/";

/// Path and content of every file that was built; none where the pages were not, and in development builds.
const BUILT: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/web_pages.rs"));

/// What stands where the pages were not built.
const UNBUILT: &[(&str, &[u8])] = &[
    ("/", UNBUILT_PAGE.as_bytes()),
    ("/wall", UNBUILT_PAGE.as_bytes()),
    ("/icon.svg", include_bytes!("../../web/public/icon.svg")),
];

const UNBUILT_PAGE: &str = "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
    <title>videofields</title>\n<link rel=\"icon\" href=\"/icon.svg\">\n<h1>videofields</h1>\n\
    <p>This daemon was built without its web pages. <code>make web</code> makes them; then build it again.</p>\n\
    <p>The interface under <code>/api/v1</code> is whole without them.</p>\n</html>\n";

/// A route for every file.
pub(super) fn routes() -> Router<Api> {
    let files = if cfg!(debug_assertions) { read() } else { BUILT.to_vec() };
    let files = if files.is_empty() { UNBUILT.to_vec() } else { files };
    files.into_iter().fold(Router::new(), |router, (path, content)| {
        let tag = EntityTag::of(content).value();
        router.route(path, get(move || async move { answer(path, content, tag) }))
    })
}

/// What lies in `web/dist` of the checkout that this was built in, read once in the process; none where it cannot be.
fn read() -> Vec<(&'static str, &'static [u8])> {
    static READ: OnceLock<Vec<(String, Vec<u8>)>> = OnceLock::new();
    let read = READ.get_or_init(|| {
        let dist = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../web/dist"));
        let folders = [(dist.to_owned(), "/"), (dist.join("assets"), LASTING)];
        folders.iter().flat_map(|(folder, prefix)| read_folder(folder, prefix)).collect()
    });
    let is_built = read.iter().any(|(path, _)| path == "/");
    read.iter().filter(|_| is_built).map(|(path, content)| (path.as_str(), content.as_slice())).collect()
}

/// The files of one folder, by the paths at which they are asked for.
fn read_folder(folder: &Path, prefix: &str) -> Vec<(String, Vec<u8>)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names
        .filter(|name| !name.starts_with('.'))
        .filter_map(|name| {
            // Folders cannot be read so.
            let content = fs::read(folder.join(&name)).ok()?;
            let path = match name.as_str() {
                "index.html" => "/".to_owned(),
                "wall.html" => "/wall".to_owned(),
                _ => format!("{prefix}{name}"),
            };
            Some((path, content))
        })
        .collect()
}

fn answer(path: &str, content: &'static [u8], tag: HeaderValue) -> Response {
    let caching = if path.starts_with(LASTING) { "public, max-age=31536000, immutable" } else { "no-cache" };
    let fields = [
        (header::CONTENT_TYPE, HeaderValue::from_static(content_type(path))),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (header::CACHE_CONTROL, HeaderValue::from_static(caching)),
        (header::ETAG, tag),
    ];
    (fields, content).into_response()
}

/// What a file is, by its name's ending; without one it is a page.
fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("html", |(_, ending)| ending) {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "json" => "application/json",
        "wasm" => "application/wasm",
        "woff2" => "font/woff2",
        "png" => "image/png",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_pages_stand_whether_they_were_built_or_not() {
        for files in [BUILT, UNBUILT, &read()].into_iter().filter(|files| !files.is_empty()) {
            for wanted in ["/", "/wall", "/icon.svg"] {
                let (_, content) = files.iter().find(|(path, _)| *path == wanted).expect(wanted);
                assert!(!content.is_empty(), "{wanted}");
            }
        }
    }

    #[test]
    fn what_has_a_digest_in_its_name_is_kept_and_all_else_asked_for_again() {
        let caching = |path| {
            let tag = EntityTag::of(b"x").value();
            answer(path, b"x", tag).headers()[header::CACHE_CONTROL].to_str().unwrap().to_owned()
        };
        assert_eq!(caching("/"), "no-cache");
        assert_eq!(caching("/wall"), "no-cache");
        assert_eq!(caching("/icon.svg"), "no-cache");
        assert_eq!(caching("/assets/main-B3xYz_12.js"), "public, max-age=31536000, immutable");
        for (path, content) in BUILT.iter().chain(&read()) {
            let kind = content_type(path);
            assert_ne!(kind, "application/octet-stream", "{path} ({} bytes)", content.len());
        }
    }
}
