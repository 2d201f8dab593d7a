//! Tests of the calibration procedures, one module a subject. They are one program: to build one for each file took minutes.

mod common;
mod friction;
mod golden;
mod photo;
mod pictures;
mod play;
mod poses;
mod stem;
