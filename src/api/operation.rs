//! One method of one route, described: what it is for, what it takes, what it answers and how it may fail.

use super::parameters::Parameter;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use videofields_vision::access::{Right, Role};

/// A description that grows as it is told what the method does. What all have in common (limits, who asks) needs not be
/// said: see [`Operation::failures`].
#[derive(Clone, Debug)]
pub(super) struct Operation {
    pub(super) id: &'static str,
    pub(super) summary: &'static str,
    pub(super) description: String,
    pub(super) parameters: Vec<Parameter>,
    pub(super) conditions: Conditions,
    pub(super) bodies: Vec<(&'static str, Value)>,
    pub(super) needs_body: bool,
    /// Most bytes of a body where that is not what every route takes.
    pub(super) body_bytes: Option<usize>,
    pub(super) answers: Vec<Answer>,
    failures: BTreeSet<u16>,
    pub(super) role: Role,
    pub(super) rights: Vec<Right>,
    pub(super) is_open: bool,
    /// Whether `Idempotency-Key` is heard.
    pub(super) is_once: bool,
    /// True for a question that is asked by POST and changes nothing.
    pub(super) keeps_nothing: bool,
}

/// Which conditions (RFC 9110, section 13) a method reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Conditions {
    #[default]
    None,
    /// `If-Match` or `If-None-Match: *` must come.
    Change,
    /// They may come.
    MayChange,
    /// `If-None-Match` may come.
    Look,
    /// `Last-Event-ID` may come.
    Resume,
    /// `Range`, and conditions of time.
    File,
}

/// An answer of success.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) meaning: &'static str,
    /// Media types, with the schema of what is JSON or text.
    pub(super) contents: Vec<(&'static str, Option<Value>)>,
    /// Header fields that always come, by name, with their meaning.
    pub(super) fields: Vec<(&'static str, &'static str)>,
    /// Those that come at times.
    pub(super) optional_fields: Vec<(&'static str, &'static str)>,
}

impl Answer {
    /// Without a body.
    pub(super) const fn nothing(status: u16, meaning: &'static str) -> Self {
        Self { status, meaning, contents: Vec::new(), fields: Vec::new(), optional_fields: Vec::new() }
    }

    /// JSON of that schema.
    pub(super) fn json(status: u16, meaning: &'static str, schema: Value) -> Self {
        Self::nothing(status, meaning).media("application/json", Some(schema))
    }

    /// A page of a list, of that schema.
    pub(super) fn page(meaning: &'static str, schema: Value) -> Self {
        Self::json(200, meaning, schema)
            .may_have("Link", "The question for the next page, where there is one")
    }

    /// Bytes of one of these media types.
    pub(super) fn bytes(status: u16, meaning: &'static str, types: &[&'static str]) -> Self {
        types.iter().fold(Self::nothing(status, meaning), |answer, media_type| answer.media(media_type, None))
    }

    /// And as that media type.
    pub(super) fn media(mut self, media_type: &'static str, schema: Option<Value>) -> Self {
        self.contents.push((media_type, schema));
        self
    }

    /// With a header field.
    pub(super) fn field(mut self, name: &'static str, meaning: &'static str) -> Self {
        self.fields.push((name, meaning));
        self
    }

    /// With a header field that comes at times.
    pub(super) fn may_have(mut self, name: &'static str, meaning: &'static str) -> Self {
        self.optional_fields.push((name, meaning));
        self
    }

    /// With the version of what is answered.
    pub(super) fn tagged(self) -> Self {
        self.field("ETag", "The version; `If-Match` of a change takes it")
    }
}

impl Operation {
    /// `id` is unique among all, in snake case; `summary` is a few words.
    pub(super) fn new(id: &'static str, summary: &'static str) -> Self {
        Self {
            id,
            summary,
            description: String::new(),
            parameters: Vec::new(),
            conditions: Conditions::None,
            bodies: Vec::new(),
            needs_body: true,
            body_bytes: None,
            answers: Vec::new(),
            failures: BTreeSet::new(),
            role: Role::Viewer,
            rights: Vec::new(),
            is_open: false,
            is_once: false,
            keeps_nothing: false,
        }
    }

    /// More about it, in sentences.
    pub(super) fn about(mut self, text: &str) -> Self {
        self.description = text.to_owned();
        self
    }

    /// What its query may have.
    pub(super) fn parameters(mut self, parameters: &[Parameter]) -> Self {
        self.parameters.extend(parameters);
        self
    }

