//! Tests of the program as people call it.

mod images;
mod usage;
