//! How faults are said: what is unknown and what was probably meant; serde's messages in the house's words.

/// The word of `allowed` that was probably meant by `word`, if one is near.
///
/// Near is at most a third of the letters changed, counted as [Damerau 1964] counts them: one for a letter left
/// out, put in, exchanged, or swapped with its neighbour; or that the one begins with the other, as a name does
/// that lacks its unit.
///
/// [Damerau 1964]: https://doi.org/10.1145/363958.363994
pub fn closest<'a>(word: &str, allowed: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase();
    let distance = |candidate: &str| {
        let candidate = candidate.to_lowercase();
        let is_begun = word.len() >= 3 && candidate.len() >= 3;
        if is_begun && (candidate.starts_with(&word) || word.starts_with(&candidate)) {
            return Some(1);
        }
        let changed = strsim::damerau_levenshtein(&word, &candidate);
        (changed * 3 <= candidate.len().max(word.len())).then_some(changed)
    };
    let near = allowed.into_iter().filter_map(|candidate| Some((distance(candidate)?, candidate)));
    near.min_by_key(|(distance, _)| *distance).map(|(_, candidate)| candidate)
}

/// Says that `word` is no known `what` ("key", "value", "parameter"), what was probably meant and what is allowed.
#[must_use]
pub fn unknown(what: &str, word: &str, allowed: &[&str]) -> String {
    let word: String = word.chars().take(64).collect();
    let meant = closest(&word, allowed.iter().copied())
        .map_or_else(String::new, |near| format!("did you mean `{near}`? "));
    let list = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
    format!("unknown {what} `{}`; {meant}allowed: {list}", word.escape_debug())
}

/// The one of `all` that has this name.
///
/// # Errors
/// Where none has: [`unknown`], of that `what`.
pub fn one_of<T: Copy>(
    what: &str,
    name: &str,
    all: &[T],
    name_of: impl Fn(T) -> &'static str,
) -> Result<T, String> {
    let found = all.iter().copied().find(|of| name_of(*of) == name);
    found.ok_or_else(|| unknown(what, name, &all.iter().copied().map(name_of).collect::<Vec<_>>()))
}

/// What serde's derived code says about a value, taken apart.
pub(super) enum Complaint<'a> {
    /// A key that the type does not have.
    UnknownKey { key: &'a str, allowed: Vec<&'a str> },
    /// A key that the type needs.
    MissingKey { key: &'a str },
    /// Anything else, ready to be said.
    Other { message: String },
}

impl<'a> Complaint<'a> {
    /// Takes apart a message of `serde::de::Error`'s constructors, whose wording serde has kept since 1.0.
    pub(super) fn parse(message: &'a str) -> Self {
        if let Some((key, allowed)) = message.strip_prefix("unknown field `").and_then(expected) {
            Self::UnknownKey { key, allowed }
        } else if let Some(key) =
            message.strip_prefix("missing field `").and_then(|rest| rest.strip_suffix('`'))
        {
            Self::MissingKey { key }
        } else if let Some((value, allowed)) = message.strip_prefix("unknown variant `").and_then(expected) {
            Self::Other { message: unknown("value", value, &allowed) }
        } else {
            Self::Other { message: plain(message) }
        }
    }
}

/// Takes apart what follows the quote before a word that is not known: the word, which may hold anything, quotes too, and the words that
/// are allowed.
fn expected(rest: &str) -> Option<(&str, Vec<&str>)> {
    // The last are serde's own.
    let end = [rest.rfind("`, expected "), rest.rfind("`, there are no ")].into_iter().flatten().max()?;
    let (word, allowed) = rest.split_at(end);
    Some((word, allowed[1..].split('`').skip(1).step_by(2).collect()))
}

/// serde names Rust's types; people who write documents know numbers and texts.
fn plain(message: &str) -> String {
    const WORDS: [(&str, &str); 10] = [
        ("invalid type: ", "wrong type: "),
        ("map, expected", "a table, expected"),
        ("sequence, expected", "a list, expected"),
        ("expected a sequence", "expected a list"),
        ("expected struct", "expected a table for"),
        ("expected u32", "expected a whole number, 0 or more"),
        ("expected u64", "expected a whole number, 0 or more"),
        ("expected usize", "expected a whole number, 0 or more"),
        ("expected f64", "expected a number"),
        ("expected path string", "expected a path (text)"),
    ];
    WORDS.iter().fold(message.to_owned(), |text, (from, to)| text.replace(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_that_was_meant_is_found() {
        let allowed = ["listen", "database", "samples"];
        let check = |word: &str, expected: Option<&str>| {
            assert_eq!(closest(word, allowed), expected, "{word}");
        };
        check("listne", Some("listen"));
        check("Listen", Some("listen"));
        check("sample", Some("samples"));
        check("data-base", Some("database"));
        check("sam", Some("samples"));
        check("listen_address", Some("listen"));
        check("colour", None);
        check("sa", None);
        check("", None);
        check("\u{1F600}", None);
    }

    #[test]
    fn of_several_the_one_of_that_name_is_found_or_all_are_told() {
        let name_of = |of: u8| ["zero", "one"][usize::from(of)];
        assert_eq!(one_of("number", "one", &[0, 1], name_of), Ok(1));
        assert_eq!(
            one_of("number", "on", &[0, 1], name_of).unwrap_err(),
            unknown("number", "on", &["zero", "one"])
        );
        assert!(one_of::<u8>("number", "one", &[], name_of).unwrap_err().ends_with("allowed: none"));
    }

    #[test]
    fn unknown_words_are_said_with_what_is_allowed() {
        assert_eq!(
            unknown("key", "listne", &["listen", "port"]),
            "unknown key `listne`; did you mean `listen`? allowed: listen, port"
        );
        assert_eq!(unknown("key", "zzz", &["listen"]), "unknown key `zzz`; allowed: listen");
        assert_eq!(unknown("key", "a\nb", &[]), "unknown key `a\\nb`; allowed: none");
        assert!(unknown("key", &"x".repeat(10_000), &["listen"]).len() < 200);
    }

    #[test]
    fn quotes_within_a_key_are_part_of_it() {
        use serde::Deserialize;
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Two {
            #[expect(dead_code, reason = "its name counts")]
            listen: Option<u8>,
            #[expect(dead_code, reason = "its name counts")]
            port: Option<u8>,
        }
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct None {}
        #[derive(Debug, Deserialize)]
        enum Word {
            #[serde(rename = "on")]
            On,
        }
        fn complaint<T: serde::de::DeserializeOwned + std::fmt::Debug>(value: serde_json::Value) -> String {
            serde_json::from_value::<T>(value).expect_err("it is odd").to_string()
        }
        for key in ["a`b", "`", "x`, expected `\u{1b}[2J", "x`, there are no fields", "``\u{7f}``"] {
            let odd = serde_json::json!({ key: 1 });
            let message = complaint::<Two>(odd.clone());
            let Complaint::UnknownKey { key: found, allowed } = Complaint::parse(&message) else {
                panic!("{message}")
            };
            assert_eq!((found, &allowed[..]), (key, &["listen", "port"][..]), "{message}");
            let message = complaint::<None>(odd);
            let Complaint::UnknownKey { key: found, allowed } = Complaint::parse(&message) else {
                panic!("{message}")
            };
            assert_eq!((found, allowed.len()), (key, 0), "{message}");
            let message = complaint::<Word>(serde_json::json!(key));
            let Complaint::Other { message } = Complaint::parse(&message) else { panic!("{message}") };
            assert!(message.ends_with("allowed: on") && !message.contains(char::is_control), "{message:?}");
        }
    }
}
