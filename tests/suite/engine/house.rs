//! A whole daemon's interface over a running engine, with one scene in its configuration, asked over HTTP in this process.

use super::Bench;
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::{HeaderMap, Request};
use serde_json::Value;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;
use tower::ServiceExt;
use videofields_api::{self as api, Limits, Site, Trust};
use videofields_picture::scene;
use videofields_recording::accounts::{Accounts, Audit};
use videofields_service::catalog::{Catalog, ConfiguredScene};
use videofields_vision::clock::{Clock, SystemClock};

/// An engine and the interface over it.
pub(crate) struct House {
    pub(crate) bench: Bench,
    pub(crate) router: Router,
}

/// What came back.
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) headers: HeaderMap,
    pub(crate) etag: Option<String>,
    /// The body, where it is JSON.
    pub(crate) body: Value,
    pub(crate) bytes: Vec<u8>,
}

impl Answer {
    pub(crate) fn field(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }
}

impl House {
    /// Over an engine that has no scenes yet; `scene` is an id and the document of its file.
    pub(crate) fn over(folder: &Path, bench: Bench, (id, document): (&str, &str)) -> Self {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let router = bench.runtime.block_on(async {
            let scene = Arc::new(scene::parse(id, document, scene::no_imports).unwrap().scene);
            let file = folder.join(format!("{id}.json"));
            let configured = vec![ConfiguredScene { id: id.to_owned(), file, scene: Some(scene) }];
            let folders = (folder.to_owned(), vec![folder.to_owned()]);
            let catalog =
                Catalog::open(bench.store.clone(), Arc::clone(&clock), configured, folders).await.unwrap();
            let catalog = catalog.with_cameras(&bench.cameras);
            catalog.restore_playheads(&bench.handle);
            for scene in catalog.scenes(&[id.to_owned()]) {
                bench.handle.put_scene(scene).unwrap();
            }
            let accounts = Accounts::open(bench.store.clone(), Arc::clone(&clock)).await.unwrap();
            let trust = Trust {
                accounts: Arc::new(accounts),
                audit: Arc::new(Audit::new(bench.store.clone())),
                catalog: Arc::new(catalog),
                snapshots: None,
            };
            // Drawing takes long where code is not optimised, and beside other work.
            let limits = Limits { request_time: Duration::from_secs(60), ..Limits::default() };
            api::router_within(limits, (bench.handle.clone(), Some(trust)), clock, Site::default())
        });
        Self { bench, router }
    }

    pub(super) fn serve(&self) -> (SocketAddr, oneshot::Sender<()>) {
        serve(&self.bench.runtime, self.router.clone())
    }

    pub(crate) fn send(
        &self,
        method: &str,
        path: &str,
        condition: Option<(&str, &str)>,
        body: &str,
    ) -> Answer {
        let mut request = Request::builder().method(method).uri(path);
        if let Some((name, value)) = condition {
            request = request.header(name, value);
        }
        let request = request.body(Body::from(body.to_owned())).unwrap();
        self.bench.runtime.block_on(answered(self.router.clone(), request))
    }

    pub(crate) fn get(&self, path: &str) -> Answer {
        self.send("GET", path, None, "")
    }

    /// All of them at once, in that order.
    pub(crate) fn get_all(&self, paths: &[String]) -> Vec<Answer> {
        self.bench.runtime.block_on(async {
            let asked: Vec<_> = paths
                .iter()
                .map(|path| Request::get(path).body(Body::empty()).unwrap())
                .map(|request| tokio::spawn(answered(self.router.clone(), request)))
                .collect();
            let mut answers = Vec::new();
            for answer in asked {
                answers.push(answer.await.unwrap());
            }
            answers
        })
    }
}

/// Answers requests at an address of this machine, until the other end is sent to or dropped.
pub(super) fn serve(runtime: &Runtime, router: Router) -> (SocketAddr, oneshot::Sender<()>) {
    let (stop, stopped) = oneshot::channel();
    let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
    let address = listener.local_addr().unwrap();
    runtime.spawn(api::serve(listener, None, router, async move { drop(stopped.await) }));
    (address, stop)
}

pub(super) async fn answered(router: Router, request: Request<Body>) -> Answer {
    let response = router.oneshot(request).await.unwrap();
    let (parts, body) = response.into_parts();
    let etag = parts.headers.get("etag").map(|tag| tag.to_str().unwrap().to_owned());
    let bytes = to_bytes(body, 1 << 24).await.unwrap().to_vec();
    let body = serde_json::from_slice(&bytes).unwrap_or(Value::Null);
    Answer { status: parts.status.as_u16(), headers: parts.headers, etag, body, bytes }
}
