//! Turns the `.proto` files into Rust types and into one embedded descriptor set per message, without needing `protoc`.

#![allow(clippy::print_stdout, reason = "cargo is told through standard output")]

use prost_build::Config;
use protox::prost::Message as _;
use protox::prost_reflect::prost_types::field_descriptor_proto::{Label, Type};
use protox::prost_reflect::prost_types::{FieldDescriptorProto, FileDescriptorSet};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Root of the imports in the `.proto` files.
const ROOT: &str = "proto";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed={ROOT}");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let files = proto_files()?;
    Config::new().compile_well_known_types().compile_fds(with_explicit_doubles(protox::compile(&files, [ROOT])?))?;
    for file in &files {
        // A viewer gets the file of its message and what that imports, with the comments, and nothing else.
        let descriptors = protox::compile([file], [ROOT])?;
        let stem = file.file_stem().ok_or("a .proto file without a name")?;
        std::fs::write(out.join(stem).with_extension("fds"), descriptors.encode_to_vec())?;
    }
    Ok(())
}

/// Has prost write every double, also one that equals zero: it leaves out -0.0 otherwise, and a recording must give back
/// the bits that were sent. The bytes are valid for the `.proto` files as they stand, and those are what is embedded.
fn with_explicit_doubles(mut descriptors: FileDescriptorSet) -> FileDescriptorSet {
    let own = descriptors.file.iter_mut().filter(|file| file.package() == "krait");
    for message in own.flat_map(|file| &mut file.message_type) {
        for field in message.field.iter_mut().filter(|field| is_single_double(field)) {
            field.set_label(Label::Required);
        }
    }
    descriptors
}

fn is_single_double(field: &FieldDescriptorProto) -> bool {
    field.r#type() == Type::Double && field.label() != Label::Repeated
}

fn proto_files() -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut files = Vec::new();
    for package in ["krait", "foxglove"] {
        for entry in std::fs::read_dir(Path::new(ROOT).join(package))? {
            files.push(entry?.path());
        }
    }
    files.sort();
    Ok(files)
}
