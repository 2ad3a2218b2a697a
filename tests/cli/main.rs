//! Tests of the program as people call it.

mod adaptive;
mod aov;
mod bench;
mod devices;
mod driver_environment;
mod guide;
mod images;
mod shader_test;
mod tev;
mod usage;
mod watch;
mod watch_files;
