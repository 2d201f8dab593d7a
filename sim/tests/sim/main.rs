//! Tests of the simulated machines, one module a subject. They are one program: to build one for each file took minutes.

mod hidden;
mod plant;
mod segments;
