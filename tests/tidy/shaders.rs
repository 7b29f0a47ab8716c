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
        assert_eq!(with_uniform_conditions(&module), [""; 0], "{name}");
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

/// Kinds of values that a condition depends on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum DependsOn {
    /// Literals, constants, and variables of the function, which count a loop's rounds.
    Nothing,
    /// A place of a uniform buffer that is known when the shader is compiled.
    UniformBuffer,
    /// Anything else.
    More,
}

fn depends_on(
    module: &naga::Module,
    function: &naga::Function,
    of: naga::Handle<naga::Expression>,
) -> DependsOn {
    use naga::Expression as E;
    let on = |of| depends_on(module, function, of);
    match &function.expressions[of] {
        E::Literal(_) | E::Constant(_) | E::Override(_) | E::ZeroValue(_) | E::LocalVariable(_) => {
            DependsOn::Nothing
        }
        E::GlobalVariable(global) => match module.global_variables[*global].space {
            naga::AddressSpace::Uniform => DependsOn::UniformBuffer,
            _ => DependsOn::More,
        },
        E::Load { pointer: base }
        | E::AccessIndex { base, .. }
        | E::Swizzle { vector: base, .. }
        | E::Splat { value: base, .. }
        | E::Unary { expr: base, .. }
        | E::As { expr: base, .. } => on(*base),
        // A place that is reckoned is not known when the shader is compiled.
        E::Access { base, index } => match on(*index) {
            DependsOn::Nothing => on(*base),
            _ => DependsOn::More,
        },
        E::Binary { left, right, .. } => on(*left).max(on(*right)),
        E::Select { condition, accept, reject } => on(*condition).max(on(*accept)).max(on(*reject)),
        E::Relational { argument, .. } => on(*argument),
        E::Compose { components, .. } => {
            components.iter().map(|of| on(*of)).max().unwrap_or(DependsOn::Nothing)
        }
        E::Math { arg, arg1, arg2, arg3, .. } => {
            let args = [Some(*arg), *arg1, *arg2, *arg3];
            args.into_iter().flatten().map(on).max().unwrap_or(DependsOn::Nothing)
        }
        _ => DependsOn::More,
    }
}

/// Adds the conditions of a block, and of those within it.
fn add_conditions(block: &naga::Block, conditions: &mut Vec<naga::Handle<naga::Expression>>) {
    for statement in block {
        match statement {
            naga::Statement::Block(inner) => add_conditions(inner, conditions),
            naga::Statement::If { condition, accept, reject } => {
                conditions.push(*condition);
                add_conditions(accept, conditions);
                add_conditions(reject, conditions);
            }
            naga::Statement::Switch { selector, cases } => {
                conditions.push(*selector);
                cases.iter().for_each(|case| add_conditions(&case.body, conditions));
            }
            naga::Statement::Loop { body, continuing, break_if } => {
                conditions.extend(*break_if);
                add_conditions(body, conditions);
                add_conditions(continuing, conditions);
            }
            _ => {}
        }
    }
}

/// Returns the names of functions with a condition that depends on a uniform buffer alone.
fn with_uniform_conditions(module: &naga::Module) -> Vec<String> {
    let named = |function: &naga::Function| function.name.clone().unwrap_or_default();
    let of_entries = module.entry_points.iter().map(|entry| (entry.name.clone(), &entry.function));
    let functions =
        module.functions.iter().map(|(_, function)| (named(function), function)).chain(of_entries);
    let is_uniform = |function: &naga::Function| {
        let mut conditions = Vec::new();
        add_conditions(&function.body, &mut conditions);
        conditions.into_iter().any(|of| depends_on(module, function, of) == DependsOn::UniformBuffer)
    };
    functions.filter(|(_, function)| is_uniform(function)).map(|(name, _)| name).collect()
}

/// Mesa's rasteriser (22.3, of Debian 12) compiles such shaders anew at every draw, and keeps each of these: memory grew by some
/// megabytes a picture. Later versions keep one a value.
#[test]
fn no_shader_branches_on_a_uniform_buffer_alone() {
    for path in SHADERS {
        let found = with_uniform_conditions(&parse(path));
        assert!(
            found.is_empty(),
            "{path}: {found:?}: read what decides from a storage buffer, or use select()"
        );
    }
}

#[test]
fn branches_on_a_uniform_buffer_alone_are_found() {
    let shader = |body: &str| {
        let source = format!(
            "struct Frame {{ n: u32, at: array<vec4<u32>, 4> }}
            @group(0) @binding(0) var<uniform> frame: Frame;
            @group(0) @binding(1) var<storage, read_write> out: array<u32>;
            @compute @workgroup_size(1) fn cs(@builtin(global_invocation_id) id: vec3<u32>) {{ {body} }}"
        );
        naga::front::wgsl::parse_str(&source).expect("a valid shader")
    };
    for (body, is_found) in [
        ("for (var i = 0u; i < frame.n; i++) { out[i] = i; }", true),
        ("if frame.n > 3u && id.x > 2u { out[0] = 1u; }", true),
        ("var i = 0u; loop { i++; continuing { break if i >= min(frame.at[1].y, 4u); } }", true),
        ("switch frame.n { case 1u: { out[0] = 1u; } default: {} }", true),
        ("if id.x < frame.n { out[0] = 1u; }", false),
        ("if frame.at[id.x].x == 1u { out[0] = 1u; }", false),
        ("for (var i = 0u; i < out[0]; i++) { out[i] = frame.n; }", false),
        ("out[0] = select(1u, 2u, frame.n == 3u);", false),
    ] {
        let found = with_uniform_conditions(&shader(body));
        assert_eq!(!found.is_empty(), is_found, "{body}: {found:?}");
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
