//! Tests of the program as people call it.

mod aov;
mod bench;
mod devices;
mod driver_environment;
mod images;
mod usage;
mod watch;
