//! Names of numbered pictures: a printf-like pattern with exactly one number, such as `in%06d.jpg`.

use super::IngestError;
use std::path::{Path, PathBuf};

/// Most digits that `%0Nd` may ask for: as many as the largest number has.
const MAX_DIGITS: usize = 20;

/// Whether the last part of `path` has a `%`, which makes it a pattern.
pub(super) fn is_pattern(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().contains(&b'%'))
}

/// A parsed pattern: what stands before the number, its least digits, what stands behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    folder: PathBuf,
    before: String,
    digits: usize,
    after: String,
}

impl Pattern {
    /// Takes `path` apart; its folder may have no number.
    ///
    /// # Errors
    /// When the name has no number, or several.
    pub fn parse(path: &Path) -> Result<Self, IngestError> {
        let refuse = |reason| IngestError::Pattern { path: path.to_path_buf(), reason };
        let name = path.file_name().and_then(|name| name.to_str());
        let name = name.ok_or_else(|| refuse("the file name must be UTF-8"))?;
        let mut number = None;
        let (mut before, mut after) = (String::new(), String::new());
        let mut rest = name;
        while let Some((text, tail)) = rest.split_once('%') {
            let part = if number.is_none() { &mut before } else { &mut after };
            part.push_str(text);
            if let Some(tail) = tail.strip_prefix('%') {
                part.push('%');
                rest = tail;
                continue;
            }
            let (spec, tail) = tail
                .split_once('d')
                .ok_or_else(|| refuse("a % must begin %d, a zero-padded number such as %06d, or %%"))?;
            if number.is_some() {
                return Err(refuse("exactly one number is allowed"));
            }
            number = Some(digits(spec).ok_or_else(|| {
                refuse("a % must begin %d, a zero-padded number of at most 20 digits such as %06d, or %%")
            })?);
            rest = tail;
        }
        let digits = number.ok_or_else(|| refuse("one number is needed, such as %06d"))?;
        after.push_str(rest);
        let folder = path.parent().unwrap_or_else(|| Path::new("")).to_path_buf();
        Ok(Self { folder, before, digits, after })
    }

    /// The folder of the pictures, as written.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The path of picture `number`.
    pub fn path(&self, number: u64) -> PathBuf {
        self.folder.join(self.name(number))
    }

    /// The number in a file's name, if it is exactly the name that the pattern gives that number.
    pub fn number(&self, name: &str) -> Option<u64> {
        let digits = name.strip_prefix(self.before.as_str())?.strip_suffix(self.after.as_str())?;
        let is_decimal = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        let number = if is_decimal { digits.parse().ok()? } else { return None };
        (self.name(number) == name).then_some(number)
    }

    fn name(&self, number: u64) -> String {
        let Self { before, digits, after, .. } = self;
        format!("{before}{number:0digits$}{after}")
    }
}

/// The least digits that the text between `%` and `d` asks for.
fn digits(spec: &str) -> Option<usize> {
    if spec.is_empty() {
        return Some(1);
    }
    let width = spec.strip_prefix('0')?;
    let is_decimal = (1..=2).contains(&width.len()) && width.bytes().all(|byte| byte.is_ascii_digit());
    if !is_decimal || width.starts_with('0') {
        return None;
    }
    width.parse().ok().filter(|digits| *digits <= MAX_DIGITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_names_the_pictures_that_it_reads() {
        let check = |pattern: &str, number: u64, path: &str| {
            let parsed = Pattern::parse(Path::new(pattern)).unwrap();
            assert_eq!(parsed.path(number), Path::new(path), "{pattern}");
            let name = Path::new(path).file_name().unwrap().to_str().unwrap();
            assert_eq!(parsed.number(name), Some(number), "{pattern}");
        };
        check("/d/in%06d.jpg", 7, "/d/in000007.jpg");
        check("/d/in%06d.jpg", 1_234_567, "/d/in1234567.jpg");
        check("in%d.jpg", 0, "in0.jpg");
        check("%d", u64::MAX, "18446744073709551615");
        check("50%%_%03d%%.png", 12, "50%_012%.png");
        check("/d/%020d", 5, "/d/00000000000000000005");
    }

    #[test]
    fn names_that_the_pattern_would_not_write_are_not_its_pictures() {
        let pattern = Pattern::parse(Path::new("in%03d.jpg")).unwrap();
        for name in ["in1.jpg", "in0001.jpg", "in+01.jpg", "in.jpg", "in001.png", "xin001.jpg", "in001.jpg~"]
        {
            assert_eq!(pattern.number(name), None, "{name}");
        }
        assert_eq!(pattern.number("in99999999999999999999999.jpg"), None);
    }

    #[test]
    fn anything_but_one_decimal_number_is_refused() {
        for pattern in [
            "%", "a%", "%s", "%6d", "%00d", "%021d", "%-3d", "%0d", "%d%d", "%03d_%d", "%%", "%ld", "%x.jpg",
            "%0+3d",
        ] {
            assert!(is_pattern(Path::new(pattern)), "{pattern}");
            assert!(
                matches!(Pattern::parse(Path::new(pattern)), Err(IngestError::Pattern { .. })),
                "{pattern}"
            );
        }
        assert!(!is_pattern(Path::new("a%d/b.avi")));
    }
}
