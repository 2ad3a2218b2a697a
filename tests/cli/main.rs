//! Tests of the program as people call it.

mod bench;
mod driver_environment;
mod images;
mod usage;
mod watch;
