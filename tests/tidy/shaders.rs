//! Every shader is valid, has its owner, and agrees with the Rust structs that mirror its own.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use videofields_render::gpu::{SHADERS, compose};
use wgpu::naga;

fn parse(path: &str) -> naga::Module {
    let source = compose(path).expect("every embedded shader composes");
    naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{path}: {}", error.emit_to_string_with_path(&source, path)))
}

fn validate(path: &str, module: &naga::Module, source: &str) {
    let flags = naga::valid::ValidationFlags::all();
    let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
    if let Err(error) = validator.validate(module) {
        panic!("{path}: {}", error.emit_to_string(source));
    }
}

#[test]
fn every_shader_of_the_lab_is_valid_and_has_its_owner() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for entry in fs::read_dir(root.join("shaders/lab")).expect("the folder is there") {
        let path = entry.expect("an entry").path();
        let source = fs::read_to_string(&path).expect("UTF-8");
        let name = path.display().to_string();
        let module = naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string_with_path(&source, &name)));
        validate(&name, &module, &source);
        let owner =
            root.join("src/lab/gpu_report").join(path.file_name().expect("a name")).with_extension("rs");
        assert!(owner.is_file(), "{name} has no {}", owner.display());
    }
}

#[test]
fn every_shader_is_valid() {
    for path in SHADERS {
        let module = parse(path);
        validate(path, &module, &compose(path).expect("it composed before"));
        let is_common = path.starts_with("common/");
        assert_eq!(module.entry_points.is_empty(), is_common, "{path}: only common/ has no entry point");
    }
}

#[test]
fn every_shader_file_is_embedded_and_has_its_owner() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut on_disk = BTreeSet::new();
    for folder in ["common", "render"] {
        for entry in fs::read_dir(root.join("shaders").join(folder)).expect("the folder is there") {
            let name = entry.expect("an entry").file_name().into_string().expect("ASCII");
            on_disk.insert(format!("{folder}/{name}"));
        }
    }
    let embedded: BTreeSet<String> = SHADERS.iter().map(|path| (*path).to_owned()).collect();
    assert_eq!(on_disk, embedded);
    for path in embedded.iter().filter_map(|path| path.strip_prefix("render/")) {
        let owner = root.join("src/render/passes").join(path).with_extension("rs");
        assert!(owner.is_file(), "{path} has no {}", owner.display());
    }
}

#[test]
fn mirror_structs_match_their_shaders() {
    let mirrors = videofields_render::mirrors();
    assert!(!mirrors.is_empty());
    for mirror in mirrors {
        let module = parse(mirror.shader);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).expect("a valid module has a layout");
        let (handle, found) = module
            .types
            .iter()
            .find(|(_, candidate)| candidate.name.as_deref() == Some(mirror.name))
            .unwrap_or_else(|| panic!("{} has no struct {}", mirror.shader, mirror.name));
        let naga::TypeInner::Struct { members, span } = &found.inner else {
            panic!("{} in {} is no struct", mirror.name, mirror.shader)
        };
        let place = format!("{} in {}", mirror.name, mirror.shader);
        assert_eq!(*span as usize, mirror.size, "size of {place}");
        assert_eq!(members.len(), mirror.fields.len(), "fields of {place}");
        for (member, field) in members.iter().zip(mirror.fields) {
            assert_eq!(member.name.as_deref(), Some(field.name), "{place}");
            assert_eq!(member.offset as usize, field.offset, "offset of {} in {place}", field.name);
            let size = layouter[member.ty].size as usize;
            assert_eq!(size, field.size, "size of {} in {place}", field.name);
        }
        let alignment = layouter[handle].alignment.round_up(1);
        assert_eq!(mirror.size % alignment as usize, 0, "{place} can stand in an array");
    }
}

#[test]
fn every_golden_picture_is_checked_by_a_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tests = fs::read_to_string(root.join("tests/render/render.rs")).expect("the tests are there");
    for entry in fs::read_dir(root.join("tests/golden")).expect("goldens are there") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "png") {
            continue;
        }
        let stem = path.file_stem().and_then(|stem| stem.to_str()).expect("ASCII");
        assert!(tests.contains(&format!("golden::check(\"{stem}\"")), "{} is dead", path.display());
    }
}