    /// A JSON body of that schema.
    pub(super) fn takes(self, schema: Value) -> Self {
        self.takes_media("application/json", schema)
    }

    /// A JSON Merge Patch (RFC 7396) of that schema, also where it says that it is JSON.
    pub(super) fn takes_patch(self, schema: Value) -> Self {
        self.takes_media("application/merge-patch+json", schema.clone()).takes(schema)
    }

    /// A body of that media type, or of those said before.
    pub(super) fn takes_media(mut self, media_type: &'static str, schema: Value) -> Self {
        self.bodies.push((media_type, schema));
        self
    }

    /// A body of so many bytes, where that is not [`super::content::MAX_BODY_BYTES`].
    pub(super) fn takes_bytes(mut self, most: usize) -> Self {
        self.body_bytes = Some(most);
        self
    }

    /// A change that needs `If-Match` or `If-None-Match: *`.
    pub(super) fn conditional(mut self) -> Self {
        self.conditions = Conditions::Change;
        self.may_fail(&[412, 428])
    }

    /// A change that `If-Match` or `If-None-Match: *` may stand before.
    pub(super) fn may_be_conditional(mut self) -> Self {
        self.conditions = Conditions::MayChange;
        self.may_fail(&[412])
    }

    /// A job that is made once however often it is asked for with one `Idempotency-Key`.
    pub(super) fn once(mut self) -> Self {
        self.is_once = true;
        self.may_fail(&[409, 422])
    }

    /// A question that changes nothing, though it is asked by POST.
    pub(super) fn keeps_nothing(mut self) -> Self {
        self.keeps_nothing = true;
        self
    }

    /// An answer that `If-None-Match` spares who has it already.
    pub(super) fn revalidated(mut self) -> Self {
        self.conditions = Conditions::Look;
        self.answers(Answer::nothing(304, "What `If-None-Match` names is still the newest"))
    }

    /// A stream of events that goes on after the one that `Last-Event-ID` names.
    pub(super) fn resumed(mut self) -> Self {
        self.conditions = Conditions::Resume;
        self
    }

    /// A file, whole or in ranges, unless the caller has it.
    pub(super) fn ranged(mut self) -> Self {
        self.conditions = Conditions::File;
        self.may_fail(&[412, 416])
    }

    /// How it is answered when all goes well.
    pub(super) fn answers(mut self, answer: Answer) -> Self {
        self.answers.push(answer);
        self
    }

    /// Statuses of failure beside those that every route may answer.
    pub(super) fn may_fail(mut self, statuses: &[u16]) -> Self {
        self.failures.extend(statuses);
        self
    }

    /// For who has this role, or one above it.
    pub(super) fn role(mut self, role: Role) -> Self {
        self.role = role;
        self.may_fail(&[403])
    }

    /// For who has this right of the cameras.
    pub(super) fn right(mut self, right: Right) -> Self {
        self.rights.push(right);
        self.may_fail(&[403])
    }

    /// For everybody, also where there are users.
    pub(super) fn open(mut self) -> Self {
        self.is_open = true;
        self
    }

    /// Every status of failure, for a method on a path with `has_segments`: what the limits of every request come to, who
    /// asks, and what was said of this one.
    pub(super) fn failures(&self, kind: MethodKind, has_segments: Segmented) -> BTreeSet<u16> {
        let mut all = self.failures.clone();
        all.extend([400, 401, 414, 421, 431, 500, 503]);
        if has_segments == Segmented::Yes {
            all.insert(404);
        }
        if kind == MethodKind::Change {
            // A page's change without proof that it is the page's own.
            all.insert(403);
            if !self.keeps_nothing {
                // A user's changes are bounded.
                all.insert(429);
            }
        }
        if !self.bodies.is_empty() {
            all.extend([408, 413]);
        }
        all
    }

    /// Role and rights, as the contract has them beside OpenAPI's own members.
    pub(super) fn extensions(&self) -> Vec<(&'static str, Value)> {
        let mut extensions = Vec::new();
        if self.is_open {
            return extensions;
        }
        extensions.push(("x-videofields-role", json!(self.role.as_str())));
        if !self.rights.is_empty() {
            let rights: Vec<&str> = self.rights.iter().map(|right| right.as_str()).collect();
            extensions.push(("x-videofields-rights", json!(rights)));
        }
        extensions
    }
}

/// Whether a method shows or changes something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MethodKind {
    /// GET and HEAD.
    Look,
    /// Any other.
    Change,
}

/// Whether a path has segments that name something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Segmented {
    /// It has.
    Yes,
    /// It stands as it is.
    No,
}
