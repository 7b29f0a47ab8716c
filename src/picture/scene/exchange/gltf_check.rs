//! What a glTF claims, held against what it has, before anything is made of it: chunks, buffers, views, accessors, pictures, and
//! who names whom. Nothing outside the file is read.

use crate::scene::SceneError;
use serde_json::Value;
use videofields_vision::error::{Fault, Gatherer, pointer_to};

/// Most elements of a list.
pub(super) const MAX_ELEMENTS: usize = 1 << 16;

/// Most elements of an accessor: three for each of some million triangles.
const MAX_COUNT: u64 = 1 << 22;

/// Most commas and brackets of a file beside its texts: each value of the tree that is made of it takes some 32 bytes.
const MAX_VALUES: usize = 1 << 21;

/// Lengths of a GLB's header and of a chunk's.
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// The JSON of a GLB, and its buffer if it has one.
pub(super) fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), SceneError> {
    read_chunks(bytes).map_err(|message| SceneError::Faults(vec![Fault::new("", message)]))
}

fn read_chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let number =
        |at: usize| bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).map(u32::from_le_bytes);
    if !bytes.starts_with(b"glTF") {
        return Err("not a GLB: it must begin with glTF".to_owned());
    }
    if number(4) != Some(2) {
        return Err("expected version 2 of the GLB".to_owned());
    }
    if number(8).map(|length| length as usize) != Some(bytes.len()) {
        return Err(format!("the GLB must say that it has {} bytes", bytes.len()));
    }
    let chunk = |at: usize, kind: &[u8; 4]| {
        let length = number(at)? as usize;
        let start = at + CHUNK_HEADER_BYTES;
        let data = bytes.get(start..start.checked_add(length)?)?;
        (bytes.get(at + 4..start)? == kind).then_some((data, start + length))
    };
    let Some((json, end)) = chunk(HEADER_BYTES, b"JSON") else {
        return Err("the first chunk must be whole, and JSON".to_owned());
    };
    match bytes.len() - end {
        0 => Ok((json, None)),
        _ => {
            let buffer = chunk(end, b"BIN\0").ok_or("the second chunk must be whole, and BIN")?;
            Ok((json, Some(buffer.0)))
        }
    }
}

/// Refuses JSON of more values than any scene has, before it is made a tree.
pub(super) fn check_values(text: &str) -> Result<(), SceneError> {
    let (mut n_values, mut is_text, mut is_escaped) = (0_usize, false, false);
    for byte in text.bytes() {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' if is_text => is_escaped = true,
            b'"' => is_text = !is_text,
            b',' | b'[' | b'{' if !is_text => n_values += 1,
            _ => {}
        }
    }
    if n_values <= MAX_VALUES {
        return Ok(());
    }
    let message = format!("more than {MAX_VALUES} values");
    Err(SceneError::Faults(vec![Fault::new("", message)]))
}

/// Checks everything that is not a node; `binary` are the bytes of a GLB's own buffer.
pub(super) fn check(gltf: &Value, binary: Option<usize>, gatherer: &mut Gatherer) {
    let mut checking = Checking { gltf, gatherer };
    checking.version();
    let sizes = checking.each("buffers", |this, of, at| this.buffer(of, at, binary));
    if sizes.iter().sum::<u64>() > super::MAX_EXCHANGE_BYTES as u64 {
        checking.fault("/buffers", "more bytes than a file may have");
    }
    let views = checking.each("bufferViews", |this, of, at| this.view(of, at, &sizes));
    checking.each("accessors", |this, of, at| this.accessor(of, at, &views));
    checking.each("images", |this, of, at| this.image(of, at, views.len()));
    checking.each("meshes", Checking::mesh);
}

struct Checking<'a> {
    gltf: &'a Value,
    gatherer: &'a mut Gatherer,
}

/// A whole number, 0 or more; 0 where it is absent.
fn whole(of: &Value, key: &str) -> Option<u64> {
    of.get(key).map_or(Some(0), Value::as_u64)
}

impl<'a> Checking<'a> {
    fn fault(&mut self, place: &str, message: impl Into<String>) {
        self.gatherer.fault(place, message);
    }

    fn version(&mut self) {
        let version = self.gltf.pointer("/asset/version").and_then(Value::as_str);
        if !version.is_some_and(|version| version.starts_with("2.")) {
            self.fault("/asset/version", "expected \"2.0\"");
        }
        let required = self.gltf.get("extensionsRequired").and_then(Value::as_array);
        for (idx, name) in required.into_iter().flatten().enumerate() {
            self.fault(&format!("/extensionsRequired/{idx}"), format!("the extension {name} is not read"));
        }
    }

