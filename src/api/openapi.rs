//! Routes with their descriptions: what a resource registers once is what is answered, what is refused (405 with `Allow`)
//! and what the contract says ([`contract`](super::contract)).

use super::operation::{MethodKind, Operation};
use super::parameters::Parameter;
use super::{Api, error, identity};
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::handler::Handler;
use axum::middleware::from_fn;
use axum::routing::{MethodFilter, MethodRouter, on};
use std::collections::BTreeMap;

/// A method as routes are registered for it; GET answers HEAD too. In the order in which `Allow` names them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Verb {
    Get,
    Post,
    Put,
    Patch,
    Delete,
}

impl Verb {
    const fn filter(self) -> MethodFilter {
        match self {
            Self::Get => MethodFilter::GET,
            Self::Post => MethodFilter::POST,
            Self::Put => MethodFilter::PUT,
            Self::Patch => MethodFilter::PATCH,
            Self::Delete => MethodFilter::DELETE,
        }
    }

    /// What it answers, as `Allow` has it.
    pub(super) const fn names(self) -> &'static [&'static str] {
        match self {
            Self::Get => &["GET", "HEAD"],
            Self::Post => &["POST"],
            Self::Put => &["PUT"],
            Self::Patch => &["PATCH"],
            Self::Delete => &["DELETE"],
        }
    }

    /// Whether it shows or changes something.
    pub(super) const fn kind(self) -> MethodKind {
        match self {
            Self::Get => MethodKind::Look,
            _ => MethodKind::Change,
        }
    }
}

/// What a group of routes is called, and what it is about.
pub(super) type Tag = (&'static str, &'static str);

/// One method of one path.
pub(super) struct Route {
    pub(super) path: &'static str,
    pub(super) verb: Verb,
    pub(super) tag: Tag,
    /// What the segments of its path mean, and of other paths of the same resource.
    pub(super) segments: &'static [Parameter],
    pub(super) operation: Operation,
    handler: MethodRouter<Api>,
}

/// The routes of a resource, or of several.
pub(super) struct Routes {
    tag: Tag,
    segments: &'static [Parameter],
    pub(super) routes: Vec<Route>,
}

impl Routes {
    /// Of a resource whose paths have some of these named segments.
    pub(super) const fn of(tag: Tag, segments: &'static [Parameter]) -> Self {
        Self { tag, segments, routes: Vec::new() }
    }

    /// Shows something at `path`: GET and HEAD.
    pub(super) fn get<T: 'static>(
        self,
        path: &'static str,
        handler: impl Handler<T, Api>,
        operation: Operation,
    ) -> Self {
        self.on(Verb::Get, path, handler, operation)
    }

    /// Asks for something.
    pub(super) fn post<T: 'static>(
        self,
        path: &'static str,
        handler: impl Handler<T, Api>,
        operation: Operation,
    ) -> Self {
        self.on(Verb::Post, path, handler, operation)
    }

    /// Makes or replaces something.
    pub(super) fn put<T: 'static>(
        self,
        path: &'static str,
        handler: impl Handler<T, Api>,
        operation: Operation,
    ) -> Self {
        self.on(Verb::Put, path, handler, operation)
    }

    /// Changes members of something.
    pub(super) fn patch<T: 'static>(
        self,
        path: &'static str,
        handler: impl Handler<T, Api>,
        operation: Operation,
    ) -> Self {
        self.on(Verb::Patch, path, handler, operation)
    }

    /// Takes something away.
    pub(super) fn delete<T: 'static>(
        self,
        path: &'static str,
        handler: impl Handler<T, Api>,
        operation: Operation,
    ) -> Self {
        self.on(Verb::Delete, path, handler, operation)
    }

    fn on<T: 'static>(
        mut self,
        verb: Verb,
        path: &'static str,
        handler: impl Handler<T, Api>,
        operation: Operation,
    ) -> Self {
        let handler = on(verb.filter(), handler);
        let handler = match operation.body_bytes {
            Some(most) => handler.layer(DefaultBodyLimit::max(most)),
            None => handler,
        };
        self.routes.push(Route { path, verb, tag: self.tag, segments: self.segments, operation, handler });
        self
    }

    /// And those of another resource.
    pub(super) fn merge(mut self, other: Self) -> Self {
        self.routes.extend(other.routes);
        self
    }

    /// What answers them. A path of which anything is not for everybody asks who is there; a method that a path does not
    /// have is refused with those that it has.
    pub(super) fn router(self) -> Router<Api> {
        let mut paths: BTreeMap<&'static str, Vec<Route>> = BTreeMap::new();
        for route in self.routes {
            paths.entry(route.path).or_default().push(route);
        }
        paths.into_iter().fold(Router::new(), |router, (path, routes)| router.route(path, answered(routes)))
    }
}

fn answered(mut routes: Vec<Route>) -> MethodRouter<Api> {
    routes.sort_by_key(|route| route.verb);
    let allowed: Vec<&str> = routes.iter().flat_map(|route| route.verb.names()).copied().collect();
    let is_open = routes.iter().all(|route| route.operation.is_open);
    let handlers =
        routes.into_iter().fold(MethodRouter::new(), |all, Route { handler, .. }| all.merge(handler));
    let handlers = handlers.fallback(move || async move { error::only(&allowed) });
    if is_open { handlers } else { handlers.layer(from_fn(identity::require)) }
}
