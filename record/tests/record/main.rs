//! Tests of recordings, one module a subject. They are one program: to build one for each file took minutes; what counts memory or kills processes is alone.

#[path = "../common/mod.rs"]
mod common;
mod end_to_end;
mod files;
mod recover;
mod round_trip;
mod viewers;
