//! Rust structs that mirror WGSL structs, described so that a test can hold them to the shader's own layout.

/// Size and offsets of a mirror struct, and the WGSL struct it must match.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mirror {
    /// Path of the shader beneath `shaders/`.
    pub shader: &'static str,
    /// Name of the WGSL struct.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Fields in order.
    pub fields: &'static [MirrorField],
}

/// One field of a mirror struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MirrorField {
    /// Its name, the same on both sides.
    pub name: &'static str,
    /// Bytes from the struct's start.
    pub offset: usize,
    /// Bytes.
    pub size: usize,
}

/// Declares a `repr(C)` struct of plain data with a `MIRROR` constant: `mirror! { "render/x.wgsl", struct Name { … } }`.
macro_rules! mirror {
    ($shader:literal, $(#[$meta:meta])* $visibility:vis struct $name:ident {
        $($(#[$field_meta:meta])* $field_visibility:vis $field:ident: $type:ty,)*
    }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        $visibility struct $name {
            $($(#[$field_meta])* $field_visibility $field: $type,)*
        }

        impl $name {
            pub(crate) const MIRROR: $crate::gpu::Mirror = $crate::gpu::Mirror {
                shader: $shader,
                name: stringify!($name),
                size: size_of::<Self>(),
                fields: &[$($crate::gpu::MirrorField {
                    name: stringify!($field),
                    offset: std::mem::offset_of!(Self, $field),
                    size: size_of::<$type>(),
                }),*],
            };
        }
    };
}

pub(crate) use mirror;
