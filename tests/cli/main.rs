//! Tests of the program as people call it.

mod bench;
mod images;
mod usage;
mod watch;