    /// Looks at each element of a list; the answers of those that are at fault are 0.
    fn each<T: Default>(
        &mut self,
        key: &str,
        mut look: impl FnMut(&mut Self, &'a Value, &str) -> Option<T>,
    ) -> Vec<T> {
        let place = format!("/{key}");
        let Some(list) = self.gltf.get(key) else { return Vec::new() };
        let Some(list) = list.as_array() else {
            self.fault(&place, "expected a list");
            return Vec::new();
        };
        if list.len() > MAX_ELEMENTS {
            self.fault(&place, format!("at most {MAX_ELEMENTS} are allowed, got {}", list.len()));
            return Vec::new();
        }
        let mut found = Vec::with_capacity(list.len());
        for (idx, of) in list.iter().enumerate() {
            found.push(look(self, of, &format!("{place}/{idx}")).unwrap_or_default());
        }
        found
    }

    /// A whole number at `key`.
    fn number(&mut self, of: &Value, (at, key): (&str, &str)) -> Option<u64> {
        let number = whole(of, key);
        if number.is_none() {
            self.fault(&pointer_to(at, key), "expected a whole number, 0 or more");
        }
        number
    }

    /// The place in a list that `key` names.
    fn index(&mut self, of: &Value, (at, key): (&str, &str), n_there: usize) -> Option<usize> {
        let idx = of.get(key).and_then(Value::as_u64).and_then(|idx| usize::try_from(idx).ok());
        let idx = idx.filter(|idx| *idx < n_there);
        if idx.is_none() {
            self.fault(&pointer_to(at, key), format!("expected one of the {n_there} there are"));
        }
        idx
    }

    /// The bytes that a buffer has.
    fn buffer(&mut self, of: &'a Value, at: &str, binary: Option<usize>) -> Option<u64> {
        let claimed = self.number(of, (at, "byteLength"))?;
        let has = match of.get("uri") {
            Some(uri) => self.within(uri, &pointer_to(at, "uri"))?,
            None if at == "/buffers/0" => match binary {
                Some(bytes) => bytes as u64,
                None => {
                    self.fault(at, "the file has no binary chunk");
                    return None;
                }
            },
            None => {
                self.fault(at, "the key `uri` is missing");
                return None;
            }
        };
        if claimed <= has {
            return Some(claimed);
        }
        self.fault(&pointer_to(at, "byteLength"), format!("claims {claimed} bytes, but there are {has}"));
        None
    }

    /// The bytes that a `data:` URI holds, counted and not decoded. Every other leads out of the file.
    fn within(&mut self, uri: &Value, at: &str) -> Option<u64> {
        let data = uri.as_str().and_then(|uri| uri.strip_prefix("data:")).and_then(|uri| uri.split_once(','));
        let Some((head, data)) = data else {
            self.fault(at, "only what stands in the file itself is read (data:), no other file or address");
            return None;
        };
        if !head.ends_with(";base64") {
            self.fault(at, "only base64 is read");
            return None;
        }
        let n_chars = data.trim_end_matches('=').len() as u64;
        Some(n_chars * 3 / 4)
    }

    fn view(&mut self, of: &'a Value, at: &str, sizes: &[u64]) -> Option<u64> {
        let buffer = self.index(of, (at, "buffer"), sizes.len())?;
        let (offset, length) = (self.number(of, (at, "byteOffset"))?, self.number(of, (at, "byteLength"))?);
        if offset.checked_add(length).is_some_and(|end| end <= sizes[buffer]) {
            return Some(length);
        }
        self.fault(
            &pointer_to(at, "byteLength"),
            format!("reaches beyond its buffer of {} bytes", sizes[buffer]),
        );
        None
    }

    fn accessor(&mut self, of: &'a Value, at: &str, views: &[u64]) -> Option<u64> {
        let count = self.number(of, (at, "count"))?;
        if !(1..=MAX_COUNT).contains(&count) {
            self.fault(&pointer_to(at, "count"), format!("expected 1 to {MAX_COUNT}, got {count}"));
            return None;
        }
        let size = match of.get("componentType").and_then(Value::as_u64) {
            Some(5120 | 5121) => 1,
            Some(5122 | 5123) => 2,
            Some(5125 | 5126) => 4,
            _ => {
                self.fault(&pointer_to(at, "componentType"), "expected 5120 to 5123, 5125 or 5126");
                return None;
            }
        };
        let width = match of.get("type").and_then(Value::as_str) {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4" | "MAT2") => 4,
            Some("MAT3") => 9,
            Some("MAT4") => 16,
            _ => {
                self.fault(&pointer_to(at, "type"), "expected SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4");
                return None;
            }
        };
        if of.get("sparse").is_some() {
            self.fault(&pointer_to(at, "sparse"), "sparse accessors are not read");
            return None;
        }
        if of.get("bufferView").is_none() {
            return Some(count);
        }
        let view = self.index(of, (at, "bufferView"), views.len())?;
        let offset = self.number(of, (at, "byteOffset"))?;
        // Counts and sizes are small by now; elements lie at least side by side.
        let end = offset.checked_add(count * size * width);
        if end.is_some_and(|end| end <= views[view]) {
            return Some(count);
        }
        let message = format!("{count} elements reach beyond their view of {} bytes", views[view]);
        self.fault(&pointer_to(at, "count"), message);
        None
    }

    fn image(&mut self, of: &'a Value, at: &str, n_views: usize) -> Option<u64> {
        match of.get("uri") {
            Some(uri) => self.within(uri, &pointer_to(at, "uri")),
            None => self.index(of, (at, "bufferView"), n_views).map(|view| view as u64),
        }
    }

    fn mesh(&mut self, of: &'a Value, at: &str) -> Option<u64> {
        let n_there = self.gltf.get("accessors").and_then(Value::as_array).map_or(0, Vec::len);
        let primitives = of.get("primitives").and_then(Value::as_array);
        for (idx, primitive) in primitives.into_iter().flatten().enumerate() {
            let at = format!("{at}/primitives/{idx}");
            if primitive.get("indices").is_some() {
                self.index(primitive, (&at, "indices"), n_there);
            }
            let attributes = primitive.get("attributes").unwrap_or(&Value::Null);
            for name in attributes.as_object().into_iter().flat_map(|members| members.keys()) {
                self.index(attributes, (&format!("{at}/attributes"), name), n_there);
            }
        }
        Some(0)
    }
}
