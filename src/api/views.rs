//! `/api/v1/views`: views that people keep under a name, and their pictures; `kept` lists, shows and changes them.

use super::error::Problem;
use super::identity::Asked;
use super::kept::{self, Kept};
use super::openapi::{Routes, Tag};
use super::operation::Operation;
use super::parameters::Parameter;
use super::picture::{Picture, files, pictured, split};
use super::query::{Moment, Query};
use super::segments::Segments;
use super::tags::Finish;
use super::{Api, documents, effects, effort, schema, view};
use axum::extract::RawQuery;
use percent_encoding::percent_decode_str;
use serde_json::{Value, json};
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::NamedView;
use videofields_service::engine::ViewRequest;
use videofields_vision::access::Right;
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::{ErrorKind, Fault};

/// Most characters of a group or tag that is asked for.
const MAX_WORD_CHARS: usize = 100;

/// What these routes are about.
pub(super) const TAG: Tag = ("Named views", "Places from which scenes are looked at, kept under a name");

/// What their paths name.
pub(super) const SEGMENTS: &[Parameter] = &[
    Parameter::id("id", "A named view"),
    documents::NUMBER,
    Parameter::files("picture", || files(&[("picture", ())]), "Its picture, and how it is written"),
];

const FILTERS: &[Parameter] = &[
    Parameter::id("scene", "Only views of that scene"),
    Parameter::free("group", (0, MAX_WORD_CHARS), "Only views of that group"),
    Parameter::free("tag", (0, MAX_WORD_CHARS), "Only views with that tag"),
];

/// Routes about named views and their documents.
pub(super) fn routes() -> Routes {
    let picture = Operation::new("show_named_view", "What a named view shows")
        .about("A parameter of the request's stands in the place of the view's own.")
        .right(Right::Live)
        .parameters(view::PARAMETERS)
        .parameters(&effort::PARAMETERS)
        .parameters(&effects::PARAMETERS)
        .may_fail(&[422])
        .answers(pictured("The picture").field("Videofields-View-Version", "The view's version"));
    kept::routes::<NamedView>().merge(Routes::of(TAG, SEGMENTS).get(
        "/api/v1/views/{id}/{picture}",
        self::picture,
        picture,
    ))
}

impl kept::Kind for NamedView {
    const KIND: DocumentKind = DocumentKind::View;
    const LIST: &'static str = "views";
    const FILTERS: &'static [Parameter] = FILTERS;
    const TAG: Tag = TAG;
    const SEGMENTS: &'static [Parameter] = SEGMENTS;
    const SCHEMA: &'static str = "NamedView";
    const PATHS: [&'static str; 5] = [
        "/api/v1/views",
        "/api/v1/views/{id}",
        "/api/v1/views/{id}/versions",
        "/api/v1/views/{id}/versions/{number}",
        "/api/v1/views/{id}/versions/{number}/restore",
    ];
    const OPERATIONS: [&'static str; 8] = [
        "list_named_views",
        "show_named_view_document",
        "put_named_view",
        "change_named_view",
        "remove_named_view",
        "list_named_view_versions",
        "show_named_view_version",
        "restore_named_view",
    ];

    fn list_schema() -> Value {
        schema::walls::views()
    }

    fn read(document: Value) -> Result<(Self, Value), Vec<Fault>> {
        let view = Self::read(document)?;
        let normal = serde_json::to_value(&view);
        Ok((view, normal.map_err(|error| vec![Fault::new("", error.to_string())])?))
    }

    fn check(&self) -> Result<(), Problem> {
        let Err(faults) = self.request() else { return Ok(()) };
        let at = |fault: Fault| Fault::new("/parameters", format!("{}: {}", fault.place, fault.message));
        Err(Problem::at(ErrorKind::Invalid, faults.into_iter().map(at).collect()))
    }

    fn scene(&self) -> &str {
        &self.scene
    }

    fn request(&self) -> Result<ViewRequest, Vec<Fault>> {
        view::read_kept(&self.scene, &self.parameters)
    }

    fn summary(kept: &Kept<Self>) -> Value {
        let Kept { id, version, content, .. } = kept;
        let Self { name, scene, parameters, group, tags, order } = content;
        json!({
            "id": id, "name": name, "scene": scene, "parameters": parameters, "group": group, "tags": tags,
            "order": order, "version": version,
        })
    }

    /// Group by group, each in its own order.
    fn listed(query: &mut Query, mut all: Vec<Kept<Self>>) -> Vec<Kept<Self>> {
        let scene = query.id("scene");
        let allowed = format!("at most {MAX_WORD_CHARS} characters");
        let word = |text: &str| (text.chars().count() <= MAX_WORD_CHARS).then(|| text.to_owned());
        let group = query.value("group", &allowed, word);
        let tag = query.value("tag", &allowed, word);
        all.retain(|Kept { content, .. }| {
            scene.as_ref().is_none_or(|scene| *scene == content.scene)
                && group.as_ref().is_none_or(|group| *group == content.group)
                && tag.as_ref().is_none_or(|tag| content.tags.contains(tag))
        });
        let place = |Kept { id, content: of, .. }: &Kept<Self>| {
            (of.group.clone(), of.order, of.name.clone(), id.clone())
        };
        all.sort_by_cached_key(place);
        all
    }
}

/// What a named view shows; a parameter of the request's stands in the place of the view's own.
pub(super) async fn picture(
    Asked(api): Asked,
    Segments((id, file)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Picture, Problem> {
    let ((), format) = split(&file, &[("picture", ())])?;
    shown(&api, (&id, raw.as_deref().unwrap_or_default()), format).await
}

/// As [`picture`], in that format.
pub(super) async fn shown(
    api: &Api,
    (id, raw): (&str, &str),
    format: PictureFormat,
) -> Result<Picture, Problem> {
    let (version, request, moment) = asked(api, (id, raw), format)?;
    let mut picture = view::drawn(api, request, (format, moment), Finish::None).await?;
    picture.fields.push(("videofields-view-version", version.to_string()));
    Ok(picture)
}

/// What a named view asks for, and in which of its versions.
pub(super) fn asked(
    api: &Api,
    (id, raw): (&str, &str),
    format: PictureFormat,
) -> Result<(i64, ViewRequest, Moment), Problem> {
    let Kept { version, content, .. } = kept::find::<NamedView>(api, id)?;
    let query = merged(&content.parameters, raw);
    let (request, moment) = view::asked(api, (content.scene, format), Some(&query))?;
    Ok((version, request, moment))
}

/// A query string with another's parameters in the place of those of the same names.
fn merged(own: &str, asked: &str) -> String {
    let name = |part: &str| {
        let name = part.split('=').next().unwrap_or_default();
        percent_decode_str(name).decode_utf8_lossy().into_owned()
    };
    let names: Vec<String> = asked.split('&').map(name).collect();
    let kept = own.split('&').filter(|part| !names.contains(&name(part)));
    kept.chain(asked.split('&')).filter(|part| !part.is_empty()).collect::<Vec<_>>().join("&")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_of_a_request_stand_in_the_place_of_the_views_own() {
        let check = |own, asked, expected| assert_eq!(merged(own, asked), expected);
        check("", "", "");
        check("eye=0,0,1&fov=50", "", "eye=0,0,1&fov=50");
        check("eye=0,0,1&fov=50", "width=64&fov=40", "eye=0,0,1&width=64&fov=40");
        check("eye=0,0,1", "%65ye=1,1,1", "%65ye=1,1,1");
        // A parameter that comes twice is still told of.
        check("eye=0,0,1", "fov=1&fov=2", "eye=0,0,1&fov=1&fov=2");
    }
}
